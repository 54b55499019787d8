"""What hostile input once brought down: each such value is refused by the name of its argument, or is no fault."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from pivoting.controller import Body, Contact, Law, Motion, WrenchController, WrenchProblem, solve
from pivoting.controller.uncertainty.uncertainty import Uncertainty
from pivoting.controller.validate import InputError, dimensions, for_each, number, one_of
from pivoting.models.errors import ModelError
from pivoting.sim import own_object, simulate
from pivoting.sim.console.command_line import cli
from pivoting.sim.identification.log_table import LogTable
from pivoting.sim.identification.logged_motion import table_log
from pivoting.sim.sweeping.part_files import PartFiles, rows_in

from tests.own_files import mjcf

HUGE = 10**400


@pytest.mark.parametrize("value", [HUGE, -HUGE, float("nan"), True, "1"])
def test_no_such_number(value: Any) -> None:
    with pytest.raises(InputError, match=r"^mass = "):
        number("mass", value, above=0.0)


def test_whole_numbers_that_no_integer_of_numpy_holds_are_numbers() -> None:
    assert number("mass", 10**30, above=0.0) == 1e30


@pytest.mark.parametrize("value", [np.zeros((3, 3)), [], {}, None, 3])
def test_no_such_word(value: Any) -> None:
    with pytest.raises(InputError, match=r"^about = .*: must be one of com, contact$"):
        one_of("about", value, ("com", "contact"))


def test_what_is_ragged_has_no_dimensions() -> None:
    assert [dimensions(each) for each in (1.0, [1.0], [[1.0]], [1.0, [2.0]])] == [0, 1, 2, -1]
    assert for_each("mu", 0.5, 2).tolist() == [0.5, 0.5]
    for wrong in ([1.0, [2.0]], [1.0], None, "a", HUGE):
        with pytest.raises(InputError, match=r"^mu = "):
            for_each("mu", wrong, 2)


def test_a_name_that_is_not_printable_stays_in_one_line() -> None:
    with pytest.raises(InputError) as caught:
        number("a\x1eb", "x")  # type: ignore[arg-type]
    assert len(str(caught.value).splitlines()) == 1


def controller(**known: Any) -> WrenchController:
    corner = Contact((-0.05, -0.05, -0.05), 0.5)
    return WrenchController(Body(1.0, np.eye(3)), [corner], Law.static(), (0.0, 0.0, -9.81), **known)


RAGGED = [1.0, [2.0]]
LEVEL = (1.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda: WrenchProblem(np.eye(3, 2), np.ones(3), RAGGED), "mu"),
        (lambda: WrenchProblem(np.eye(3, 2), np.ones(3), 0.5, f_min=RAGGED), "f_min"),
        (lambda: WrenchProblem(np.eye(3, 2), np.ones(3), 0.5, margin=HUGE), "margin"),
        (lambda: solve(WrenchProblem(np.eye(3, 2), np.ones(3), 0.5), 3), "method"),  # type: ignore[arg-type]
        (lambda: Law.dynamic(1e300), "bandwidth"),
        (lambda: Law.quasi_dynamic(1e-300), "h"),
        (lambda: Body(1.0, RAGGED), "inertia"),
        (lambda: Uncertainty(com=RAGGED, dim=2), "com"),
        (lambda: Uncertainty(mass=RAGGED, dim=2), "mass"),
        (lambda: Uncertainty(dim=np.zeros((3, 3))), "dim"),  # type: ignore[arg-type]
        (lambda: Uncertainty(com=np.zeros((3, 2)), dim=[]), "dim"),  # type: ignore[arg-type]
        (lambda: controller().problem(Motion(LEVEL, np.ones(4))), "velocity"),
        (lambda: controller().problem(Motion(LEVEL), Motion(LEVEL, 0.0, "a")), "acceleration"),
    ],
)  # fmt: skip
def test_an_argument_that_cannot_be_is_named(call: Any, named: str) -> None:
    with pytest.raises(InputError, match=f"^{named} = "):
        call()


def test_bodies_and_contacts_that_cannot_be(tmp_path: Path) -> None:
    (tmp_path / "own.xml").write_text(mjcf())
    with pytest.raises(ModelError, match=r"^body = \{\}: must be one of 'box'"):
        simulate(own_object(tmp_path / "own.xml", {}, "edge"))  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"^contact = \[\[0.05, 0.04, -0.06\], \[0.06\]\]: must be points of three"):
        simulate(own_object(tmp_path / "own.xml", "box", [[0.05, 0.04, -0.06], [0.06]]))


def test_a_setting_that_is_not_printable_is_refused() -> None:
    done = CliRunner().invoke(cli, ["run", "pivot-2d", "--set", "a\x1e=1", "--set", "a\x1e=1"])
    assert done.exit_code == 2
    assert "must be KEY=VALUE" in done.output


def test_a_log_without_times_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text("ti\x0bme_s,theta_deg,wrench_Fu_N,wrench_Fv_N,wrench_M_N_m\n" + "0,10,1,2,0.1\n" * 4)
    with pytest.raises(InputError, match="has no column time_s"):
        table_log(LogTable(file), np.array([0.05, 0.06]), 9.81)


def test_files_of_a_sweep_that_are_not_whole_are_named(tmp_path: Path) -> None:
    out, plan = tmp_path / "s.parquet", {"scenario": "{}", "worlds": 2}
    rows = {"world": np.arange(1), "passed": np.ones(1, bool)}
    parts = PartFiles(out, plan, False)
    for chunk in range(2):
        parts.write(chunk, rows)
    part = tmp_path / ".s.parquet.parts" / "part-000001.parquet"
    kept = part.read_bytes()
    part.write_bytes(kept[:-8])
    for call in (parts.failed, parts.join):
        with pytest.raises(InputError, match=r"part-000001.parquet: must be a chunk of a sweep, whole: remove it"):
            call(2)
    parts.write(1, {"world": np.arange(1)})
    with pytest.raises(InputError, match="its columns are others"):
        parts.join(2)
    assert not out.exists()
    parts.write(1, rows)
    for broken in ("{", json.dumps([1]), "\x00"):
        (part.parent / "plan.json").write_text(broken)
        with pytest.raises(InputError, match=r"plan.json: must be the plan of a sweep, whole"):
            PartFiles(out, plan, True)
    parts.join(2)
    out.write_bytes(out.read_bytes()[:-8])
    with pytest.raises(InputError, match="must be the file of a sweep, whole"):
        rows_in(out)
