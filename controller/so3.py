"""Small turns: what linearises rotations, compiled, and turning by rotation vectors (Sola et al. 2018)."""

import numpy as np
from numpy.typing import ArrayLike
from pivoting.controller.kernel import kernel, subroutine
from pivoting.controller.space import components, fill_product, rotation_error, stacked, turned
from pivoting.controller.validate import Array

_SMALL = 1e-4  # [rad]: below, the series is more accurate than the quotient


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
    """(..., 3) points turned by unit quaternions (..., 4), shapes broadcast."""
    return stacked(list(turned(*components(orientation), *components(point))))


def exponential(vector: Array) -> Array:
    """(..., 4) unit quaternions of rotation vectors (..., 3) [rad]."""
    angle = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.concatenate([np.cos(0.5 * angle), 0.5 * np.sinc(angle / (2.0 * np.pi)) * vector], axis=-1)


@kernel
def fill_differences(orientation, out):  # type: ignore[no-untyped-def]
    """Write the rotation vectors (N, 3) [rad], in object axes, from each of (N+1, 4) orientations to the next."""
    for i in range(out.shape[0]):
        out[i, 0], out[i, 1], out[i, 2] = rotation_error(orientation[i], orientation[i + 1])


@subroutine
def fill_hat(x, y, z, out):  # type: ignore[no-untyped-def]
    """Write the matrix (3, 3) with out u = (x, y, z) x u."""
    out[0, 0] = out[1, 1] = out[2, 2] = 0.0
    out[0, 1], out[0, 2], out[1, 2] = -z, y, -x
    out[1, 0], out[2, 0], out[2, 1] = z, -y, x


@subroutine
def add_product(scale, A, B, out, row, column):  # type: ignore[no-untyped-def]
    """Add scale A B, (3, 3), to the block of out that begins at this row and column."""
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
