"""Assertions on a run for anyone's tests: that the contact stuck, and that the reference was followed."""

from collections.abc import Callable, Mapping

import numpy as np
from pivoting.sim.judging.verdict import judge
from pivoting.sim.run import Run

TRACKING = ("angle_error_rms_deg", "angle_error_max_deg")  # checks of the angle; the others are of contact and force


def assert_sticking(
    run: Run,
    *,
    slip_m: float | None = None,
    contact_lost_s: float | None = None,
    undeclared_contact_s: float | None = None,
    penetration_rel: float | None = None,
    friction_use: float | None = None,
    force_mismatch_rel: float | None = None,
    bounce_m: float | None = None,
) -> None:
    """Fail unless the contact stuck in every world, nothing else touched, and the force was as predicted.

    Args:
        run: of `simulate`.
        slip_m, ...: limits in place of the scenario's own, see `Limits`.

    Raises:
        AssertionError: it names the check, the worst world, its value, the limit, and the slip that is the simulator's
            own.
        ValueError: a limit is not a number >= 0.
    """
    given = {
        "slip_m": slip_m,
        "contact_lost_s": contact_lost_s,
        "undeclared_contact_s": undeclared_contact_s,
        "penetration_rel": penetration_rel,
        "friction_use": friction_use,
        "force_mismatch_rel": force_mismatch_rel,
        "bounce_m": bounce_m,
    }
    floor = float(np.max(run.measures.slip_floor_m))
    _assert_below(
        run,
        given,
        lambda name: name not in (*TRACKING, "unsolved_steps"),
        f" (the simulator itself: slip_floor_m = {floor:.3g})",
    )


def assert_tracking(run: Run, *, rms_deg: float | None = None, max_deg: float | None = None) -> None:
    """Fail unless theta follows the reference in every world.

    Args:
        run: of `simulate`.
        rms_deg, max_deg: limits [deg] in place of the scenario's own.

    Raises:
        AssertionError: it names the check, the worst world, its value and the limit.
        ValueError: a limit is not a number >= 0.
    """
    _assert_below(run, {"angle_rms_deg": rms_deg, "angle_max_deg": max_deg}, TRACKING.__contains__, "")


def _assert_below(run: Run, given: Mapping[str, float | None], asked: Callable[[str], bool], context: str) -> None:
    """Of the checks whose name is asked for, within the limits that are given or else the run's own."""
    limits = run.limits.change({name: value for name, value in given.items() if value is not None})
    wrong = []
    for check in judge(run.measures, limits, run.certified):
        if asked(check.name) and not check.passed:
            values = np.atleast_1d(getattr(run.measures, check.name))
            world = int(np.argmax(np.where(np.isfinite(values), values, np.inf)))
            wrong.append(f"{check.name} = {values[world]:.4g} > {check.limit:.4g} in world {world}")
    if wrong:
        raise AssertionError(f"{run.scenario.name}: " + "; ".join(wrong) + context)
