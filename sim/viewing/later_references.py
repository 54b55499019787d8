"""References that go on from what another one does: the same one later, and one that is redirected to an angle."""

from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import ArrayLike
from pivoting.controller.motion import Motion
from pivoting.controller.references import Constant, MinimumJerk, Reference


@dataclass(frozen=True, eq=False)
class Later:
    """What another reference does from a time on.

    Attributes:
        reference: the other.  by: how much later this one begins [s].
    """

    reference: Reference
    by: float

    @property
    def duration(self) -> float:
        """What remains of the other's [s]."""
        return max(0.0, float(getattr(self.reference, "duration", inf)) - self.by)

    def __call__(self, times: ArrayLike) -> Motion:
        """The other's motion."""
        return self.reference(np.asarray(times, dtype=float) + self.by)


@dataclass(frozen=True, eq=False)
class Redirected:
    """Another reference that is redirected to rest at an angle, however it moves: theta + s (target - theta).

    s goes from 0 to 1 with minimum jerk, so that angle, rate and acceleration are continuous. Where the other rests it
    is the minimum-jerk motion itself; where it is on its way to another angle the new motion is blended into it, much
    as arms do that reach for a target that jumps (Flash and Henis 1991).

    Attributes:
        reference: the other.  target: [rad].  seconds: that it takes [s].
    """

    reference: Reference
    target: float
    seconds: float

    @property
    def duration(self) -> float:
        """Until it rests [s]."""
        return self.seconds

    def __call__(self, times: ArrayLike) -> Motion:
        """The motion at each of `times`."""
        angle, rate, acceleration = (np.asarray(values, dtype=float) for values in self.reference(times))
        s, ds, dds = (np.asarray(values, dtype=float) for values in MinimumJerk((0.0, 1.0), self.seconds)(times))
        away = self.target - angle
        return Motion(
            angle + s * away,
            (1.0 - s) * rate + ds * away,
            (1.0 - s) * acceleration - 2.0 * ds * rate + dds * away,
        )


def from_now(reference: Reference, time: float) -> Reference:
    """A reference from a time [s] on, without what no longer matters of it."""
    if isinstance(reference, Later):
        return from_now(reference.reference, reference.by + time)
    if isinstance(reference, Redirected) and time >= reference.seconds:
        return Constant(reference.target)
    return Later(reference, time)
