"""Rotations as vectors, many at once: exponential, logarithm and the Jacobians that linearise them (Sola et al. 2018)."""

import numpy as np
from pivoting.controller.space import quaternion_product
from pivoting.controller.validate import Array

CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])
_SMALL = 1e-4  # [rad]: below, the series is more accurate than the quotient


def exponential(vector: Array) -> Array:
    """(..., 4) unit quaternions of rotation vectors (..., 3) [rad]."""
    angle = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.concatenate([np.cos(0.5 * angle), 0.5 * np.sinc(angle / (2.0 * np.pi)) * vector], axis=-1)


def difference(start: Array, end: Array) -> Array:
    """(..., 3) rotation vectors [rad], in the axes of the object, that turn orientations `start` into `end` (..., 4)."""
    q = quaternion_product(start * CONJUGATE, end)
    q = q * np.where(q[..., :1] < 0.0, -1.0, 1.0)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    small = sine < 1e-12
    scale = np.where(small, 2.0, 2.0 * np.arctan2(sine, q[..., :1]) / np.where(small, 1.0, sine))
    return scale * q[..., 1:]


def turned(orientation: Array, vector: Array) -> Array:
    """(..., 4) orientations turned by rotation vectors (..., 3) in the axes of the object, of unit length."""
    q = quaternion_product(orientation, exponential(vector))
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def matrices(q: Array) -> Array:
    """(..., 3, 3) rotation matrices of unit quaternions (..., 4)."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def hat(v: Array) -> Array:
    """(..., 3, 3) with hat(v) u = v x u."""
    out = np.zeros((*v.shape, 3))
    x, y, z = np.moveaxis(v, -1, 0)
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -z, y, -x
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = z, -y, x
    return out


def difference_jacobians(vector: Array) -> tuple[Array, Array]:
    """Of d = difference(start, end) (..., 3) by small turns of `end` and of `start`, in object axes: (..., 3, 3) each.

    They are the inverses of SO(3)'s right Jacobian at d, and minus that of the left.
    """
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    small = angle < _SMALL
    safe = np.where(small, 1.0, angle)
    quotient = np.where(small, 1.0 / 12.0, (1.0 - 0.5 * safe / np.tan(0.5 * safe)) / safe**2)
    cross = hat(vector)
    even = np.eye(3) + quotient * (cross @ cross)
    return even + 0.5 * cross, -(even - 0.5 * cross)
