"""A fleet: measures that do not depend on the chunks, worlds that can be run again, and memory that does not grow."""

import json
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from pivoting import Fleet, PivotingError, Run, load, simulate
from pivoting.sim import chunks
from pivoting.sim.fleet import ReplayError
from pivoting.sim.pipeline.own_control import Moment
from pivoting.sim.scenarios.scenario_file import read

from tests.own_files import mjcf, own
from tests.processes import called, pivoting
from tests.same_runs import assert_same

CASES: dict[str, dict[str, Any]] = {
    "noise": {"name": "pivot-2d", "worlds": 5, "noise": 0.05, "integral": 5.0, "f_min": "1w", "seconds": 0.15},
    "space": {"name": "pivot-3d", "worlds": 5, "noise": 0.02, "seconds": 0.15},
    "a horizon": {"name": "mpc-2d", "worlds": 2, "noise": 0.02, "seconds": 0.03, "limits": {"settle_s": 0.015}},
    "released": {
        "name": "mpc-2d", "worlds": 2, "seconds": 0.3, "force_max": "0.05w", "moment_max": "0.05w", "theta_end": 40,
    },
    "diverging": {"name": "balance-2d", "worlds": 3, "bandwidth": 5000, "seconds": 0.6},
    "landing": {"name": "settle-3d", "worlds": 3, "seconds": 0.3},
}  # fmt: skip
TIMED = {"solve_us_median", "solve_us_p99", "wall_s", "real_time_factor", "plan_ms_median", "plan_ms_p99"}


@pytest.fixture(scope="module", params=CASES)
def whole(request: pytest.FixtureRequest) -> tuple[Run, dict[str, Any]]:
    """All worlds at once, with every array."""
    arguments = {"seed": 3, **CASES[request.param]}
    return simulate(**arguments), arguments


def told(run: Run | Fleet) -> dict[str, Any]:
    """The summary, but for times and what a fleet says of itself; nan as text, which equals itself."""
    left_out = TIMED | {"keep", "events_left_out", "events"}
    return {key: repr(value) for key, value in run.summary().items() if key not in left_out}


def assert_same_measures(fleet: Fleet, run: Run) -> None:
    for name, values in vars(run.measures).items():
        assert getattr(fleet.measures, name).tobytes() == values.tobytes(), name


@pytest.mark.parametrize("size", [1, 3])
def test_nothing_depends_on_the_chunks(
    size: int, whole: tuple[Run, dict[str, Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Measures, samples, verdict and summary are those of one run of all worlds, to the last bit."""
    run, arguments = whole
    steps = run.time.size - 1
    monkeypatch.setattr(chunks, "CHUNK", size * steps)
    fleet = simulate(**arguments, keep="reduced")
    assert isinstance(fleet, Fleet)
    assert fleet.worlds == run.worlds
    assert_same_measures(fleet, run)
    assert (fleet.verdict, fleet.worst_world) == (run.verdict, run.worst_world)
    np.testing.assert_array_equal(fleet.failed_worlds, run.failed_worlds)
    assert fleet.limits == run.limits
    assert told(fleet) == told(run)
    assert sorted(fleet.events) == sorted(run.events)
    assert fleet.engine_warnings == run.engine_warnings
    assert set(run.summary()) == set(fleet.summary()) - {"keep", "events_left_out"}
    assert fleet.samples is not None
    at = slice(0, steps, -(-steps // 200))
    assert 100 < fleet.samples.time.size <= 200 or fleet.samples.time.size == steps
    np.testing.assert_array_equal(fleet.samples.time, run.time[at])
    for name in ("theta", "angle_error", "slip", "wrench", "friction_use"):
        sampled = getattr(fleet.samples, name)
        assert sampled.dtype == np.float64
        assert sampled.tobytes() == getattr(run, name)[:, at].tobytes(), name


def test_a_world_that_is_run_again_is_what_it_was(whole: tuple[Run, dict[str, Any]]) -> None:
    run, arguments = whole
    fleet = simulate(**arguments, keep="measures")
    assert fleet.samples is None
    world = run.worlds - 1
    again = fleet.replay(world)
    assert again.worlds == 1
    for name in ("states", "wrench_world", "measured"):
        there, now = getattr(run.log, name), getattr(again.log, name)
        assert (there is None and now is None) or there[world].tobytes() == now[0].tobytes(), name
    for name in ("wrench", "force", "residual", "status", "slip", "friction_use"):
        assert getattr(run, name)[world].tobytes() == getattr(again, name)[0].tobytes(), name
    for name, values in zip(run.log.contacts._fields, run.log.contacts, strict=True):
        assert values[world].tobytes() == getattr(again.log.contacts, name)[0].tobytes(), name


def test_the_cases_above_hold_what_they_are_to_compare(whole: tuple[Run, dict[str, Any]]) -> None:
    """Or they compare nothing: worlds differ, one is released, one diverges."""
    run, arguments = whole
    assert len(set(run.measures.angle_error_rms_deg.tolist())) > 1 or np.isnan(run.measures.angle_error_rms_deg).any()
    if "force_max" in arguments:
        assert run.events
    if "bandwidth" in arguments:
        assert run.engine_warnings
        assert run.summary()["reasons"]


def test_what_else_is_touched_is_said_of_the_same_world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ball = '<body name="ball" pos="0 0 .16"><freejoint/><geom name="ball" size=".02" mass="50"/></body>'
    case = own(tmp_path, mjcf(world=ball))
    run = simulate(case, 3, seed=3, spread=1.0)
    assert "'ball'" in run.strays[0]
    assert run.strays[0].endswith("in world 1")
    monkeypatch.setattr(chunks, "CHUNK", 1)
    fleet = simulate(case, 3, seed=3, spread=1.0, keep="measures")
    assert_same_measures(fleet, run)
    assert told(fleet) == told(run)
    assert fleet.strays == run.strays


class Unsteady:
    """A control with a state: what it gives depends on how often it was asked, since it last began anew."""

    def __init__(self, begins_anew: bool):
        self.begins_anew, self.asked, self.seen = begins_anew, 0, []

    def __call__(self, now: Moment) -> np.ndarray:
        if now.before is None:
            self.asked *= not self.begins_anew
            self.seen.append((now.first_world, len(now.states.position)))
        self.asked += 1
        return np.array([1.0, 5.0, 0.5 + 1e-4 * self.asked])


def test_a_control_of_ones_own_is_told_of_its_worlds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chunks, "CHUNK", 1200)
    control = Unsteady(True)
    fleet = simulate("balance-2d", 5, control=control, first_world=10, seconds=0.6, keep="measures")
    assert control.seen[:3] == [(10, 2), (12, 2), (14, 1)]
    assert fleet.controller == "own control"
    assert_same_measures(fleet, simulate("balance-2d", 5, control=Unsteady(True), first_world=10, seconds=0.6))
    assert fleet.replay(3).first_world == 13
    lasting = simulate("balance-2d", 5, control=Unsteady(False), seconds=0.6, keep="measures")
    with pytest.raises(ReplayError, match=r"world = 0: run again its .* begin anew") as raised:
        lasting.replay(0)
    assert isinstance(raised.value, PivotingError)


@pytest.fixture(scope="module")
def fleet() -> Fleet:
    return simulate("pivot-2d", 3, seed=5, noise=0.05, seconds=0.3, keep="reduced")


def test_it_cannot_be_changed_and_can_be_pickled(fleet: Fleet) -> None:
    assert fleet.samples is not None
    again = pickle.loads(pickle.dumps(fleet))
    for each in (fleet, again):
        for values in (*vars(each.measures).values(), *each.samples, each.control_us, each.time):
            assert not values.flags.writeable
    assert told(again) == told(fleet)
    assert again.replay(1).worlds == 1


@pytest.mark.parametrize(("keep", "case"), [("reduced", "noise"), ("measures", "noise"), ("measures", "a horizon")])
def test_what_is_loaded_is_what_was_saved(keep: str, case: str, tmp_path: Path) -> None:
    fleet = simulate(**CASES[case], keep=keep)
    assert sorted(path.name for path in fleet.save(tmp_path).iterdir()) == ["run.nc", "scenario.json"]
    assert read(tmp_path / "scenario.json").keep == keep
    again = load(tmp_path)
    assert isinstance(again, Fleet)
    assert again.keep == keep
    for name, values in vars(fleet.measures).items():
        assert getattr(again.measures, name).tobytes() == values.tobytes(), name
    for one, other in zip(fleet.samples or (), again.samples or (), strict=True):
        assert one.tobytes() == other.tobytes()
    assert {key: repr(value) for key, value in again.summary().items()} == {
        key: repr(value) for key, value in fleet.summary().items()
    }
    assert_same_timeless(again.replay(1), fleet.replay(1))


def assert_same_timeless(run: Run, other: Run) -> None:
    assert run.log.states.tobytes() == other.log.states.tobytes()
    assert run.log.wrench_world.tobytes() == other.log.wrench_world.tobytes()


def test_a_run_takes_the_place_of_a_fleet(tmp_path: Path, fleet: Fleet) -> None:
    run = fleet.replay(2)
    fleet.save(tmp_path)
    assert_same(run, load(run.save(tmp_path)))
    assert "keep" not in json.loads((tmp_path / "scenario.json").read_text())


def test_without_its_control_no_world_can_be_run_again(tmp_path: Path) -> None:
    made = simulate("balance-2d", 2, control=Unsteady(True), seconds=0.6, keep="measures")
    again = load(made.save(tmp_path))
    assert again.verdict == made.verdict
    with pytest.raises(ValueError, match="fleet: Python objects, which no file holds, were its control"):
        again.replay(0)


def test_xarray_opens_it(fleet: Fleet, tmp_path: Path) -> None:
    fleet.save(tmp_path)
    with xarray.open_dataset(tmp_path / "run.nc", engine="scipy") as data:
        assert data["slip_max_m"].dims == ("world",)
        assert data["slip_max_m"].attrs["units"] == "m"
        assert data["slip"].dims == ("world", "sample", "contact", "table_axis")
        assert {"time", "world"} <= set(data.coords)
        np.testing.assert_array_equal(data["wrench"].values, fleet.samples.wrench)
        for name, variable in data.data_vars.items():
            assert variable.attrs["long_name"], name


def test_a_table_has_a_row_for_each_world(fleet: Fleet) -> None:
    table = fleet.to_dataframe()
    assert table.index.name == "world"
    assert len(table) == 3
    np.testing.assert_array_equal(table["slip_max_m"], fleet.measures.slip_max_m)
    assert set(table.index[~table["passed"]]) == set(fleet.failed_worlds)


def test_what_cannot_be_is_refused(fleet: Fleet, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="keep = 'some': must be one of all, reduced, measures"):
        simulate("pivot-2d", keep="some")
    with pytest.raises(ValueError, match="keep = 'measures': must be 'all' in open loop"):
        simulate("mpc-2d", open_loop=True, keep="measures")
    with pytest.raises(ValueError, match=r"worlds = 100000: must be at most .* or any number with keep = 'measures'"):
        simulate("pivot-2d", 100_000)
    for world in (-1, 3, True, 0.5):
        with pytest.raises(ValueError, match=r"world = .*: must be a whole number in \[0, 3\)"):
            fleet.replay(world)
    (tmp_path / "a.json").write_text('{"scenario": "pivot-2d", "keep": "some"}')
    with pytest.raises(ValueError, match=r"a.json: keep = 'some': must be one of"):
        read(tmp_path / "a.json")


def test_on_the_command_line(tmp_path: Path) -> None:
    """Table, summary, measures, the worst world's recording; and again from the file that it wrote."""
    words = ("run", "pivot-2d", "--worlds", "5", "--set", "noise=0.05", "--set", "seconds=0.3", "--keep", "measures")
    done = pivoting(*words, "--out", str(tmp_path))
    assert done.returncode == 1, done.stderr
    assert "0 of 5 within limits" in done.stdout
    assert "what may hold it, not tried in so many worlds: --set" in done.stdout
    kept = json.loads((tmp_path / "summary.json").read_text())
    assert kept["keep"] == "measures"
    assert (tmp_path / kept["recording"]).stat().st_size > 10_000
    assert f"world {kept['worst_world']} of 5, the worst, is in" in done.stdout
    assert isinstance(load(tmp_path / kept["scenario_file"]), Fleet)
    again = called("run", "--scenario", str(tmp_path / kept["scenario_file"]), "--json")
    summary = json.loads(again.stdout)
    assert (again.returncode, summary["keep"]) == (1, "measures")
    assert summary["slip_max_m"] == kept["slip_max_m"]
    refused = called("run", "pivot-2d", "--keep", "nothing")
    assert (refused.returncode, refused.stdout) == (2, "")
    assert "--keep" in refused.stderr
    assert len(refused.stderr.splitlines()) == 1


MEMORY = """
import resource, sys
from pivoting import simulate
for worlds in (300, 600):
    simulate("pivot-2d", worlds, seconds=0.2, limits={"settle_s": 0.1}, keep="measures")
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="has no getrusage")
def test_memory_does_not_grow_with_the_worlds() -> None:
    """300 worlds more, of 1050 steps, would take some 300 MB where all is kept; of both a chunk has 217 or more."""
    done = subprocess.run([sys.executable, "-c", MEMORY], capture_output=True, text=True, timeout=300, check=True)
    few, many = (int(line) / (1024 if sys.platform == "linux" else 1024**2) for line in done.stdout.split())
    grown = many - few
    assert grown < 100, f"{grown:.0f} MB"
