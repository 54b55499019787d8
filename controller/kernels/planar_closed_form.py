"""The optimum for one contact in the plane, in closed form.

Eliminating w = b - J f leaves  min 1/2 f'H f - h'f  over the truncated cone {|f_t| <= mu f_n, f_n >= f_min}, with
H = Q_f + J'Q_w J (positive definite because Q_f is) and h = J'Q_w b: strictly convex and never infeasible, since
f = (0, f_min) is in the cone whatever b is. This is erratum 6 of the notes: eliminate w, not f.
"""

import numpy as np
from pivoting.controller.kernels.compilation import kernel, subroutine
from pivoting.controller.kernels.workspace import Reduced
from pivoting.controller.kkt_residual import kkt_residual

SMALL = 1e-15  # relative optimality at which a candidate is taken without looking at the others


@subroutine
def reduce(J, b, Q_w, Q_f, H, h, row):  # type: ignore[no-untyped-def]
    """Write H = Q_f + J'Q_w J (n, n) and h = J'Q_w b (n,) of the problem in f alone; row (n,) is scratch.

    Returns the sum of their entries, which is finite where the problem is.
    """
    nw, n = J.shape
    for j in range(n):
        h[j] = 0.0
        for i in range(j + 1):
            H[i, j] = 0.5 * (Q_f[i, j] + Q_f[j, i])
    for p in range(nw):
        for j in range(n):
            row[j] = 0.0
        for q in range(nw):  # row p of Q_w J, along rows of J: contiguous, so that it vectorises
            weight = Q_w[p, q]
            for j in range(n):
                row[j] += weight * J[q, j]
        for j in range(n):
            h[j] += row[j] * b[p]
        for i in range(n):
            left = J[p, i]
            for j in range(i, n):
                H[i, j] += left * row[j]
    total = 0.0
    for j in range(n):
        total += h[j] + H[j, j]
        for i in range(j):
            H[j, i] = H[i, j]
            total += H[i, j]
    return total


@subroutine
def _gradient(H, h, t, n):  # type: ignore[no-untyped-def]
    """H f - h at f = (t, n)."""
    return H[0, 0] * t + H[0, 1] * n - h[0], H[1, 0] * t + H[1, 1] * n - h[1]


@subroutine
def _violation(H, h, mu, f_min, t, n):  # type: ignore[no-untyped-def]
    """How far a feasible (t, n) is from optimal: the gradient's distance from the dual cone, and the gap."""
    z_t, z_n = _gradient(H, h, t, n)
    slack = z_n - mu * abs(z_t)
    scale = max(abs(h[0]), abs(h[1]), abs(H[0, 0] * t), abs(H[0, 1] * n), abs(H[1, 0] * t), abs(H[1, 1] * n))
    if scale == 0.0:
        return 0.0
    size = max(abs(t), n, f_min)
    gap = z_t * t + z_n * n - f_min * slack
    return max(-slack / scale, abs(gap) / (scale * size) if size > 0.0 else 0.0)


@subroutine
def planar_force(H, h, mu, f_min, f):  # type: ignore[no-untyped-def]
    """Write the minimiser (f_t, f_n) of 1/2 f'H f - h'f over {|f_t| <= mu f_n, f_n >= f_min} into f (2,).

    The optimum lies inside, on one of the two edges, or on the floor between them (with f_min = 0 the floor is the
    apex). Each piece has a closed form. The candidate that satisfies the optimality conditions best is the answer, so
    that the choice is as exact as the certificate itself.
    """
    det = H[0, 0] * H[1, 1] - H[0, 1] * H[0, 1]
    t = (h[0] * H[1, 1] - h[1] * H[0, 1]) / det
    n = (h[1] * H[0, 0] - h[0] * H[0, 1]) / det
    g_t, g_n = _gradient(H, h, t, n)  # one step of refinement: H may be ill conditioned
    t -= (g_t * H[1, 1] - g_n * H[0, 1]) / det
    n -= (g_n * H[0, 0] - g_t * H[0, 1]) / det
    if abs(t) <= mu * n and n >= f_min:
        f[0], f[1] = t, n
        return
    best = np.inf
    for piece in range(3):
        if piece < 2:  # the edges f = s (+-mu, 1), s >= f_min; first the one on the side of the free minimum
            m = mu if (t >= 0.0) == (piece == 0) else -mu
            curvature = m * m * H[0, 0] + 2.0 * m * H[0, 1] + H[1, 1]
            s = (m * h[0] + h[1]) / curvature
            g_t, g_n = _gradient(H, h, m * s, s)
            s = max(s - (m * g_t + g_n) / curvature, f_min)
            at_t, at_n = m * s, s
        else:  # the floor f_n = f_min
            at_t = (h[0] - H[0, 1] * f_min) / H[0, 0]
            at_t, at_n = min(max(at_t, -mu * f_min), mu * f_min), f_min
        violation = _violation(H, h, mu, f_min, at_t, at_n)
        if violation < best:
            best = violation
            f[0], f[1] = at_t, at_n
            if best <= SMALL:
                return
    if not np.isfinite(best):
        f[0] = f[1] = np.nan


@subroutine
def balancing_wrench(J, b, f, w):  # type: ignore[no-untyped-def]
    """Write w = b - J f, the only wrench that balances given contact forces."""
    for i in range(J.shape[0]):
        s = b[i]
        for j in range(J.shape[1]):
            s -= J[i, j] * f[j]
        w[i] = s


@subroutine
def state_from_tip(J, b, Q_f, f_min, guard):  # type: ignore[no-untyped-def]
    """State a problem in f - a, a being the cones' tip (n,): the wrench that is left, the linear cost, the floors.

    Args:
        f_min: (K,) floors [N], from 0.  guard: a `Guard`, with the tip; left, linear and height are written.
    """
    a, height, left, linear = guard.tip, guard.height, guard.left, guard.linear
    nw, n = J.shape
    for i in range(nw):
        left[i] = b[i]
        for j in range(n):
            left[i] -= J[i, j] * a[j]
    for i in range(n):
        linear[i] = 0.0
        for j in range(n):
            linear[i] += Q_f[i, j] * a[j]
    K = f_min.shape[0]
    for c in range(K):
        height[c] = max(f_min[c] - a[(c + 1) * (n // K) - 1], 0.0)


@kernel
def planar_wrench(J, b, Q_w, Q_f, mu, f_min, f, w, scratch, linear=None):  # type: ignore[no-untyped-def]
    """Solve one contact in the plane, like `contact_wrench`; scratch contains the values of a `Reduced`."""
    work = Reduced(*scratch)
    reduce(J, b, Q_w, Q_f, work.H, work.h, work.x)
    if linear is not None:
        for j in range(2):
            work.h[j] -= linear[j]
    planar_force(work.H, work.h, mu[0], f_min[0], f)
    balancing_wrench(J, b, f, w)
    return kkt_residual(J, b, Q_w, Q_f, mu, f_min, w, f, work.pull, linear)


@subroutine
def moved_planar_wrench(J, b, Q_w, Q_f, mu, guard, f, w, scratch):  # type: ignore[no-untyped-def]
    """The same for a cone whose tip and floor are in `guard`, a `Guard`."""
    state_from_tip(J, b, Q_f, guard.floor, guard)
    residual = planar_wrench(J, guard.left, Q_w, Q_f, mu, guard.height, f, w, scratch, guard.linear)
    f[0], f[1] = f[0] + guard.tip[0], f[1] + guard.tip[1]
    return residual
