"""A run that is kept: read again it is the same to the last bit, by xarray too; what is not whole is refused."""

import json
import re
import resource
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from pivoting import load
from pivoting.controller.references import Sine
from pivoting.models import ModelError
from pivoting.sim import SCENARIOS, Run, Scenario, simulate
from pivoting.sim.pipeline.own_control import Moment
from pivoting.sim.run_arrays import described
from pivoting.sim.saved_run import VERSIONS, _fingerprint
from scipy.io import netcdf_file

from tests.own_files import BOX, FLOOR, mjcf, own
from tests.same_runs import assert_same

SHIPPED: dict[str, dict[str, Any]] = {
    "two worlds": {"name": "pivot-2d", "worlds": 2, "seed": 3, "seconds": 0.5, "world": {"mu": 0.29}},
    "a later world": {"name": "incline-2d", "first_world": 4, "seed": 10**12, "seconds": 0.6, "mu": 0.35},
    "space": {"name": "settle-3d", "seconds": 0.5, "limits": {"slip_m": 2e-4}},
    "a horizon": {"name": "mpc-2d", "worlds": 2, "seconds": 0.3},
    "a horizon that has to let go": {
        "name": "mpc-2d",
        "seconds": 0.5,
        "force_max": "0.05w",
        "moment_max": "0.05w",
        "theta_end": 40,
    },
    "open loop": {"name": "mpc-2d", "seconds": 0.3, "open_loop": True},
    "a world that diverges": {"name": "balance-2d", "bandwidth": 5000, "seconds": 1.0},
}


@pytest.mark.parametrize("arguments", SHIPPED.values(), ids=SHIPPED)
def test_what_is_loaded_is_what_was_saved(arguments: dict[str, Any], tmp_path: Path) -> None:
    run = simulate(**arguments)
    assert run.save(tmp_path / "new" / "folder") == tmp_path / "new" / "folder"
    assert sorted(path.name for path in (tmp_path / "new" / "folder").iterdir()) == ["run.nc", "scenario.json"]
    again = load(str(tmp_path / "new" / "folder"))
    assert_same(run, again)
    assert again.scenario == run.scenario
    if arguments["name"] == "mpc-2d":
        assert (again.plan is not None) == arguments.get("open_loop", False) == (again.plans is None)


def test_events_and_warnings_are_among_it(tmp_path: Path) -> None:
    """Or the comparison above compares nothing."""
    released, diverged = (simulate(**SHIPPED[key]) for key in list(SHIPPED)[4::2])
    assert released.events
    assert diverged.engine_warnings
    assert np.isnan(diverged.wrench).any()


def own_run(folder: Path, unit: str = "m") -> Run:
    """Of an object of one's own; in mm its gravity is 9810."""
    if unit == "m":
        return simulate(own(folder, mjcf(), [[0.05, 0.04, -0.06], [0.05, -0.04, -0.06]]), worlds=2)
    geom = BOX.replace(".05 .04 .06", "50 40 60").replace("/>", ' mass="1"/>')
    text = mjcf(geom, pose='pos="0 0 60"', floor=FLOOR.replace("2 2 .1", "2000 2000 1"), option='gravity="0 0 -9810"')
    return simulate(own(folder, text))


@pytest.mark.parametrize("unit", ["m", "mm"])
def test_an_object_of_ones_own(unit: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its model is found from any folder; it may be moved, if the scenario's file says where to."""
    monkeypatch.chdir(tmp_path)
    run = own_run(Path(), unit)
    run.save("kept")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    again = load(tmp_path / "kept")
    assert_same(run, again)
    assert again.scenario.path == tmp_path / "own.xml"
    (tmp_path / "own.xml").rename(tmp_path / "kept" / "moved.xml")
    with pytest.raises(ModelError, match=r"scenario.json: .*own.xml.* \(there is no such file"):
        load(tmp_path / "kept")
    file = tmp_path / "kept" / "scenario.json"
    file.write_text(file.read_text().replace(str(tmp_path / "own.xml"), "moved.xml"))
    assert load(file).scenario.path == tmp_path / "kept" / "moved.xml"


def test_a_scenario_of_ones_own_making(tmp_path: Path) -> None:
    run = simulate(Scenario("mine", "my own", "pivot-2d", theta=40.0, seconds=0.3))
    assert_same(run, load(run.save(tmp_path)))


def test_all_stages_are_kept(tmp_path: Path) -> None:
    """Also those that this run has not, with nan of either sign and zeros of both."""
    run = simulate("balance-2d", worlds=3, seconds=0.2, limits={"settle_s": 0.05})
    rng = np.random.default_rng(0)
    measured, estimated = rng.normal(size=(2, *run.log.states[:, 1:].shape))
    measured[0, 0, :4] = np.nan, -np.nan, -0.0, np.inf
    stepped = (np.moveaxis(np.moveaxis(values, 0, 1).copy(), 1, 0) for values in (measured, estimated, run.wrench))
    log = run.log._replace(**dict(zip(("measured", "estimated", "acting"), stepped, strict=True)))
    altered = replace(run, log=log)
    assert_same(altered, load(altered.save(tmp_path)))


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> tuple[Run, Path]:
    """A run of two worlds, on an edge, in a folder of its own beside its model."""
    folder = tmp_path_factory.mktemp("kept")
    run = simulate(own(folder, mjcf()), worlds=2)
    run.save(folder / "run")
    return run, folder / "run"


def test_xarray_opens_it(kept: tuple[Run, Path]) -> None:
    """Everything has its dimensions by name, what it is and its unit, and time is a coordinate."""
    run, folder = kept
    with xarray.open_dataset(folder / "run.nc", engine="scipy") as data:
        assert data.sizes["world"] == 2
        assert data.sizes["state"] == data.sizes["step"] + 1 == run.time.size
        assert {"time", "step_time", "world"} <= set(data.coords)
        assert data["wrench"].dims == ("world", "step", "component")
        assert data["force"].dims == ("world", "step", "contact", "contact_axis")
        assert data["wrench"].sel(component="M_x").shape == (2, run.time.size - 1)
        assert list(data["contact_axis"].values) == ["t", "o", "n"]
        for name in ("time", "position", "quaternion", "theta", "wrench", "force", "residual", "status", "slip"):
            np.testing.assert_array_equal(data[name].values, getattr(run, name))
        assert data["held_slides"].dtype == bool
        assert data["status"].attrs["flag_meanings"].split()[3] == "bounded"
        of = "velocity of what is taken for the centre of mass, world axes"
        assert data["velocity"].attrs == {"long_name": of, "units": "m/s"}
        for name, variable in data.data_vars.items():
            assert variable.attrs["long_name"], name
            assert ("units" in variable.attrs) == (name not in UNITLESS), name
        assert data.attrs["title"] == run.scenario.label


UNITLESS = {
    "quaternion", "residual", "status", "contact_found", "contact_strays", "held_slides", "start_qpos", "start_qvel",
}  # fmt: skip


def test_units_are_the_models(tmp_path: Path) -> None:
    own_run(tmp_path, "mm").save(tmp_path)
    with xarray.open_dataset(tmp_path / "run.nc", engine="scipy") as data:
        assert data["position"].attrs["units"] == "0.001 m"
        assert data["wrench"].attrs["units"] == "0.001 N, 1e-06 N m"
        assert data["angular_velocity"].attrs["units"] == "rad/s"


def test_every_array_of_the_log_is_in_the_file(kept: tuple[Run, Path]) -> None:
    """By its bytes, whatever its name."""
    run, _ = kept
    there = {variable.values.tobytes() for variable in described(run).values()}
    flat = [run.log.wrench_world, *run.log.contacts, *run.log.held, run.log.control_ns, *run.start]
    flat += [run.position, run.quaternion, run.velocity, run.angular_velocity]
    flat += [run.log.answers.required, run.log.answers.force, run.wrench, run.residual, run.status]
    assert all(values.tobytes() in there for values in flat)


def copied(kept: tuple[Run, Path], folder: Path) -> Path:
    for name in ("run.nc", "scenario.json"):
        (folder / name).write_bytes((kept[1] / name).read_bytes())
    return folder


@pytest.mark.parametrize("share", [0.0, 0.00001, 0.001, 0.01, 0.5, 0.999999])
@pytest.mark.parametrize("name", ["run.nc", "scenario.json"])
def test_a_file_that_was_cut_is_refused(name: str, share: float, kept: tuple[Run, Path], tmp_path: Path) -> None:
    file = copied(kept, tmp_path) / name
    whole = file.read_bytes()
    file.write_bytes(whole[: min(int(share * len(whole)), len(whole) - 2)])
    told = rf"{re.escape(str(file))}: {'was cut' if name == 'run.nc' else 'must be a scenario in JSON, whole'}"
    with pytest.raises(ValueError, match=told):
        load(tmp_path)


def edited(file: Path, **entries: Any) -> None:
    """Entries of the scenario's file set, or taken away by None; and what it says of the arrays made true."""
    said = json.loads(file.read_text())
    arrays = {"file": "run.nc", **_fingerprint(file.parent / "run.nc")}
    said = {**said, "arrays": arrays, **entries}
    file.write_text(json.dumps({key: value for key, value in said.items() if value is not None}))


def magic(folder: Path) -> None:
    file = folder / "run.nc"
    file.write_bytes(b"HDF" + file.read_bytes()[3:])


def byte(folder: Path) -> None:
    file = folder / "run.nc"
    content = bytearray(file.read_bytes())
    content[-9] ^= 1
    file.write_bytes(content)


def other_file(folder: Path) -> None:
    magic(folder)
    edited(folder / "scenario.json")


def missing_array(folder: Path) -> None:
    with netcdf_file(folder / "run.nc", "a", mmap=False) as file:
        file.variables["stray"] = file.variables.pop("wrench_world")
    edited(folder / "scenario.json")


def missing_text(folder: Path) -> None:
    with netcdf_file(folder / "run.nc", "a", mmap=False) as file:
        del file._attributes["outcome"]
    edited(folder / "scenario.json")


BROKEN: dict[str, tuple[Callable[[Path], object], str]] = {
    "other magic": (magic, r"run.nc: was changed"),
    "one bit": (byte, r"run.nc: was changed"),
    "another file": (other_file, r"run.nc: is no file of a run \(.*not a valid NetCDF 3 file"),
    "an array is missing": (missing_array, r"run.nc: has no wrench_world"),
    "a text is missing": (missing_text, r"run.nc: is no file of a run"),
    "no arrays": (lambda folder: (folder / "run.nc").unlink(), r"run.nc: cannot be read \(No such file"),
    "nothing": (lambda folder: (folder / "scenario.json").unlink(), r"scenario.json: cannot be read \(No such file"),
    "a later format": (
        lambda folder: edited(folder / "scenario.json", format="pivoting 2"),
        r"scenario.json: format = 'pivoting 2': this version of pivoting reads 'pivoting 1'",
    ),
    "another seed": (
        lambda folder: edited(folder / "scenario.json", seed=1), r"scenario.json: seed must be as in the run",
    ),
    "another scenario": (
        lambda folder: edited(folder / "scenario.json", changes={"seconds": 0.2}), r"scenario.json: .* has changed",
    ),
    "an impossible one": (
        lambda folder: edited(folder / "scenario.json", changes={"theta": "much"}),
        r"scenario.json: theta = 'much': must be a number",
    ),
    "only a scenario": (
        lambda folder: (folder / "scenario.json").write_text('{"scenario": "pivot-2d"}'), r"scenario.json: names no",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_what_is_not_the_run_is_refused(case: str, kept: tuple[Run, Path], tmp_path: Path) -> None:
    """In one error that names the file and what is wrong with it."""
    spoil, told = BROKEN[case]
    spoil(copied(kept, tmp_path))
    with pytest.raises(ValueError, match=told):
        load(tmp_path)


def test_a_model_that_has_changed_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where other versions read it than wrote it, they are named, for it may be they that make the difference."""
    run = simulate(own(tmp_path, mjcf()))
    run.save(tmp_path / "run")
    own(tmp_path, mjcf(BOX.replace(".06", ".0600001")))
    with pytest.raises(
        ModelError, match=r"scenario.json: the model .*own.xml', .* has changed since the run was saved"
    ):
        load(tmp_path / "run")
    with monkeypatch.context() as patch:
        patch.setitem(VERSIONS, "numpy", "1.0")
        with pytest.raises(ModelError, match=r"; it was saved by .* this is .*numpy 1\.0$"):
            load(tmp_path / "run")
    own(tmp_path, mjcf(), body="box")
    assert_same(run, load(tmp_path / "run"))
    file = tmp_path / "run" / "scenario.json"
    (tmp_path / "own.xml").write_text(mjcf().replace('name="box"', 'name="crate"'))
    with pytest.raises(ModelError, match=rf"{re.escape(str(file))}: cannot be set up again: body = 'box'"):
        load(tmp_path / "run")


def test_a_folder_of_several_runs_says_which_there_are(tmp_path: Path) -> None:
    (tmp_path / "a.scenario.json").write_text("{}")
    with pytest.raises(ValueError, match=r"load one of .*a\.scenario\.json$"):
        load(tmp_path)


def test_saved_twice_it_is_the_later_run(tmp_path: Path) -> None:
    """And other files in the folder stay."""
    first, second = (simulate("snap-2d", seed=seed) for seed in (0, 1))
    (tmp_path / "notes.txt").write_text("mine")
    for run in (first, first, second):
        assert_same(run, load(run.save(tmp_path)))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["notes.txt", "run.nc", "scenario.json"]
    assert (tmp_path / "notes.txt").read_text() == "mine"


@contextmanager
def files_of_at_most(size: int) -> Iterator[None]:
    """No file may grow beyond so many bytes, as on a disk that is full."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("size", [0, 5000, 200_000])
def test_where_the_disk_is_full_nothing_is_left(size: int, tmp_path: Path) -> None:
    """Not even the folders that were made for it; and what was there stays as it was."""
    run, old = (simulate("snap-2d", seed=seed) for seed in (0, 1))
    old.save(tmp_path / "old")
    for folder in (tmp_path / "new" / "folder", tmp_path / "old"):
        with files_of_at_most(size), pytest.raises(OSError, match="File too large"):
            run.save(folder)
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["old", "run.nc", "scenario.json"]
    assert_same(old, load(tmp_path / "old"))


def held(moment: Moment) -> np.ndarray:
    """A wrench of one's own."""
    return np.array([1.0, 5.0, 0.5])


def test_what_no_file_can_hold_is_said_and_asked_for(tmp_path: Path) -> None:
    """A control or an observer is not needed to load a run; a controller, or a scenario with a Python object, is."""
    case = SCENARIOS["balance-2d"].change(seconds=0.6)
    controller = simulate(case, length=2.0).attached.controller
    sine = case.change(reference=Sine(0.5, 0.05, 1.0))
    for number, (arguments, scenario, needed) in enumerate(
        [
            ({"control": held}, case, {}),
            ({"observe": lambda k, measured, applied: measured}, case, {}),
            ({"controller": controller}, case, {"controller": controller}),
            ({"control": held, "controller": controller}, case, {"controller": controller}),
            ({}, sine, {"scenario": sine}),
            ({}, replace(SCENARIOS["incline-2d"], world={}), {"scenario": replace(SCENARIOS["incline-2d"], world={})}),
        ]
    ):
        run = simulate(scenario, **arguments)  # type: ignore[arg-type]
        folder = run.save(tmp_path / str(number))
        said = json.loads((folder / "scenario.json").read_text())
        assert set(said["python_objects"]) == {*arguments, *needed}
        assert_same(run, load(folder, **needed))
        for name in needed:
            with pytest.raises(ValueError, match=rf"scenario.json: the run's {name} was a Python object"):
                load(folder)
        if not needed:
            with pytest.raises(ValueError, match="the run's controller is in the file; must be left out"):
                load(folder, controller=controller)
    with pytest.raises(ModelError, match="what the scenario makes of it"):
        load(tmp_path / "2", controller=simulate(case, length=3.0).attached.controller)
    with pytest.raises(ValueError, match="changes must be as in the run that was saved"):
        load(tmp_path / "4", scenario=sine.change(spread=0.02))
