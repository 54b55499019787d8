"""The price of a guarantee: how much more the answer costs than if all were as believed."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pivoting.controller.motion import Motion
from pivoting.controller.solvers.solve import solve
from pivoting.controller.uncertainty.uncertainty import Uncertainty
from pivoting.controller.validate import Array, fail
from pivoting.controller.wrench_controller import WrenchController


class Price(NamedTuple):
    """What is paid for a guarantee at one state, over the nominal answer's; inf where that costs nothing.

    Attributes:
        wrench: the size of the wrench, sqrt(w' Q_w w), in which moments count as forces at the lever, unless another
            weight was given. It may be below 1, because contact forces cost as well, and more of them may be asked for.
        objective: 1/2 w' Q_w w + 1/2 f' Q_f f, which is minimised: at least 1, because the set only takes forces away.
    """

    wrench: float
    objective: float


def price(
    controller: WrenchController, state: Motion, desired: Motion | None = None, *, external: ArrayLike | None = None
) -> Price:
    """The answer that is guaranteed for the controller's set, over the nominal one, at one state.

    The nominal answer is that of the same controller without a set: for its body and the friction of its contacts,
    with the same margin and floors.

    Args:
        state, desired, external: as for `WrenchController.problem`.

    Raises:
        ValueError: the controller has no set.
        SolveError: a problem has no answer within tolerance.
    """
    answers = [solve(each.problem(state, desired, external=external)) for each in (controller, nominal(controller))]
    sizes = [float(wrench_size(controller.Q_w, answer.wrench)) for answer in answers]
    return Price(_over(*sizes), _over(*(answer.objective for answer in answers)))


def _over(with_set: float, without: float) -> float:
    return with_set / without if without > 0.0 else float(np.inf)


def nominal(controller: WrenchController) -> WrenchController:
    """The same controller with what it believes as the only member of its set; that is compiled already.

    Raises:
        ValueError: the controller has no set.
    """
    known = controller.uncertainty
    if known is None:
        raise fail("uncertainty", None, "an Uncertainty: without one there is nothing to pay for")
    return WrenchController(
        controller.body, controller.contacts, controller.law, controller.gravity, base=controller.base,
        margin=controller.margin, uncertainty=Uncertainty(about=known.about, dim=known.dim), Q_w=controller.Q_w,
        Q_f=controller.Q_f,
    )  # fmt: skip


def wrench_size(Q_w: Array, wrench: Array) -> Array:
    """sqrt(w' Q_w w) of wrenches (..., nw)."""
    return np.asarray(np.sqrt(np.einsum("...i,ij,...j->...", wrench, Q_w, wrench)))
