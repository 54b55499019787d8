"""Rates as differences of measured poses, filtered; without a model, to compare with."""

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.rotations import CONJUGATE, quaternion_product, rotation_vector
from pivoting.sim.pipeline.stages import ANGULAR_VELOCITY, ORIENTATION, POSITION, VELOCITY, Setting, States

Array = NDArray[np.float64]


class Differentiator:
    """Poses as they are measured, and rates by a filter of first order of their differences.

    Args:
        bandwidth: of the filter [rad/s].
    """

    slot = "observe"

    def __init__(self, bandwidth: float, setting: Setting):
        self._bandwidth, self._dt = bandwidth, setting.dt
        self._values: Array = np.zeros(0)
        self._age: NDArray[np.int64] = np.zeros(0, np.int64)

    def __call__(self, k: int, measured: States, applied: Array | None) -> States:
        """The poses of the last measurements with these rates; at rest at first."""
        if k == 0:
            self._values = measured.values[:, :13].copy()
            self._values[:, 7:] = 0.0
            self._age = np.zeros(len(self._values), np.int64)
            return measured.changed(self._values.copy())
        self._age += 1
        new, values, past = measured.fresh[:, None], measured.values, self._values
        seconds = self._dt * self._age[:, None]
        share = np.where(new, -np.expm1(-self._bandwidth * seconds), 0.0)
        now = np.where(new, values[:, :13], past)
        turned = rotation_vector(quaternion_product(now[:, ORIENTATION], past[:, ORIENTATION] * CONJUGATE))
        moved = now[:, POSITION] - past[:, POSITION]
        now[:, VELOCITY] = past[:, VELOCITY] + share * (moved / seconds - past[:, VELOCITY])
        now[:, ANGULAR_VELOCITY] = past[:, ANGULAR_VELOCITY] + share * (turned / seconds - past[:, ANGULAR_VELOCITY])
        self._values, self._age = now, np.where(measured.fresh, 0, self._age)
        return measured.changed(now.copy())
