"""`WrenchProblem`: what it refuses, and the standard form of the notes."""

import numpy as np
import pytest
from pivoting.controller import WrenchProblem, wrench_weight
from pivoting.controller.worked_example import EXAMPLES

J = np.array([[1.0, 0.0], [0.0, 1.0], [0.5, -0.5]])
GOOD = {"jacobian": J, "required": [0.0, 10.0, 0.0], "mu": 0.3}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"jacobian": np.full((3, 2), np.nan)}, "jacobian = .*finite"),
        ({"jacobian": np.ones((4, 2))}, "jacobian = .*3 rows"),
        ({"jacobian": np.ones((3, 3))}, "jacobian = .*2 columns"),
        ({"jacobian": "J"}, "jacobian = 'J'.*array"),
        ({"required": [0.0, np.inf, 0.0]}, "required = .*finite"),
        ({"required": [0.0, 1.0]}, r"required = .*shape \(3\)"),
        ({"mu": 0.0}, "mu = 0.0.*> 0"),
        ({"mu": [-0.1]}, "mu = -0.1.*> 0"),
        ({"mu": [0.1, 0.2]}, r"mu = .*shape \(1\)"),
        ({"f_min": -1.0}, "f_min = -1.0.*>= 0"),
        ({"margin": 1.0}, "margin = 1.0.*< 1"),
        ({"margin": -0.1}, "margin = -0.1.*>= 0"),
        ({"Q_w": np.diag([1.0, 1.0, 0.0])}, "Q_w = .*positive definite.*least eigenvalue"),
        ({"Q_w": [[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]}, "Q_w = .*symmetric"),
        ({"Q_f": np.diag([1.0, -1.0])}, "Q_f = .*positive definite"),
        ({"Q_f": np.eye(3)}, r"Q_f = .*shape \(2, 2\)"),
    ],
)
def test_bad_input_is_named(change: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        WrenchProblem(**{**GOOD, **change})


def test_standard_form_is_the_notes() -> None:
    """A, b and C as printed (with erratum 1: x = (f, w)), at the printed optimum: feasible and tight on the edge."""
    form = EXAMPLES[0].problem().standard_form()
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    moment = [0.5 * (c + s), 0.5 * (s - c)]  # r x, with r = -(1, 1) / 2: -r_y R[0] + r_x R[1]
    np.testing.assert_allclose(form.A[:, :2], [[c, s], [-s, c], moment], atol=1e-12)
    np.testing.assert_array_equal(form.A[:, 2:], np.eye(3))
    np.testing.assert_allclose(form.b, [10.0 * c, 10.0 * s, 0.0], atol=1e-12)
    x = np.array([1.39789, 4.65964, 5.11982, 1.66358, -0.10201])
    np.testing.assert_allclose(form.A @ x, form.b, atol=2e-5)
    assert (form.C @ x <= form.d + 2e-5).all()
    assert abs(form.C @ x)[1] < 1e-5
    assert x @ form.P @ x == pytest.approx(52.6568, abs=1e-4)


def test_margin_narrows_the_cone() -> None:
    assert WrenchProblem(**GOOD, margin=0.25).mu_planned == pytest.approx(0.225)


def test_values_are_copied_and_cannot_be_changed() -> None:
    mine = np.array(J)
    problem = WrenchProblem(mine, [0.0, 10.0, 0.0], 0.3)
    mine[0, 0] = 7.0
    assert problem.jacobian[0, 0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        problem.required[0] = 1.0


def test_characteristic_length() -> None:
    np.testing.assert_array_equal(wrench_weight(2, 0.5), np.diag([1.0, 1.0, 4.0]))
    np.testing.assert_array_equal(wrench_weight(3), np.eye(6))
    with pytest.raises(ValueError, match="length = 0"):
        wrench_weight(2, 0.0)
