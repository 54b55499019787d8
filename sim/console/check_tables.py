"""What people read of a check: yes or no, where it is tightest, and how much of the bounds is used."""

from collections.abc import Callable

import numpy as np
from pivoting.controller.uncertainty.feasible_scale import FeasibleScale
from pivoting.sim.reference_check import CheckedMoment, ReferenceCheck, sizes
from rich.console import Console

_ENDS = {
    "bounds": "beyond it no wrench within the bounds holds all worlds",
    "worlds": "beyond it there are no worlds: a mass, an inertia or friction would not be positive",
    "nothing": "however little is known, a wrench holds all worlds",
    "nominal": "not even the world in the middle of the set can be held",
}


def print_check(console: Console, found: ReferenceCheck) -> None:
    """A check in a few lines."""

    def line(text: str, style: str = "") -> None:
        console.print(text, style=style or None, highlight=False, markup=False, soft_wrap=True)

    line(found.scenario.label, "bold")
    worlds = "all worlds of the set" if found.scale is not None else "the one world that the controller believes in"
    span = f"{len(found.moments)} moments from {found.moments[0].time:g} to {found.moments[-1].time:g} s"
    line(f"{span}, {worlds}{' (weak stability)' * (found.stability == 'weak')}")
    if found.left_out:
        line(f"{found.left_out} moments are not checked: {found.why}", "yellow")
    if found.bounds.rated:
        line("bounds on rates are not checked", "yellow")
    _print_answer(line, found)
    if found.bounded:
        line(f"least margin: {_signed(found.tightest.margin)} N {_where(found.tightest)}")
        if found.scale is not None:
            line(_scaled(found.scale, found.scale_at))
    for part, unit in (("force", "N"), ("moment", "N m")):
        largest = found.largest(part)
        if largest is not None:
            line(f"largest {part} of the smallest wrench: {sizes(largest)[part]:.4g} {unit} {_where(largest)}")
    if found.bounded and found.fullest is not None:
        line(f"of a bound at most {100.0 * found.fullest.share:.3g} % is used, {_where(found.fullest)}")


def _print_answer(line: Callable[..., None], found: ReferenceCheck) -> None:
    """Yes, no or undecided."""
    if not found.bounded:
        line("yes: without force_max or moment_max a wrench that is large enough always exists", "green")
        return
    if found.first is None:
        line("yes: at each of them there is a wrench within the bounds", "green")
        return
    wrong = sum(moment.answer == found.answer for moment in found.moments)
    told = f"{found.answer}: first {_where(found.first)}, and at {wrong} moments in all"
    line(told, "bold red" if found.answer == "no" else "bold yellow")
    proof = found.first.certificate
    if proof is None:
        line("there, rounding decides: arithmetic accepts neither a wrench nor a proof that there is none", "yellow")
        return
    limit = "" if np.isinf(proof.limit) else f"; normal forces up to {proof.limit:.4g} N were considered"
    line(f"proof: y'b + R |A'y| = {-proof.gap:.3g} < 0 with |x| <= R = {proof.radius:.4g}{limit}")


def _scaled(scale: FeasibleScale, at: CheckedMoment | None) -> str:
    told = f"the set may be {scale.scale:.4g} times as wide" if np.isfinite(scale.scale) else "the set may be any width"
    where = "" if at is None else f" {_where(at)}"
    return f"{told}{where}: {_ENDS[scale.ends]}"


def _where(moment: CheckedMoment) -> str:
    return f"at {moment.time:.4g} s, {np.rad2deg(moment.theta):.4g} deg"


def _signed(value: float) -> str:
    return f"{value:.3g}" if np.isfinite(value) else "unknown"
