"""Rotations: quaternions (w, x, y, z), matrices, the exponential and the logarithm (Sola et al. 2018).

Functions that kernels call work with scalars and loops, not with arrays.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pivoting.controller.kernels.compilation import kernel, subroutine
from pivoting.controller.validate import Array

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])  # a unit quaternion's inverse, component by component
_SMALL = 1e-4  # [rad]: below, the series is more accurate than the quotient


@subroutine
def cross(a0, a1, a2, b0, b1, b2):  # type: ignore[no-untyped-def]
    """The cross product a x b, as three scalars."""
    return a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0


@subroutine
def turned(w, x, y, z, a, b, c):  # type: ignore[no-untyped-def]
    """The vector (a, b, c) turned by a quaternion, which need not be exactly of unit length, as three scalars."""
    s = 2.0 / (w * w + x * x + y * y + z * z)
    t, u, v = cross(x, y, z, a, b, c)
    d, e, f = cross(x, y, z, t, u, v)
    return a + s * (w * t + d), b + s * (w * u + e), c + s * (w * v + f)


@subroutine
def into(R, a0, a1, a2):  # type: ignore[no-untyped-def]
    """R^T a, a world vector turned into object axes, as three scalars."""
    return (
        R[0, 0] * a0 + R[1, 0] * a1 + R[2, 0] * a2,
        R[0, 1] * a0 + R[1, 1] * a1 + R[2, 1] * a2,
        R[0, 2] * a0 + R[1, 2] * a1 + R[2, 2] * a2,
    )


@subroutine
def fill_product(p, q, out):  # type: ignore[no-untyped-def]
    """Write the Hamilton product of quaternions (4,) (w, x, y, z) into out, which may be one of them."""
    w = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3]
    x = p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2]
    y = p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1]
    z = p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0]
    out[0], out[1], out[2], out[3] = w, x, y, z


def components(vectors: ArrayLike) -> list[Any]:
    """The components of vectors (..., n): n arrays (...); or, of one vector, n floats, with which Python is faster."""
    array = np.asarray(vectors, dtype=float)
    return array.tolist() if array.ndim == 1 else [array[..., i] for i in range(array.shape[-1])]


def stacked(values: list[Any]) -> Array:
    """The vectors (..., n) with these n components (...)."""
    return np.array(values) if isinstance(values[0], float) else np.stack(values, axis=-1)


def quaternion_product(p: ArrayLike, q: ArrayLike) -> Array:
    """The Hamilton product of quaternions (..., 4), ordered (w, x, y, z); shapes broadcast."""
    out: list[Any] = [0.0] * 4
    fill_product(components(p), components(q), out)
    return stacked(out)


def angle_between(p: ArrayLike, q: ArrayLike) -> Array:
    """(...,) angle of the rotation between orientations (..., 4), from 0 to pi [rad]; shapes broadcast."""
    turned = quaternion_product(p, np.asarray(q) * CONJUGATE)
    return np.asarray(2.0 * np.arctan2(np.linalg.norm(turned[..., 1:], axis=-1), np.abs(turned[..., 0])))


@kernel
def fill_rotation(q, out):  # type: ignore[no-untyped-def]
    """Write the rotation matrix (3, 3) of quaternion q (4,) into out; q need not be exactly of unit length."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    s = 2.0 / (w * w + x * x + y * y + z * z)
    out[0, 0] = 1.0 - s * (y * y + z * z)
    out[0, 1] = s * (x * y - w * z)
    out[0, 2] = s * (x * z + w * y)
    out[1, 0] = s * (x * y + w * z)
    out[1, 1] = 1.0 - s * (x * x + z * z)
    out[1, 2] = s * (y * z - w * x)
    out[2, 0] = s * (x * z - w * y)
    out[2, 1] = s * (y * z + w * x)
    out[2, 2] = 1.0 - s * (x * x + y * y)


def rotation_matrix(quaternion: Array) -> Array:
    """The rotation matrix (3, 3) of one quaternion (4,)."""
    out = np.empty((3, 3))
    fill_rotation(np.ascontiguousarray(quaternion, dtype=float), out)
    return out


@kernel
def rotation_error(q, q_d):  # type: ignore[no-untyped-def]
    """Rotation vector [rad], in object axes, that turns orientation q into q_d; its length is at most pi."""
    # q^-1 q_d, in the object's axes
    w = q[0] * q_d[0] + q[1] * q_d[1] + q[2] * q_d[2] + q[3] * q_d[3]
    x = q[0] * q_d[1] - q[1] * q_d[0] - q[2] * q_d[3] + q[3] * q_d[2]
    y = q[0] * q_d[2] + q[1] * q_d[3] - q[2] * q_d[0] - q[3] * q_d[1]
    z = q[0] * q_d[3] - q[1] * q_d[2] + q[2] * q_d[1] - q[3] * q_d[0]
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = np.sqrt(x * x + y * y + z * z)
    scale = 2.0 / w if sine < 1e-9 else 2.0 * np.arctan2(sine, w) / sine
    return scale * x, scale * y, scale * z


@subroutine
def turn(orientation, vector, out):  # type: ignore[no-untyped-def]
    """Write the unit quaternion (4,) turned by a rotation vector (3,) [rad] in the object's own axes."""
    angle = np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    scale = 0.5 if angle < 1e-9 else np.sin(0.5 * angle) / angle
    by = np.cos(0.5 * angle), scale * vector[0], scale * vector[1], scale * vector[2]
    fill_product(orientation, by, out)
    length = np.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2 + out[3] ** 2)
    for i in range(4):
        out[i] /= length


def rotated(orientation: ArrayLike, point: ArrayLike) -> Array:
    """Points (..., 3) turned by unit quaternions (..., 4); shapes broadcast."""
    return stacked(list(turned(*components(orientation), *components(point))))


def exponential(vector: Array) -> Array:
    """The unit quaternions (..., 4) of rotation vectors (..., 3) [rad]."""
    angle = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.concatenate([np.cos(0.5 * angle), 0.5 * np.sinc(angle / (2.0 * np.pi)) * vector], axis=-1)


def rotation_vector(quaternion: Array) -> Array:
    """The rotation vectors (..., 3) [rad] of unit quaternions (..., 4), the shorter way round."""
    shorter = quaternion * np.where(quaternion[..., :1] < 0.0, -1.0, 1.0)
    sine = np.linalg.norm(shorter[..., 1:], axis=-1, keepdims=True)
    scale = 2.0 * np.arctan2(sine, shorter[..., :1]) / np.where(sine > 0.0, sine, 1.0)
    return np.asarray(scale * shorter[..., 1:])


@kernel
def fill_differences(orientation, out):  # type: ignore[no-untyped-def]
    """Write the rotation vectors (N, 3) [rad], in object axes, from each of (N+1, 4) orientations to the next."""
    for i in range(out.shape[0]):
        out[i, 0], out[i, 1], out[i, 2] = rotation_error(orientation[i], orientation[i + 1])


@subroutine
def fill_hat(x, y, z, out):  # type: ignore[no-untyped-def]
    """Write the matrix (3, 3) of a cross product: out u = (x, y, z) x u."""
    out[0, 0] = out[1, 1] = out[2, 2] = 0.0
    out[0, 1], out[0, 2], out[1, 2] = -z, y, -x
    out[1, 0], out[2, 0], out[2, 1] = z, -y, x


@subroutine
def add_product(scale, A, B, out, row, column):  # type: ignore[no-untyped-def]
    """Add scale A B (3, 3) to the block of out that begins at this row and column."""
    for i in range(3):
        for j in range(3):
            out[row + i, column + j] += scale * (A[i, 0] * B[0, j] + A[i, 1] * B[1, j] + A[i, 2] * B[2, j])


@subroutine
def fill_difference_jacobians(v, end, start):  # type: ignore[no-untyped-def]
    """Derivatives (3, 3) of v = rotation_error(q, q_d) by small turns of q_d (`end`) and of q (`start`), object axes.

    The inverse of SO(3)'s right Jacobian at v, and minus that of the left.
    """
    x, y, z = v[0], v[1], v[2]
    angle = np.sqrt(x * x + y * y + z * z)
    k = 1.0 / 12.0 if angle < _SMALL else (1.0 - 0.5 * angle / np.tan(0.5 * angle)) / (angle * angle)
    fill_hat(0.5 * x, 0.5 * y, 0.5 * z, end)
    for i in range(3):
        for j in range(3):
            even = k * v[i] * v[j] + (1.0 - k * angle * angle if i == j else 0.0)  # 1 + k v^ v^
            start[i, j] = end[i, j] - even
            end[i, j] += even
