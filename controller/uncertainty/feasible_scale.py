"""How much less could be known: the greatest scale of a set for which any wrench within bounds holds every world."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pivoting.controller.motion import Motion
from pivoting.controller.uncertainty.farkas_certificate import FarkasCertificate
from pivoting.controller.uncertainty.feasibility import YES, Feasibility, feasibility
from pivoting.controller.validate import InputError, fail, number
from pivoting.controller.wrench_bounds import WrenchBounds
from pivoting.controller.wrench_controller import WrenchController

ACCURACY = 1e-4  # relative, of the scale that is found
LARGEST, SMALLEST = 1e3, 1e-6  # scales beyond which the set does not matter, or hardly differs from the nominal world


class FeasibleScale(NamedTuple):
    """The greatest scale that was found.

    Attributes:
        scale: up to which a wrench holds; 0: only the nominal world, or not even that one; inf: whatever the set is.
        above: the next one that was tried, at which none does, or it is undecided; `scale` (1 + 1e-4) at most.
        ends: why there is none beyond: "bounds"; "worlds", beyond which a mass, an inertia or friction would not be
            positive; "nothing"; or "nominal", where not even the nominal world can be held.
        certificate: that there is no wrench at `above`, or for the nominal world; None without, or if it is undecided.
    """

    scale: float
    above: float
    ends: str
    certificate: FarkasCertificate | None


def feasible_scale(
    controller: WrenchController,
    state: Motion,
    desired: Motion | None = None,
    *,
    bounds: WrenchBounds,
    external: ArrayLike | None = None,
    at_least: float = 0.0,
) -> FeasibleScale:
    """The greatest scale of the controller's set at which any wrench within bounds gives what the law requires.

    See `Uncertainty.scaled`. It differs from the scale up to which one given wrench holds. Without bounds on the wrench
    it is infinite: a large enough force along the normals is in the cones of all worlds, and a wrench balances it.

    Args:
        state, desired, external: see `WrenchController.problem`.
        bounds: on the wrench; those on rates are not considered.
        at_least: a scale that is known to be feasible, from which the search begins.

    Raises:
        ValueError: the controller has no set, or the world that it believes in is not in the middle of it.
    """
    known = controller.uncertainty
    if known is None:
        raise fail("controller", "one without uncertainty", "one with a set")
    number("at_least", at_least, at_least=0.0)
    still = bounds.without_rates
    if not still.any:
        return FeasibleScale(np.inf, np.inf, "nothing", None)

    def at(scale: float) -> Feasibility | None:
        """Whether it is feasible; None: there are no such worlds."""
        try:
            scaled = replace(controller, uncertainty=known.scaled(scale))
            problem = scaled.problem(state, desired, external=external)
        except InputError:
            if scale == 0.0:
                raise
            return None
        return feasibility(problem, still)

    if at_least == 0.0 and (nominal := at(0.0)) is not None and nominal.answer != YES:
        return FeasibleScale(0.0, 0.0, "nominal", nominal.certificate)
    low, high = at_least, max(1.0, 2.0 * at_least)
    above = at(high)
    while above is not None and above.answer == YES:
        if high > LARGEST:
            return FeasibleScale(np.inf, np.inf, "nothing", None)
        low, high = high, 2.0 * high
        above = at(high)
    while high - low > ACCURACY * low and high > SMALLEST:
        middle = 0.5 * (low + high)
        found = at(middle)
        if found is not None and found.answer == YES:
            low = middle
        else:
            high, above = middle, found
    if above is None:
        return FeasibleScale(low, high, "worlds", None)
    return FeasibleScale(low, high, "bounds", above.certificate)
