"""The command line as a stranger uses it: exit codes, a line for a wrong call; in real processes where it matters."""

import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from pivoting.sim.console.command_line import main

from tests.processes import called, pivoting

KEYS = {
    "scenario", "seed", "worlds", "verdict", "failed_worlds", "slip_max_m", "slip_floor_m", "angle_error_rms_deg",
    "angle_error_max_deg", "contact_lost_s", "friction_use_max", "force_mismatch_rel", "residual_max",
    "solve_us_median", "solve_us_p99", "sim_s", "wall_s",
}  # fmt: skip


def test_example_json() -> None:
    """Every printed digit, by the closed form, Clarabel and at least three backends of qpsolvers."""
    done = pivoting("example", "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["agrees"] is True
    printed = [row for row in told["results"] if row["example"] == "printed"]
    agreeing = {row["method"] for row in printed if row["agrees"] and row["status"] == "solved"}
    assert {"closed-form", "clarabel"} <= agreeing
    assert len([method for method in agreeing if method.startswith("qp:")]) >= 3
    assert printed[0]["digits"]["f_t"]["printed"] == "1.39789"
    assert printed[0]["digits"]["f_t"]["value"] == pytest.approx(1.39789, abs=5e-6)


def test_example_for_people_and_its_figure(tmp_path: Path) -> None:
    done = pivoting("example", "--figure", str(tmp_path / "space.png"))
    assert done.returncode == 0
    for words in ("1.39789", "52.6568", "closed-form", "agree", "tau: the notes print -0.10201"):
        assert words in done.stdout
    assert (tmp_path / "space.png").read_bytes().startswith(b"\x89PNG")
    assert [path.name for path in tmp_path.iterdir()] == ["space.png"]


def test_list() -> None:
    done = called("list")
    assert done.returncode == 0
    names = [line.split()[0] for line in done.stdout.splitlines()]
    assert {"balance-2d", "incline-2d", "pivot-2d", "snap-2d"} <= set(names)


def test_run_json_is_one_object_and_nothing_else() -> None:
    done = pivoting("run", "snap-2d", "--json", "--worlds", "3", "--seed", "5")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert set(told) >= KEYS
    assert told["verdict"] == "pass"
    assert told["failed_worlds"] == []
    assert (told["worlds"], told["seed"], told["scenario"]) == (3, 5, "snap-2d")


def test_run_writes_recording_and_summary(tmp_path: Path) -> None:
    done = called("run", "snap-2d", "--out", str(tmp_path / "new" / "folder"))
    assert done.returncode == 0, done.stderr
    assert "pass" in done.stdout
    out = tmp_path / "new" / "folder"
    assert sorted(path.name for path in out.iterdir()) == [
        "snap-2d.nc", "snap-2d.rrd", "snap-2d.scenario.json", "snap-2d.summary.json", "summary.json",
    ]  # fmt: skip
    assert json.loads((out / "summary.json").read_text())["verdict"] == "pass"


def test_a_failed_verdict_exits_1_and_still_tells_everything() -> None:
    done = pivoting("run", "incline-2d", "--set", "world.mu=0.2", "--set", "seconds=1", "--json")
    assert done.returncode == 1
    told = json.loads(done.stdout)
    assert told["verdict"] == "fail"
    assert told["failed_worlds"] == [0]


def test_a_diverged_run_is_still_json() -> None:
    """nan is not JSON: it is written as null, and the verdict is fail."""
    done = called("run", "balance-2d", "--set", "bandwidth=5000", "--set", "seconds=1", "--json")
    assert done.returncode == 1
    assert json.loads(done.stdout)["verdict"] == "fail"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["run", "fly-2d"], "scenario = 'fly-2d': must be one of balance-2d"),
        (["run", "pivot-2d", "--set", "thet=3"], "thet = '3': must be a known key"),
        (["run", "pivot-2d", "--set", "theta=abc"], "theta = 'abc': must be a number"),
        (["run", "pivot-2d", "--set", "theta=nan"], "theta = nan: must be a finite number"),
        (["run", "pivot-2d", "--set", "theta=120"], "theta = 120.0: must be a finite number >= 0.1 and <= 89.9 [deg]"),
        (["run", "pivot-2d", "--set", "mu=0"], "mu = 0.0: must be a finite number > 0"),
        (["run", "pivot-2d", "--set", "world_mu=0.1"], "world_mu = '0.1': must be a known key"),
        (["run", "pivot-2d", "--set", "world=3"], "world = '3': must be a mapping"),
        (["run", "pivot-2d", "--set", "theta"], "'theta': must be KEY=VALUE"),
        (["run", "pivot-2d", "--set", "world.law=static"], "world.law"),
        (["run", "pivot-2d", "--set", "mu=.2", "--set", "mu=.3"], "--set 'mu=.3': mu is already given as .2"),
        (["run", "pivot-2d", "--set", "force_max=0.8x"], "force_max = '0.8x': must be a number, or in weights"),
        (["run", "balance-2d", "--set", "theta_end=50"], "theta_end = 50.0: must be left out: it has no effect unless"),
        (["run", "pivot-2d", "--set", "plan_step=.01"], "plan_step = 0.01: must be left out: it has no effect unless"),
        (["run", "pivot-2d", "--set", "mu=1e-6"], "mu = 1e-06: must be > 1e-05, which is the least friction coeff"),
        (["run", "pivot-2d", "--set", "f_min=1e300w"], "f_min = '1e300w': must be at most 1e+12w"),
        (["run", "pivot-2d", "--set", "limits=5"], "--set limits: must be --limit KEY=VALUE"),
        (["run", "pivot-2d", "--limit", "slip=1"], "limits.slip = '1': must be a known limit: slip_m"),
        (["run", "pivot-2d", "--limit", "slip_m=x"], "limits.slip_m = 'x': must be a number"),
        (["run", "pivot-2d", "--limit", "slip_m=1", "--limit", "slip_m=2"], "slip_m is already given as 1"),
        (["run", "pivot-2d", "--contact", ""], "--contact: only the scenario pivot takes it"),
        (["run", "pivot-2d", "--worlds", "10000000000000"], "worlds = 10000000000000: must be at most 2105"),
        (["run", "pivot-2d", "--record-world", "0"], "--record-world 0: must be given with --out"),
        (["run", "pivot-2d", "--out", ""], "--out '': must be a folder"),
        (["run", "pivot-2d", "--worlds", "0"], "'--worlds': 0 is not in the range"),
        (["run", "pivot-2d", "--seed", "x"], "'--seed': 'x' is not a valid integer"),
        (["run"], "Missing argument 'SCENARIO'"),
        (["jump"], "No such command 'jump'"),
        (["run", "pivot-2d", "--fast"], "No such option"),
        (["example", "--figure", "x.txt"], "must end in .png, .svg or .pdf"),
        (["example", "--figure", "nowhere/x.png"], "its folder does not exist"),
    ],
)
def test_wrong_calls_are_one_line_and_exit_2(words: list[str], message: str, tmp_path: Path) -> None:
    done = called(*words, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout == ""
    assert len(done.stderr.strip().splitlines()) == 1
    assert message in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_wrong_call_in_a_process_of_its_own() -> None:
    """As the others; what the process adds to them is its exit code."""
    done = pivoting("run", "fly-2d")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("pivoting: scenario = 'fly-2d'")


def test_a_fault_of_ours_is_not_called_a_wrong_use(monkeypatch: pytest.MonkeyPatch) -> None:
    """A ValueError that no check of an argument raised keeps its traceback."""

    def broken(console: object) -> None:
        np.zeros(2) + np.zeros(3)

    monkeypatch.setattr("pivoting.sim.console.scenario_tables.print_scenarios", broken)
    monkeypatch.setattr(sys, "argv", ["pivoting", "list"])
    with pytest.raises(ValueError, match="broadcast"):
        main()


def test_out_that_is_a_file_is_refused_before_the_run(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("mine")
    done = called("run", "balance-2d", "--out", str(tmp_path / "taken"))
    assert done.returncode == 2
    assert "must be a folder" in done.stderr
    assert (tmp_path / "taken").read_text() == "mine"
    below = called("run", "balance-2d", "--out", str(tmp_path / "taken" / "sub"))
    assert below.returncode == 2
    assert "must be a folder that can be written to" in below.stderr


def test_help_and_version() -> None:
    assert pivoting("--help").returncode == 0
    assert pivoting("--version").stdout.startswith("pivoting 0.")


def test_help_of_run_lists_the_keys() -> None:
    """With unit, range, default and meaning."""
    told = " ".join(called("run", "--help").stdout.split())
    assert "--set KEY=VALUE" in told
    for words in (
        "[>= 0.1 and <= 89.9 deg; default: 80; only if reference is arc or return]",
        "force_max greatest force [> 0 N, or 2w; default: none]",
        "slip_m displacement of the contact along the support [>= 0 m; default: 0.0001]",
    ):
        assert words in told


def test_limits_and_worlds_of_a_run(tmp_path: Path) -> None:
    """A limit of one's own fails some of the worlds: which, and which is recorded, is said; here is a folder."""
    words = ["run", "snap-2d", "--worlds", "12", "--set", "spread=0.05", "--out", "."]
    free = called(*words, cwd=tmp_path)
    assert free.returncode == 0, free.stderr
    errors = json.loads((tmp_path / "summary.json").read_text())
    assert errors["failed_worlds"] == []
    limit = errors["slip_max_m"] * 0.999999
    words += ["--limit", f"slip_m={limit!r}", "--record-world"]
    assert called(*words, "2", cwd=tmp_path).returncode == 1
    held = called(*words, "3", cwd=tmp_path)
    assert held.returncode == 1
    told = json.loads((tmp_path / "snap-2d-2.summary.json").read_text())
    assert told["limits"]["slip_m"] == limit
    assert told["changes"]["limit.slip_m"] == limit
    assert len(told["failed_worlds"]) == 1
    assert told["recorded_world"] == 3
    said = " ".join(held.stdout.split())
    assert f"the worst world is {told['worst_world']}; those that fail are {told['failed_worlds'][0]} " in said
    assert "replaced snap-2d-2.summary.json" in said
    assert "world 3 of 12 is in snap-2d-2.rrd" in said
    assert "world 3 of 12 is" not in free.stdout


def test_no_recording_where_rerun_is_off(tmp_path: Path) -> None:
    """One line says why; stderr has nothing else."""
    done = pivoting("run", "snap-2d", "--json", "--out", str(tmp_path), RERUN="off")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["recording"] is None
    lines = done.stderr.strip().splitlines()
    assert lines[-1] == "nothing is recorded: RERUN=off is set in the environment"
    assert len(lines) == 2
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "snap-2d.nc", "snap-2d.scenario.json", "snap-2d.summary.json", "summary.json",
    ]  # fmt: skip


OWN = """<mujoco><worldbody><geom type="plane" size="1 1 1"/><body name="can" pos="0 0 .2"><freejoint/>
<geom type="cylinder" size=".05 .1" mass=".4"/></body></worldbody></mujoco>"""


def test_an_object_of_ones_own(tmp_path: Path) -> None:
    """One JSON object, a recording and a summary; wrong calls in one line each, and nothing half-written."""
    model, out = tmp_path / "can.xml", tmp_path / "out"
    model.write_text(OWN)
    own = ["run", "pivot", "--model", str(model), "--body", "can"]
    done = called(*own, "--contact", "vertex", "--set", "seconds=0.5", "--out", str(out), "--json")
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["verdict"] == "pass"
    assert summary["body"] == "can"
    assert len(summary["contacts"]) == 1
    assert sorted(path.name for path in out.iterdir()) == [
        "pivot-can-vertex.nc", "pivot-can-vertex.rrd", "pivot-can-vertex.scenario.json",
        "pivot-can-vertex.summary.json", "summary.json",
    ]  # fmt: skip
    for arguments, message in (
        ([*own[:4]], "--body is missing"),
        (["run", "pivot-2d", "--body", "can"], "only the scenario pivot takes it"),
        ([*own, "--contact", "1,2"], "in the body frame"),
        ([*own, "--contact", "a,b,c"], "--contact 'a,b,c'"),
        ([*own, "--contact", ""], "contact = ''"),
        ([*own, "--contact", "edge"], "contact = 'edge'"),
        ([*own, "--set", "size=1"], "size = 1: the body is not a box"),
        ([*own, "--set", "theta_end=170"], r"theta = 5 and theta_end = 170 deg: about .* can be turned within \["),
        ([*own, "--support", "moon"], "support = 'moon'"),
        (["run", "pivot", "--model", str(tmp_path), "--body", "can"], "it is a directory"),
    ):
        wrong = called(*arguments, "--out", str(tmp_path / "other"))
        assert wrong.returncode == 2
        assert re.search(message, wrong.stderr), wrong.stderr
        assert len(wrong.stderr.strip().splitlines()) == 1
        assert not list((tmp_path / "other").glob("*"))
