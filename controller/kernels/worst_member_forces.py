"""The contact forces of the members of an `Uncertainty`, in space or with several contacts.

With f the contact forces that the controller reckons with, those of a member are f + d. The members at the ends of all
intervals are taken one by one. In between, d differs from what interpolates it along one coordinate by at most what it
does halfway, if it is a parabola there. Only what leads out of the friction cone counts, and each coordinate adds its
own: where nothing has to be added, the members at the ends are all that matters.

In mass and centre of mass, with the inertia about the contact, d is of degree 2 at most in each coordinate, and whether
it leads out along a coordinate of the centre of mass is the same all over the set. How much is added is taken halfway
of all intervals, and half as much again: an estimate, not a proof.

Several contacts share a member's wrench as the pseudoinverse does, without squeezing each other. That an admissible
force exists for every member is thereby guaranteed (weak stability, Pang and Trinkle 2000); that every force that
satisfies the equations is admissible (strong stability) is not, since nothing determines the squeeze.
"""

import numpy as np
from pivoting.controller.kernels.compilation import subroutine
from pivoting.controller.rotations import cross, into

COORDINATES = 5  # of a member: mass, inertia, and three of the centre of mass
MORE = 1.5  # times what is found in the middle of the set


@subroutine
def move_cones(R, omega, b, moved, held, wrench_map, unknown, guard):  # type: ignore[no-untyped-def]
    """Write the apexes (V, K, d) and floors (K,) that all members ask for; returns V, and what was added [N].

    Args:
        R: (3, 3) object to world.  omega: (3,) world axes [rad/s].  b: (nw,) the required wrench, object axes.
        moved: the values of a `BelievedObject`.  held: `HeldContacts`.  wrench_map: (nw, 6), see `Space`.
        unknown: the values of a `BelievedSet`, of one world.  guard: a `Guard`.
    """
    masses, com, scales, about_contact, push, spin, axes, spread = unknown
    apex, floor, place, state, frame = guard.apex, guard.floor, guard.place, guard.state, guard.frame
    tensor, force, lifted = guard.tensor, guard.force, guard.lifted
    K, dim = held.mu.shape[0], held.force_map.shape[1]
    case = masses, com, scales, about_contact, moved[0], moved[1], held.pivot, axes, spread
    _fill_state(R, omega, b, moved, held, wrench_map, state, frame)
    V = 1
    for i in range(COORDINATES):
        if _widened(case, i):
            V *= 2
    for k in range(K):
        floor[k] = -np.inf
    for v in range(V):
        _place(case, v, -1, place)
        _forces(place, case, state, frame, tensor, force)
        for k in range(K):
            for j in range(dim):
                apex[v, k, j] = -force[k, j]
            floor[k] = max(floor[k], held.f_min[k] - force[k, dim - 1])
    added = _add_bends(case, state, frame, tensor, place, force, held.mu, apex[:V], floor)
    sway = push + _spun(case, state, spin)
    if sway > 0.0:
        for k in range(K):
            frame[k, 4, 0] = 0.0
        for v in range(V):
            _place(case, v, -1, place)
            _fill_push(place, case, state, frame, tensor, force, lifted)
            for k in range(K):
                apex[v, k, dim - 1] += sway * (lifted[k, 0] / held.mu[k] + lifted[k, 1])
                frame[k, 4, 0] = max(frame[k, 4, 0], lifted[k, 1])
        for k in range(K):
            floor[k] += sway * frame[k, 4, 0]
    return V, added


@subroutine
def _fill_state(R, omega, b, moved, held, wrench_map, state, frame):  # type: ignore[no-untyped-def]
    """Write force and moment about the pivot that are required, omega and gravity, and the frames, in object axes."""
    for i in range(3):
        F = M = 0.0
        for row in range(wrench_map.shape[0]):
            F += b[row] * wrench_map[row, i]
            M += b[row] * wrench_map[row, 3 + i]
        state[0, i], state[1, i] = F, M
    p, gravity = held.pivot, moved[2]
    m0, m1, m2 = cross(p[0], p[1], p[2], state[0, 0], state[0, 1], state[0, 2])
    state[1, 0], state[1, 1], state[1, 2] = state[1, 0] - m0, state[1, 1] - m1, state[1, 2] - m2
    state[2, 0], state[2, 1], state[2, 2] = into(R, omega[0], omega[1], omega[2])
    state[3, 0], state[3, 1], state[3, 2] = into(R, gravity[0], gravity[1], gravity[2])
    for k in range(frame.shape[0]):
        for j in range(3):
            a, c, d = held.frames[k, 0, j], held.frames[k, 1, j], held.frames[k, 2, j]
            if not held.turning[k]:
                a, c, d = into(R, a, c, d)
            frame[k, j, 0], frame[k, j, 1], frame[k, j, 2] = a, c, d


@subroutine
def _widened(case, i):  # type: ignore[no-untyped-def]
    """Whether coordinate i of the members is an interval."""
    masses, com, scales = case[0], case[1], case[2]
    if i == 0:
        return masses[1] > masses[0]
    if i == 1:
        return scales[1] > scales[0]
    return com[i - 2, 1] > com[i - 2, 0]


@subroutine
def _place(case, v, middle, place):  # type: ignore[no-untyped-def]
    """Write the shares (5,) of the way through the intervals of vertex v, of coordinate `middle` a half."""
    bit = 0
    for i in range(COORDINATES):
        place[i] = 0.0
        if _widened(case, i):
            place[i] = 0.5 if i == middle else float((v >> bit) & 1)
            bit += 1


@subroutine
def _forces(place, case, state, frame, tensor, out):  # type: ignore[no-untyped-def]
    """Write d (K, d) of one member, contact axes [N]; see the head of this file."""
    masses, com, scales, about_contact, mass, inertia, p, axes, spread = case
    m = masses[0] + place[0] * (masses[1] - masses[0])
    scale = scales[0] + place[1] * (scales[1] - scales[0])
    r0 = com[0, 0] + place[2] * (com[0, 1] - com[0, 0]) - p[0]
    r1 = com[1, 0] + place[3] * (com[1, 1] - com[1, 0]) - p[1]
    r2 = com[2, 0] + place[4] * (com[2, 1] - com[2, 0]) - p[2]
    if about_contact:  # of its inverse d is a polynomial
        scale = 1.0 / ((1.0 - place[1]) / scales[0] + place[1] / scales[1])
        _fill_tensor(scale, inertia, scale * mass, p[0], p[1], p[2], tensor)
    else:
        _fill_tensor(scale, inertia, m, r0, r1, r2, tensor)
    w0, w1, w2, g0, g1, g2 = state[2, 0], state[2, 1], state[2, 2], state[3, 0], state[3, 1], state[3, 2]
    L0 = tensor[0, 0] * w0 + tensor[0, 1] * w1 + tensor[0, 2] * w2
    L1 = tensor[1, 0] * w0 + tensor[1, 1] * w1 + tensor[1, 2] * w2
    L2 = tensor[2, 0] * w0 + tensor[2, 1] * w1 + tensor[2, 2] * w2
    k0, k1, k2 = cross(w0, w1, w2, L0, L1, L2)
    t0, t1, t2 = cross(m * r0, m * r1, m * r2, g0, g1, g2)
    t0, t1, t2 = state[1, 0] + t0 - k0, state[1, 1] + t1 - k1, state[1, 2] + t2 - k2
    a0, a1, a2 = _turned_by(tensor, axes, t0, t1, t2)
    u0, u1, u2 = cross(w0, w1, w2, r0, r1, r2)
    n0, n1, n2 = cross(w0, w1, w2, u0, u1, u2)
    c0, c1, c2 = cross(a0, a1, a2, r0, r1, r2)
    F0, F1, F2 = m * (c0 + n0 - g0) - state[0, 0], m * (c1 + n1 - g1) - state[0, 1], m * (c2 + n2 - g2) - state[0, 2]
    M0, M1, M2 = cross(p[0], p[1], p[2], F0, F1, F2)
    M0 += tensor[0, 0] * a0 + tensor[0, 1] * a1 + tensor[0, 2] * a2 - t0
    M1 += tensor[1, 0] * a0 + tensor[1, 1] * a1 + tensor[1, 2] * a2 - t1
    M2 += tensor[2, 0] * a0 + tensor[2, 1] * a1 + tensor[2, 2] * a2 - t2
    dim = out.shape[1]
    for k in range(out.shape[0]):
        for j in range(dim):
            out[k, j] = 0.0
        for i in range(3):
            row = spread[3 * k + i]
            part = row[0] * F0 + row[1] * F1 + row[2] * F2 + row[3] * M0 + row[4] * M1 + row[5] * M2
            out[k, 0] += frame[k, 0, i] * part
            out[k, dim - 1] += frame[k, 2, i] * part
            if dim == 3:
                out[k, 1] += frame[k, 1, i] * part


@subroutine
def _fill_tensor(scale, inertia, m, r0, r1, r2, out):  # type: ignore[no-untyped-def]
    """Write scale times the inertia about the CoM plus m (|r|^2 1 - r r') into out (3, 3)."""
    square = m * (r0 * r0 + r1 * r1 + r2 * r2)
    r = r0, r1, r2
    for i in range(3):
        for j in range(3):
            out[i, j] = scale * inertia[i, j] - m * r[i] * r[j]
        out[i, i] += square


@subroutine
def _turned_by(I, axes, t0, t1, t2):  # type: ignore[no-untyped-def]  # noqa: E741
    """The angular acceleration by a torque, of an object with inertia I (3, 3) that is free about axes (A, 3)."""
    if axes.shape[0] == 0:
        return 0.0, 0.0, 0.0
    if axes.shape[0] == 1:
        e0, e1, e2 = axes[0, 0], axes[0, 1], axes[0, 2]
        own = e0 * (I[0, 0] * e0 + I[0, 1] * e1 + I[0, 2] * e2) + e1 * (I[1, 0] * e0 + I[1, 1] * e1 + I[1, 2] * e2)
        own += e2 * (I[2, 0] * e0 + I[2, 1] * e1 + I[2, 2] * e2)
        a = (e0 * t0 + e1 * t1 + e2 * t2) / own
        return a * e0, a * e1, a * e2
    x0, x1, x2 = cross(I[1, 0], I[1, 1], I[1, 2], I[2, 0], I[2, 1], I[2, 2])  # columns of the adjugate
    y0, y1, y2 = cross(I[2, 0], I[2, 1], I[2, 2], I[0, 0], I[0, 1], I[0, 2])
    z0, z1, z2 = cross(I[0, 0], I[0, 1], I[0, 2], I[1, 0], I[1, 1], I[1, 2])
    inverse = 1.0 / (I[0, 0] * x0 + I[0, 1] * x1 + I[0, 2] * x2)
    return (
        inverse * (x0 * t0 + y0 * t1 + z0 * t2),
        inverse * (x1 * t0 + y1 * t1 + z1 * t2),
        inverse * (x2 * t0 + y2 * t1 + z2 * t2),
    )


@subroutine
def _spun(case, state, spin):  # type: ignore[no-untyped-def]
    """The push [N/kg] that an error of the angular velocity amounts to, at most."""
    mass, inertia, p = case[4], case[5], case[6]
    arm, own = np.sqrt(p[0] ** 2 + p[1] ** 2 + p[2] ** 2), 0.0
    for i in range(3):
        for j in range(3):
            own += inertia[i, j] * inertia[i, j]
    rate = np.sqrt(state[2, 0] ** 2 + state[2, 1] ** 2 + state[2, 2] ** 2)
    return (2.0 * rate * spin + spin * spin) * (2.0 * arm + np.sqrt(own) / (mass * arm))


@subroutine
def _fill_push(place, case, state, frame, tensor, force, lifted):  # type: ignore[no-untyped-def]
    """Write how much a push of 1 N/kg changes the forces along and across the contacts (K, 2) at most.

    It acts like gravity: the forces are linear in it, and the changes are bounded by their Frobenius norms.
    """
    K, dim = force.shape
    _forces(place, case, state, frame, tensor, force)
    for k in range(K):
        lifted[k, 0] = lifted[k, 1] = 0.0
        for j in range(dim):
            frame[k, 3, j] = force[k, j]
    for i in range(3):
        state[3, i] += 1.0
        _forces(place, case, state, frame, tensor, force)
        state[3, i] -= 1.0
        for k in range(K):
            for j in range(dim):
                change = force[k, j] - frame[k, 3, j]
                lifted[k, 1 if j == dim - 1 else 0] += change * change
    for k in range(K):
        lifted[k, 0], lifted[k, 1] = np.sqrt(lifted[k, 0]), np.sqrt(lifted[k, 1])


@subroutine
def _add_bends(case, state, frame, tensor, place, force, mu, apex, floor):  # type: ignore[no-untyped-def]
    """Raise all cones and floors by what the forces bend out of them between the vertices; returns the most [N].

    Args:
        apex: (V, K, d) of the vertices.
    """
    K, dim = force.shape
    worst = 0.0
    for k in range(K):
        frame[k, 4, 0] = frame[k, 4, 1] = 0.0
    for i in range(COORDINATES):
        if not _widened(case, i):
            continue
        for step in range(3):  # halfway, less what interpolates it there
            for c in range(COORDINATES):
                place[c] = 0.5
            place[i] = 0.5 * step
            _forces(place, case, state, frame, tensor, force)
            share = 1.0 if step == 1 else -0.5
            for k in range(K):
                for j in range(dim):
                    frame[k, 3, j] = share * force[k, j] + (frame[k, 3, j] if step > 0 else 0.0)
        for k in range(K):
            across = np.hypot(frame[k, 3, 0], frame[k, 3, 1]) if dim == 3 else abs(frame[k, 3, 0])
            frame[k, 4, 0] += MORE * max(across / mu[k] - frame[k, 3, dim - 1], 0.0)
            frame[k, 4, 1] += MORE * max(-frame[k, 3, dim - 1], 0.0)
    for k in range(K):
        worst = max(worst, frame[k, 4, 0])
        for v in range(apex.shape[0]):
            apex[v, k, dim - 1] += frame[k, 4, 0]
        floor[k] += frame[k, 4, 1]
    return worst
