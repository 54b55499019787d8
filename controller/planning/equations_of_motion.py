"""The equations of motion of a horizon, linearised about a path, in the plane and in space.

Let y_t be the change from pose t - 1 to pose t (translation in table axes, rotation vector in object axes). The
equations of the four integrators,

    quasi-dynamic  M y_t / h^2 = F(q_t, u_t)                      the notes: every step starts from rest
    implicit       M (y_t - y_{t-1}) / h^2 = F(q_t, u_t)          the same with the velocity term
    semi-implicit  M (y_t - y_{t-1}) / h^2 = F(q_{t-1}, u_t)      MuJoCo's Euler
    forward        M (y_t - y_{t-1}) / h^2 = F(q_{t-2}, u_t)      its first pose is given by the initial velocity

with u = (w, f) and F = (R w_F + C f + m g, w_M + p x R'C f - c omega x I omega), are one equation with two numbers:
`order` is the order of the difference on the left, and `lag` the number of poses from the one at which the forces act
to the one that is reached. Velocities are y / h, so they need no variables; omega is that of y_{t-1}, and c = 0 for
order 1.
"""

from typing import NamedTuple, Self

import numpy as np
from pivoting.controller.kernels.compilation import kernel, subroutine
from pivoting.controller.rotations import (
    add_product,
    cross,
    fill_difference_jacobians,
    fill_hat,
    fill_product,
    fill_rotation,
    into,
    rotation_error,
    turn,
)
from pivoting.controller.solvers.block_matrix import Indices
from pivoting.controller.units import Units
from pivoting.controller.validate import Array


class Path(NamedTuple):
    """The poses 0 to N of a motion, in table axes, and the motion before them.

    position: (N+1, 3) CoM [m].  orientation: (N+1, 4) object axes to table.
    before: (7,) the pose, position and orientation, at which the forces of the first "forward" step act.
    arriving: (6,) y_0, h times the velocity with which pose 0 is reached.
    """

    position: Array
    orientation: Array
    before: Array
    arriving: Array


class Mechanics(NamedTuple):
    """What the compiled equations need to know about the object; as in `Belief`, but in table axes.

    frames: (K, 3, d) contact axes as columns.  gravity: (3,).  pick, sign: (nw,) the components of 6 that are used.
    units: of the rows and columns.
    """

    mass: float
    inertia: Array
    points: Array
    pivot: Array
    frames: Array
    gravity: Array
    pick: Indices
    sign: Array
    units: Units


class MotionRows(NamedTuple):
    """The linearised equations of motion, as the coefficients of

        towards[0] d_t + towards[1] d_{t-1} + towards[2] d_{t-2} + by_wrench w_t + by_force f_t + constant = 0

    for every step t. The correction d_t (nq,) of pose t is zero for the given pose 0. Everything is in `Units`.
    constant: (N, nq).  towards: (3, N, nq, nq).  by_wrench: (N, nq, nw).  by_force: (N, nq, K d).
    """

    constant: Array
    towards: Array
    by_wrench: Array
    by_force: Array


class Scratch(NamedTuple):
    """The scratch arrays of `fill_rows`, `fill_tracking` and `fill_corrected`.

    turns: (8, 3, 3).  poses: (5, 6).  blocks: (4, 6, 6).
    """

    turns: Array
    poses: Array
    blocks: Array

    @classmethod
    def empty(cls) -> Self:
        """New scratch arrays, not initialised."""
        return cls(np.empty((8, 3, 3)), np.empty((5, 6)), np.empty((4, 6, 6)))


@kernel
def fill_start(table, to_table, kept, h, ahead, position, orientation, velocity, omega, R, out):  # type: ignore[no-untyped-def]
    """Write pose 0 of a `Path` from a state in world axes; with `ahead` it is one step later, see `INTEGRATORS`.

    Args:
        table: (3, 3) the table's axes as columns; to_table: (4,) the inverse.
        kept: (6,) 0 for what cannot move, else 1.
        R: (3, 3) scratch.
    """
    fill_rotation(orientation, R)
    before, arriving = out.before, out.arriving
    before[0], before[1], before[2] = into(table, position[0], position[1], position[2])
    fill_product(to_table, orientation, before[3:])
    arriving[0], arriving[1], arriving[2] = into(table, velocity[0], velocity[1], velocity[2])
    arriving[3], arriving[4], arriving[5] = into(R, omega[0], omega[1], omega[2])
    for i in range(6):
        arriving[i] *= h * kept[i]
    for i in range(3):
        out.position[0, i] = before[i] + (arriving[i] if ahead else 0.0)
    for i in range(4):
        out.orientation[0, i] = before[3 + i]
    if ahead:
        turn(before[3:], arriving[3:], out.orientation[0])


@subroutine
def _fill_inertia(body, order, h, scratch):  # type: ignore[no-untyped-def]
    """Write what acceleration and gravity ask for in one step, and how that changes with the poses at its end, at its
    start and before, into rows 2 and blocks 0 to 2 of the scratch; its other rows and turns are as `fill_motion` has
    them."""
    hatted, gyro = scratch.turns[1], scratch.turns[3]
    end, start, last_end, last_start = scratch.turns[4], scratch.turns[5], scratch.turns[6], scratch.turns[7]
    y, last, rows, full, spin = (
        scratch.poses[0], scratch.poses[1], scratch.poses[2], scratch.poses[3], scratch.poses[4]
    )  # fmt: skip
    X, unit, light = scratch.blocks[:3], body.mass / h**2, 1.0 / h**2
    for k in range(3):
        for i in range(6):
            for j in range(6):
                X[k, i, j] = 0.0
    for i in range(3):
        X[0, i, i], X[1, i, i] = unit, -unit
    add_product(light, body.inertia, end, X[0], 3, 3)
    add_product(light, body.inertia, start, X[1], 3, 3)
    for i in range(6):
        full[i] = y[i] - (order - 1) * last[i]
    for i in range(3):
        rows[i] = unit * full[i] - body.mass * body.gravity[i]
        rows[3 + i] = light * (
            body.inertia[i, 0] * full[3] + body.inertia[i, 1] * full[4] + body.inertia[i, 2] * full[5]
        )
    if order == 2:
        for i in range(3):
            X[1, i, i] -= unit
            X[2, i, i] += unit
            spin[i] = (body.inertia[i, 0] * last[3] + body.inertia[i, 1] * last[4] + body.inertia[i, 2] * last[5]) / h
        c0, c1, c2 = cross(last[3], last[4], last[5], spin[0], spin[1], spin[2])
        rows[3] += c0 / h
        rows[4] += c1 / h
        rows[5] += c2 / h
        # d(omega x I omega - I omega / h) by y_{t-1}
        fill_hat(spin[0], spin[1], spin[2], gyro)
        for i in range(3):
            for j in range(3):
                gyro[i, j] = -gyro[i, j] / h - light * body.inertia[i, j]
        fill_hat(last[3], last[4], last[5], hatted)
        add_product(light, hatted, body.inertia, gyro, 0, 0)
        add_product(1.0, gyro, last_end, X[1], 3, 3)
        add_product(1.0, gyro, last_start, X[2], 3, 3)


@subroutine
def _fill_forces(body, wrench, force, scratch, X, by_force):  # type: ignore[no-untyped-def]
    """Write the contact forces' part of one step's equations, and add how it and the wrench's turn with the pose.

    Args:
        wrench: (nw,), force: (K d,).  X: (6, 6), added to.  by_force: (nq, K d), written.
    """
    K, d, nw, units = body.points.shape[0], body.frames.shape[2], body.pick.shape[0], body.units
    R, hatted, turning, full = scratch.turns[0], scratch.turns[1], scratch.turns[2], scratch.poses[3]
    for i in range(6):
        full[i] = 0.0
    for i in range(nw):
        full[body.pick[i]] = body.sign[i] * wrench[i]
    fill_hat(full[0], full[1], full[2], hatted)
    add_product(1.0, R, hatted, X, 0, 3)  # R w turns by -R w^
    for k in range(K):
        p0, p1, p2 = body.points[k, 0], body.points[k, 1], body.points[k, 2]
        g0 = g1 = g2 = 0.0
        for j in range(d):
            a0, a1, a2 = body.frames[k, 0, j], body.frames[k, 1, j], body.frames[k, 2, j]
            b0, b1, b2 = into(R, a0, a1, a2)
            full[0], full[1], full[2] = a0, a1, a2
            full[3], full[4], full[5] = cross(p0, p1, p2, b0, b1, b2)
            for r in range(nw):
                by_force[r, d * k + j] = -body.sign[r] * full[body.pick[r]] * units.force / units.wrench[r]
            g0 += b0 * force[d * k + j]
            g1 += b1 * force[d * k + j]
            g2 += b2 * force[d * k + j]
        fill_hat(g0, g1, g2, hatted)  # and R'g by (R'g)^
        fill_hat(p0, p1, p2, turning)
        add_product(-1.0, turning, hatted, X, 3, 3)


@subroutine
def fill_motion(body, order, lag, h, path, wrench, force, scratch, out):  # type: ignore[no-untyped-def]
    """Write the equations of motion about a path: to first order in the poses, exactly in wrenches and forces.

    Args:
        body: `Mechanics`.  order, lag: of the integrator.  h: [s].  path: `Path`.
        wrench, force: (N, nw), (N, K d) [N, N m], about which the dependence of the forces on the pose is linearised;
            with zeros it is neglected.
        scratch: `Scratch`.  out: `MotionRows`.
    """
    nw, units, R = body.pick.shape[0], body.units, scratch.turns[0]
    end, start, last_end, last_start = scratch.turns[4], scratch.turns[5], scratch.turns[6], scratch.turns[7]
    y, last, rows = scratch.poses[0], scratch.poses[1], scratch.poses[2]
    X, gain = scratch.blocks[:3], scratch.blocks[3]
    for i in range(6):
        last[i] = path.arriving[i]
    for i in range(3):
        for j in range(3):
            last_end[i, j] = last_start[i, j] = 0.0
    for t in range(wrench.shape[0]):
        for i in range(3):
            y[i] = path.position[t + 1, i] - path.position[t, i]
        y[3], y[4], y[5] = rotation_error(path.orientation[t], path.orientation[t + 1])
        fill_difference_jacobians(y[3:], end, start)
        _fill_inertia(body, order, h, scratch)
        if lag == 2 and t == 0:  # forces, at the pose where they act
            fill_rotation(path.before[3:], R)
        else:
            fill_rotation(path.orientation[t + 1 - lag], R)
        _fill_forces(body, wrench[t], force[t], scratch, X[lag], out.by_force[t])
        for i in range(3):
            for j in range(3):
                gain[i, j] = R[i, j]
                gain[i, 3 + j] = gain[3 + i, j] = 0.0
                gain[3 + i, 3 + j] = 1.0 if i == j else 0.0
        for r in range(nw):
            sign = body.sign[r] / units.wrench[r]
            out.constant[t, r] = sign * rows[body.pick[r]]
            for c in range(nw):
                s = sign * body.sign[c]
                out.by_wrench[t, r, c] = -s * units.wrench[c] * gain[body.pick[r], body.pick[c]]
                for k in range(3):
                    out.towards[k, t, r, c] = s * units.pose[c] * X[k, body.pick[r], body.pick[c]]
        for i in range(6):
            last[i] = y[i]
        for i in range(3):
            for j in range(3):
                last_end[i, j], last_start[i, j] = end[i, j], start[i, j]
