"""Quantisation of the wrench: the actuator makes multiples of a least force and of a least moment."""

import numpy as np
from numpy.typing import NDArray
from pivoting.sim.pipeline.stages import Setting

Array = NDArray[np.float64]


class WrenchResolution:
    """Each component of the wrench, in object axes, is rounded to a multiple of a step; see the keys."""

    slot = "actuate"

    def __init__(self, value: float, setting: Setting):
        case, dim = setting.case, setting.controllers[0].space.dim
        force = float(case.force_resolution) / setting.unit
        moment = float(case.moment_resolution) / setting.unit**2
        self._step = np.array([force] * dim + [moment] * (2 * dim - 3))
        self._per = np.where(self._step > 0.0, self._step, 1.0)

    def __call__(self, k: int, wrench: Array) -> Array:
        """The wrenches that act."""
        return np.where(self._step > 0.0, self._step * np.round(wrench / self._per), wrench)
