"""Rotations as MuJoCo keeps them: quaternions (w, x, y, z) and matrices."""

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def matrix(quaternion: Array) -> Array:
    """(3, 3) rotation matrix of a quaternion (4,)."""
    out = np.empty(9)
    mujoco.mju_quat2Mat(out, np.asarray(quaternion, dtype=float))
    return out.reshape(3, 3)


def quaternion(rotation: Array) -> Array:
    """(4,) quaternion of a rotation matrix (3, 3)."""
    out = np.empty(4)
    mujoco.mju_mat2Quat(out, np.ascontiguousarray(rotation).ravel())
    return out
