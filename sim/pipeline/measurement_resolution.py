"""Quantisation of the measured pose, as by an encoder or a camera with pixels."""

import numpy as np
from pivoting.controller.rotations import CONJUGATE, exponential, quaternion_product, rotation_vector
from pivoting.sim.pipeline.stages import ORIENTATION, POSITION, Setting, States


class OrientationResolution:
    """The rotation vector from the table's axes to the object's is rounded, component by component.

    Args:
        step: to a multiple of which it is rounded [deg].
    """

    slot = "sense"

    def __init__(self, step: float, setting: Setting):
        self._step, self._base = np.deg2rad(step), setting.controllers[0].space.base

    def __call__(self, k: int, states: States) -> States:
        """The states with orientations as measured."""
        values = states.values.copy()
        turned = rotation_vector(quaternion_product(self._base * CONJUGATE, states.orientation))
        rounded = exponential(self._step * np.round(turned / self._step))
        values[:, ORIENTATION] = quaternion_product(self._base, rounded)
        return states.changed(values)


class PositionResolution:
    """The position is rounded along each of the world's axes.

    Args:
        step: to a multiple of which it is rounded [m].
    """

    slot = "sense"

    def __init__(self, step: float, setting: Setting):
        self._step = step / setting.unit

    def __call__(self, k: int, states: States) -> States:
        """The states with positions as measured."""
        values = states.values.copy()
        values[:, POSITION] = self._step * np.round(states.position / self._step)
        return states.changed(values)
