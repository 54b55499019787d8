"""The verdict and the assertions: explicit limits on what was measured, each of which can fail."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from pivoting.sim import Limits, Run, assert_sticking, assert_tracking
from pivoting.sim.judging.verdict import judge


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


@pytest.mark.parametrize(
    ("limit", "name"),
    [
        ("slip_m", "slip_max_m"),
        ("contact_lost_s", "contact_lost_s"),
        ("undeclared_contact_s", "undeclared_contact_s"),
        ("penetration_rel", "penetration_rel"),
        ("friction_use", "friction_use_max"),
        ("force_mismatch_rel", "force_mismatch_rel"),
    ],
)
def test_every_limit_of_sticking_is_an_argument(shipped: Callable[[str], Run], limit: str, name: str) -> None:
    run = replace(shipped("snap-2d"))
    vars(run)["measures"] = replace(run.measures, **{name: np.array([0.01])})
    assert_sticking(run, **{limit: 0.0101})
    with pytest.raises(AssertionError, match=rf"^snap-2d: {name} = 0.01 > 0.0099 in world 0 \(the simulator itself"):
        assert_sticking(run, **{limit: 0.0099})
    with pytest.raises(ValueError, match=f"limits.{limit} = -1.0"):
        assert_sticking(run, **{limit: -1.0})


def test_limits_of_a_landing(shipped: Callable[[str], Run]) -> None:
    run = shipped("settle-3d")
    bounce = float(run.measures.bounce_m[0])
    assert_sticking(run, bounce_m=1.01 * bounce + 1e-12)
    missing = replace(run)
    vars(missing)["measures"] = replace(run.measures, contacts_missing=np.array([1.0]))
    with pytest.raises(AssertionError, match="contacts_missing = 1 > 0"):
        assert_sticking(missing)


def test_limits_may_be_given_as_a_mapping_or_text() -> None:
    limits = Limits(slip_m=1e-4, settle_s=0.2)
    assert limits.change({"slip_m": "2e-3"}) == Limits(slip_m=2e-3, settle_s=0.2)
    assert limits.change(Limits()) == Limits()
    for wrong, message in (
        ({"slip": 1.0}, "limits.slip = 1.0: must be a known limit: slip_m"),
        ({"slip_m": "x"}, "limits.slip_m = 'x': must be a number"),
        ({"slip_m": -1}, "limits.slip_m = -1.0: must be"),
        (3, "limits = 3: must be Limits, or a mapping"),
    ):
        with pytest.raises(ValueError, match=message):
            limits.change(wrong)  # type: ignore[arg-type]
