"""The least admissible contact force in the plane: what every member of an `Uncertainty` asks of one contact.

The contact sticks at P. With r from P to the true centre of mass, gravity g, the measured rate omega, and the moment
tau about P of all that is applied, Newton and Euler give the contact force of a member as f + d, where f is the force
that the controller reckons with, and

    d = kappa (tau + m r x g) r' - m omega^2 r - m g - F,   kappa = m / I_P,   r' = r turned by 90 degrees.

F is the force of the required wrench. The law fixes tau, so that d does not depend on the wrench that is looked for.
Every member asks that f is in a moved cone, and in the plane the intersection of moved cones is one moved cone. The
places of its edges and of its floor are the least values of mu d_n + d_t, mu d_n - d_t and d_n over the set.

For a set in (m, c, kappa) they are exact: each is affine in m and in kappa, and quadratic in r with a curvature that is
not positive in every direction, so that the least value over the box of c is on its boundary, an edge of which is a
parabola. For a set in the inertia about the centre of mass they are quotients of polynomials, which are bounded from
below by the least quotient of their Bernstein coefficients (Farin, "Curves and Surfaces for CAGD", rational forms).
"""

import numpy as np
from pivoting.controller.kernels.compilation import subroutine
from pivoting.controller.rotations import cross, into


@subroutine
def move_planar_cone(R, omega, b, moved, held, wrench_map, unknown, guard):  # type: ignore[no-untyped-def]
    """Write apex (1, 1, 2) and floor (1,) of the cone that all members ask for; returns how much too high it may be.

    Args:
        R: (3, 3) object to world.  omega: (3,) world axes [rad/s].  b: (3,) the required wrench, object axes.
        moved: the values of a `BelievedObject`.  held: `HeldContacts`.  wrench_map: (3, 6), see `Space`.
        unknown: the values of a `BelievedSet`, of one world.  guard: a `Guard`.
    """
    mass, inertia, gravity = moved
    normal = wrench_map[2, 3], wrench_map[2, 4], wrench_map[2, 5]
    t = held.frames[0, 0, 0], held.frames[0, 1, 0], held.frames[0, 2, 0]
    n = held.frames[0, 0, 2], held.frames[0, 1, 2], held.frames[0, 2, 2]
    if not held.turning[0]:
        t, n = into(R, *t), into(R, *n)
    F0 = b[0] * wrench_map[0, 0] + b[1] * wrench_map[1, 0]
    F1 = b[0] * wrench_map[0, 1] + b[1] * wrench_map[1, 1]
    F2 = b[0] * wrench_map[0, 2] + b[1] * wrench_map[1, 2]
    turning = _dot(into(R, omega[0], omega[1], omega[2]), normal)
    about = 0.0
    for i in range(3):
        for j in range(3):
            about += normal[i] * inertia[i, j] * normal[j]
    guard.floor[0], excess = planar_moved_cone(
        (normal, t, n), ((F0, F1, F2), b[2]), turning, (mass, about), held.pivot,
        into(R, gravity[0], gravity[1], gravity[2]), held.mu[0], held.f_min[0], unknown, (guard.corner, guard.ends),
        guard.apex[0, 0],
    )  # fmt: skip
    for axis in range(2):
        guard.tip[axis] = guard.apex[0, 0, axis]
    return excess


@subroutine
def planar_moved_cone(axes, b, omega, moved, pivot, gravity, mu, f_min, unknown, scratch, apex):  # type: ignore[no-untyped-def]
    """Write the apex (2,) of the moved cone; returns its floor [N], and how far each may be too high [N].

    Args:
        axes: (normal, t, n) of the plane and the contact, each three scalars, object axes; angles are about the normal.
        b: (F (3 scalars), moment about the normal) that is required, about the believed CoM, object axes.
        omega: [rad/s] about the normal.  moved: (mass, inertia about the normal and the CoM) as they are believed.
        pivot: (3,) of the contact from the believed CoM, object axes.  gravity: three scalars, object axes.
        mu, f_min: of the cone that each member asks for.  unknown: the values of a `BelievedSet`, of one world.
        scratch: (corner (4, 2), ends (3, 2)).
    """
    normal, t, n = axes
    corner, ends = scratch
    masses, com, scales, about_contact, push, spin, _, _ = unknown
    mass, inertia = moved
    turn = _dot(cross(*normal, *t), n)  # 1 if positive angles lead from t to n, else -1
    p_t, p_n = _dot((pivot[0], pivot[1], pivot[2]), t), _dot((pivot[0], pivot[1], pivot[2]), n)
    F_t, F_n = _dot(b[0], t), _dot(b[0], n)
    pull = turn * b[1] - (p_t * F_n - p_n * F_t), _dot(gravity, t), _dot(gravity, n)
    fill_corners(com, pivot, t, n, corner)
    ends[0, 0], ends[0, 1] = masses[0], masses[1]
    slow, fast = max(abs(omega) - spin, 0.0), abs(omega) + spin
    ends[2, 0], ends[2, 1] = slow * slow, fast * fast
    if about_contact:
        kappa = mass / (inertia + mass * (p_t * p_t + p_n * p_n))
        ends[1, 0], ends[1, 1] = kappa / scales[1], kappa / scales[0]
    else:
        most = 0.0
        for c in range(4):
            most = max(most, corner[c, 0] * corner[c, 0] + corner[c, 1] * corner[c, 1])
        ends[1, 0] = 1.0 / (scales[1] * inertia / masses[0] + most)
        ends[1, 1] = 1.0 / (scales[0] * inertia / masses[1] + _nearest(corner))
    excess, right, left, floor = 0.0, 0.0, 0.0, 0.0
    for row in range(3):
        a_t, a_n = (1.0 - row, mu) if row != 1 else (0.0, 1.0)  # mu d_n + d_t, d_n, mu d_n - d_t
        if about_contact:
            least, over = least_over_set(a_t, a_n, pull, ends, corner), 0.0
        else:
            least, over = least_by_bernstein(a_t, a_n, pull, ends, inertia, scales, corner)
        if push > 0.0:
            least -= push * greatest_push(a_t, a_n, ends, corner)
        least -= a_t * F_t + a_n * F_n
        excess = max(excess, over / a_n)
        if row == 0:
            right = least
        elif row == 1:
            floor = f_min - least
        else:
            left = least
    apex[0], apex[1] = 0.5 * (left - right), -0.5 * (right + left) / mu
    return floor, excess


@subroutine
def _dot(a, b):  # type: ignore[no-untyped-def]
    """The product of two vectors of three scalars."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@subroutine
def fill_corners(com, pivot, t, n, corner):  # type: ignore[no-untyped-def]
    """Write the corners of the box of the true CoM, from the contact, in its axes (t, n): corner (4, 2), in order.

    Args:
        com: (3, 2) the box, from the believed CoM, object axes [m].  pivot: (3,) the contact from there.
        t, n: the contact's axes, each three scalars, object axes.
    """
    for axis in range(2):
        a0, a1, a2 = t if axis == 0 else n
        middle = -(a0 * pivot[0] + a1 * pivot[1] + a2 * pivot[2])
        x = y = 0.0  # what the two sides of the box that lie in the plane contribute
        for side in range(3):
            along = a0 if side == 0 else (a1 if side == 1 else a2)
            middle += 0.5 * along * (com[side, 0] + com[side, 1])
            half = 0.5 * along * (com[side, 1] - com[side, 0])
            if side == 2:
                y += half
            else:
                x += half  # of the plane x-z the side along y is empty
        corner[0, axis], corner[1, axis] = middle - x - y, middle + x - y
        corner[2, axis], corner[3, axis] = middle + x + y, middle - x + y


@subroutine
def least_over_set(a_t, a_n, pull, ends, corner):  # type: ignore[no-untyped-def]
    """The least a . (d + F) over all (m, kappa, omega^2) of `ends` and all r of the polygon `corner`, exactly.

    Args:
        pull: (tau, g_t, g_n), see the head of this file.
        ends: (3, 2) of mass, kappa and omega^2.  corner: (4, 2) see `fill_corners`.
    """
    tau, g_t, g_n = pull
    least = np.inf
    for i in range(2):
        m = ends[0, i]
        if i == 1 and ends[0, 1] == ends[0, 0]:
            break
        for j in range(2):
            kappa = ends[1, j]
            if j == 1 and ends[1, 1] == ends[1, 0]:
                break
            for k in range(2):
                square = ends[2, k]
                if k == 1 and ends[2, 1] == ends[2, 0]:
                    break
                rest = m * (a_t * g_t + a_n * g_n)
                for edge in range(4):
                    r_t, r_n = corner[edge, 0], corner[edge, 1]
                    e_t, e_n = corner[(edge + 1) % 4, 0] - r_t, corner[(edge + 1) % 4, 1] - r_n
                    lever, torque = a_n * r_t - a_t * r_n, tau + m * (r_t * g_n - r_n * g_t)
                    slope, more = a_n * e_t - a_t * e_n, m * (e_t * g_n - e_n * g_t)
                    start = kappa * torque * lever - m * square * (a_t * r_t + a_n * r_n) - rest
                    rise = kappa * (torque * slope + more * lever) - m * square * (a_t * e_t + a_n * e_n)
                    bend = kappa * more * slope
                    least = min(least, start)  # the end is where the next edge starts
                    if 0.0 < -rise < 2.0 * bend:
                        least = min(least, start - 0.25 * rise * rise / bend)
    return least


@subroutine
def least_by_bernstein(a_t, a_n, pull, ends, inertia, scales, corner):  # type: ignore[no-untyped-def]
    """A lower bound on a . (d + F) for a set in the inertia about the CoM, and how much too low it may be.

    Args:
        inertia: about the CoM, as it is believed.  scales: (2,) of it.  Others: as `least_over_set`, without kappa.
    """
    tau, g_t, g_n = pull
    m_0, m_1 = ends[0, 0], ends[0, 1]
    r_t, r_n = corner[0, 0], corner[0, 1]  # r = r_0 + x e + y u, with x and y in [0, 1]
    e_t, e_n, u_t, u_n = corner[1, 0] - r_t, corner[1, 1] - r_n, corner[3, 0] - r_t, corner[3, 1] - r_n
    lever, lever_x, lever_y = a_n * r_t - a_t * r_n, a_n * e_t - a_t * e_n, a_n * u_t - a_t * u_n
    arm, arm_x, arm_y = r_t * g_n - r_n * g_t, e_t * g_n - e_n * g_t, u_t * g_n - u_n * g_t
    square, square_x, square_y = r_t * r_t + r_n * r_n, r_t * e_t + r_n * e_n, r_t * u_t + r_n * u_n
    weight = a_t * g_t + a_n * g_n
    bound = np.inf
    for i in range(3):
        x, xx = 0.5 * i, 0.5 * i * (i - 1.0)  # Bernstein coefficients of x and x^2, of degree 2
        for j in range(3):
            y, yy = 0.5 * j, 0.5 * j * (j - 1.0)
            # of a x r, of (r x g)(a x r), and of |r|^2; e and u are at right angles
            b = lever + lever_x * x + lever_y * y
            gb = arm * b + arm_x * (lever * x + lever_x * xx + lever_y * x * y)
            gb += arm_y * (lever * y + lever_x * x * y + lever_y * yy)
            rho = square + 2.0 * (square_x * x + square_y * y)
            rho += (e_t * e_t + e_n * e_n) * xx + (u_t * u_t + u_n * u_n) * yy
            for s in range(2):
                own = scales[s] * inertia
                for k in range(3):
                    m, mm = m_0 + 0.5 * k * (m_1 - m_0), m_0 * m_0 if k == 0 else (m_0 * m_1 if k == 1 else m_1 * m_1)
                    below = own + m * rho
                    value = (m * tau * b + mm * gb - weight * (m * own + mm * rho)) / below
                    if not below > 0.0:  # the box is too large for a bound of this kind
                        value = -np.inf
                    bound = min(bound, value)
    spin = np.inf
    for c in range(4):
        for k in range(4):
            m, turning = ends[0, k % 2], ends[2, k // 2]
            spin = min(spin, -m * turning * (a_t * corner[c, 0] + a_n * corner[c, 1]))
    at_once = np.inf  # of members, so that the least value is not greater
    for c in range(4):
        for k in range(8):
            m, turning, own = ends[0, k % 2], ends[2, k // 2 % 2], scales[k // 4] * inertia
            p_t, p_n = corner[c, 0], corner[c, 1]
            kappa = m / (own + m * (p_t * p_t + p_n * p_n))
            value = kappa * (tau + m * (p_t * g_n - p_n * g_t)) * (a_n * p_t - a_t * p_n) - m * weight
            at_once = min(at_once, value - m * turning * (a_t * p_t + a_n * p_n))
    return bound + spin, at_once - bound - spin


@subroutine
def _nearest(corner):  # type: ignore[no-untyped-def]
    """A lower bound of |r|^2 over the polygon: the middle less half a diagonal."""
    c_t, c_n = 0.5 * (corner[0, 0] + corner[2, 0]), 0.5 * (corner[0, 1] + corner[2, 1])
    half = 0.0
    for c in range(2):
        half = max(half, np.hypot(corner[c, 0] - c_t, corner[c, 1] - c_n))
    nearest = max(np.hypot(c_t, c_n) - half, 0.0)
    return nearest * nearest


@subroutine
def greatest_push(a_t, a_n, ends, corner):  # type: ignore[no-untyped-def]
    """The most that a push of 1 N/kg at the true CoM, in any direction, can take from a . d, bounded from above.

    The push s adds m s . (kappa (a x r) r' - a). This is convex in kappa, and quadratic in r, so that all its values
    are in the convex hull of those of its polar form at pairs of corners.
    """
    most = 0.0
    for j in range(2):
        kappa = ends[1, j]
        for c in range(4):
            for e in range(c + 1):
                lever_c = a_n * corner[c, 0] - a_t * corner[c, 1]
                lever_e = a_n * corner[e, 0] - a_t * corner[e, 1]
                x = -0.5 * kappa * (lever_c * corner[e, 1] + lever_e * corner[c, 1]) - a_t
                y = 0.5 * kappa * (lever_c * corner[e, 0] + lever_e * corner[c, 0]) - a_n
                most = max(most, x * x + y * y)
    return ends[0, 1] * np.sqrt(most)
