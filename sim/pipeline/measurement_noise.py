"""Measurement noise: the measured orientation is off by a random rotation, drawn anew for each world and step."""

import numpy as np
from pivoting.controller.rotations import exponential, quaternion_product
from pivoting.sim.pipeline.stages import ORIENTATION, Setting, States


class MeasurementNoise:
    """White noise in the rotation vector. The other values of the state are measured as they are.

    Args:
        amplitude: greatest angle about each axis that the object can turn about, or its standard deviation where the
            noise is normal [deg].
    """

    slot = "sense"

    def __init__(self, amplitude: float, setting: Setting):
        self._amplitude = np.deg2rad(amplitude)
        draws = setting.draws("measured orientation")
        self._draw = draws.of(setting.case.noise_distribution)
        self._axes = setting.axes

    def __call__(self, k: int, states: States) -> States:
        """The states with orientations as measured at step k."""
        turned = self._amplitude * self._draw(k, len(self._axes)) @ self._axes
        values = states.values.copy()
        values[:, ORIENTATION] = quaternion_product(exponential(turned), states.orientation)
        return states.changed(values)
