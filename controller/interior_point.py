"""Any number of contacts: a primal-dual interior point on the forces alone, ended by a polish.

min 1/2 f'H f - h'f  s.t.  s_i = (mu f_n, f_t, f_o) in the second-order cone and f_n >= f_min, contact by contact.
Nesterov-Todd scaling and Mehrotra's predictor and corrector (Vandenberghe, "The CVXOPT linear and quadratic cone
program solvers", 2010), with s a function of f: every iterate is strictly feasible. A floor of 0 is no constraint.
"""

import numpy as np
from pivoting.controller.certificate import kkt_residual
from pivoting.controller.closed_form import balancing_wrench, reduce
from pivoting.controller.dense import factor, solve_factored
from pivoting.controller.kernel import subroutine
from pivoting.controller.polish import gradient, polish, release
from pivoting.controller.spatial_form import APEX, EDGE, FLOOR, INSIDE, RIM, spatial_force
from pivoting.controller.workspace import Work

ITERATIONS = 60  # bound; 6 to 12 are usual
GUESSES = 3  # polishes of one iterate, each on the pieces that the one before asked for
FIRST_GOAL = 1e-3  # relative gap at which the pieces are guessed for the first time
SPREAD = 0.1  # least height of the start above the floors, relative to the largest force
EXACT = 1e-13  # relative KKT residual at which nothing is left to improve

P, Q, DP, DQ, C = 0, 1, 2, 3, 4  # columns of `Work.floor`


@subroutine
def contact_wrench(J, b, Q_w, Q_f, mu, f_min, f, w, scratch):  # type: ignore[no-untyped-def]
    """Write the optimal contact forces f (n,) and wrench w (nw,), and return their relative KKT residual.

    One contact in space is solved in closed form, and polished where that does not suffice; several, or what is still
    not exact, by the interior point. Bounded in time; all nan where the problem is not finite.

    Args:
        J: (nw, n); b: (nw,) [N, N m]; Q_w: (nw, nw); Q_f: (n, n); mu (planned), f_min [N]: (K,).
        scratch: the values of a `Work`, see `workspace`.
    """
    work, n, K = Work(*scratch), f.shape[0], mu.shape[0]
    best = np.inf
    H, h, M, x, g, now = work.H, work.h, work.M, work.x, work.g, work.now
    size = reduce(J, b, Q_w, Q_f, H, h, x)
    for i in range(K):
        size += mu[i] + f_min[i]
    if not np.isfinite(size):
        for i in range(n):
            f[i] = np.nan
        balancing_wrench(J, b, f, w)
        return np.nan
    if n == 3:  # exact up to eps cond(H): most problems need no more
        work.piece[0] = spatial_force(H, h, mu[0], f_min[0], f)
        balancing_wrench(J, b, f, w)
        best = kkt_residual(J, b, Q_w, Q_f, mu, f_min, w, f, work.pull)
        if best <= EXACT:
            return best
        for i in range(n):
            now[i] = f[i]
        best = _try(J, b, Q_w, Q_f, mu, f_min, work.axes, 1, f, w, best, work)
        if best <= EXACT:
            return best
    if _nothing_pulls(h, mu, f_min, work.axes):  # f = 0 is optimal, exactly
        for i in range(n):
            now[i] = 0.0
        return _try(J, b, Q_w, Q_f, mu, f_min, work.axes, 0, f, w, best, work)
    for i in range(n):
        now[i] = h[i]
        for j in range(n):
            M[i, j] = H[i, j]
    factor(M, n)
    solve_factored(M, now, n)
    if _inside(mu, f_min, work.axes, now):
        for i in range(K):
            work.piece[i] = INSIDE
        best = _try(J, b, Q_w, Q_f, mu, f_min, work.axes, GUESSES, f, w, best, work)
        if best <= EXACT:
            return best
    cones = _start(H, h, mu, f_min, work.axes, work)
    goal, least = FIRST_GOAL, np.inf
    for _ in range(ITERATIONS):
        gap, left, size = _measure(mu, f_min, work.axes, work)
        if not gap + left < np.inf:
            break
        if gap + left <= goal * size:
            _guess(mu, f_min, work)
            best = _try(J, b, Q_w, Q_f, mu, f_min, work.axes, GUESSES, f, w, best, work)
            if best <= EXACT or goal < 1e-13:
                break
            goal *= 1e-2
        for i in range(n):
            for j in range(i, n):
                M[i, j] = H[i, j]
        _scale(mu, f_min, work.axes, work)
        factor(M, n)
        for i in range(n):
            x[i] = -g[i]
        solve_factored(M, x, n)
        alpha = min(1.0, _step_length(mu, f_min, work.axes, False, work))
        # Mehrotra's rule alone can cycle: the second-order term is only as good as the predictor is long (Colombo and
        # Gondzio 2008), and without progress one step is taken towards the central path instead. The gap must not run
        # ahead of the dual residual either, or the iterates end at a boundary far from the optimum.
        sigma, second = (1.0 - alpha) ** 3, alpha * alpha
        if gap + left > 0.9 * least:
            sigma, second = max(sigma, 0.5), 0.0
        least = min(least, gap + left)
        _correct(mu, f_min, work.axes, sigma * max(gap, left) / cones, second, work)
        solve_factored(M, x, n)
        alpha = 0.99 * _step_length(mu, f_min, work.axes, True, work)
        if alpha <= 1e-12:
            break
        _advance(f_min, min(1.0, alpha), work)
    if best > EXACT:
        best = _try(J, b, Q_w, Q_f, mu, f_min, work.axes, 0, f, w, best, work)
    return best


@subroutine
def _try(J, b, Q_w, Q_f, mu, f_min, axes, polishes, f, w, best, work):  # type: ignore[no-untyped-def]
    """Polish the iterate, or with no polishes take it as it is; keep it in f and w if its certificate is better."""
    dim = len(axes)
    trial_f, trial_w = work.trial_f, work.trial_w
    for _ in range(max(polishes, 1)):
        for i in range(f.shape[0]):
            trial_f[i] = work.now[i]
        balancing_wrench(J, b, trial_f, trial_w)
        if polishes > 0:
            polish(J, Q_w, Q_f, work.H, mu, f_min, axes, work.piece, trial_f, trial_w, work)
        residual = kkt_residual(J, b, Q_w, Q_f, mu, f_min, trial_w, trial_f, work.pull)
        if residual < best:
            best = residual
            for i in range(f.shape[0]):
                f[i] = trial_f[i]
            for i in range(w.shape[0]):
                w[i] = trial_w[i]
        if best <= EXACT or polishes == 0:
            return best
        gradient(J, Q_w, Q_f, trial_w, trial_f, work.pull, work.z)
        if not release(mu, axes, work.piece, trial_f, work.z):
            return best
    return best


@subroutine
def _nothing_pulls(h, mu, f_min, axes):  # type: ignore[no-untyped-def]
    """Is -h in every dual cone, and no floor above 0: then f = 0 is the optimum."""
    dim = len(axes)
    for i in range(mu.shape[0]):
        n = (i + 1) * dim - 1
        size = np.hypot(h[n - 2], h[n - 1]) if dim == 3 else abs(h[n - 1])
        if f_min[i] > 0.0 or -h[n] < mu[i] * size:
            return False
    return True


@subroutine
def _inside(mu, f_min, axes, f):  # type: ignore[no-untyped-def]
    """Is every force (n,) in its truncated cone?"""
    dim = len(axes)
    for i in range(mu.shape[0]):
        n = (i + 1) * dim - 1
        size = np.hypot(f[n - 2], f[n - 1]) if dim == 3 else abs(f[n - 1])
        if not (f[n] >= f_min[i] and size <= mu[i] * f[n]):
            return False
    return True


@subroutine
def _start(H, h, mu, f_min, axes, work):  # type: ignore[no-untyped-def]
    """From the free minimum in `now` to a strictly feasible start with multipliers on the central path's scale.

    Returns the number of cones.
    """
    dim = len(axes)
    K = mu.shape[0]
    now, s, y, floor = work.now, work.s, work.y, work.floor
    largest = 0.0
    for i in range(K * dim):
        largest = max(largest, abs(now[i]))
    for i in range(K):
        largest = max(largest, f_min[i])
    for i in range(K):
        normal = (i + 1) * dim - 1
        now[normal] = max(now[normal], f_min[i] + SPREAD * largest)
        size = np.hypot(now[normal - 2], now[normal - 1]) if dim == 3 else abs(now[normal - 1])
        shrink = min(1.0, 0.5 * mu[i] * now[normal] / size) if size > 0.0 else 1.0
        for p in range(i * dim, normal):
            now[p] *= shrink
    for i in range(K):
        for a in range(3):
            y[i, a] = s[i, a] = 0.0
        for a in range(5):
            floor[i, a] = 0.0
    _measure(mu, f_min, axes, work)
    cones = 0
    level = 0.0
    for i in range(K * dim):
        level += abs(work.g[i] * now[i])
    for i in range(K):
        cones += 2 if f_min[i] > 0.0 else 1
    level /= cones
    for i in range(K):  # s o y = level e, p q = level
        scale = level / (s[i, 0] ** 2 - s[i, 1] ** 2 - s[i, 2] ** 2)
        y[i, 0], y[i, 1], y[i, 2] = scale * s[i, 0], -scale * s[i, 1], -scale * s[i, 2]
        if f_min[i] > 0.0:
            floor[i, Q] = level / floor[i, P]
    return cones


@subroutine
def _measure(mu, f_min, axes, work):  # type: ignore[no-untyped-def]
    """Slacks and gradient of the iterate; its gap, what is left of the dual residual, and the size of both."""
    dim = len(axes)
    H, h, now, g, s, y, floor = work.H, work.h, work.now, work.g, work.s, work.y, work.floor
    n = h.shape[0]
    for i in range(n):
        g[i] = 0.0
    for j in range(n):
        value = now[j]
        for i in range(n):
            g[i] += H[j, i] * value
    gap = size = left = 0.0
    for i in range(n):
        size += abs(now[i]) * (abs(g[i]) + abs(h[i]))
        g[i] -= h[i]
    for i in range(mu.shape[0]):
        t, e = i * dim, (i + 1) * dim - 1
        s[i, 0], s[i, 1] = mu[i] * now[e], now[t]
        left += abs(now[t] * (g[t] - y[i, 1])) + abs(now[e] * (g[e] - mu[i] * y[i, 0] - floor[i, Q]))
        if dim == 3:
            s[i, 2] = now[t + 1]
            left += abs(now[t + 1] * (g[t + 1] - y[i, 2]))
        gap += s[i, 0] * y[i, 0] + s[i, 1] * y[i, 1] + s[i, 2] * y[i, 2]
        if f_min[i] > 0.0:
            floor[i, P] = now[e] - f_min[i]
            gap += floor[i, P] * floor[i, Q]
    return gap, left, size


@subroutine
def _guess(mu, f_min, work):  # type: ignore[no-untyped-def]
    """The piece each contact is on: of slack and multiplier, the one that is not small."""
    s, y, floor = work.s, work.y, work.floor
    size_s = size_y = 0.0
    for i in range(mu.shape[0]):
        size_s = max(size_s, s[i, 0])
        size_y = max(size_y, max(y[i, 0], floor[i, Q]))
    for i in range(mu.shape[0]):
        norm_s, norm_y = np.hypot(s[i, 1], s[i, 2]), np.hypot(y[i, 1], y[i, 2])
        low = f_min[i] > 0.0 and floor[i, P] * mu[i] * size_y < floor[i, Q] * size_s
        if (s[i, 0] - norm_s) * size_y > (y[i, 0] + norm_y) * size_s:
            work.piece[i] = FLOOR if low else INSIDE
        elif f_min[i] == 0.0 and (s[i, 0] + norm_s) * size_y < (y[i, 0] - norm_y) * size_s:
            work.piece[i] = APEX
        else:
            work.piece[i] = RIM if low else EDGE


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


@subroutine
def _scale(mu, f_min, axes, work):  # type: ignore[no-untyped-def]
    """The Nesterov-Todd scaling W y = W^-1 s = lam of every cone, and M += A'W^-2 A block by block.

    W^2 = eta^2 (2 b b' - diag(1, -1, -1)), so W^-2 = (2 v v' - diag(1, -1, -1)) / eta^2 with v = (b_0, -b_1, -b_2).
    """
    dim = len(axes)
    M, s, y, bar, lam, floor = work.M, work.s, work.y, work.bar, work.lam, work.floor
    for i in range(mu.shape[0]):
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
        t, e = i * dim, (i + 1) * dim - 1
        scale = 1.0 / eta2
        head, double = mu[i] * b0, 2.0 * scale
        M[t, t] += scale + double * b1 * b1
        M[t, e] -= double * b1 * head
        if dim == 3:
            M[t, t + 1] += double * b1 * b2
            M[t + 1, t + 1] += scale + double * b2 * b2
            M[t + 1, e] -= double * b2 * head
        M[e, e] += double * head * head - scale * mu[i] * mu[i]
        if f_min[i] > 0.0:
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
    for i in range(mu.shape[0]):
        t, e = i * dim, (i + 1) * dim - 1
        s0, s1, s2 = mu[i] * x[e], x[t], x[t + 1] if dim == 3 else 0.0
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
        if f_min[i] > 0.0:
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
def _correct(mu, f_min, axes, target, second, work):  # type: ignore[no-untyped-def]
    r"""From the predictor's steps: c = lam \ (target e - second (W^-1 ds) o (W dy)), and x = -g + A'W^-1 c."""
    dim = len(axes)
    x, g, u, lam, c, bar, floor = work.x, work.g, work.u, work.lam, work.c, work.bar, work.floor
    for i in range(mu.shape[0]):
        t, e = i * dim, (i + 1) * dim - 1
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
        x[e], x[t] = mu[i] * c0 - g[e], c1 - g[t]
        if dim == 3:
            x[t + 1] = c2 - g[t + 1]
        if f_min[i] > 0.0:
            floor[i, C] = (target - second * floor[i, DP] * floor[i, DQ]) / floor[i, P]
            x[e] += floor[i, C]


@subroutine
def _advance(f_min, alpha, work):  # type: ignore[no-untyped-def]
    """Follow the step: f, and the multipliers; the slacks are functions of f."""
    for i in range(work.x.shape[0]):
        work.now[i] += alpha * work.x[i]
    for i in range(f_min.shape[0]):
        for a in range(3):
            work.y[i, a] += alpha * work.c[i, a]
        if f_min[i] > 0.0:
            work.floor[i, Q] += alpha * work.floor[i, DQ]
