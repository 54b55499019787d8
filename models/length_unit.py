"""The unit of a model's lengths, which MJCF leaves to its author: read from the size of gravity."""

import numpy as np
from numpy.typing import ArrayLike

EARTH, NEAR = 9.81, 0.05  # [m/s^2], and the share by which a file may be off it
NAMES = {1.0: "m", 1e-2: "cm", 1e-3: "mm"}
POWERS = {"m": 1, "m/s^2": 1, "N": 1, "N/s": 1, "N m": 2, "N m/s": 2}  # of length in a unit of a key


def length_unit(gravity: ArrayLike) -> float:
    """[m] of a model's unit of length: 0.001 where its gravity (3,) is the earth's in mm, 0.01 in cm, else 1.

    Masses are taken to be in kg and times in s, so that its unit of force is as many N, and of moments its square N m.
    """
    size = float(np.linalg.norm(gravity))
    return next((unit for unit in (1e-3, 1e-2) if abs(size * unit / EARTH - 1.0) <= NEAR), 1.0)
