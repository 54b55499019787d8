"""Sweeps: the rows are those of a fleet, whoever runs the chunks, whatever is killed; each leads back to its world."""

import signal
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import distributed
import numpy as np
import pyarrow.parquet as parquet
import pytest
from click.testing import CliRunner
from pivoting.controller.uncertainty.uncertainty import Interval
from pivoting.sim import SweepProgress, Swept, read_sweep, simulate, sweep
from pivoting.sim.console.command_line import cli
from pivoting.sim.scenarios.scenario_file import read
from pivoting.sim.sweeping.failure_map import draw_map
from pivoting.sim.sweeping.sampling import SAMPLING, sampled_values

from tests.processes import started

VARY: dict[str, Any] = {"mass": "0.8:1.2", "mu": (0.25, 0.8), "com": "-0.005:0.005"}
QUICK: dict[str, Any] = {"seconds": 0.25, "hold": 0.05, "theta_end": 15.0}
WORDS = ["sweep", "pivot-2d", "--worlds", "30", "--chunk", "5"]
WORDS += [word for key, value in QUICK.items() for word in ("--set", f"{key}={value}")]
WORDS += ["--vary", "mass=0.8:1.2", "--vary", "mu=.25:.8", "--vary", "com=-0.005:0.005"]


def assert_same_rows(one: Swept, other: Swept) -> None:
    assert list(one.rows) == list(other.rows)
    for name, values in one.rows.items():
        np.testing.assert_array_equal(values, other.rows[name], err_msg=name)


@pytest.fixture(scope="module")
def swept() -> Swept:
    """In one piece, on no disk."""
    return sweep("pivot-2d", 30, VARY, **QUICK)


def test_its_rows_are_those_of_a_fleet(swept: Swept) -> None:
    fleet = simulate(swept.scenario, 30, keep="measures")
    for name, values in fleet.to_dataframe().items():
        np.testing.assert_array_equal(swept.rows[str(name)], values, err_msg=str(name))


def test_each_row_leads_back_to_its_world(swept: Swept) -> None:
    worst = int(np.argmax(swept.rows["slip_max_m"]))
    run = swept.replay(worst)
    again = simulate(swept.scenario, 1, first_world=worst, **{key: float(swept.rows[key][worst]) for key in swept.keys})
    np.testing.assert_array_equal(run.position, again.position)
    with pytest.raises(ValueError, match="world = 30: must be a whole number"):
        swept.replay(30)


def test_so_does_one_of_a_set_that_the_controller_is_not_told_of() -> None:
    hidden = sweep("pivot-2d", 2, {"world.mass": "0.8:1.2", "mu": "0.2:0.4", "world.com": (0.0, 0.01)}, **QUICK)
    assert hidden.replay(1).scenario.world["mass"] == hidden.rows["world.mass"][1]


def test_it_is_kept_chunk_by_chunk(swept: Swept, tmp_path: Path) -> None:
    told: list[SweepProgress] = []
    out = tmp_path / "s.parquet"
    kept = sweep("pivot-2d", 30, VARY, out=out, chunk=7, progress=told.append, **QUICK)
    assert_same_rows(kept, swept)
    assert_same_rows(read_sweep(out), swept)
    assert read_sweep(out).scenario == swept.scenario
    assert [each.done for each in told] == [7, 14, 21, 28, 30]
    assert told[-1].failed == len(swept.failed)
    assert told[0].left > 0.0 == told[-1].left
    assert [path.name for path in tmp_path.iterdir()] == ["s.parquet"]
    assert parquet.ParquetFile(out).num_row_groups == 5


@pytest.mark.parametrize("sampling", SAMPLING)
def test_the_worlds_are_where_they_are_said_to_be(sampling: str) -> None:
    sets = {"mass": Interval(0.8, 1.2), "mu": Interval(0.2, 0.6), "inertia": Interval(1.0, 1.0)}
    values, again = (sampled_values(sets, sampling, 3, 64).values for _ in range(2))
    np.testing.assert_array_equal(values, again)
    assert (values.min(axis=0) >= [0.8, 0.2, 1.0]).all()
    assert (values.max(axis=0) <= [1.2, 0.6, 1.0]).all()
    if sampling == "vertices":
        assert len(np.unique(values, axis=0)) == 4
    else:
        assert len(np.unique(values[:, 0])) == 64
    if sampling in ("sobol", "lhs"):  # one in each of as many slices
        assert len(np.unique(np.floor((values[:, 0] - 0.8) / 0.4 * 64.0))) == 64


@pytest.mark.parametrize("sampling", ["sobol", "vertices"])
def test_any_sample_can_be_replayed_and_bounds_nothing(sampling: str, tmp_path: Path) -> None:
    found = sweep("pivot-2d", 4, VARY, sampling=sampling, seed=2, out=tmp_path / "s.parquet", **QUICK)
    assert found.bound is None
    assert read_sweep(tmp_path / "s.parquet").replay(3).worlds == 1


def test_the_bound_is_that_of_clopper_and_pearson(swept: Swept) -> None:
    none = Swept(swept.scenario, 0, "drawn", {**swept.rows, "passed": np.ones(30, bool)})
    assert none.bound == pytest.approx(1.0 - 0.05 ** (1.0 / 30.0))
    all_failed = Swept(swept.scenario, 0, "drawn", {**swept.rows, "passed": np.zeros(30, bool)})
    assert all_failed.bound == 1.0


def test_whoever_runs_it(swept: Swept) -> None:
    with ThreadPoolExecutor(1) as pool:
        assert_same_rows(sweep("pivot-2d", 30, VARY, chunk=8, executor=pool, **QUICK), swept)


def test_a_sweep_that_is_killed_is_resumed(swept: Swept, tmp_path: Path) -> None:
    """The rows are those of one that was not; another sweep is not taken for it."""
    out, folder = tmp_path / "s.parquet", tmp_path / ".s.parquet.parts"
    process, limit = started(*WORDS, "--out", str(out)), time.monotonic() + 100.0
    while not list(folder.glob("part-*.parquet")):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < limit
        time.sleep(0.005)
    process.send_signal(signal.SIGKILL)
    process.communicate(timeout=60)
    assert not out.exists()
    with pytest.raises(ValueError, match="a sweep was begun there: resume it, or remove that folder"):
        sweep("pivot-2d", 30, VARY, out=out, chunk=5, **QUICK)
    with pytest.raises(ValueError, match=r"scenario must be as in the sweep that was begun"):
        sweep("pivot-2d", 30, VARY, out=out, chunk=5, resume=True, **{**QUICK, "theta_end": 16.0})
    told: list[SweepProgress] = []
    found = sweep("pivot-2d", 30, VARY, out=out, chunk=5, resume=True, progress=told.append, **QUICK)
    assert_same_rows(found, swept)
    assert told[0].began >= 5
    assert told[-1].failed == len(swept.failed)
    assert [path.name for path in tmp_path.iterdir()] == ["s.parquet"]
    before = out.stat().st_mtime_ns
    assert_same_rows(sweep("pivot-2d", 30, VARY, out=out, chunk=5, resume=True, **QUICK), swept)
    assert out.stat().st_mtime_ns == before


def test_the_command(swept: Swept, tmp_path: Path) -> None:
    out, picture, worst = (tmp_path / name for name in ("s.parquet", "map.png", "worst.json"))
    files = ["--out", str(out), "--map", str(picture), "--worst", str(worst)]
    done = CliRunner().invoke(cli, [*WORDS, *files], standalone_mode=False)
    assert done.exception is None, done.exception
    assert done.return_value == (1 if len(swept.failed) else 0)
    assert f"failed: {len(swept.failed)} of 30 worlds (drawn)" in done.output
    assert "with 95 % confidence fewer than" in done.output
    assert "30 done" in done.output
    assert_same_rows(read_sweep(out), swept)
    assert picture.exists()
    file = read(worst)
    alone = simulate(file.scenario, file.worlds, file.seed, first_world=file.first_world)
    assert alone.measures.slip_max_m[0] == swept.rows["slip_max_m"][swept.worst]
    for wrong, message in (("dusk", "must be local, or dask:"), ("dask:", "must be local, or dask:")):
        done = CliRunner().invoke(cli, [*WORDS, "--executor", wrong], standalone_mode=False)
        assert message in str(done.exception)


def test_two_workers_of_dask_of_which_one_is_killed(swept: Swept) -> None:
    with distributed.LocalCluster(2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        killed: list[int] = []

        def kill(progress: SweepProgress) -> None:
            if not killed:
                worker = next(iter(cluster.workers.values()))
                killed.append(worker.process.process.pid)
                worker.process.process.kill()

        with distributed.Client(cluster) as client:
            pool = client.get_executor(pure=False)
            found = sweep("pivot-2d", 30, VARY, chunk=3, executor=pool, progress=kill, **QUICK)
    assert killed
    assert_same_rows(found, swept)


def test_sensitivities_find_what_matters(swept: Swept) -> None:
    rows = {name: np.resize(values, 500) for name, values in swept.rows.items()}
    rng = np.random.default_rng(0)
    rows |= {key: rng.uniform(size=500) for key in swept.keys}
    for name in ("slip_max_m", "angle_error_max_deg", "friction_use_max"):
        rows[name] = 1.0 - rows["world.mu"] + 0.01 * rows["world.mass"]
    found = Swept(swept.scenario, 0, "drawn", rows).sensitivities()["slip_max_m"]
    assert found["world.mu"] > 0.9
    assert abs(found["world.mass"]) < 0.1


def test_a_map_is_drawn(swept: Swept, tmp_path: Path) -> None:
    draw_map(swept, tmp_path / "map.png", ("world.mu", "world.com_x"))
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(ValueError, match=r"^map = 'world.x': must be one of world.mass"):
        draw_map(swept, tmp_path / "map.png", ("world.mu", "world.x"))


@pytest.mark.parametrize(
    ("vary", "changes", "message"),
    [
        ({"mass": 1.0}, {}, r"^mass = 1.0: must be an interval LOW:HIGH"),
        ({}, {}, r"^vary = \{\}: must be at least one key"),
        ({"theta": "10:20"}, {}, r"^theta = "),
        ({"mu": "0.2:0.4"}, {"worlds": 0}, r"^worlds = 0: must be a whole number >= 1"),
        ({"mu": "0.2:0.4"}, {"chunk": 0}, r"^chunk = 0: must be a whole number >= 1"),
        ({"mu": "0.2:0.4"}, {"sampling": "grid"}, r"^sampling = 'grid': must be one of"),
        ({"mu": "0.2:0.4"}, {"resume": True}, r"^resume = True: must be given with out"),
    ],
)
def test_what_is_no_sweep_is_refused(vary: dict[str, Any], changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        sweep("pivot-2d", **{"worlds": 4, "vary": vary, **changes})


def test_a_file_that_is_none_is_refused(swept: Swept, tmp_path: Path) -> None:
    path = tmp_path / "s.parquet"
    path.write_bytes(b"PAR1 and no more")
    with pytest.raises(ValueError, match="must be the file of a sweep, whole"):
        read_sweep(path)
    swept.to_dataframe().to_parquet(path)
    with pytest.raises(ValueError, match="must be the file of a sweep, whole"):
        read_sweep(path)
