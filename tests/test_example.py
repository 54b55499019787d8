"""The worked example, and the errata that are checked by numbers."""

import numpy as np
import pytest
from pivoting.controller import solve
from pivoting.controller.worked_example import EXAMPLES, compare, quantities

SHIPPED = ("closed-form", "clarabel", "qp:clarabel", "qp:daqp", "qp:piqp", "qp:quadprog")


@pytest.mark.parametrize("method", SHIPPED)
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.name)
def test_all_digits_agree(example, method: str) -> None:  # type: ignore[no-untyped-def]
    digits, solution = compare(example, method)
    assert solution.status == "solved"
    assert all(digit.agrees for digit in digits), digits


def test_only_tau_is_off_in_its_last_digit() -> None:
    """The exact optimum on the edge, from its own closed form: tau = -0.1020047, which rounds to -0.10200."""
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    u = np.array([0.3 * c + s, -0.3 * s + c])  # R (mu, 1)
    moment = -0.5 * u[1] + 0.5 * u[0]
    load = 10.0 * np.array([c, s])
    scale = u @ load / (u @ u + moment**2 + 1.09)
    assert -moment * scale == pytest.approx(-0.1020047, abs=1e-7)
    every = [digit for example in EXAMPLES for method in SHIPPED for digit in compare(example, method)[0]]
    assert {(digit.example, digit.quantity) for digit in every if not digit.rounds} == {("printed", "tau")}


def test_the_printed_example_is_on_the_edge_of_the_cone() -> None:
    f_t, f_n = solve(EXAMPLES[0].problem()).force[0]
    assert f_t / f_n == pytest.approx(0.3, abs=1e-12)


def test_both_objective_conventions() -> None:
    """Erratum 4: the printed Obj is x'Qx; the program as stated gives half."""
    found = quantities(solve(EXAMPLES[0].problem()))
    assert found["x'Qx"] == pytest.approx(52.6568, abs=1e-4)
    assert found["x'Qx/2"] == pytest.approx(26.3284, abs=1e-4)


def test_a_wrong_digit_is_seen() -> None:
    wrong = type(EXAMPLES[0])("wrong", "", EXAMPLES[0].incline, {"f_t": "1.39787", "f_n": "4.65964"})
    digits, _ = compare(wrong, "closed-form")
    assert [digit.agrees for digit in digits] == [False, True]
