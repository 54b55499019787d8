"""One step of the interior-point method: Nesterov-Todd scaling, the affine step and the corrected step.

See `interior_point`. Cone i is one of contact `work.of[i]`; the first of each contact is number i of both, and has the
floor. The scaling W of a cone is such that W y = W^-1 s = lam.
"""

import numpy as np
from pivoting.controller.kernels.cholesky import factor, solve_factored
from pivoting.controller.kernels.compilation import subroutine
from pivoting.controller.kernels.workspace import DP, DQ, C, P, Q


@subroutine
def predict(mu, f_min, axes, work):  # type: ignore[no-untyped-def]
    """The affine (predictor) step: factor M = H + A'W^-2 A and solve M x = -g; returns the share that can be taken."""
    H, M, x, g, n = work.H, work.M, work.x, work.g, work.x.shape[0]
    for i in range(n):
        x[i] = -g[i]
        for j in range(i, n):
            M[i, j] = H[i, j]
    _scale(mu, f_min, axes, work)
    factor(M, n)
    solve_factored(M, x, n)
    return min(1.0, _step_length(mu, f_min, axes, False, work))


@subroutine
def correct(mu, f_min, axes, target, second, work):  # type: ignore[no-untyped-def]
    r"""The corrected step, from the affine: c = lam \ (target e - second (W^-1 ds) o (W dy)), and M x = -g + A'W^-1 c.

    Returns the share of the step that is taken.
    """
    dim = len(axes)
    x, g, u, lam, c, bar, floor = work.x, work.g, work.u, work.lam, work.c, work.bar, work.floor
    for i in range(x.shape[0]):
        x[i] = -g[i]
    for i in range(lam.shape[0]):
        k = work.of[i]
        t, e = k * dim, (k + 1) * dim - 1
        l0, l1, l2 = lam[i, 0], lam[i, 1], lam[i, 2]
        u0, u1, u2 = u[i, 0], u[i, 1], u[i, 2]
        v0, v1, v2 = -l0 - u0, -l1 - u1, -l2 - u2
        d0 = target - second * (u0 * v0 + u1 * v1 + u2 * v2)
        d1, d2 = -second * (u0 * v1 + v0 * u1), -second * (u0 * v2 + v0 * u2)
        c0 = (l0 * d0 - l1 * d1 - l2 * d2) / lam[i, 3]
        inverse = 1.0 / l0
        c1, c2 = (d1 - c0 * l1) * inverse, (d2 - c0 * l2) * inverse
        c[i, 0], c[i, 1], c[i, 2] = c0, c1, c2
        c0, c1, c2 = _unscale(bar[i, 0], bar[i, 1], bar[i, 2], bar[i, 3], c0, c1, c2)
        x[e], x[t] = x[e] + mu[k] * c0, x[t] + c1
        if dim == 3:
            x[t + 1] += c2
        if i < mu.shape[0] and f_min[k] > 0.0:
            floor[i, C] = (target - second * floor[i, DP] * floor[i, DQ]) / floor[i, P]
            x[e] += floor[i, C]
    solve_factored(work.M, x, x.shape[0])
    return min(1.0, 0.99 * _step_length(mu, f_min, axes, True, work))


@subroutine
def _scale(mu, f_min, axes, work):  # type: ignore[no-untyped-def]
    """The Nesterov-Todd scaling W y = W^-1 s = lam of every cone, and M += A'W^-2 A block by block.

    W^2 = eta^2 (2 b b' - diag(1, -1, -1)), so W^-2 = (2 v v' - diag(1, -1, -1)) / eta^2 with v = (b_0, -b_1, -b_2).
    """
    dim = len(axes)
    M, s, y, bar, lam, floor = work.M, work.s, work.y, work.bar, work.lam, work.floor
    for i in range(lam.shape[0]):
        k = work.of[i]
        s0, s1, s2, y0, y1, y2 = s[i, 0], s[i, 1], s[i, 2], y[i, 0], y[i, 1], y[i, 2]
        size_s, size_y = np.sqrt(_determinant(s0, s1, s2)), np.sqrt(_determinant(y0, y1, y2))
        eta2 = size_s / size_y
        # (s / size_s + J y / size_y) / (2 gamma)
        half = 0.5 / np.sqrt(0.5 + 0.5 * (s0 * y0 + s1 * y1 + s2 * y2) / (size_s * size_y))
        in_s, in_y = half / size_s, half / size_y
        b0, b1, b2 = s0 * in_s + y0 * in_y, s1 * in_s - y1 * in_y, s2 * in_s - y2 * in_y
        eta = np.sqrt(eta2)
        l0, l1, l2 = _unscale(b0, b1, b2, eta, s0, s1, s2)
        bar[i, 0], bar[i, 1], bar[i, 2], bar[i, 3] = b0, b1, b2, eta
        lam[i, 0], lam[i, 1], lam[i, 2], lam[i, 3] = l0, l1, l2, size_s * size_y
        t, e = k * dim, (k + 1) * dim - 1
        scale = 1.0 / eta2
        head, double = mu[k] * b0, 2.0 * scale
        M[t, t] += scale + double * b1 * b1
        M[t, e] -= double * b1 * head
        if dim == 3:
            M[t, t + 1] += double * b1 * b2
            M[t + 1, t + 1] += scale + double * b2 * b2
            M[t + 1, e] -= double * b2 * head
        M[e, e] += double * head * head - scale * mu[k] * mu[k]
        if i < mu.shape[0] and f_min[k] > 0.0:
            M[e, e] += floor[i, Q] / floor[i, P]


@subroutine
def _step_length(mu, f_min, axes, corrected, work):  # type: ignore[no-untyped-def]
    """The steps that belong to the step x of f, and how far (<= 2) they may be followed to the first boundary.

    u = W^-1 ds and W dy = c - lam - u, with c = 0 in the predictor, whose length is only a measure and is taken in the
    scaled cones; the corrector's is taken in the cones themselves and dy is written into c.
    """
    dim = len(axes)
    x, s, y, bar, lam, u, c, floor = work.x, work.s, work.y, work.bar, work.lam, work.u, work.c, work.floor
    alpha = 2.0
    for i in range(lam.shape[0]):
        k = work.of[i]
        t, e = k * dim, (k + 1) * dim - 1
        s0, s1, s2 = mu[k] * x[e], x[t], x[t + 1] if dim == 3 else 0.0
        u0, u1, u2 = _unscale(bar[i, 0], bar[i, 1], bar[i, 2], bar[i, 3], s0, s1, s2)
        l0, l1, l2 = lam[i, 0], lam[i, 1], lam[i, 2]
        if corrected:
            y0, y1, y2 = _unscale(bar[i, 0], bar[i, 1], bar[i, 2], bar[i, 3], c[i, 0] - u0, c[i, 1] - u1, c[i, 2] - u2)
            y0, y1, y2 = y0 - y[i, 0], y1 - y[i, 1], y2 - y[i, 2]  # W^-1 lam = y: take it exactly
            c[i, 0], c[i, 1], c[i, 2] = y0, y1, y2
            alpha = min(alpha, _reach(s[i, 0], s[i, 1], s[i, 2], s0, s1, s2))
            alpha = min(alpha, _reach(y[i, 0], y[i, 1], y[i, 2], y0, y1, y2))
        else:
            u[i, 0], u[i, 1], u[i, 2] = u0, u1, u2
            alpha = min(alpha, _reach(l0, l1, l2, u0, u1, u2))
            alpha = min(alpha, _reach(l0, l1, l2, -l0 - u0, -l1 - u1, -l2 - u2))
        if i < mu.shape[0] and f_min[k] > 0.0:
            dp = x[e]
            dq = -floor[i, Q] * (1.0 + dp / floor[i, P])
            if corrected:
                dq += floor[i, C]
            floor[i, DP], floor[i, DQ] = dp, dq
            if dp < 0.0:
                alpha = min(alpha, -floor[i, P] / dp)
            if dq < 0.0:
                alpha = min(alpha, -floor[i, Q] / dq)
    return alpha


@subroutine
def _reach(v0, v1, v2, d0, d1, d2):  # type: ignore[no-untyped-def]
    """The largest t <= 2 with v + t d in the second-order cone, v inside: the first root of a quadratic."""
    inside = _determinant(v0, v1, v2)
    half = v0 * d0 - v1 * d1 - v2 * d2
    root = half * half - _determinant(d0, d1, d2) * inside
    if root < 0.0:
        return 2.0
    slope = np.sqrt(root) - half
    return inside / slope if slope > 0.5 * inside else 2.0


@subroutine
def _determinant(v0, v1, v2):  # type: ignore[no-untyped-def]
    """v_0^2 - |v_1|^2 without the cancellation of the squares."""
    size = np.sqrt(v1 * v1 + v2 * v2)
    return (v0 - size) * (v0 + size)


@subroutine
def _unscale(b0, b1, b2, eta, v0, v1, v2):  # type: ignore[no-untyped-def]
    """W^-1 v for the scaling point b."""
    dot = b1 * v1 + b2 * v2
    slope = dot / (1.0 + b0) - v0
    inverse = 1.0 / eta
    return (b0 * v0 - dot) * inverse, (v1 + slope * b1) * inverse, (v2 + slope * b2) * inverse
