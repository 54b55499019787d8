"""The parameters that a user knows, out of the set of the unknowns; what told each of them, or why nothing could."""

from typing import NamedTuple

import numpy as np
from pivoting.controller.learning.polytope import Polytope
from pivoting.controller.learning.unknowns import Unknowns
from pivoting.controller.uncertainty.uncertainty import Interval
from pivoting.controller.validate import Array

NARROWER = 0.99  # of its width before: what is wider counts as not told
UNSEEN = 1e-6  # of a balance's error: what could change it by no more does not occur in it
_UNKNOWN = {"mass": "m", "inertia": "s"}  # the names of parameters among the unknowns, where they are others
PRODUCT = "a pivot on a contact that sticks tells only m c and I_P"


class Parameter(NamedTuple):
    """What is known of one parameter.

    Attributes:
        name, unit: of it.  before, after: its interval, whose ends may be infinite.
        estimate: by least squares; None: there is none.
        why: what told it, or why nothing could.  told: whether the interval became narrower.
    """

    name: str
    unit: str
    before: Interval
    after: Interval
    estimate: float | None
    why: str
    told: bool


class Seen(NamedTuple):
    """What the balances could see of each unknown.

    Attributes:
        motion, force: (n,) by how much it could change a balance of moments, or of forces, at most, over the error of
            that balance.
    """

    motion: Array
    force: Array


def parameters(
    unknowns: Unknowns, stages: tuple[Polytope, Polytope, Polytope], mean: Array, seen: Seen
) -> tuple[Parameter, ...]:
    """Mass, centre of mass, factor on the inertia, first moment and inertia about the contact, in this order.

    Args:
        stages: the set before, after the balances of moments, and after those of forces.
        mean: (n,) estimate of the unknowns.
    """
    known = {id(stage): _intervals(unknowns, stage) for stage in {id(each): each for each in stages}.values()}
    told = [known[id(stage)] for stage in stages]
    estimates = _estimates(unknowns, mean)
    found = []
    for name, unit in _named(unknowns):
        before, moved, after = (each[name] for each in told)
        why = _why(name, before, moved, after, seen, unknowns)
        found.append(Parameter(name, unit, before, after, estimates[name], *why))
    return tuple(found)


def _named(unknowns: Unknowns) -> list[tuple[str, str]]:
    """Names and units, in the order of a table."""
    moments = unknowns.moments
    coms = [(com_of(name), "m") for name in moments]
    inertias = [(name, "kg m^2") for name in unknowns.names if name.startswith("I_P")]
    return [("mass", "kg"), *coms, ("inertia", ""), *((name, "kg m") for name in moments), *inertias]


def _intervals(unknowns: Unknowns, found: Polytope) -> dict[str, Interval]:
    """By name; of the centre of mass from where it is believed to be."""
    ends = {name: Interval(low, high) for name, low, high in zip(unknowns.names, *_ends(found), strict=True)}
    for name, lever in zip(unknowns.moments, unknowns.lever[unknowns.axes].tolist(), strict=True):
        low, high = found.ratio(unknowns.names.index(name), 0)
        ends[com_of(name)] = Interval(low - lever, high - lever)
    return {**ends, "mass": ends["m"], "inertia": ends["s"]}


def _ends(found: Polytope) -> tuple[list[float], list[float]]:
    return found.low.tolist(), found.high.tolist()


def _estimates(unknowns: Unknowns, mean: Array) -> dict[str, float]:
    """Likewise, of a point."""
    at = dict(zip(unknowns.names, mean.tolist(), strict=True))
    for name, lever in zip(unknowns.moments, unknowns.lever[unknowns.axes].tolist(), strict=True):
        at[com_of(name)] = at[name] / at["m"] - lever
    return {**at, "mass": at["m"], "inertia": at["s"]}


def _why(
    name: str, before: Interval, moved: Interval, after: Interval, seen: Seen, unknowns: Unknowns
) -> tuple[str, bool]:
    """What told it, or why nothing could, and which of the two."""
    by = ["motion"] * narrower(before, moved) + ["contact force"] * narrower(moved, after)
    place = unknowns.names.index(_UNKNOWN.get(name, name.replace("com_", "m c_")))
    visible = max(seen.motion[place], seen.force[place]) > UNSEEN
    direct = visible and name in ("mass", *unknowns.names) and (name != "mass" or by == ["contact force"])
    if by:
        return " and ".join(by) + ("" if direct else f", with what is known of {_others(name)}"), True
    if before.half == 0.0:
        return "it was known", False
    weighed = bool((seen.force > 0.0).any())
    if name == "mass":
        return (
            "the measurement errors hide it" if weighed else f"{PRODUCT}: needs a contact force or a lift-off"
        ), False
    if name == "inertia":
        return f"{PRODUCT}: m |c|^2 is not known well enough to be taken from I_P", False
    if visible:
        return (
            "the measurement errors hide it" if name in unknowns.names else "mass and m c are not known well enough"
        ), False
    if name.startswith("I_P"):
        return "no balance depends on it: the object does not turn about that axis", False
    return "no balance depends on it: about an edge only the components across it do", False


def _others(name: str) -> str:
    """What a parameter that no balance has alone is found with."""
    if name.startswith("com_"):
        return "the mass"
    return "the centre of mass" if name == "mass" else "mass and centre of mass"


def com_of(moment: str) -> str:
    """The name of the centre of mass along the axis of a first moment."""
    return moment.replace("m c_", "com_")


def narrower(before: Interval, after: Interval) -> bool:
    """Whether an interval counts as narrower than before."""
    return bool(after.half < NARROWER * before.half or (np.isinf(before.half) and np.isfinite(after.half)))
