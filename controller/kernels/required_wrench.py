"""The wrench that a control law requires: contact forces and applied wrench have to make it together."""

from pivoting.controller.kernels.compilation import subroutine
from pivoting.controller.plane_and_space import component
from pivoting.controller.rotations import cross, into, rotation_error


@subroutine
def fill_required(R, q, omega, q_d, omega_d, alpha_d, moved, pivot, offset, wrench_map, law, out):  # type: ignore[no-untyped-def]
    """Write the required wrench (nw,), object axes, which contacts and applied wrench must make together.

    Args:
        R, q: (3, 3), (4,) orientation, object to world; omega: (3,) angular velocity, world axes [rad/s].
        q_d, omega_d, alpha_d: the reference's orientation, angular velocity and acceleration, likewise.
        moved, law: of a `Belief`.  pivot, offset: of its contacts.  wrench_map: (nw, 6), see `Space`.
    """
    feedforward, kp, kd, c = law
    mass, inertia, gravity = moved
    e0, e1, e2 = rotation_error(q, q_d)
    w0, w1, w2 = into(R, omega[0], omega[1], omega[2])
    v0, v1, v2 = into(R, omega_d[0], omega_d[1], omega_d[2])
    a0, a1, a2 = into(R, alpha_d[0], alpha_d[1], alpha_d[2])
    a0 = feedforward * a0 + kp * e0 + kd * (v0 - w0)
    a1 = feedforward * a1 + kp * e1 + kd * (v1 - w1)
    a2 = feedforward * a2 + kp * e2 + kd * (v2 - w2)
    # acceleration of the CoM on its arc about the pivot; of rho the turning part is -pivot
    r0, r1, r2 = -pivot[0], -pivot[1], -pivot[2]
    o0, o1, o2 = into(R, offset[0], offset[1], offset[2])
    t0, t1, t2 = cross(a0, a1, a2, r0 - o0, r1 - o1, r2 - o2)
    u0, u1, u2 = cross(w0, w1, w2, r0, r1, r2)
    n0, n1, n2 = cross(w0, w1, w2, u0, u1, u2)
    g0, g1, g2 = into(R, gravity[0], gravity[1], gravity[2])
    F0 = mass * (t0 + c * n0 - g0)
    F1 = mass * (t1 + c * n1 - g1)
    F2 = mass * (t2 + c * n2 - g2)
    L0 = inertia[0, 0] * w0 + inertia[0, 1] * w1 + inertia[0, 2] * w2
    L1 = inertia[1, 0] * w0 + inertia[1, 1] * w1 + inertia[1, 2] * w2
    L2 = inertia[2, 0] * w0 + inertia[2, 1] * w1 + inertia[2, 2] * w2
    k0, k1, k2 = cross(w0, w1, w2, L0, L1, L2)
    M0 = inertia[0, 0] * a0 + inertia[0, 1] * a1 + inertia[0, 2] * a2 + c * k0
    M1 = inertia[1, 0] * a0 + inertia[1, 1] * a1 + inertia[1, 2] * a2 + c * k1
    M2 = inertia[2, 0] * a0 + inertia[2, 1] * a1 + inertia[2, 2] * a2 + c * k2
    for row in range(wrench_map.shape[0]):
        out[row] = component(wrench_map, row, F0, F1, F2, M0, M1, M2)
