"""Recordings, read back: they hold the run's numbers, equal runs give equal files, a file is whole or not there."""

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun
from pivoting.models.rigid_body import matrix
from pivoting.sim import Run, simulate
from pivoting.sim.drawing import rerun_recording as recording
from pivoting.sim.drawing.rerun_recording import record
from pivoting.sim.judging.measures import predicted_slip
from rerun.chunk import RrdReader
from scipy.spatial.transform import Rotation

from tests.altered_runs import altered
from tests.recordings import Columns, one_each, read, steps


@pytest.fixture(scope="module")
def run() -> Run:
    """Too fast to stick: every part of the picture moves, and the contact opens now and then."""
    return simulate("pivot-2d", worlds=2, seconds=0.2)


@pytest.fixture(scope="module")
def rrd(run: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(run, tmp_path_factory.mktemp("recording") / "run.rrd", world=1)


@pytest.fixture(scope="module")
def entities(rrd: Path) -> dict[str, Columns]:
    return read(rrd)


def rerun_rrd(*arguments: object) -> int:
    command = [sys.executable, "-m", "rerun", "rrd", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, timeout=60).returncode


def test_plots_hold_the_arrays_of_the_run(run: Run, entities: dict[str, Columns]) -> None:
    wanted = {
        "angle/theta": np.rad2deg(run.theta[1]),
        "angle/reference": np.rad2deg(run.reference[0]),
        "slip/measured": 1e3 * run.slip[1, :, 0, 0],
        "wrench/F_u": run.wrench[1, :, 0],
        "wrench/F_v": run.wrench[1, :, 1],
        "wrench/M": run.wrench[1, :, 2],
        "force/predicted_f_t": run.force[1, :, 0, 0],
        "force/predicted_f_n": run.force[1, :, 0, 1],
        "force/measured_f_t": run.force_measured[1, :, 0, 0],
        "force/measured_f_n": run.force_measured[1, :, 0, 1],
        "solve_us": run.control_us,
    }
    assert np.abs(run.theta[0] - run.theta[1]).max() > 0.0  # the worlds differ
    for name, values in wanted.items():
        columns = entities[f"/plots/{name}"]
        assert np.array_equal(one_each(columns["Scalars:scalars"]), values), name
        assert np.array_equal(steps(columns), np.arange(values.size)), name
        seconds = columns["sim_time"].to_numpy() / np.timedelta64(1, "s")
        assert np.allclose(seconds, run.time[: values.size], rtol=0.0, atol=1e-9), name
    predicted = 1e3 * predicted_slip(run)[1, :, 0, 0]
    rows = entities["/plots/slip/predicted"]["Scalars:scalars"].to_pylist()
    assert [len(row) for row in rows] == np.isfinite(predicted).astype(int).tolist()
    assert np.array_equal([row[0] for row in rows if row], predicted[np.isfinite(predicted)])


def test_what_is_not_a_number_is_a_gap(run: Run, entities: dict[str, Columns]) -> None:
    rows = entities["/plots/friction_use/measured"]["Scalars:scalars"].to_pylist()
    lost = np.isnan(run.friction_use[1, :, 0])
    assert 0 < lost.sum() < lost.size
    assert [len(row) for row in rows] == (~lost).astype(int).tolist()
    assert np.array_equal([row[0] for row in rows if row], run.friction_use[1, ~lost, 0])
    assert set(one_each(entities["/plots/friction_use/limit"]["Scalars:scalars"])) == {1.0}


def test_block_is_posed_as_the_run_says(run: Run, entities: dict[str, Columns]) -> None:
    """Also without knowing the order of a quaternion: it takes the corner of the drawn box to where the corner is."""
    block = entities["/world/block"]
    at, turn = one_each(block["Transform3D:translation"]), one_each(block["Transform3D:quaternion"])
    k = steps(block)
    assert np.array_equal(at, run.position[1, k].astype(np.float32))
    assert np.array_equal(turn, run.quaternion[1, k][:, [1, 2, 3, 0]].astype(np.float32))
    (half,) = entities["/world/block/solid"]["static Boxes3D:half_sizes"].to_pylist()[0]
    corner = at + Rotation.from_quat(turn).apply([-half[0], 0.0, -half[2]])
    assert np.allclose(corner[:, [0, 2]], run.corner[1, k, 0][:, [0, 2]], atol=1e-6)
    assert half[0] == half[2] == 0.5


@pytest.mark.parametrize("name", ["balance-2d", "incline-2d"])
def test_arrows_of_a_body_at_rest_add_up_to_nothing(name: str, shipped: Callable[[str], Run], tmp_path: Path) -> None:
    """Weight, applied force and contact force, each in the frame that it is sent in, at one scale, before the block."""
    run = shipped(name)
    entities = read(record(run, tmp_path / "rest.rrd"))
    k = steps(entities["/world/wrench/force"])
    rest = run.time[k] > 1.0
    (weight,) = entities["/world/wrench/weight"]["static Arrows3D:vectors"].to_pylist()[0]
    force = one_each(entities["/world/wrench/force"]["Arrows3D:vectors"])
    frame = Rotation.from_quat(one_each(entities["/world/contact"]["Transform3D:quaternion"]))
    for which in ("predicted", "measured"):
        contact = frame.apply(one_each(entities[f"/world/contact/{which}"]["Arrows3D:vectors"]))
        assert np.abs(contact + force + weight)[rest].max() < 1e-4
    assert np.allclose(np.linalg.norm(weight), 0.5)  # m g: half a side
    assert np.allclose(force, 0.05 * run.wrench_world[0, k, :3], atol=1e-6)  # and so 50 mm / N
    (half,) = entities["/world/block/solid"]["static Boxes3D:half_sizes"].to_pylist()[0]
    for entity, point in (("/world/wrench", run.position[0, k]), ("/world/contact", at_corner(run)[k])):
        offset = one_each(entities[entity]["Transform3D:translation"]) - point
        assert (offset[:, 1] < -half[1]).all()
        assert np.abs(offset[:, [0, 2]]).max() < 1e-6


def at_corner(run: Run) -> np.ndarray:
    """(N+1, 3) the material corner, world axes."""
    return run.truth.origin + run.corner[0, :, 0] @ matrix(run.truth.table).T


def test_cones_are_the_planned_and_the_worlds(shipped: Callable[[str], Run], tmp_path: Path) -> None:
    for name, mu, planned, f_min in (("incline-2d", 0.4, 0.3, 0.0), ("snap-2d", 0.3, 0.25, 50.0)):
        run = shipped(name)
        entities = read(record(run, tmp_path / "cones.rrd"))
        (arrow,) = entities["/world/contact/predicted"]["Arrows3D:vectors"].to_pylist()[0]
        newtons = run.force[0, 0, 0, 1] / arrow[2]  # of a unit of length
        for which, slope, least in (("world", mu, 0.0), ("planned", planned, f_min)):
            column = entities[f"/world/contact/cone/{which}"]["static LineStrips3D:strips"]
            (left, apex, right), floor = column.to_pylist()[0]
            assert apex == [0.0, 0.0, 0.0]
            assert np.allclose([-left[0] / left[2], right[0] / right[2]], slope)
            assert np.allclose(np.array(floor)[:, 2] * newtons, least, rtol=1e-5)
        (turn,) = entities["/world/table"]["static Transform3D:quaternion"].to_pylist()[0]
        assert np.allclose(Rotation.from_quat(turn).as_matrix(), matrix(run.truth.table), atol=1e-6)
        slab = entities["/world/table"]
        top = [slab[f"static Boxes3D:{key}"].to_pylist()[0][0][2] for key in ("centers", "half_sizes")]
        assert np.isclose(sum(top), 0.0)  # the table's surface


def test_moment_is_an_arc_in_its_own_sense(run: Run, entities: dict[str, Columns]) -> None:
    arcs = one_each(entities["/world/wrench/moment"]["LineStrips3D:strips"])
    k = steps(entities["/world/wrench/moment"])
    angle = np.unwrap(np.arctan2(arcs[:, :25, 2], arcs[:, :25, 0]), axis=1)
    sweep = angle[:, -1] - angle[:, 0]
    moment = run.wrench[1, k, 2]
    inside = np.abs(sweep) < np.deg2rad(329.0)
    assert inside.any()
    assert np.array_equal(np.sign(sweep), np.sign(moment))
    ratio = sweep[inside] / moment[inside]
    assert np.allclose(ratio, ratio[0], rtol=1e-3)


def test_long_runs_are_thinned_out(shipped: Callable[[str], Run], tmp_path: Path) -> None:
    short = read(record(shipped("snap-2d"), tmp_path / "short.rrd"))  # at 2,000 Hz
    for entity, stride in (("/world/block", 10), ("/wrench_space/wrench", 40), ("/plots/angle/theta", 1)):
        assert set(np.diff(steps(short[entity]))[:-1]) == {stride}, entity
    run = simulate("balance-2d", dt=4e-4, seconds=12.0)
    entities = read(record(run, tmp_path / "long.rrd"))
    for entity, hertz, most in (
        ("/world/block", 200.0, 2_000),
        ("/world/wrench/force", 200.0, 2_000),
        ("/wrench_space/wrench", 50.0, 500),
        ("/plots/angle/theta", np.inf, 20_000),
    ):
        k = steps(entities[entity])
        assert 0.45 * most < k.size <= most, entity
        assert np.diff(k)[:-1].min() * run.dt >= 1.0 / hertz, entity
        assert k[0] == 0
        assert k[-1] >= run.time.size - 2
    theta = entities["/plots/angle/theta"]
    assert np.array_equal(one_each(theta["Scalars:scalars"]), np.rad2deg(run.theta[0, steps(theta)]))


def test_report_is_of_this_world(run: Run, tmp_path: Path, entities: dict[str, Columns]) -> None:
    first = read(record(run, tmp_path / "first.rrd", world=0))
    for world, held in enumerate((first, entities)):
        ((text,),) = held["/report"]["static TextDocument:text"].to_pylist()
        assert text.startswith("# pivot-2d: FAIL")
        for check in run.checks:
            value = getattr(run.measures, check.name)[world]
            word = "FAIL" if check.failed[world] else "ok"
            assert f"| {check.name} | {value:.3g} | {check.limit:.3g} | {word} |" in text


def test_layout_shows_everything(rrd: Path, entities: dict[str, Columns]) -> None:
    reader = RrdReader(rrd)
    (store,) = reader.recordings()
    assert re.fullmatch("pivot-2d seconds=0.2 seed=0 world=1 [0-9a-f]{12}", store.recording_id)
    (blueprint,) = reader.blueprints()
    batches = [chunk.to_record_batch() for chunk in reader.stream(store=blueprint)]
    shown = str([batch.column(name).to_pylist() for batch in batches for name in batch.schema.names if ":" in name])
    drawn = {"angle", "slip", "friction_use", "force", "wrench", "solve_us"}
    for origin in ("world", "wrench_space", "report", *(f"plots/{name}" for name in drawn)):
        assert f"/{origin}'" in shown or f"'{origin}'" in shown, origin
    plots = {entity.split("/")[2] for entity in entities if entity.startswith("/plots/")}
    assert plots == drawn
    rooms = {entity.split("/")[1] for entity in entities}
    assert rooms == {"world", "wrench_space", "plots", "report"}  # and no properties


def test_equal_runs_give_equal_files_but_for_the_solve_time(run: Run, rrd: Path, tmp_path: Path) -> None:
    again = simulate("pivot-2d", worlds=2, seconds=0.2)
    other = simulate("pivot-2d", worlds=2, seconds=0.2, margin=0.17)
    assert not np.array_equal(again.control_us, run.control_us)
    files = [rrd, record(again, tmp_path / "again.rrd", world=1), record(other, tmp_path / "other.rrd", world=1)]
    kept = [tmp_path / f"{i}.rrd" for i in range(3)]
    for file, rest in zip(files, kept, strict=True):
        assert rerun_rrd("filter", "--drop-entity", "/plots/solve_us", file, "-o", rest) == 0
    assert rerun_rrd("compare", "--unordered", kept[0], kept[1]) == 0
    assert rerun_rrd("compare", "--unordered", kept[0], kept[2]) == 1
    assert rerun_rrd("compare", "--unordered", files[0], files[1]) == 1


def test_file_is_whole(rrd: Path, tmp_path: Path) -> None:
    assert rerun_rrd("verify", rrd) == 0
    cut = tmp_path / "cut.rrd"
    cut.write_bytes(rrd.read_bytes()[:-100])
    assert rerun_rrd("verify", cut) == 1


@pytest.mark.parametrize("world", [2, -1, True, 0.0])
def test_a_world_that_is_not_there(run: Run, tmp_path: Path, world: Any) -> None:
    with pytest.raises(ValueError, match=rf"^world = {world}: must be a whole number in \[0, 2\)"):
        record(run, tmp_path / "none.rrd", world=world)
    assert not list(tmp_path.iterdir())


def test_what_goes_wrong_leaves_the_old_file_alone(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "run.rrd"
    path.write_text("old")
    rerun.set_strict_mode(False)
    honest = Path.write_bytes

    def full(self: Path, data: bytes) -> int:
        honest(self, data[:1000])
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", full)
        with pytest.raises(OSError, match="No space left"):
            record(run, path)
    with monkeypatch.context() as patch:
        patch.setattr(recording, "GREEN", "no colour")
        with pytest.raises(ValueError, match="sequence of length"):  # rerun itself would warn and go on
            record(run, path)
    assert not rerun.strict_mode()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]
    assert record(run, path) == path
    assert path.read_bytes().startswith(b"RRF")
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("poison", [np.nan, np.inf, 1e200])
def test_a_world_that_diverges_is_recorded_up_to_there(run: Run, tmp_path: Path, poison: float) -> None:
    velocity, position, force, wrench = (
        np.array(values) for values in (run.velocity, run.position, run.force_measured, run.wrench)
    )
    velocity[1, 300:], position[1, 301:] = poison, np.nan
    force[1, 299:], wrench[1, 250] = poison, np.nan
    bad = altered(run, velocity=velocity, position=position, force_measured=force, wrench=wrench)
    entities = read(record(bad, tmp_path / "bad.rrd", world=1))
    for entity in ("/plots/angle/theta", "/plots/wrench/M", "/world/block", "/wrench_space/wrench"):
        assert 280 <= steps(entities[entity])[-1] < 300, entity
    applied = entities["/plots/wrench/M"]["Scalars:scalars"].to_pylist()
    assert [k for k, row in enumerate(applied) if not row] == [250]
    arcs = entities["/world/wrench/moment"]["LineStrips3D:strips"].to_pylist()
    assert [k for k, row in zip(steps(entities["/world/wrench/moment"]), arcs, strict=True) if not row] == [250]
    pushes = entities["/world/contact/measured"]["Arrows3D:vectors"].to_pylist()
    assert not pushes[-1]
    assert pushes[-2]
    ((text,),) = entities["/report"]["static TextDocument:text"].to_pylist()
    assert "diverged at 0.3 s" in text
    assert "# pivot-2d: FAIL" in text


def test_a_world_that_is_nowhere_from_the_start(run: Run, tmp_path: Path) -> None:
    lost = altered(run, position=np.full_like(run.position, np.nan))
    ((text,),) = read(record(lost, tmp_path / "lost.rrd"))["/report"]["static TextDocument:text"].to_pylist()
    assert "diverged at 0 s" in text


SPATIAL = {"pivot-3d": {}, "balance-3d": {"seconds": 1.0, "f_min": 2.0}, "settle-3d": {}}


@pytest.mark.parametrize("name", list(SPATIAL))
def test_in_space(name: str, tmp_path: Path) -> None:
    """Body, arrows, cones and plots of a run with one or two contacts are the run's arrays."""
    run = simulate(name, **SPATIAL[name])
    path = record(run, tmp_path / "space.rrd")
    assert rerun_rrd("verify", path) == 0
    entities = read(path)
    block, k = entities["/world/block"], steps(entities["/world/block"])
    at, turn = one_each(block["Transform3D:translation"]), one_each(block["Transform3D:quaternion"])
    assert np.array_equal(at, run.position[0, k].astype(np.float32))
    assert np.array_equal(turn, run.quaternion[0, k][:, [1, 2, 3, 0]].astype(np.float32))
    solid = entities["/world/block/solid"]
    vertices = np.unique(solid["static Mesh3D:vertex_positions"].to_pylist()[0], axis=0)
    assert np.allclose(np.abs(vertices), [0.5, 0.35, 0.7])
    assert vertices.shape == (8, 3)
    assert len(entities["/world/block/edges"]["static LineStrips3D:strips"].to_pylist()[0]) == 12
    force = one_each(entities["/world/wrench/force"]["Arrows3D:vectors"])
    (weight,) = entities["/world/wrench/weight"]["static Arrows3D:vectors"].to_pylist()[0]
    scale = np.linalg.norm(weight) / (run.truth.mass * np.linalg.norm(run.truth.gravity))
    k = steps(entities["/world/wrench/force"])
    moment = one_each(entities["/world/wrench/moment"]["Arrows3D:vectors"])
    lever = np.linalg.norm(run.points[run.stances[0].held].mean(axis=0))
    assert np.allclose(force, scale * run.wrench_world[0, k, :3], atol=1e-5)
    assert np.allclose(moment, scale / lever * run.wrench_world[0, k, 3:], atol=1e-5)
    centre = one_each(entities["/world/wrench"]["Transform3D:translation"])
    assert np.array_equal(centre, run.position[0, k].astype(np.float32))
    tags = [""] if len(run.points) == 1 else ["0", "1"]
    paths = entities["/world/path/corner"]["static LineStrips3D:strips"].to_pylist()[0]
    for i, tag in enumerate(tags):
        entity, tail = f"/world/contact/{tag}".rstrip("/"), f"_{tag}".rstrip("_")
        pose = entities[entity]
        point = run.position[0] + Rotation.from_quat(run.quaternion[0][:, [1, 2, 3, 0]]).apply(run.points[i])
        assert np.allclose(one_each(pose["Transform3D:translation"]), point[k], atol=1e-6)
        assert np.allclose(paths[i][-1], point[-1], atol=1e-6)
        frame = Rotation.from_quat(one_each(pose["Transform3D:quaternion"]))
        assert np.allclose(frame.as_matrix(), matrix(run.truth.table), atol=1e-6)
        for which, forces in (("predicted", run.force), ("measured", run.force_measured)):
            arrows = one_each(entities[f"{entity}/{which}"]["Arrows3D:vectors"])
            assert np.allclose(arrows, scale * forces[0, k, i], atol=1e-5)
            plotted = [one_each(entities[f"/plots/{part}/{which}{tail}"]["Scalars:scalars"]) for part in ("f_n", "f_t")]
            assert np.array_equal(plotted[0], forces[0, :, i, 2])
            assert np.allclose(plotted[1], np.hypot(*forces[0, :, i, :2].T), rtol=1e-12)
        floor = scale * run.scenario.f_min
        for which, mu, low in (
            ("planned", run.attached.controller.belief.contacts.mu[i], floor),
            ("world", run.world.mu, 0.0),
        ):
            lines = entities[f"{entity}/cone/{which}"]["static LineStrips3D:strips"].to_pylist()[0]
            (left, apex, right), (bottom, top) = np.array(lines[0]), map(np.array, lines[-2:])
            assert apex.tolist() == [0.0, 0.0, 0.0]
            assert np.allclose([left[0], right[0]], [-mu * left[2], mu * left[2]])
            assert np.allclose(np.hypot(bottom[:, 0], bottom[:, 1]), mu * low, atol=1e-6)
            assert np.allclose(bottom[:, 2], low, atol=1e-6)
            assert np.allclose(np.hypot(top[:, 0], top[:, 1]), mu * top[:, 2])
        slip = one_each(entities[f"/plots/slip/measured{tail}"]["Scalars:scalars"])
        assert np.allclose(slip, 1e3 * np.linalg.norm(run.slip[0, :, i], axis=1), rtol=1e-12)
    wrench = [one_each(entities[f"/plots/wrench/{part}_{axis}"]["Scalars:scalars"]) for part in "FM" for axis in "xyz"]
    assert np.array_equal(np.transpose(wrench), run.wrench[0])
    error = one_each(entities["/plots/error/orientation"]["Scalars:scalars"])
    assert np.array_equal(error, np.rad2deg(run.angle_error[0]))
    assert {entity.split("/")[1] for entity in entities} == {"world", "plots", "report"}
    plots = {entity.split("/")[2] for entity in entities if entity.startswith("/plots/")}
    assert plots == {"angle", "slip", "friction_use", "f_n", "f_t", "wrench", "solve_us", "error"}


def test_importing_does_not_load_rerun() -> None:
    code = "import sys, pivoting.sim, pivoting.sim.drawing.rerun_recording; print('rerun' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout == "False\n"
