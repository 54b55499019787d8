"""One description for motion in the plane and in space: everything is in 3-D, and a `Space` selects what is used.

A planar problem is a spatial problem of which only 3 of the 6 wrench components and 2 of the 3 axes of each contact
frame are used; two constant matrices select them. So every formula (Jacobian, law, error) is written only once.
Planar coordinates are (x right, z up), the angle theta counter-clockwise, that is about -y.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from pivoting.controller.kernels.compilation import subroutine
from pivoting.controller.motion import Motion
from pivoting.controller.rotations import CONJUGATE, IDENTITY, quaternion_product, rotation_matrix
from pivoting.controller.validate import Array, array, dimensions, fail, for_each, unit_quaternions


@dataclass(frozen=True, eq=False)
class Space:
    """The plane or space: which components of the 3-D rigid-body quantities a problem uses.

    Attributes:
        dim: 2 (plane) or 3 (space).
        base: (4,) quaternion of the table's frame (tangent, -, normal) in the world; theta = 0 means that the
            object's axes are the table's. Identity on a level table. In space only a `Horizon` uses it.
    """

    dim: int
    base: Array

    @cached_property
    def wrench_map(self) -> Array:
        """(nw, 6) matrix that selects the components used of (force, moment) in 3-D; nw is 3 in the plane, else 6."""
        if self.dim == 3:
            return np.eye(6)
        out = np.zeros((3, 6))
        out[0, 0] = out[1, 2] = 1.0
        out[2, 4] = -1.0
        return out

    @cached_property
    def force_map(self) -> Array:
        """(3, d) matrix of the axes of a contact frame (t, o, n) along which forces act: (t, n) in the plane."""
        return np.eye(3) if self.dim == 3 else np.eye(3)[:, [0, 2]]

    def lift(self, vector: Array) -> Array:
        """The vector (..., 3) of a vector (..., d); a planar (x, z) becomes (x, 0, z)."""
        return vector @ self.force_map.T

    def lift_inertia(self, inertia: ArrayLike) -> Array:
        """The inertia tensor (3, 3) [kg m^2] about the CoM, in object axes; a planar number is the inertia about y."""
        if self.dim == 3:
            return array("inertia", inertia, (3, 3))
        if dimensions(inertia) != 0:
            raise fail("inertia", inertia, "a number in the plane, about the plane's normal [kg m^2]")
        return np.diag([0.0, float(np.asarray(inertia)), 0.0])

    def orientation(self, angle: ArrayLike) -> Array:
        """Quaternions (..., 4), object to world, of planar angles (...)."""
        half = 0.5 * np.asarray(angle, dtype=float)
        zero = np.zeros_like(half)
        return quaternion_product(self.base, np.stack([np.cos(half), zero, -np.sin(half), zero], axis=-1))

    def angle(self, quaternion: Array) -> Array:
        """Planar angles (...) [rad] in (-pi, pi] of quaternions (..., 4) object to world."""
        relative = quaternion_product(self.base * CONJUGATE, quaternion)
        turned = 2.0 * np.arctan2(-relative[..., 2], relative[..., 0])
        return np.arctan2(np.sin(turned), np.cos(turned))

    def axial(self, rate: ArrayLike) -> Array:
        """Vectors (..., 3), world axes, of planar rates (...) about the plane's normal."""
        axis = -rotation_matrix(self.base)[:, 1]
        return np.asarray(rate, dtype=float)[..., None] * axis

    def lift_motion(self, motion: Motion) -> tuple[Array, Array, Array]:
        """The quaternion (4,), angular velocity (3,) and acceleration (3,) of a `Motion` of this space, world axes."""
        if self.dim == 2:
            values = []
            for name, value in zip(Motion._fields, motion, strict=True):
                if dimensions(value) != 0 or np.asarray(value).dtype.kind not in "iuf" or not np.isfinite(value):
                    raise fail(name, value, "a finite number in the plane")
                values.append(float(value))  # type: ignore[arg-type]
            return self.orientation(values[0]), self.axial(values[1]), self.axial(values[2])
        quaternion = unit_quaternions("orientation", motion.orientation, (4,))
        return quaternion, for_each("velocity", motion.velocity, 3), for_each("acceleration", motion.acceleration, 3)


def space(dim: int, base: ArrayLike = IDENTITY) -> Space:
    """The plane (`dim` 2, with the table's frame `base`) or space (`dim` 3)."""
    return Space(dim, unit_quaternions("base", base, (4,)))


def tilt(angle: float) -> Array:
    """The frame (4,) of a table that rises to the right by `angle` [rad]."""
    return np.array([np.cos(0.5 * angle), 0.0, -np.sin(0.5 * angle), 0.0])


@subroutine
def component(wrench_map, row, F0, F1, F2, M0, M1, M2):  # type: ignore[no-untyped-def]
    """The component number `row` of the nw that are used of a wrench (F, M) in 3-D."""
    m = wrench_map[row]
    return m[0] * F0 + m[1] * F1 + m[2] * F2 + m[3] * M0 + m[4] * M1 + m[5] * M2
