"""How an object moves that turns about its believed contacts under a known wrench, one time step ahead."""

import numpy as np
from pivoting.controller.belief import Belief
from pivoting.controller.kernels.compilation import kernel, subroutine
from pivoting.controller.kernels.compiled_step import belief_of
from pivoting.controller.kernels.required_wrench import fill_required
from pivoting.controller.plane_and_space import component
from pivoting.controller.rotations import cross, fill_product, fill_rotation

MOVING = (1.0, 0.0, 0.0, 1.0)  # the law that asks for the reference's own acceleration, velocities and all


@kernel
def predict_worlds(beliefs, axes, wrenches, added, dt, scratch, states):  # type: ignore[no-untyped-def]
    """Move the states of all worlds one step ahead, in place, as a semi-implicit Euler step does.

    The contact forces do no work in the motions that the contacts allow, t_i = (e_i x rho, e_i). So the accelerations
    about the axes e_i follow from t_i' (b0 + B a) = t_i' w, where b0 + B a is the wrench that a motion requires.

    Args:
        beliefs: of the worlds, or one that they share, see `belief.for_worlds`; of their law nothing is used.
        axes: (W or 1, A, 3) object axes about which the object can still turn, A <= 3; see `mobility.free_axes`.
        wrenches: (W, nw) on the object besides gravity and the contacts, object axes; what is not a number counts as 0.
        added: (W, 3) angular accelerations that the model does not know of, world axes.
        scratch: R (3, 3), b (nw,), B and T (3, nw), G (3, 4), a (3,), still (3,) of zeros, and turn (4,).
        states: (W, 13), see `compiled_step.STATE`; written.
    """
    R, b, B, T, G, a, still, turn = scratch
    each, A = beliefs[0][0].shape[0], axes.shape[1]
    first = belief_of(beliefs, 0)
    nw, dim = first.source.map.shape[0], first.contacts.force_map.shape[1]
    for i in range(states.shape[0]):
        believed = belief_of(beliefs, i if each > 1 else 0)
        belief = Belief(believed.object, believed.contacts, believed.source, MOVING)
        mass = belief.object.mass
        q, omega, e = states[i, 3:7], states[i, 10:13], axes[i if axes.shape[0] > 1 else 0]
        fill_rotation(q, R)
        fill_required(R, q, omega, q, omega, still, belief, b)
        for k in range(A):
            for j in range(3):
                a[j] = R[j, 0] * e[k, 0] + R[j, 1] * e[k, 1] + R[j, 2] * e[k, 2]
            fill_required(R, q, omega, q, omega, a, belief, B[k])
            for row in range(nw):
                B[k, row] -= b[row]
                turned = component(belief.source.map, row, 0.0, 0.0, 0.0, e[k, 0], e[k, 1], e[k, 2])
                T[k, row] = B[k, row] / mass if row < dim else turned
        for k in range(A):
            G[k, A] = 0.0
            for row in range(nw):
                w = wrenches[i, row] if np.isfinite(wrenches[i, row]) else 0.0
                G[k, A] += T[k, row] * (w - b[row])
            for j in range(A):
                G[k, j] = 0.0
                for row in range(nw):
                    G[k, j] += T[k, row] * B[j, row]
        solve_in_place(G, A)
        for j in range(3):
            a[j] = 0.0
        for k in range(A):
            for j in range(3):
                a[j] += (R[j, 0] * e[k, 0] + R[j, 1] * e[k, 1] + R[j, 2] * e[k, 2]) * G[k, A]
        for j in range(3):
            omega[j] += dt * (a[j] + added[i, j])
        move_about(R, belief.contacts.pivot, belief.contacts.offset, dt, turn, states[i])


@subroutine
def solve_in_place(G, A):  # type: ignore[no-untyped-def]
    """Solve G (A, A) x = G[:, A] of a positive definite matrix by elimination; the solution is written to G[:, A]."""
    for k in range(A):
        for row in range(A):
            if row != k:
                factor = G[row, k] / G[k, k]
                for j in range(k, A + 1):
                    G[row, j] -= factor * G[k, j]
    for k in range(A):
        G[k, A] /= G[k, k]


@subroutine
def move_about(R, pivot, offset, dt, turn, state):  # type: ignore[no-untyped-def]
    """Turn a state (13,) by its angular velocity for a time, and move its centre of mass as the contacts make it move.

    Args:
        R: (3, 3) its orientation.  pivot, offset: of `HeldContacts`.  turn: (4,) scratch.
    """
    omega, q = state[10:13], state[3:7]
    x = -(R[0, 0] * pivot[0] + R[0, 1] * pivot[1] + R[0, 2] * pivot[2]) - offset[0]
    y = -(R[1, 0] * pivot[0] + R[1, 1] * pivot[1] + R[1, 2] * pivot[2]) - offset[1]
    z = -(R[2, 0] * pivot[0] + R[2, 1] * pivot[1] + R[2, 2] * pivot[2]) - offset[2]
    u, v, w = cross(omega[0], omega[1], omega[2], x, y, z)
    state[7], state[8], state[9] = u, v, w
    state[0] += dt * u
    state[1] += dt * v
    state[2] += dt * w
    angle = np.sqrt(omega[0] ** 2 + omega[1] ** 2 + omega[2] ** 2) * dt
    scale = 0.5 * dt if angle < 1e-9 else dt * np.sin(0.5 * angle) / angle
    turn[0], turn[1], turn[2], turn[3] = np.cos(0.5 * angle), scale * omega[0], scale * omega[1], scale * omega[2]
    fill_product(turn, q, q)
    length = np.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
    for j in range(4):
        q[j] /= length
