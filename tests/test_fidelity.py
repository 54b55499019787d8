"""What the simulator itself does to a sticking contact is predicted, term by term."""

import numpy as np
import pytest
from pivoting.sim import simulate
from pivoting.sim.monitor import predicted_slip


def worst_gap(run) -> tuple[float, float]:  # type: ignore[no-untyped-def]
    """Greatest difference of the measured and the predicted path of the corner, and the greatest slip [m]."""
    return float(np.abs(predicted_slip(run) - run.slip).max()), float(run.measures.slip_max_m[0])


def test_creep_under_a_constant_load() -> None:
    """Soft friction rows (impratio 1) creep a thousand times more, and as predicted within 1 %."""
    for impratio in (1000.0, 1.0):
        gap, slip = worst_gap(simulate("balance-2d", impratio=impratio, seconds=3.0, spread=0.0))
        assert gap < 0.01 * slip
    assert slip > 1e-4


def test_rotation_drift() -> None:
    """At b h < 2 a turning corner drifts; within 5 % of the prediction."""
    gap, slip = worst_gap(simulate("pivot-2d", timeconst=0.003, spread=0.0))
    assert slip > 2e-5
    assert gap < 0.05 * slip


@pytest.mark.parametrize("name", ["pivot-2d", "snap-2d"])
def test_what_is_left_at_the_shipped_settings(name: str) -> None:
    """At b h = 1.9 a twentieth of the rotation is left, and the lever of the penetration; within 10 %."""
    gap, slip = worst_gap(simulate(name, spread=0.0))
    assert gap < 0.10 * slip


def test_a_corner_opens_where_it_is_predicted_to() -> None:
    """c_n (1 - b h / 2) > R_n f_n: a stiff contact (impedance 0.9) opens in the pivot, a soft one does not."""
    assert simulate("pivot-2d", impedance=0.9, timeconst=0.004).measures.contact_lost_s[0] > 0.05
    assert simulate("pivot-2d", impedance=0.5, timeconst=0.004).measures.contact_lost_s[0] == 0.0


def test_default_contact_settings_would_fail() -> None:
    """MuJoCo's defaults (timeconst 0.02, impedance 0.9, impratio 1): the verdict sees it."""
    run = simulate("pivot-2d", timeconst=0.02, impedance=0.9, impratio=1.0)
    assert run.verdict == "fail"
    assert run.measures.slip_max_m[0] > 1e-4
