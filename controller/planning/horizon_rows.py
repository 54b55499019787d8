"""The parts of a horizon's program that depend on the guess: its rows, the cost of tracking, and the defects."""

from typing import NamedTuple, Self

import numpy as np
from pivoting.controller.kernels.compilation import kernel, subroutine
from pivoting.controller.planning.equations_of_motion import MotionRows, fill_motion
from pivoting.controller.rotations import cross, fill_difference_jacobians, fill_rotation, into, rotation_error, turn
from pivoting.controller.validate import Array


class Rows(NamedTuple):
    """The rows of N steps; see `fill_motion`, `fill_sticking` and `fill_clearance`.

    sticking: (N, S, nq), with the sides off: (N, S).  clearance: (N, P, nq), with the sides room: (N, P).
    """

    motion: MotionRows
    sticking: Array
    off: Array
    clearance: Array
    room: Array

    @classmethod
    def empty(cls, N: int, nq: int, n: int, S: int, P: int) -> Self:
        """Arrays for the rows, not initialised."""
        motion = MotionRows(np.empty((N, nq)), np.empty((3, N, nq, nq)), np.empty((N, nq, nq)), np.empty((N, nq, n)))
        return cls(motion, np.empty((N, S, nq)), np.empty((N, S)), np.empty((N, P, nq)), np.empty((N, P)))


@kernel
def fill_rows(body, order, lag, h, fixed, planar, clear, path, wrench, force, scratch, rows):  # type: ignore[no-untyped-def]
    """Write all rows about a path, wrenches (N, nw) and forces (N, K d) [N, N m]."""
    fill_motion(body, order, lag, h, path, wrench, force, scratch, rows.motion)
    if rows.off.shape[1]:
        fill_sticking(body, fixed, planar, path, scratch, rows.sticking, rows.off)
    if rows.room.shape[1]:
        fill_clearance(body, clear, path, scratch, rows.clearance, rows.room)


@kernel
def fill_sides(rows, equal, linear, out):  # type: ignore[no-untyped-def]
    """Write those right-hand sides of a program that depend on the guess.

    Args:
        equal, linear: numbers of equalities (motion, sticking) and of half-lines (others, clearance) of a step.
        out: the sides of all equalities, then of all half-lines, then others.
    """
    N, nq = rows.motion.constant.shape
    for t in range(N):
        for r in range(nq):
            out[equal * t + r] = -rows.motion.constant[t, r]
        for r in range(rows.off.shape[1]):
            out[equal * t + nq + r] = rows.off[t, r]
        first = equal * N + linear * (t + 1) - rows.room.shape[1]
        for r in range(rows.room.shape[1]):
            out[first + r] = rows.room[t, r]


@kernel
def defects(rows, units, wrench, force):  # type: ignore[no-untyped-def]
    """How far wrenches (N, nw) and forces (N, K d) are from making the motion, and a path from sticking, in units."""
    moved, off = 0.0, 0.0
    motion = rows.motion
    for t in range(wrench.shape[0]):
        for r in range(wrench.shape[1]):
            left = motion.constant[t, r]
            for c in range(wrench.shape[1]):
                left += motion.by_wrench[t, r, c] * wrench[t, c] / units.wrench[c]
            for c in range(force.shape[1]):
                left += motion.by_force[t, r, c] * force[t, c] / units.force
            if abs(left) > moved or np.isnan(left):
                moved = abs(left)
        for r in range(rows.off.shape[1]):
            if abs(rows.off[t, r]) > off or np.isnan(rows.off[t, r]):
                off = abs(rows.off[t, r])
    return moved, off


@kernel
def fill_corrected(body, x, guess, scratch, out):  # type: ignore[no-untyped-def]
    """Write the guess as an answer x (N, 2 nq + K d) corrects it, and return the greatest change, in units."""
    nq, n, units, change = guess.wrench.shape[1], guess.force.shape[1], body.units, 0.0
    moved = scratch.poses[0]
    for i in range(3):
        out.path.position[0, i] = guess.path.position[0, i]
    for i in range(4):
        out.path.orientation[0, i] = guess.path.orientation[0, i]
    for t in range(x.shape[0]):
        for i in range(6):
            moved[i] = 0.0
        for c in range(nq):
            moved[body.pick[c]] = body.sign[c] * x[t, c] * units.pose[c]
            out.wrench[t, c] = x[t, nq + c] * units.wrench[c]
            change = max(change, max(abs(x[t, c]), abs(x[t, nq + c] - guess.wrench[t, c] / units.wrench[c])))
        for c in range(n):
            out.force[t, c] = x[t, 2 * nq + c] * units.force
            change = max(change, abs(x[t, 2 * nq + c] - guess.force[t, c] / units.force))
        for i in range(3):
            out.path.position[t + 1, i] = guess.path.position[t + 1, i] + moved[i]
        turn(guess.path.orientation[t + 1], moved[3:], out.path.orientation[t + 1])
    return change


@subroutine
def fill_sticking(body, fixed, planar, path, scratch, rows, side):  # type: ignore[no-untyped-def]
    """Write the sticking rows (N, S, nq) and sides (N, S): rows d_t = side keeps the contacts where they started.

    Args:
        body: `Mechanics`.
        fixed: (D, 2, 3) pairs (u, e) of object axes: e must not turn towards u from where it pointed at the start.
        planar: whether the motion is planar; then the middle one of the three rows for the contacts' mean is left out.
    """
    R, R_0 = scratch.turns[0], scratch.turns[1]
    fill_rotation(path.before[3:], R_0)
    nw, p, length, pose = body.pick.shape[0], body.pivot, body.units.length, body.units.pose
    full, there = scratch.poses[0], scratch.poses[1]
    for i in range(3):
        there[i] = path.before[i] + R_0[i, 0] * p[0] + R_0[i, 1] * p[1] + R_0[i, 2] * p[2]
    for t in range(rows.shape[0]):
        fill_rotation(path.orientation[t + 1], R)
        row = 0
        for i in range(3):
            if planar and i == 1:
                continue
            full[0] = full[1] = full[2] = 0.0
            full[i] = 1.0
            # e_i . R (d x p) = (p x R'e_i) . d
            full[3], full[4], full[5] = cross(p[0], p[1], p[2], R[i, 0], R[i, 1], R[i, 2])
            for c in range(nw):
                rows[t, row, c] = body.sign[c] * pose[c] * full[body.pick[c]] / length
            off = path.position[t + 1, i] + R[i, 0] * p[0] + R[i, 1] * p[1] + R[i, 2] * p[2] - there[i]
            side[t, row] = -off / length
            row += 1
        for k in range(fixed.shape[0]):
            u, e = fixed[k, 0], fixed[k, 1]
            w0 = R_0[0, 0] * e[0] + R_0[0, 1] * e[1] + R_0[0, 2] * e[2]
            w1 = R_0[1, 0] * e[0] + R_0[1, 1] * e[1] + R_0[1, 2] * e[2]
            w2 = R_0[2, 0] * e[0] + R_0[2, 1] * e[1] + R_0[2, 2] * e[2]
            s0, s1, s2 = into(R, w0, w1, w2)
            full[0] = full[1] = full[2] = 0.0
            full[3], full[4], full[5] = cross(u[0], u[1], u[2], s0, s1, s2)  # u . (s x d)
            for c in range(nw):
                rows[t, row, c] = body.sign[c] * pose[c] * full[body.pick[c]]
            side[t, row] = -(u[0] * s0 + u[1] * s1 + u[2] * s2)
            row += 1


@subroutine
def fill_clearance(body, clear, path, scratch, rows, side):  # type: ignore[no-untyped-def]
    """Write the clearance rows (N, P, nq) and sides (N, P): rows d_t <= side keeps points above the table.

    Args:
        body: `Mechanics`.
        clear: (P, 3) the points, from the CoM, object axes [m]. The table is taken to be as high as the lowest contact
            at the start.
    """
    length, pose = body.units.length, body.units.pose
    R, full = scratch.turns[0], scratch.poses[0]
    fill_rotation(path.before[3:], R)
    floor = np.inf
    for k in range(body.points.shape[0]):
        p = body.points[k]
        floor = min(floor, path.before[2] + R[2, 0] * p[0] + R[2, 1] * p[1] + R[2, 2] * p[2])
    for t in range(rows.shape[0]):
        fill_rotation(path.orientation[t + 1], R)
        for k in range(clear.shape[0]):
            p = clear[k]
            full[0] = full[1] = 0.0
            full[2] = 1.0
            full[3], full[4], full[5] = cross(p[0], p[1], p[2], R[2, 0], R[2, 1], R[2, 2])
            for c in range(body.pick.shape[0]):
                rows[t, k, c] = -body.sign[c] * pose[c] * full[body.pick[c]] / length
            height = path.position[t + 1, 2] + R[2, 0] * p[0] + R[2, 1] * p[1] + R[2, 2] * p[2] - floor
            side[t, k] = height / length


@kernel
def fill_tracking(body, Q, path, position, orientation, scratch, curvature, slope):  # type: ignore[no-untyped-def]
    """Write the cost of tracking, 1/2 e'Q e, to second order in d_t; e leads from a path's poses to desired ones.

    Args:
        body: `Mechanics`.  Q: (N, nq, nq), divided by the square of the unit of force.
        position: (N, 3), orientation: (N, 4): desired, table axes.
        curvature: (N, nq, nq) and slope: (N, nq or more), out.

    Returns:
        The sum of 1/2 e'Q e, divided by that square.
    """
    cost, nw = 0.0, body.pick.shape[0]
    full, error = scratch.poses[0], scratch.poses[1]
    X, J, QJ = scratch.blocks[0], scratch.blocks[1], scratch.blocks[2]
    end, start = scratch.turns[0], scratch.turns[1]
    for i in range(6):
        for j in range(6):
            X[i, j] = -1.0 if i == j else 0.0
    for t in range(position.shape[0]):
        for i in range(3):
            full[i] = position[t, i] - path.position[t + 1, i]
        full[3], full[4], full[5] = rotation_error(path.orientation[t + 1], orientation[t])
        fill_difference_jacobians(full[3:], end, start)
        for i in range(3):
            for j in range(3):
                X[3 + i, 3 + j] = start[i, j]
        for r in range(nw):
            error[r] = body.sign[r] * full[body.pick[r]]
            for c in range(nw):
                J[r, c] = body.sign[r] * body.sign[c] * X[body.pick[r], body.pick[c]] * body.units.pose[c]
        for r in range(nw):
            for c in range(nw):
                cost += 0.5 * error[r] * Q[t, r, c] * error[c]
                QJ[r, c] = 0.0
                for k in range(nw):
                    QJ[r, c] += Q[t, r, k] * J[k, c]
        for r in range(nw):
            slope[t, r] = 0.0
            for k in range(nw):
                slope[t, r] += QJ[k, r] * error[k]
            for c in range(nw):
                curvature[t, r, c] = 0.0
                for k in range(nw):
                    curvature[t, r, c] += J[k, r] * QJ[k, c]
    return cost
