"""What a run leaves behind: files named after what was run, none lost in silence; a run that goes through pickle."""

import copy
import json
import multiprocessing
import pickle
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pivoting.sim import SCENARIOS, Run, load, own_object, simulate
from pivoting.sim.console.json_values import jsonable
from pivoting.sim.console.output_files import save, stem
from pivoting.sim.drawing.rerun_recording import RecordingOffError, record
from rerun.chunk import RrdReader

BOX = """<mujoco><worldbody><geom type="plane" size="1 1 1"/><body name="a/box" pos="0 0 .1"><freejoint/>
<geom type="box" size=".05 .04 .1" mass=".4"/></body></worldbody></mujoco>"""


@pytest.fixture(scope="module")
def worlds() -> Run:
    """Three worlds, of which the second starts farthest off."""
    return simulate("snap-2d", worlds=3, seed=2, spread=0.05)


def test_names_tell_runs_apart(tmp_path: Path) -> None:
    for name, case in SCENARIOS.items():
        assert stem(case.change(seconds=1)) == name
    model = tmp_path / "can 2.xml"
    model.write_text(BOX)
    for contact, name in (
        ("edge", "pivot-can_2-a_box-edge"),
        ([0.05, 0.04, -0.1], "pivot-can_2-a_box-0.05,0.04,-0.1"),
        ([[0.05, 0.04, -0.1], [0.05, -0.04, -0.1]], "pivot-can_2-a_box-0.05,0.04,-0.1+0.05,-0.04,-0.1"),
    ):
        assert stem(own_object(model, "a/box", contact)) == name
    assert stem(own_object("a/mug.xml", "mug", "vertex")) == "pivot-mug-vertex"


def files(*names: str, recorded: bool = True) -> list[str]:
    """Those of runs of these names in a folder."""
    endings = ["nc", "scenario.json", "summary.json"] + ["rrd"] * recorded
    return sorted(["summary.json", *(f"{name}.{ending}" for name in names for ending in endings)])


def test_one_summary_each_and_the_latest(worlds: Run, shipped: Callable[[str], Run], tmp_path: Path) -> None:
    first, second = save(worlds, tmp_path), save(shipped("balance-2d"), tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == files("balance-2d", "snap-2d")
    kept = {path.name: json.loads(path.read_text()) for path in tmp_path.glob("*.json")}
    assert kept["snap-2d.summary.json"] == first.summary
    assert kept["balance-2d.summary.json"] == kept["summary.json"] == second.summary
    assert first.summary["recording"] == "snap-2d.rrd"
    assert first.summary["scenario"] == "snap-2d"
    assert first.said[0].startswith("wrote ")
    again = save(worlds, tmp_path)
    assert again.said[0].startswith("replaced ")
    assert json.loads((tmp_path / "summary.json").read_text())["scenario"] == "snap-2d"
    assert len(list(tmp_path.iterdir())) == len(files("balance-2d", "snap-2d"))


def test_no_run_takes_the_place_of_another(worlds: Run, tmp_path: Path) -> None:
    """Of another seed, or of another model whose file has the same name; the same run takes its own place again."""
    out, others = tmp_path / "out", [tmp_path / name / "own.xml" for name in ("a", "b")]
    out.mkdir()
    runs = [worlds, simulate("snap-2d", worlds=3, seed=3, spread=0.05)]
    for number, model in enumerate(others):
        model.parent.mkdir()
        model.write_text(BOX.replace(".4", f".{4 + number}"))
        runs.append(simulate(own_object(model, "a/box", "edge"), seconds=0.3, hold=0.1))
    names = ["snap-2d", "snap-2d-2", "pivot-own-a_box-edge", "pivot-own-a_box-edge-2"]
    for said in ("wrote ", "replaced "):
        for run, name in zip(runs, names, strict=True):
            saved = save(run, out)
            assert saved.summary["scenario_file"] == f"{name}.scenario.json"
            assert saved.said[0].startswith(said)
    assert sorted(path.name for path in out.iterdir()) == files(*names)
    for run, name in zip(runs, names, strict=True):
        assert np.array_equal(load(out / f"{name}.scenario.json").wrench, run.wrench)
    others[0].write_text(BOX.replace(".4", ".6"))  # the same path, and another object
    changed = simulate(own_object(others[0], "a/box", "edge"), seconds=0.3, hold=0.1)
    assert save(changed, out).summary["scenario_file"] == "pivot-own-a_box-edge-3.scenario.json"


def test_files_of_unknown_runs_are_left_alone(worlds: Run, tmp_path: Path) -> None:
    """Such as what an earlier version left, which knew no scenario's files."""
    (tmp_path / "snap-2d.rrd").write_text("mine")
    (tmp_path / "snap-2d-2.scenario.json").write_text("{")
    assert save(worlds, tmp_path).summary["recording"] == "snap-2d-3.rrd"
    assert (tmp_path / "snap-2d.rrd").read_text() == "mine"
    assert (tmp_path / "snap-2d-2.scenario.json").read_text() == "{"


def test_the_worst_world_is_recorded(worlds: Run, tmp_path: Path) -> None:
    """Where a value is the greatest multiple of its limit."""
    ratios = [
        [getattr(worlds.measures, check.name)[i] / (check.limit or 1.0) for check in worlds.checks] for i in range(3)
    ]
    worst = int(np.argmax(np.max(ratios, axis=1)))
    assert worst != 0  # or nothing is shown
    assert worlds.worst_world == worlds.summary()["worst_world"] == worst
    for world, named in ((None, worst), (0, 0)):
        saved = save(worlds, tmp_path, world)
        assert saved.summary["recorded_world"] == named
        assert f"world {named} of 3" in saved.said[1]
        ((text,),) = [
            chunk.to_record_batch().column("TextDocument:text").to_pylist()[0]
            for chunk in RrdReader(tmp_path / "snap-2d.rrd").stream()
            if str(chunk.entity_path) == "/report"
        ]
        assert f"World {named} of 3" in text


def test_what_is_not_finite_or_must_not_be_is_the_worst(worlds: Run) -> None:
    for poison in (np.nan, np.inf):
        slip = np.array([9.0, poison, 9.0])
        bad = replace(worlds)
        vars(bad)["measures"] = replace(worlds.measures, slip_max_m=slip)
        assert bad.worst_world == 1
    lost = replace(worlds)
    vars(lost)["measures"] = replace(worlds.measures, contact_lost_s=np.array([0.0, 0.0, 1e-9]))
    assert lost.worst_world == 2


def test_recordings_can_be_off(worlds: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for word in ("off", "False", "0"):
        monkeypatch.setenv("RERUN", word)
        with pytest.raises(RecordingOffError, match=f"RERUN={word}"):
            record(worlds, tmp_path / "x.rrd")
    saved = save(worlds, tmp_path)
    assert saved.said[1] == "nothing is recorded: RERUN=0 is set in the environment"
    assert saved.summary["recording"] is None
    assert saved.summary["recorded_world"] is None
    assert sorted(path.name for path in tmp_path.iterdir()) == files("snap-2d", recorded=False)
    monkeypatch.setenv("RERUN", "on")
    assert save(worlds, tmp_path).summary["recording"] == "snap-2d.rrd"


def test_paths_may_be_text(worlds: Run, tmp_path: Path) -> None:
    model = tmp_path / "box.xml"
    model.write_text(BOX)
    assert own_object(str(model), "a/box", "edge") == own_object(model, "a/box", "edge")
    assert simulate(own_object(str(model), "a/box", "edge"), seconds=0.5).scenario.path == model
    assert record(worlds, str(tmp_path / "x.rrd")) == tmp_path / "x.rrd"


def test_scenarios_can_be_pickled_and_copied() -> None:
    for case in (*SCENARIOS.values(), SCENARIOS["snap-2d"].change(**{"world.mu": 0.2}, limits={"slip_m": 1.0})):
        for other in (pickle.loads(pickle.dumps(case)), copy.deepcopy(case)):
            assert other == case
            assert other.label == case.label
            with pytest.raises(TypeError):
                other.world["mu"] = 1.0


def same(a: Any, b: Any) -> bool:
    """Of arrays, and of tuples of them."""
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(same, a, b))
    return bool(np.array_equal(a, b, equal_nan=True)) if isinstance(a, np.ndarray) else True


@pytest.mark.parametrize(
    "arguments",
    [{"name": "mpc-2d", "seconds": 0.2}, {"name": "mpc-2d", "seconds": 0.2, "open_loop": True}, {"name": "snap-2d"}],
    ids=str,
)
def test_runs_go_through_pickle(arguments: dict[str, Any]) -> None:
    """The same arrays, read-only again, and the same summary."""
    run = simulate(**arguments)
    other = pickle.loads(pickle.dumps(run))
    assert jsonable(other.summary()) == jsonable(run.summary())  # nan is null there
    for each in fields(Run):
        assert same(getattr(run, each.name), getattr(other, each.name)), each.name
    with pytest.raises(ValueError, match="read-only"):
        other.wrench[0, 0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        other.desired[0][0, 0] = 1.0


def test_runs_come_back_from_other_processes() -> None:
    case = SCENARIOS["balance-2d"].change(seconds=0.6, **{"world.mu": 0.25})
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        run = pool.submit(simulate, case, 2, seed=3).result(timeout=300)
    here = simulate(case, 2, seed=3)
    assert np.array_equal(run.wrench, here.wrench)
    assert run.scenario == here.scenario
    assert run.verdict == here.verdict
