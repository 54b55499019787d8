"""The rotational state of an object: orientation, angular velocity and angular acceleration."""

from typing import NamedTuple

from numpy.typing import ArrayLike


class Motion(NamedTuple):
    """An orientation with its angular velocity and acceleration: a measured state, or a reference at one time.

    In the plane these are the angle theta [rad], its rate [rad/s] and its acceleration [rad/s^2], as floats. In space
    they are a unit quaternion (w, x, y, z) from object to world, and an angular velocity and acceleration (3,) in world
    axes.
    """

    orientation: float | ArrayLike
    velocity: float | ArrayLike = 0.0
    acceleration: float | ArrayLike = 0.0
