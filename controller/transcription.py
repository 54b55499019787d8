"""The horizon's equations of motion, linearised about a path: blocks for each step, in the plane and in space alike.

With y_t the difference of pose t from pose t - 1 (translation in table axes, rotation vector in object axes), all of

    quasi-dynamic  M y_t / h^2 = F(q_t, u_t)                      the notes: every step starts from rest
    implicit       M (y_t - y_{t-1}) / h^2 = F(q_t, u_t)          the same with the velocity term
    semi-implicit  M (y_t - y_{t-1}) / h^2 = F(q_{t-1}, u_t)      MuJoCo's Euler
    forward        M (y_t - y_{t-1}) / h^2 = F(q_{t-2}, u_t)      its first pose is given by the initial velocity

with u = (w, f), F = (R w_F + C f + m g, w_M + p x R'C f - c omega x I omega), are one equation: `order` counts the
differences on the left, `lag` the poses between the one that is reached and the one at which forces act. Velocities
are y / h, so that they are no variables; omega is that of y_{t-1}, and c = 0 for order 1.
"""

from typing import NamedTuple

import numpy as np
from pivoting.controller.controller import Belief
from pivoting.controller.so3 import difference, difference_jacobians, hat, matrices
from pivoting.controller.validate import Array

INTEGRATORS = {"quasi-dynamic": (1, 0), "implicit": (2, 0), "semi-implicit": (2, 1), "forward": (2, 2)}  # order, lag


class Path(NamedTuple):
    """Poses 0 to N, in table axes, and what came before them.

    position: (N+1, 3) CoM [m].  orientation: (N+1, 4) object axes to table.
    before: (3,), (4,) the pose before pose 0, at which a forward step's forces act.
    arriving: (6,) y_0, h times the velocity with which pose 0 is reached.
    """

    position: Array
    orientation: Array
    before: tuple[Array, Array]
    arriving: Array


class Linear(NamedTuple):
    """constant + towards[0] d_t + towards[1] d_{t-1} + towards[2] d_{t-2} = wrench_gain w_t + force_gain f_t.

    d: corrections of the poses, (nq,) each; zero for the given pose 0. In the rows' own units [N, N m].
    constant: (N, nq).  towards: three of (N, nq, nq).  wrench_gain: (N, nq, nw).  force_gain: (N, nq, K d).
    """

    constant: Array
    towards: tuple[Array, Array, Array]
    wrench_gain: Array
    force_gain: Array


def linearised(
    belief: Belief, frames: Array, gravity: Array, h: float, integrator: str, path: Path, wrench: Array, force: Array
) -> Linear:
    """The equations of motion to first order in poses, and exactly in wrench and force, about a path.

    Args:
        belief: what the controller believes; of it mass, inertia, points and maps are used.
        frames: (K, 3, d) contact axes as columns, table axes.  gravity: (3,) table axes.
        wrench: (N, nw), force: (N, K d): with which the forces' dependence on the pose is linearised; zero leaves it out.
    """
    order, lag = INTEGRATORS[integrator]
    inertia, W, points = belief.inertia, belief.wrench_map, belief.points
    N = len(wrench)
    position, orientation = path.position, path.orientation
    y, end, start = differences(path)
    M = np.zeros((6, 6))
    M[:3, :3], M[3:, 3:] = belief.mass * np.eye(3), inertia
    acceleration = y[1:] - (order - 1) * y[:-1]
    constant = acceleration @ M.T / h**2
    by_end, by_start = M @ end / h**2, M @ start / h**2
    towards = [by_end[1:].copy(), by_start[1:].copy(), np.zeros((N, 6, 6))]
    if order == 2:
        omega = y[:-1, 3:] / h
        spin = omega @ inertia
        constant[:, 3:] += np.cross(omega, spin)
        gyro = np.zeros((N, 6, 6))
        gyro[:, 3:, 3:] = (hat(omega) @ inertia - hat(spin)) / h
        towards[1] += (gyro @ end[:-1]) - by_end[:-1]
        towards[2] += (gyro @ start[:-1]) - by_start[:-1]
    acts = np.concatenate([path.before[1][None], orientation])[2 - lag : 2 - lag + N] if lag else orientation[1:]
    R = matrices(acts)
    constant[:, :3] -= belief.mass * gravity
    pushes = np.swapaxes(R, 1, 2)[:, None] @ frames  # (N, K, 3, d) contact axes in object axes
    arms = hat(points)
    gain = np.zeros((N, 6, 6))
    gain[:, :3, :3], gain[:, 3:, 3:] = R, np.eye(3)
    contact = np.concatenate([np.broadcast_to(frames, pushes.shape), arms @ pushes], axis=2)  # (N, K, 6, d)
    contact = np.moveaxis(contact, 1, 2).reshape(N, 6, -1)
    # R w turns by -R w^, R'g by (R'g)^: what the forces change as the pose does
    K, d = len(points), frames.shape[-1]
    turning = np.zeros((N, 6, 6))
    turning[:, :3, 3:] = R @ hat((wrench @ W)[:, :3])
    held = (pushes @ force.reshape(N, K, d, 1))[..., 0]
    turning[:, 3:, 3:] = -(arms @ hat(held)).sum(axis=1)
    towards[lag] += turning
    return Linear(
        constant @ W.T,
        tuple(W @ block @ W.T for block in towards),  # type: ignore[arg-type]
        W @ gain @ W.T,
        W @ contact,
    )


def differences(path: Path) -> tuple[Array, Array, Array]:
    """y_0 to y_N (N+1, 6), and their derivatives by the pose that is reached and the one before, (N+1, 6, 6) each.

    Those of y_0, which is given, are zero.
    """
    count = len(path.position)
    y = np.empty((count, 6))
    y[0] = path.arriving
    y[1:, :3] = np.diff(path.position, axis=0)
    y[1:, 3:] = difference(path.orientation[:-1], path.orientation[1:])
    end, start = np.zeros((count, 6, 6)), np.zeros((count, 6, 6))
    end[1:, :3, :3] = np.eye(3)
    start[1:, :3, :3] = -np.eye(3)
    end[1:, 3:, 3:], start[1:, 3:, 3:] = difference_jacobians(y[1:, 3:])
    return y, end, start
