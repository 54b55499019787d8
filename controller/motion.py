"""An orientation and how it changes, as it is measured and as it is asked for."""

from typing import NamedTuple

from numpy.typing import ArrayLike


class Motion(NamedTuple):
    """An orientation and how it changes: a measured state or a point of a reference.

    Plane: angle theta [rad], its rate [rad/s] and acceleration [rad/s^2], as floats.
    Space: unit quaternion (w, x, y, z) object to world, angular velocity and acceleration (3,) in world axes.
    """

    orientation: float | ArrayLike
    velocity: float | ArrayLike = 0.0
    acceleration: float | ArrayLike = 0.0
