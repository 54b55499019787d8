"""What people and programs read of an identification: each parameter's interval before and after, and why."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from pivoting.controller.learning.identification import Identification
from pivoting.controller.learning.motion_log import MeasurementErrors, MotionLog
from pivoting.controller.uncertainty.uncertainty import Interval
from rich.console import Console

CORRELATED = (
    "the intervals are the projections of one set, in which mass and centre of mass hang together by m c, and the "
    "inertia with both by I_P = I + m |c|^2: not all of their ends go together"
)
_UNITS = {"theta": "rad", "omega": "rad/s", "shove": "N s/kg", "rate": "rad/s", "contact_force": "N", "position": "m"}


def described(found: Identification, log: MotionLog, errors: MeasurementErrors) -> dict[str, Any]:
    """What `pivoting identify --json` says, SI units; an interval's end that is not finite is null."""
    learned = found.uncertainty
    return {
        "consistent": found.consistent,
        "resets": found.resets,
        "dim": log.space.dim,
        "steps": log.steps,
        "sticking_steps": int(log.sticking.sum()),
        "seconds": float(log.time[-1] - log.time[0]),
        "cuts": found.cuts,
        "assumed": asdict(errors),
        "parameters": [
            {
                "name": each.name,
                "unit": each.unit,
                "before": list(each.before),
                "after": list(each.after),
                "least_squares": each.estimate,
                "told": each.told,
                "why": each.why,
            }
            for each in found.parameters
        ],
        "correlated": CORRELATED,
        "shift_m": found.shift.tolist(),
        "uncertainty": {
            "mass": None if learned.mass is None else list(learned.mass),
            "com": learned.com.tolist(),
            "inertia": list(learned.inertia),
            "mu": None if learned.mu is None else list(learned.mu),
        },
    }


def print_identification(
    console: Console, file: Path, found: Identification, log: MotionLog, errors: MeasurementErrors
) -> None:
    """The same for people."""
    kind = "plane" if log.space.dim == 2 else "space"
    seconds = float(log.time[-1] - log.time[0])
    head = f"{file}: {log.steps} steps in {seconds:.4g} s in the {kind}, {int(log.sticking.sum())} of them sticking"
    console.print(head, highlight=False, markup=False, soft_wrap=True)
    bounds = ", ".join(_bounded(name, value) for name, value in asdict(errors).items() if value > 0.0)
    console.print(
        f"taken as bounds on errors: {bounds or 'none'}", highlight=False, markup=False, soft_wrap=True, style="dim"
    )
    console.print(
        _line("", "before", "after", "fit", "what told it, or why nothing could"), style="bold", soft_wrap=True
    )
    for each in found.parameters:
        name = each.name + (f", {each.unit}" if each.unit else "")
        estimate = "" if each.estimate is None else f"{each.estimate:.4g}"
        line = _line(name, _shown(each.before), _shown(each.after), estimate, each.why)
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    shift = ", ".join(f"{1e3 * value:.3g}" for value in found.shift)
    told = "com: from where it is believed to be; m c and I_P: about the contact; inertia: a factor; fit: least squares"
    console.print(told, highlight=False, markup=False, soft_wrap=True, style="dim")
    moved = f"for the controller: move the believed centre of mass by ({shift}) mm"
    console.print(moved, highlight=False, markup=False, soft_wrap=True)
    console.print(CORRELATED, highlight=False, markup=False, soft_wrap=True, style="dim")
    if not found.consistent:
        told = f"the log contradicts the prior or the bounds on its errors, {found.resets} times: nothing is guaranteed"
        console.print(told, highlight=False, markup=False, soft_wrap=True, style="bold red")


def _line(name: str, before: str, after: str, estimate: str, why: str) -> str:
    return f"{name:<14}  {before:>20}  {after:>20}  {estimate:>10}  {why}"


def _bounded(name: str, value: float) -> str:
    if name == "wrench":
        return f"wrench {100.0 * value:.3g} %"
    shown = f"{np.rad2deg(value):.3g} deg" if name == "theta" else f"{value:.3g} {_UNITS[name]}"
    return f"{name.replace('_', ' ')} {shown}"


def _shown(interval: Interval) -> str:
    return f"{interval.low:.4g} to {interval.high:.4g}" if np.isfinite(interval.high) else f"{interval.low:.4g} or more"
