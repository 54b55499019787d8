"""The verdict and the assertions: explicit limits on what was measured, each of which can fail."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from pivoting.sim import Limits, Run, assert_sticking, assert_tracking
from pivoting.sim.verdict import judge


@pytest.mark.parametrize(
    ("limit", "name"),
    [
        ("slip_m", "slip_max_m"),
        ("angle_rms_deg", "angle_error_rms_deg"),
        ("angle_max_deg", "angle_error_max_deg"),
        ("force_mismatch_rel", "force_mismatch_rel"),
        ("friction_use", "friction_use_max"),
    ],
)
def test_each_limit_can_fail_a_run(shipped: Callable[[str], Run], limit: str, name: str) -> None:
    measures = shipped("pivot-2d").measures
    value = float(getattr(measures, name).max())
    for factor, passed in ((1.01, True), (0.99, False)):
        checks = {check.name: check for check in judge(measures, replace(Limits(), **{limit: factor * value}))}
        assert checks[name].passed is passed


@pytest.mark.parametrize("name", ["contact_lost_s", "unsolved_steps"])
def test_one_step_is_enough(shipped: Callable[[str], Run], name: str) -> None:
    measures = replace(shipped("pivot-2d").measures, **{name: np.array([0.001])})
    assert [check.name for check in judge(measures, shipped("pivot-2d").scenario.limits) if not check.passed] == [name]


def test_not_a_number_fails(shipped: Callable[[str], Run]) -> None:
    measures = replace(shipped("pivot-2d").measures, slip_max_m=np.array([np.nan]))
    assert "slip_max_m" in [check.name for check in judge(measures, Limits()) if not check.passed]


def test_assertions_take_limits_of_ones_own(shipped: Callable[[str], Run]) -> None:
    run = shipped("snap-2d")
    assert_sticking(run)
    assert_tracking(run)
    with pytest.raises(AssertionError, match=r"snap-2d: slip_max_m = .* > 1e-06 in world 0"):
        assert_sticking(run, slip_m=1e-6)
    with pytest.raises(AssertionError, match="angle_error_rms_deg"):
        assert_tracking(run, rms_deg=1e-6)
    with pytest.raises(AssertionError, match="angle_error_max_deg"):
        assert_tracking(run, max_deg=1e-6)
