"""Measurement noise: the measured orientation is off by a random rotation, drawn anew for each world and step."""

import numpy as np
from pivoting.controller.rotations import exponential, quaternion_product
from pivoting.sim.pipeline.random_draws import Draws
from pivoting.sim.pipeline.stages import ORIENTATION, Setting, States


class MeasurementNoise:
    """White noise, uniform in its rotation vector. The other values of the state are measured as they are.

    Args:
        amplitude: greatest angle about each axis that the object can turn about [deg].
    """

    slot = "sense"

    def __init__(self, amplitude: float, setting: Setting):
        self._amplitude = np.deg2rad(amplitude)
        self._draws = Draws(setting.seed, "measured orientation", setting.worlds, setting.first_world)
        self._axes = setting.axes

    def __call__(self, k: int, states: States) -> States:
        """The states with orientations as measured at step k."""
        turned = self._amplitude * self._draws.uniform(k, len(self._axes)) @ self._axes
        values = states.values.copy()
        values[:, ORIENTATION] = quaternion_product(exponential(turned), states.orientation)
        return states.changed(values)
