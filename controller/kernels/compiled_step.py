"""The compiled step of the loop: it makes, solves and certifies the wrench problem of every world."""

import numpy as np
from pivoting.controller.belief import HeldContacts
from pivoting.controller.contacts import fill_jacobian
from pivoting.controller.kernels.compilation import kernel, subroutine
from pivoting.controller.kernels.guarded_interior_point import guarded_wrench
from pivoting.controller.kernels.interior_point import contact_wrench
from pivoting.controller.kernels.planar_closed_form import moved_planar_wrench, planar_wrench
from pivoting.controller.kernels.required_wrench import fill_required
from pivoting.controller.kernels.worst_member_forces import move_cones
from pivoting.controller.kernels.worst_planar_force import move_planar_cone
from pivoting.controller.rotations import fill_rotation, turned
from pivoting.controller.solution import FAILED, INACCURATE, SOLVED
from pivoting.controller.wrench_bounds import (
    Stacked,
    begin_multiplier,
    farthest_exceeded,
    fill_heavier,
    next_multiplier,
    size_over,
)

ATTEMPTS, HELD = 30, 1e-10  # solves in which a bound is to be held, relative to it
HEAVIEST = 30.0  # of the weight: a bound that needs more is left to `BoundedSolver`
STATE = 13  # numbers of a state: position (3), quaternion (4), velocity (3), angular velocity (3), world axes


@kernel
def state_problem(belief, q, omega, q_d, omega_d, alpha_d, R, J, b):  # type: ignore[no-untyped-def]
    """Write the problem at one state: R (3, 3), J (nw, K d) and the required wrench b (nw,).

    Args:
        belief: the values of a `Belief`, without a set: what is not used here would be compiled for, all the same.
    """
    moved, held, (wrench_map, _), law = belief
    fill_rotation(q, R)
    fill_jacobian(R, held, wrench_map, J)
    fill_required(R, q, omega, q_d, omega_d, alpha_d, moved, held.pivot, held.offset, wrench_map, law, b)


@kernel
def state_cones(belief, q, omega, R, b, guard, planar):  # type: ignore[no-untyped-def]
    """Write the apexes and floors that all members of the believed set ask for, into a `Guard`.

    Args:
        belief: the values of a `Belief`, with a set.  b: (nw,) the required wrench.  R: (3, 3) scratch.
        planar: True for one contact in the plane, else None, so that the compiler leaves out what is not needed.

    Returns:
        How many members there are, and what had to be added [N].
    """
    moved, held, (wrench_map, _), _, unknown = belief
    fill_rotation(q, R)
    if planar is not None:
        return 1, move_planar_cone(R, omega, b, moved, held, wrench_map, unknown, guard)
    return move_cones(R, omega, b, moved, held, wrench_map, unknown, guard)


@subroutine
def contacts_of(held, i):  # type: ignore[no-untyped-def]
    """The `HeldContacts` of one world, among those of `belief.for_worlds`."""
    points, offsets, frames, turning, pivot, offset, mu, f_min, force_map, Q_f = held
    return HeldContacts(
        points[i], offsets[i], frames[i], turning, pivot[i], offset[i], mu[i], f_min[i], force_map, Q_f[i]
    )


@subroutine
def set_of(unknown, i):  # type: ignore[no-untyped-def]
    """The values of the `BelievedSet` of one world, among those of `belief.for_worlds`."""
    mass, com, inertia, about_contact, push, spin, axes, spread = unknown
    return mass[i], com[i], inertia[i], about_contact, push[i], spin[i], axes[i], spread[i]


@kernel
def step_worlds(  # type: ignore[no-untyped-def]
    beliefs, unknown, bounds, own, planar, several, tolerance, states, desired, external, out, status
):  # fmt: skip
    """Make, solve and certify the wrench problem of every world.

    Args:
        beliefs, unknown: of the worlds, or one that they share, and the sets in which they are believed to be, or None;
            see `belief.for_worlds`.
        bounds: the values of `WrenchBounds.stacked`, or None. One that is not on a rate is kept, as a heavier weight;
            where that needs more than `HEAVIEST` times the weight, or a second bound, the answer is that without any.
        own, planar, several: `WrenchController.workspace()`.
        tolerance: largest relative KKT residual of status 0 (solved).
        states: (W, 13 or more) measured states, see `STATE`, of which orientation and angular velocity are used.
        desired: (W, 10) orientation (4), angular velocity (3) and acceleration (3) of the reference now; (1, 10) if
            it is the same for all worlds.
        external: (W, nw) or (1, nw), known wrenches on the object other than those of gravity, the contacts and the
            controller, object axes.
        out: (W, 2 nw + K d + 1), written: required (nw), the right-hand side J f + w of the problem, less
            `external`, object axes; wrench (nw), object axes, nan where the status is 2 (failed: no finite answer);
            force (K d), contact axes; residual.
        status: (W,) int8, written: 0 solved, 1 inaccurate, 2 failed.
    """
    (masses, inertias, gravities), all_held, (wrench_map, weights), law = beliefs
    each, nw, last = masses.shape[0], wrench_map.shape[0], out.shape[1] - 1
    R, J, heavier, root, guard = own
    for i in range(states.shape[0]):
        mine = i % each
        moved, held, Q_w = (masses[mine], inertias[mine], gravities[mine]), contacts_of(all_held, mine), weights[mine]
        Q_f, mu, f_min = held.Q_f, held.mu, held.f_min
        j, b, wrench, force = i % desired.shape[0], out[i, :nw], out[i, nw : 2 * nw], out[i, 2 * nw : last]
        q, omega = states[i, 3:7], states[i, 10:13]
        fill_rotation(q, R)
        fill_jacobian(R, held, wrench_map, J)
        q_d, omega_d, alpha_d = desired[j, :4], desired[j, 4:7], desired[j, 7:10]
        fill_required(R, q, omega, q_d, omega_d, alpha_d, moved, held.pivot, held.offset, wrench_map, law, b)
        if unknown is not None and planar is not None:
            move_planar_cone(R, omega, b, moved, held, wrench_map, set_of(unknown, mine), guard)
        if unknown is not None and several is not None:
            members, _ = move_cones(R, omega, b, moved, held, wrench_map, set_of(unknown, mine), guard)
        for row in range(nw):
            b[row] -= external[i % external.shape[0], row]
        ball, multiplier, Q = -1, 0.0, Q_w
        for attempt in range(ATTEMPTS + 1):
            if bounds is not None:
                fill_heavier(Stacked(*bounds), ball, multiplier, Q_w, heavier)
                Q = heavier
            # Of what is None the compiler leaves the branch out, and all kernels that it calls.
            if planar is not None and unknown is None:
                residual = planar_wrench(J, b, Q, Q_f, mu, f_min, force, wrench, planar)
            if planar is not None and unknown is not None:
                residual = moved_planar_wrench(J, b, Q, Q_f, mu, guard, force, wrench, planar)
            if several is not None and unknown is None:
                residual = contact_wrench(J, b, Q, Q_f, mu, f_min, force, wrench, several)
            if several is not None and unknown is not None:
                tips = guard.apex[:members]
                residual = guarded_wrench(J, b, Q, Q_f, mu, guard.floor, tips, force, wrench, several, guard)
            if bounds is None:
                break
            if attempt == 0:
                ball = farthest_exceeded(Stacked(*bounds), wrench)
                if ball >= 0:
                    begin_multiplier(Stacked(*bounds), ball, Q_w, root)
            if ball < 0 or not np.isfinite(residual):
                break
            size = size_over(Stacked(*bounds), ball, wrench, wrench, 1.0)
            if abs(size - 1.0) <= HELD:
                residual = max(residual, abs(size - 1.0))
                break
            next_multiplier(root, size)
            multiplier = root[0]
            if attempt >= ATTEMPTS - 1 or not multiplier <= HEAVIEST * root[5]:  # out of reach: as without bounds
                ball = -1
        out[i, last] = residual
        if not np.isfinite(residual):
            status[i] = FAILED
            for row in range(nw):
                wrench[row] = np.nan
        else:
            status[i] = SOLVED if residual <= tolerance else INACCURATE


@kernel
def world_wrench(wrench_map, q, wrench, out):  # type: ignore[no-untyped-def]
    """Turn a wrench in object axes into force and torque at the CoM in WORLD axes, as `xfrc_applied` expects them.

    Args:
        wrench_map: (nw, 6), see `Space`.  q: (4,) object to world.  wrench: (nw,).
        out: (6,), written; zero if the wrench is not finite, because nothing is applied without an answer.
    """
    for half in (0, 3):
        a = b = c = 0.0
        for j in range(wrench_map.shape[0]):
            a += wrench_map[j, half] * wrench[j]
            b += wrench_map[j, half + 1] * wrench[j]
            c += wrench_map[j, half + 2] * wrench[j]
        a, b, c = turned(q[0], q[1], q[2], q[3], a, b, c)
        finite = np.isfinite(a + b + c)
        out[half], out[half + 1], out[half + 2] = (a, b, c) if finite else (0.0, 0.0, 0.0)


@kernel
def apply_wrenches(wrench_map, states, wrenches, first, out, xfrc, body):  # type: ignore[no-untyped-def]
    """Write the wrenches of W worlds, turned into world axes as by `world_wrench`, to the log and to MuJoCo.

    Args:
        states: (W, 13 or more), see `STATE`.
        wrenches: (W, at least nw), in the nw columns from `first` on.
        out: (W, 6) and xfrc: (W, bodies, 6), in the row `body`: written.
    """
    for i in range(out.shape[0]):
        world_wrench(wrench_map, states[i, 3:7], wrenches[i, first : first + wrench_map.shape[0]], out[i])
        for j in range(6):
            xfrc[i, body, j] = out[i, j]
