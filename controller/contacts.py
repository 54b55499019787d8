"""Contacts of an object with its support, and the contact Jacobian, which turns their forces into a wrench."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from pivoting.controller.kernels.compilation import subroutine
from pivoting.controller.plane_and_space import component
from pivoting.controller.rotations import cross, into
from pivoting.controller.validate import Array, array, fail, number, one_of


@dataclass(frozen=True, eq=False)
class Contact:
    """A contact that is to stick: a point or a ball of the object, and the friction at it.

    A ball, such as the end of a capsule, sticks by rolling without slipping.

    Attributes:
        point: (d,) the contact, or the centre of the ball, relative to the centre of mass, object axes [m]; d is 2 in
            the plane, with (x, z), and 3 in space.
        mu: friction coefficient, > 0.
        f_min: floor of the normal force [N], >= 0 (a truncated cone).
        frame: (d, d) contact axes as columns, tangent(s) first and the normal (into the object) last, in the axes of
            what it is fixed to; None means the table's own frame.
        fixed_to: "environment" (a corner of the object on a face of its support; the frame is in world axes) or
            "object" (a corner of the environment on a face of the object, with which the frame turns; object axes).
        radius: of the ball [m], >= 0; it touches at its centre less radius times the normal. 0: a point.
    """

    point: Array
    mu: float
    f_min: float = 0.0
    frame: Array | None = None
    radius: float = 0.0
    fixed_to: str = "environment"

    def __init__(
        self,
        point: ArrayLike,
        mu: float,
        f_min: float = 0.0,
        frame: ArrayLike | None = None,
        radius: float = 0.0,
        fixed_to: str = "environment",
    ):
        where = array("point", point, (None,))
        if where.size not in (2, 3):
            raise fail("point", where, "of length 2 (x, z) or 3 (x, y, z)")
        object.__setattr__(self, "point", where)
        object.__setattr__(self, "mu", number("mu", mu, above=0.0))
        object.__setattr__(self, "f_min", number("f_min", f_min, at_least=0.0, unit="N"))
        object.__setattr__(self, "radius", number("radius", radius, at_least=0.0, unit="m"))
        one_of("fixed_to", fixed_to, ("environment", "object"))
        object.__setattr__(self, "fixed_to", fixed_to)
        if self.fixed_to == "object" and (frame is None or self.radius > 0.0):
            raise fail("fixed_to", fixed_to, "with a frame, and a radius of 0: what rolls does so on the environment")
        if frame is not None:
            axes = array("frame", frame, (where.size, where.size))
            if np.abs(axes.T @ axes - np.eye(where.size)).max() > 1e-6:
                raise fail("frame", axes, "orthonormal columns")
            object.__setattr__(self, "frame", axes)
        else:
            object.__setattr__(self, "frame", None)

    @property
    def dim(self) -> int:
        """2 in the plane, 3 in space."""
        return int(self.point.size)


@subroutine
def fill_jacobian(R, held, wrench_map, J):  # type: ignore[no-untyped-def]
    """Write the contact Jacobian into J (nw, K d): contact forces, in contact axes, to the wrench in object axes.

    J_c = [I; r^] R(theta) with r^ f = r x f, where r leads from the CoM to the point of contact. In the plane
    r^ = [-r_y, r_x] (erratum 3 of the notes).

    Args:
        R: (3, 3) object to world.
        held: of `HeldContacts`, points (K, 3), contacts, or the centres of balls, from the CoM, object axes [m];
            offsets (K, 3) from there to where they touch, -radius n, world axes [m]; frames (K, 3, 3) contact axes as
            columns (t, o, n), in world axes or, where turning (K,) is true, in object axes; force_map (3, d).
        wrench_map: (nw, 6), see `Space`.
    """
    points, offsets, frames, force_map = held.points, held.offsets, held.frames, held.force_map
    dim = force_map.shape[1]
    for i in range(points.shape[0]):
        o0, o1, o2 = into(R, offsets[i, 0], offsets[i, 1], offsets[i, 2])
        r0, r1, r2 = points[i, 0] + o0, points[i, 1] + o1, points[i, 2] + o2
        for j in range(dim):
            a0 = a1 = a2 = 0.0
            for axis in range(3):  # axis j of the contact frame, in object axes: R^T frame
                pick = force_map[axis, j]
                if pick == 0.0:
                    continue
                u0, u1, u2 = pick * frames[i, 0, axis], pick * frames[i, 1, axis], pick * frames[i, 2, axis]
                if not held.turning[i]:
                    u0, u1, u2 = into(R, u0, u1, u2)
                a0, a1, a2 = a0 + u0, a1 + u1, a2 + u2
            m0, m1, m2 = cross(r0, r1, r2, a0, a1, a2)
            for row in range(wrench_map.shape[0]):
                J[row, dim * i + j] = component(wrench_map, row, a0, a1, a2, m0, m1, m2)
