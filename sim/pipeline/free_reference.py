"""Feedback about the axes alone that the contacts leave free: about the others there is only noise to be corrected."""

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.pivot_model import PivotModel
from pivoting.controller.rotations import CONJUGATE, exponential, quaternion_product, rotation_vector
from pivoting.sim.pipeline.stages import Desired, Setting, States, desired_values

Array = NDArray[np.float64]


class FreeReference:
    """The reference turned so that it is off the estimate about the free axes only.

    An error about an axis along which friction holds the object is one of the measurement, or of a slip; what the law
    did against it, the friction would have to take up.
    """

    slot = "correct"

    def __init__(self, value: float, setting: Setting):
        self._model = PivotModel(setting.controllers, setting.dt)
        self._all = self._model.axes.shape[1] == len(setting.axes)

    def __call__(self, states: States, desired: Desired) -> Desired:
        """The reference of each world; where all axes are free, as it is."""
        if self._all:
            return desired
        now = states.orientation
        off = rotation_vector(quaternion_product(desired.orientation, now * CONJUGATE))
        rates = [
            self._model.free(now, np.broadcast_to(values, off.shape))
            for values in (off, desired.angular_velocity, desired.angular_acceleration)
        ]
        return Desired(desired_values(quaternion_product(exponential(rates[0]), now), *rates[1:]))
