"""The units used inside the programs: forces in weights, lengths in levers, so that all numbers are of order one."""

from typing import NamedTuple

import numpy as np
from pivoting.controller.validate import Array


class Units(NamedTuple):
    """The size of one unit of each quantity.

    Attributes:
        force: the weight [N]; without gravity, the force that accelerates the object by 1 m/s^2.
        length: the lever from the CoM to the contacts' mean, or to the farthest contact [m].
        wrench: (nw,) [N, N m].  pose: (nw,) [m, rad].
    """

    force: float
    length: float
    wrench: Array
    pose: Array


def lever(points: Array) -> float:
    """Distance [m] from the CoM to the mean of points (K, d); 0 if it is no more than rounding."""
    reach, farthest = float(np.linalg.norm(points.mean(axis=0))), float(np.linalg.norm(points, axis=1).max())
    return reach if reach > 1e-9 * farthest else 0.0


def units(mass: float, gravity: Array, points: Array, dim: int) -> Units:
    """The units for an object [kg] in `gravity` (3,) [m/s^2] with contacts at `points` (K, 3) from its CoM [m]."""
    force = mass * (float(np.linalg.norm(gravity)) or 1.0)
    length = lever(points) or float(np.linalg.norm(points, axis=1).max()) or 1.0
    turns = 2 * dim - 3
    return Units(
        force, length, force * np.array([1.0] * dim + [length] * turns), np.array([length] * dim + [1.0] * turns)
    )
