"""`pivoting identify`: tables of a user's own, saved runs, and one clear error for what is neither."""

import csv
import json
import sys
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from pivoting import simulate
from pivoting.sim.console.command_line import main

from tests.pivot_runs import PivotRun, pivot_runs
from tests.test_cli import pivoting

Said = Callable[..., tuple[int, str, str]]


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Said:
    """Exit code, stdout and stderr of the command in this process."""

    def call(*words: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["pivoting", "identify", *words])
        code = main()
        return code, *capfd.readouterr()

    return call


@cache
def planar_run() -> PivotRun:
    """A run whose table is good."""
    (run,) = pivot_runs(23, 1, 2)
    return run


def columns(run: PivotRun) -> dict[str, np.ndarray]:
    """A log as a user keeps it; the last row has neither wrench nor contact force."""
    log = run.log
    planar = log.space.dim == 2
    wrench = np.hstack([log.force, log.moment]) @ log.space.wrench_map.T
    names = ["Fu_N", "Fv_N", "M_N_m"] if planar else [f"F{i}_N" for i in "xyz"] + [f"M{i}_N_m" for i in "xyz"]
    found = {"time_s": log.time}
    if planar:
        found["theta_deg"] = np.rad2deg(log.space.angle(log.orientation))
    else:
        found |= dict(zip(("qw", "qx", "qy", "qz"), log.orientation.T, strict=True))
    found |= {f"wrench_{name}": np.append(column, np.nan) for name, column in zip(names, wrench.T, strict=True)}
    axes = {"t": 0, "n": 2} if planar else {"t": 0, "o": 1, "n": 2}
    return found | {f"force_{axis}_N": np.append(log.contact_force[:, i], np.nan) for axis, i in axes.items()}


def write(path: Path, table: dict[str, Sequence[object] | np.ndarray]) -> Path:
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(table)
        writer.writerows([["" if cell != cell else cell for cell in row] for row in zip(*table.values(), strict=True)])
    return path


def options(run: PivotRun) -> list[str]:
    """What the command is to be told beside the table."""
    prior, unknowns = run.unknowns.prior, run.unknowns
    inertia = np.diag(unknowns.inertia)[[1] if prior.dim == 2 else [0, 1, 2]]
    return [
        "--lever", ",".join(map(str, unknowns.lever[unknowns.axes])),
        "--inertia", ",".join(map(str, inertia)),
        "--mass", f"{prior.mass.low}:{prior.mass.high}",
        "--com", ",".join(f"{low}:{high}" for low, high in prior.com),
        "--shove", str(prior.shove.high),
        "--rate", str(run.errors.rate),
        "--force-error", str(run.errors.contact_force),
    ]  # fmt: skip


@pytest.mark.parametrize("dim", [2, 3])
def test_a_table_of_ones_own(dim: int, tmp_path: Path) -> None:
    """In CSV and in Parquet: the intervals hold the truth, and the mass is told by the contact force."""
    import pandas

    (run,) = pivot_runs(20, 1, dim)
    table = columns(run)
    pandas.DataFrame(table).to_parquet(tmp_path / "log.parquet")
    answers = []
    for path in (write(tmp_path / "log.csv", table), tmp_path / "log.parquet"):
        done = pivoting("identify", str(path), *options(run), "--json")
        assert done.returncode == 0, done.stderr
        answers.append(json.loads(done.stdout))
    told = {each["name"]: each for each in answers[0]["parameters"]}
    assert {**answers[1], "file": ""} == {**answers[0], "file": ""}
    assert answers[0]["consistent"] is True
    truth = dict(zip(run.unknowns.names, run.truth.tolist(), strict=True))
    truth |= {"mass": run.member.mass, "inertia": run.member.inertia}
    for name, value in truth.items():
        if name in told:
            low, high = told[name]["after"]
            assert low <= value <= high, name
    assert told["mass"]["told"]
    assert "contact force" in told["mass"]["why"]
    assert told["mu"]["before"] == [0.0, None]


def test_what_is_not_measured_is_not_told(tmp_path: Path, said: Said) -> None:
    """Without contact forces the mass keeps its upper end, and mu everything; people read why."""
    (run,) = pivot_runs(21, 1, 2, shove=0.0)
    table = {name: values for name, values in columns(run).items() if not name.startswith("force")}
    code, out, err = said(str(write(tmp_path / "log.csv", table)), *options(run))
    assert (code, err) == (0, "")
    assert (
        "mu                         0 or more             0 or more              needs a measured contact force" in out
    )
    assert "a pivot on a contact that sticks tells only m c and I_P" in out
    assert "theta 0.1 deg" in out
    assert "hang together by m c" in out


def test_a_log_that_contradicts_its_bounds_exits_1(tmp_path: Path, said: Said) -> None:
    (run,) = pivot_runs(22, 1, 2)
    table = columns(run)
    table["wrench_M_N_m"] = 1.5 * table["wrench_M_N_m"]
    code, out, _ = said(str(write(tmp_path / "log.csv", table)), *options(run))
    assert code == 1
    assert "the log contradicts the prior or the bounds on its errors" in out


def changed(**columns_changed: object) -> Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]]:
    def change(table: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        return {name: values for name, values in (table | columns_changed).items() if values is not None}  # type: ignore[return-value, operator]

    return change


LATE, GAP = np.arange(401.0)[::-1], np.where(np.arange(401) == 7, np.nan, 1.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (changed(theta_deg=None), "has no column theta_rad or theta_deg (measured angle from the table"),
        (
            changed(wrench_Fv_N=None),
            "has no column wrench_Fv_N, which belongs to wrench_Fu_N, wrench_Fv_N, wrench_M_N_m",
        ),
        (changed(wrench_Fu_N=None, wrench_Fv_N=None, wrench_M_N_m=None), "or wrench_Fx_N, wrench_Fy_N, wrench_Fz_N"),
        (changed(theta_deg=GAP), "row 8 of theta_deg is nan; must be a finite number"),
        (changed(wrench_M_N_m=GAP), "row 8 of wrench_M_N_m is nan; must be a finite number"),
        (changed(time_s=["soon"] * 401), "row 1 of time_s is 'soon'; must be a number"),
        (changed(time_s=LATE), "must be at least three times that rise"),
        (changed(contact=["glued"] * 401), "row 1 of contact is 'glued'; must be one of sticks, slides, open, other"),
        (changed(contact=["open"] * 401), "must be at least 16 steps on end in which the contact sticks"),
    ],
)
def test_a_bad_table_is_one_clear_error(
    change: Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]], message: str, tmp_path: Path, said: Said
) -> None:
    run = planar_run()
    refused(said(str(write(tmp_path / "log.csv", change(columns(run)))), *options(run)), message)


def refused(told: tuple[int, str, str], message: str) -> None:
    code, out, err = told
    assert (code, out) == (2, "")
    assert len(err.strip().splitlines()) == 1
    assert message in err, err


def test_a_bad_file_or_option_is_one_clear_error(tmp_path: Path, said: Said) -> None:
    run = planar_run()
    own, good = options(run), str(write(tmp_path / "log.csv", columns(run)))
    (tmp_path / "text.parquet").write_text("no")
    (tmp_path / "text.nc").write_text("no")
    (tmp_path / "bytes.csv").write_bytes(b"\xff\xfe\x00a,b\n")
    (tmp_path / "ragged.csv").write_text("time_s,theta_rad\n0,1\n1\n")
    (tmp_path / "twice.csv").write_text("a,a\n0,1\n")
    (tmp_path / "empty.csv").write_text("")
    for name, message in (
        ("gone.csv", "No such file"),
        ("gone.nc", "No such file"),
        ("gone.txt", "must end in .csv, .parquet or .nc"),
        ("text.parquet", "is no Parquet file"),
        ("text.nc", "text.scenario.json"),
        ("bytes.csv", "is no CSV file"),
        ("ragged.csv", "row 2 has 1 values"),
        ("twice.csv", "has two columns 'a'"),
        ("empty.csv", "has 0 rows; must have at least 3"),
    ):
        refused(said(str(tmp_path / name), *([] if name.endswith(".nc") else own)), message)
    for words, message in (
        (own[2:], "Missing option --lever, of a table of your own."),
        ([*own, "--mass", "1"], "must be LO:HI"),
        ([*own, "--mass", "2:1"], "LO <= HI"),
        ([*own, "--mass", "0:1"], "must be an interval (low, high) of numbers > 0"),
        ([*own, "--com", "0.1:0.2"], "with 0 in it"),
        ([*own, "--lever", "1,2,3"], "must be two numbers, along u and v"),
        ([*own, "--inertia", "1,2"], "must be one number in the plane"),
        ([*own, "--edge", "0,1,0"], "must be left out in the plane"),
        ([*own, "--omega-error", "0.1"], "has no column omega_rad_s"),
        ([*own, "--theta-error", "-1"], "is not in the range x>=0"),
    ):
        refused(said(good, *words), message)
    refused(said(), "Missing argument 'FILE'")


def test_help_names_the_columns(said: Said) -> None:
    code, out, _ = said("--help")
    assert code == 0
    for words in ("wrench_Fu_N, wrench_Fv_N", "qw, qx, qy, qz", "[needed]", "of its last row"):
        assert words in " ".join(out.split())


def test_a_saved_run(tmp_path: Path, said: Said) -> None:
    """Of a world that is heavier than is believed; what the run knows itself must not be given."""
    run = simulate("pivot-2d", reference="arc", world={"mass": 1.15}, seconds=1.0)
    run.save(tmp_path)
    done = pivoting("identify", str(tmp_path / "run.nc"), "--json")
    assert done.returncode == 0, done.stderr
    told = {each["name"]: each for each in json.loads(done.stdout)["parameters"]}
    assert told["mass"]["before"] == pytest.approx([0.8, 1.2])
    low, high = told["mass"]["after"]
    assert 1.1 < low <= 1.15 <= high
    refused(said(str(tmp_path / "run.nc"), "--lever", "1,1"), "--lever: must be left out")
    refused(said(str(tmp_path / "run.nc"), "--world", "3"), "world = 3: must be 0 to 0")


def test_a_table_of_a_run_is_a_table(tmp_path: Path, said: Said) -> None:
    """What a run's `to_dataframe` has under the same names is read as it is."""
    run = simulate("pivot-2d", reference="arc", seconds=1.0)
    frame = run.to_dataframe()
    frame.to_csv(tmp_path / "log.csv", index=False)
    belief = run.attached.controller.belief
    pivot = -belief.contacts.pivot[[0, 2]]
    words = ["--lever", ",".join(map(str, pivot)), "--inertia", str(belief.object.inertia[1, 1])]
    words += ["--mass", "0.8:1.2", "--com", "-0.05:0.05", "--gravity", "10"]
    code, out, err = said(str(tmp_path / "log.csv"), *words)
    assert code == 0, err
    assert "motion" in out
