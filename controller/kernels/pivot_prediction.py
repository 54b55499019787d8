"""How an object moves that turns about its believed contacts under a known wrench, and what a measured pose adds."""

import numpy as np
from pivoting.controller.kernels.cholesky import factor, solve_factored
from pivoting.controller.kernels.compilation import kernel, subroutine
from pivoting.controller.kernels.compiled_step import contacts_of
from pivoting.controller.kernels.required_wrench import fill_required
from pivoting.controller.plane_and_space import component
from pivoting.controller.rotations import cross, fill_product, fill_rotation, rotation_error, turn, turned

MOVING = (1.0, 0.0, 0.0, 1.0)  # the law that asks for the reference's own acceleration, velocities and all


@kernel
def predict_worlds(beliefs, axes, wrenches, added, dt, scratch, states):  # type: ignore[no-untyped-def]
    """Move the states of all worlds one step ahead, in place, as a semi-implicit Euler step does.

    The contact forces do no work in the motions that the contacts allow, t_i = (e_i x rho, e_i). So the accelerations
    about the axes e_i follow from t_i' (b0 + B a) = t_i' w, where b0 + B a is the wrench that a motion requires.

    Args:
        beliefs: of the worlds, or one that they share, see `belief.for_worlds`; of their sets and law nothing is used.
        axes: (W or 1, A, 3) object axes about which the object can still turn, A <= 3; see `mobility.free_axes`.
        wrenches: (W, nw) on the object besides gravity and the contacts, object axes; what is not a number counts as 0.
        added: (W, 3) angular accelerations that the model does not know of, world axes.
        scratch: R (3, 3), b (nw,), B and T (3, nw), G (3, 3), a (3,), still (3,) of zeros, rate (3,), and spin (4,).
        states: (W, 13), see `compiled_step.STATE`; written.
    """
    R, b, B, T, G, a, still, rate, spin = scratch
    (masses, inertias, gravities), all_held, (wrench_map, _), _ = beliefs
    each, A, nw = masses.shape[0], axes.shape[1], wrench_map.shape[0]
    dim = nw // 3 + 1
    for i in range(states.shape[0]):
        mine = i % each
        mass, held = masses[mine], contacts_of(all_held, mine)
        moved, pivot, offset = (mass, inertias[mine], gravities[mine]), held.pivot, held.offset
        q, omega, e = states[i, 3:7], states[i, 10:13], axes[i if axes.shape[0] > 1 else 0]
        fill_rotation(q, R)
        fill_required(R, q, omega, q, omega, still, moved, pivot, offset, wrench_map, MOVING, b)
        for k in range(A):
            for j in range(3):
                a[j] = R[j, 0] * e[k, 0] + R[j, 1] * e[k, 1] + R[j, 2] * e[k, 2]
            fill_required(R, q, omega, q, omega, a, moved, pivot, offset, wrench_map, MOVING, B[k])
            for row in range(nw):
                B[k, row] -= b[row]
                lever = component(wrench_map, row, 0.0, 0.0, 0.0, e[k, 0], e[k, 1], e[k, 2])
                T[k, row] = B[k, row] / mass if row < dim else lever
        for k in range(A):
            rate[k] = 0.0
            for row in range(nw):
                w = wrenches[i, row] if np.isfinite(wrenches[i, row]) else 0.0
                rate[k] += T[k, row] * (w - b[row])
            for j in range(A):
                G[k, j] = 0.0
                for row in range(nw):
                    G[k, j] += T[k, row] * B[j, row]
        factor(G, A)
        solve_factored(G, rate, A)
        for j in range(3):
            a[j] = 0.0
        for k in range(A):
            for j in range(3):
                a[j] += (R[j, 0] * e[k, 0] + R[j, 1] * e[k, 1] + R[j, 2] * e[k, 2]) * rate[k]
        for j in range(3):
            omega[j] += dt * (a[j] + added[i, j])
        move_about(pivot, offset, dt, spin, states[i])


@kernel
def correct_worlds(  # type: ignore[no-untyped-def]
    axes, pivots, offsets, slow, measured, fresh, spin, states, unknown, covariance
):  # fmt: skip
    """Correct the states of all worlds by measured poses, those of a Kalman filter about the axes that are free.

    About the other axes, and along all of them, the estimate follows the measurement slowly.

    Args:
        axes: of `predict_worlds`.  pivots, offsets: (W or 1, 3) of `HeldContacts`.
        slow: share of an error that is taken up where nothing is to move.
        measured: (W, 7 or more) positions and orientations.  fresh: (W,) which of them are new.
        spin: (6,) scratch.
        states: (W, 13), unknown: (W, 3), covariance: (W, 3, 3), see `PoseObserver`; written.
    """
    for i in range(states.shape[0]):
        if not fresh[i]:
            continue
        state, P, q = states[i], covariance[i], states[i, 3:7]
        e, pivot, offset = axes[i % axes.shape[0]], pivots[i % pivots.shape[0]], offsets[i % offsets.shape[0]]
        angle, rate, jerk = P[0, 0] / (P[0, 0] + 1.0), P[1, 0] / (P[0, 0] + 1.0), P[2, 0] / (P[0, 0] + 1.0)
        off, free = spin[:3], spin[3:6]
        off[0], off[1], off[2] = rotation_error(q, measured[i, 3:7])
        for j in range(3):
            free[j] = 0.0
        for k in range(e.shape[0]):
            along = e[k, 0] * off[0] + e[k, 1] * off[1] + e[k, 2] * off[2]
            for j in range(3):
                free[j] += along * e[k, j]
        for j in range(3):
            off[j] = angle * free[j] + slow * (off[j] - free[j])
        x, y, z = arm(q, pivot, offset)
        turn(q, off, q)
        u, v, w = arm(q, pivot, offset)
        shifts = u - x, v - y, w - z
        du, dv, dw = turned(q[0], q[1], q[2], q[3], free[0], free[1], free[2])
        spins = du, dv, dw
        for j in range(3):
            state[j] += shifts[j]
            state[j] += slow * (measured[i, j] - state[j])
            state[10 + j] += rate * spins[j]
            unknown[i, j] += jerk * spins[j]
        state[7], state[8], state[9] = cross(state[10], state[11], state[12], u, v, w)
        for k in range(3):
            spin[k] = P[0, k]
        for j in range(3):
            gain = angle if j == 0 else (rate if j == 1 else jerk)
            for k in range(3):
                P[j, k] -= gain * spin[k]


@kernel
def fill_contacts(pivots, offsets, states, out):  # type: ignore[no-untyped-def]
    """Write where the contacts' mean is, (W, 3), world axes, by the poses of states (W, 13)."""
    for i in range(states.shape[0]):
        x, y, z = arm(states[i, 3:7], pivots[i % pivots.shape[0]], offsets[i % offsets.shape[0]])
        out[i, 0], out[i, 1], out[i, 2] = states[i, 0] - x, states[i, 1] - y, states[i, 2] - z


@subroutine
def arm(q, pivot, offset):  # type: ignore[no-untyped-def]
    """From the contacts' mean to the centre of mass at an orientation (4,), world axes, as three scalars."""
    x, y, z = turned(q[0], q[1], q[2], q[3], pivot[0], pivot[1], pivot[2])
    return -x - offset[0], -y - offset[1], -z - offset[2]


@subroutine
def move_about(pivot, offset, dt, spin, state):  # type: ignore[no-untyped-def]
    """Turn a state (13,) by its angular velocity for a time, and move its centre of mass as the contacts make it move.

    Args:
        pivot, offset: of `HeldContacts`.  spin: (4,) scratch.
    """
    omega, q = state[10:13], state[3:7]
    x, y, z = arm(q, pivot, offset)
    state[7], state[8], state[9] = cross(omega[0], omega[1], omega[2], x, y, z)
    for j in range(3):
        state[j] += dt * state[7 + j]
    angle = np.sqrt(omega[0] ** 2 + omega[1] ** 2 + omega[2] ** 2) * dt
    scale = 0.5 * dt if angle < 1e-9 else dt * np.sin(0.5 * angle) / angle
    spin[0], spin[1], spin[2], spin[3] = np.cos(0.5 * angle), scale * omega[0], scale * omega[1], scale * omega[2]
    fill_product(spin, q, q)
    length = np.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
    for j in range(4):
        q[j] /= length
