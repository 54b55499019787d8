"""What measured contact forces say of the friction coefficient: friction that was used without a slip, and a slip."""

from typing import NamedTuple

import numpy as np
from pivoting.controller.learning.motion_log import SLIDES, STICKS, MotionLog
from pivoting.controller.uncertainty.uncertainty import Interval
from pivoting.controller.validate import Array


class FrictionBounds(NamedTuple):
    """Bounds on the friction coefficient; 0 and infinity where nothing bounds it.

    Attributes:
        used: the greatest |f_t| / f_n without a slip, at least: the coefficient is no smaller.
        slipped: the least |f_t| / f_n in a slip, at most: the coefficient is no greater.
    """

    used: float
    slipped: float

    def within(self, prior: Interval) -> Interval | None:
        """What they leave of an interval; None: nothing, which proves that a bound is wrong."""
        low, high = max(prior.low, self.used), min(prior.high, self.slipped)
        return None if low > high else Interval(low, high)


def friction_bounds(log: MotionLog, normal: Array, error: float, *, several: bool = False) -> FrictionBounds:
    """What the contact forces of a log say by Coulomb's law.

    Args:
        normal: (3,) of the contact, into the object, world axes.
        error: of a measured contact force in any direction [N].
        several: whether the force is the sum over several contacts. Then it bounds the coefficient from below all the
            same, but a slip says nothing: they may slip in different directions.
    """
    along = log.contact_force @ normal
    across = np.linalg.norm(log.contact_force - along[:, None] * normal, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        least = np.maximum(across - error, 0.0) / (along + error)
        most = np.where(along > error, (across + error) / (along - error), np.inf)
    stuck = least[(log.contact == STICKS) & np.isfinite(least) & (along > error)]
    slid = most[(log.contact == SLIDES) & np.isfinite(most)]
    return FrictionBounds(float(stuck.max(initial=0.0)), np.inf if several else float(slid.min(initial=np.inf)))
