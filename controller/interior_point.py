"""Any number of contacts: a primal-dual interior point on the forces alone, ended by a polish.

min 1/2 f'H f - h'f  s.t.  s_i = (mu f_n, f_t, f_o) in the second-order cone and f_n >= f_min, contact by contact.
Nesterov-Todd scaling and Mehrotra's predictor and corrector (Vandenberghe, "The CVXOPT linear and quadratic cone
program solvers", 2010), with s a function of f, so that every iterate is strictly feasible. A floor of 0 is no constraint.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from pivoting.controller.certificate import kkt_residual
from pivoting.controller.closed_form import balancing_wrench
from pivoting.controller.dense import factor, solve_factored
from pivoting.controller.polish import polish
from pivoting.controller.spatial_form import APEX, EDGE, FLOOR, INSIDE, RIM

ITERATIONS = 60  # bound; 6 to 12 are usual
FIRST_GOAL = 1e-3  # relative gap at which the pieces are guessed for the first time
SPREAD = 0.1  # least height of the start above the floors, relative to the largest force
EXACT = 1e-13  # relative KKT residual at which nothing is left to improve

P, Q, DP, DQ, C = 0, 1, 2, 3, 4  # columns of `Work.floor`


class Work(NamedTuple):
    """Scratch of the kernels for one problem size, made once a batch by `workspace`; n = K d."""

    H: np.ndarray  # (n, n) and (n,): the problem in f alone
    h: np.ndarray
    M: np.ndarray  # (n, n): the matrix being factored
    x: np.ndarray  # (n,): right-hand side and step
    z: np.ndarray  # (n,): gradient
    moved: np.ndarray  # (n,): forces before a step
    now: np.ndarray  # (n,): iterate
    g: np.ndarray  # (n,): H f - h at the iterate
    trial_f: np.ndarray  # (n,) and (nw,): an answer that may be better
    trial_w: np.ndarray
    pull: np.ndarray  # (nw,): Q_w w
    tangent: np.ndarray  # (n, d)
    start: np.ndarray  # (K + 1,) int
    piece: np.ndarray  # (K,) int
    s: np.ndarray  # (K, d): slack of the cones, (mu f_n, f_t, f_o)
    y: np.ndarray  # (K, d): its multiplier
    bar: np.ndarray  # (K, d): scaling point
    lam: np.ndarray  # (K, d): scaled slack = scaled multiplier
    ds: np.ndarray  # (K, d): steps
    dy: np.ndarray  # (K, d)
    c: np.ndarray  # (K, d): corrector
    eta: np.ndarray  # (K,)
    floor: np.ndarray  # (K, 5): slack p = f_n - f_min, its multiplier q, dp, dq, corrector
    total: np.ndarray  # (1,): the gap s'y + p q


@njit(cache=True)
def workspace(nw, K, dim):  # type: ignore[no-untyped-def]
    """The scratch of `smallest_wrench` for K contacts of `dim` forces and wrenches of nw components."""
    n = K * dim
    return Work(
        np.empty((n, n)), np.empty(n), np.empty((n, n)), np.empty(n), np.empty(n), np.empty(n), np.empty(n),
        np.empty(n), np.empty(n), np.empty(nw), np.empty(nw), np.zeros((n, dim)), np.empty(K + 1, np.int64), np.empty(K, np.int64),
        np.empty((K, dim)), np.empty((K, dim)), np.empty((K, dim)), np.empty((K, dim)), np.empty((K, dim)),
        np.empty((K, dim)), np.empty((K, dim)), np.empty(K), np.zeros((K, 5)), np.empty(1),
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def contact_forces(J, b, Q_w, Q_f, mu, f_min, f, w, work):  # type: ignore[no-untyped-def]
    """Write the optimum into f (n,) and w (nw,), given finite H and h in `work`; return its relative KKT residual."""
    n, K = f.shape[0], mu.shape[0]
    dim = n // K
    H, h, M, x, g, now, floor = work.H, work.h, work.M, work.x, work.g, work.now, work.floor
    if _nothing_pulls(h, mu, f_min, dim):  # f = 0 is optimal, exactly
        f[:] = 0.0
        balancing_wrench(J, b, f, w)
        return kkt_residual(J, b, Q_w, Q_f, mu, f_min, w, f)
    best = np.inf
    M[:] = H
    now[:] = h
    factor(M, n)
    solve_factored(M, now, n)
    if _inside(mu, f_min, dim, now):
        work.piece[:] = INSIDE
        best = _try(J, b, Q_w, Q_f, mu, f_min, dim, True, f, w, best, work)
        if best <= EXACT:
            return best
    cones = _start(H, h, mu, f_min, dim, work)
    goal = FIRST_GOAL
    for _ in range(ITERATIONS):
        gap, size = _measure(mu, f_min, dim, work)
        if gap <= goal * size:
            _guess(mu, f_min, dim, work)
            best = _try(J, b, Q_w, Q_f, mu, f_min, dim, True, f, w, best, work)
            if best <= EXACT or goal < 1e-13:
                break
            goal *= 1e-2
        _scale(mu, f_min, dim, work)
        M[:] = H
        _add_scaling(mu, f_min, dim, work)
        factor(M, n)
        for i in range(n):
            x[i] = -g[i]
        solve_factored(M, x, n)
        alpha = _steps(mu, f_min, dim, False, work)
        _correct(mu, f_min, dim, (1.0 - alpha) ** 3 * work.total[0] / cones, work)
        solve_factored(M, x, n)
        alpha = 0.99 * _steps(mu, f_min, dim, True, work)
        if not alpha > 1e-12:  # also when nan
            break
        alpha = min(1.0, alpha)
        for i in range(n):
            now[i] += alpha * x[i]
        for i in range(K):
            for a in range(dim):
                work.y[i, a] += alpha * work.dy[i, a]
            floor[i, Q] += alpha * floor[i, DQ]
    if best > EXACT:
        best = _try(J, b, Q_w, Q_f, mu, f_min, dim, False, f, w, best, work)
    return best


@njit(cache=True, error_model="numpy")
def _try(J, b, Q_w, Q_f, mu, f_min, dim, polished, f, w, best, work):  # type: ignore[no-untyped-def]
    """Polish the iterate, or take it as it is; keep it in f and w if its certificate is the better one. The residual."""
    trial_f, trial_w = work.trial_f, work.trial_w
    trial_f[:] = work.now
    balancing_wrench(J, b, trial_f, trial_w)
    if polished:
        polish(J, Q_w, Q_f, work.H, mu, f_min, dim, work.piece, trial_f, trial_w, work)
    residual = kkt_residual(J, b, Q_w, Q_f, mu, f_min, trial_w, trial_f)
    if not residual < best:
        return best
    f[:] = trial_f
    w[:] = trial_w
    return residual


@njit(cache=True, error_model="numpy")
def _nothing_pulls(h, mu, f_min, dim):  # type: ignore[no-untyped-def]
    """Is -h in every dual cone, and no floor above 0: then f = 0 is the optimum."""
    for i in range(mu.shape[0]):
        n = (i + 1) * dim - 1
        size = np.hypot(h[n - 2], h[n - 1]) if dim == 3 else abs(h[n - 1])
        if f_min[i] > 0.0 or -h[n] < mu[i] * size:
            return False
    return True


@njit(cache=True, error_model="numpy")
def _inside(mu, f_min, dim, f):  # type: ignore[no-untyped-def]
    """Is every force (n,) in its truncated cone?"""
    for i in range(mu.shape[0]):
        n = (i + 1) * dim - 1
        size = np.hypot(f[n - 2], f[n - 1]) if dim == 3 else abs(f[n - 1])
        if not (f[n] >= f_min[i] and size <= mu[i] * f[n]):
            return False
    return True


@njit(cache=True, error_model="numpy")
def _start(H, h, mu, f_min, dim, work):  # type: ignore[no-untyped-def]
    """From the free minimum in `now` to a strictly feasible start with multipliers on the central path's scale.

    Returns the number of cones.
    """
    n, K = h.shape[0], mu.shape[0]
    now, floor = work.now, work.floor
    largest = 0.0
    for i in range(n):
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
    work.y[:] = 0.0
    floor[:] = 0.0
    _measure(mu, f_min, dim, work)
    cones = 0
    level = 0.0
    for i in range(n):
        level += abs(work.g[i] * now[i])
    for i in range(K):
        cones += 2 if f_min[i] > 0.0 else 1
    level /= cones
    for i in range(K):  # s o y = level e, p q = level
        slack = 0.0
        for a in range(1, dim):
            slack += work.s[i, a] ** 2
        slack = work.s[i, 0] ** 2 - slack
        for a in range(dim):
            work.y[i, a] = (level if a == 0 else -level) * work.s[i, a] / slack
        if f_min[i] > 0.0:
            floor[i, Q] = level / floor[i, P]
    return cones


@njit(cache=True, error_model="numpy")
def _measure(mu, f_min, dim, work):  # type: ignore[no-untyped-def]
    """Slacks and gradient of the iterate; (its gap plus what is left of the dual residual, the size of both)."""
    H, h, now, g, s, y, floor = work.H, work.h, work.now, work.g, work.s, work.y, work.floor
    n, K = h.shape[0], mu.shape[0]
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
    for i in range(K):
        normal = (i + 1) * dim - 1
        s[i, 0] = mu[i] * now[normal]
        gap += s[i, 0] * y[i, 0]
        for a in range(1, dim):
            p = i * dim + a - 1
            s[i, a] = now[p]
            gap += s[i, a] * y[i, a]
            left += abs(now[p] * (g[p] - y[i, a]))
        if f_min[i] > 0.0:
            floor[i, P] = now[normal] - f_min[i]
            gap += floor[i, P] * floor[i, Q]
        left += abs(now[normal] * (g[normal] - mu[i] * y[i, 0] - floor[i, Q]))
    work.total[0] = gap
    return gap + left, size


@njit(cache=True, error_model="numpy")
def _margin(v, i, dim):  # type: ignore[no-untyped-def]
    """v_0 - |v_1|, v_0 + |v_1| of row i: the spectral values of a cone's point."""
    size = np.hypot(v[i, 1], v[i, 2]) if dim == 3 else abs(v[i, 1])
    return v[i, 0] - size, v[i, 0] + size


@njit(cache=True, error_model="numpy")
def _guess(mu, f_min, dim, work):  # type: ignore[no-untyped-def]
    """The piece each contact is on: of slack and multiplier, the one that is not small."""
    K = mu.shape[0]
    size_s = size_y = 0.0
    for i in range(K):
        size_s = max(size_s, work.s[i, 0])
        size_y = max(size_y, max(work.y[i, 0], work.floor[i, Q]))
    for i in range(K):
        s_low, s_high = _margin(work.s, i, dim)
        y_low, y_high = _margin(work.y, i, dim)
        low = f_min[i] > 0.0 and work.floor[i, P] * mu[i] * size_y < work.floor[i, Q] * size_s
        if s_low * size_y > y_high * size_s:
            work.piece[i] = FLOOR if low else INSIDE
        elif f_min[i] == 0.0 and s_high * size_y < y_low * size_s:
            work.piece[i] = APEX
        else:
            work.piece[i] = RIM if low else EDGE


@njit(cache=True, error_model="numpy")
def _scale(mu, f_min, dim, work):  # type: ignore[no-untyped-def]
    """The Nesterov-Todd scaling of every cone: W = eta (2 bar bar' - J)^1/2 with W y = W^-1 s = lam."""
    s, y, bar = work.s, work.y, work.bar
    for i in range(mu.shape[0]):
        low, high = _margin(s, i, dim)
        size_s = np.sqrt(low * high)
        low, high = _margin(y, i, dim)
        size_y = np.sqrt(low * high)
        dot = 0.0
        for a in range(dim):
            dot += s[i, a] * y[i, a]
        gamma = np.sqrt(0.5 * (1.0 + dot / (size_s * size_y)))
        for a in range(dim):
            other = y[i, a] / size_y
            bar[i, a] = 0.5 / gamma * (s[i, a] / size_s + (other if a == 0 else -other))
        work.eta[i] = np.sqrt(size_s / size_y)
        _unscale(bar, work.eta[i], s, work.lam, i, dim)


@njit(cache=True, error_model="numpy")
def _unscale(bar, eta, v, out, i, dim):  # type: ignore[no-untyped-def]
    """Row i of out = W^-1 v; in place too."""
    dot = 0.0
    for a in range(1, dim):
        dot += bar[i, a] * v[i, a]
    first = v[i, 0]
    slope = (dot / (1.0 + bar[i, 0]) - first) / eta
    for a in range(1, dim):
        out[i, a] = v[i, a] / eta + slope * bar[i, a]
    out[i, 0] = (bar[i, 0] * first - dot) / eta


@njit(cache=True, error_model="numpy")
def _add_scaling(mu, f_min, dim, work):  # type: ignore[no-untyped-def]
    """M += A'W^-2 A, block by block: W^-2 = (2 v v' - diag(1, -1, -1)) / eta^2 with v = (bar_0, -bar_1)."""
    M, bar, floor = work.M, work.bar, work.floor
    for i in range(mu.shape[0]):
        at, n = i * dim, (i + 1) * dim - 1
        scale = 1.0 / (work.eta[i] * work.eta[i])
        head = mu[i] * bar[i, 0]
        for a in range(dim - 1):
            for c in range(a, dim - 1):
                M[at + a, at + c] += 2.0 * scale * bar[i, a + 1] * bar[i, c + 1]
            M[at + a, at + a] += scale
            M[at + a, n] -= 2.0 * scale * bar[i, a + 1] * head
        M[n, n] += scale * (2.0 * head * head - mu[i] * mu[i])
        if f_min[i] > 0.0:
            M[n, n] += floor[i, Q] / floor[i, P]


@njit(cache=True, error_model="numpy")
def _steps(mu, f_min, dim, corrected, work):  # type: ignore[no-untyped-def]
    """The steps of slacks and multipliers that belong to the step x of f; the length up to the first boundary (<= 2)."""
    x, y, ds, dy, bar, c, floor = work.x, work.y, work.ds, work.dy, work.bar, work.c, work.floor
    alpha = 2.0
    for i in range(mu.shape[0]):
        n = (i + 1) * dim - 1
        eta = work.eta[i]
        ds[i, 0] = mu[i] * x[n]
        for a in range(1, dim):
            ds[i, a] = x[i * dim + a - 1]
        dot = -bar[i, 0] * ds[i, 0]  # W^-2 ds = (2 v (v'ds) - J ds) / eta^2
        for a in range(1, dim):
            dot += bar[i, a] * ds[i, a]
        scale = 1.0 / (eta * eta)
        dy[i, 0] = -scale * (-2.0 * dot * bar[i, 0] - ds[i, 0]) - y[i, 0]
        for a in range(1, dim):
            dy[i, a] = -scale * (2.0 * dot * bar[i, a] + ds[i, a]) - y[i, a]
        if corrected:
            for a in range(dim):
                dy[i, a] += c[i, a]
        alpha = min(alpha, min(_reach(work.s, ds, i, dim), _reach(y, dy, i, dim)))
        if f_min[i] > 0.0:
            floor[i, DP] = x[n]
            floor[i, DQ] = -floor[i, Q] * (1.0 + x[n] / floor[i, P])
            if corrected:
                floor[i, DQ] += floor[i, C]
            if floor[i, DP] < 0.0:
                alpha = min(alpha, -floor[i, P] / floor[i, DP])
            if floor[i, DQ] < 0.0:
                alpha = min(alpha, -floor[i, Q] / floor[i, DQ])
    return alpha if corrected else min(alpha, 1.0)


@njit(cache=True, error_model="numpy")
def _reach(v, dv, i, dim):  # type: ignore[no-untyped-def]
    """The largest t <= 2 with v + t dv in the second-order cone, v inside: the first root of a quadratic."""
    low, high = _margin(v, i, dim)
    inside = low * high
    a, half = dv[i, 0] * dv[i, 0], v[i, 0] * dv[i, 0]
    for p in range(1, dim):
        a -= dv[i, p] * dv[i, p]
        half -= v[i, p] * dv[i, p]
    root = half * half - a * inside
    if root < 0.0:
        return 2.0
    slope = np.sqrt(root) - half
    return min(2.0, inside / slope) if slope > 0.0 else 2.0


@njit(cache=True, error_model="numpy")
def _correct(mu, f_min, dim, target, work):  # type: ignore[no-untyped-def]
    """From the predictor's steps: c = W^-1 (lam \\ (target e - (W^-1 ds) o (W dy))), and x = -g + A'c."""
    x, g, ds, dy, lam, c, bar, floor = work.x, work.g, work.ds, work.dy, work.lam, work.c, work.bar, work.floor
    for i in range(mu.shape[0]):
        at, n = i * dim, (i + 1) * dim - 1
        # W dy = -lam - W^-1 ds in the predictor, so that one scaled step is enough.
        _unscale(bar, work.eta[i], ds, c, i, dim)
        head = target
        dot = norm = 0.0
        first, second = c[i, 0], -lam[i, 0] - c[i, 0]
        for a in range(dim):
            head += c[i, a] * (lam[i, a] + c[i, a])
        for a in range(1, dim):
            u = c[i, a]
            dy[i, a] = -(first * (-lam[i, a] - u) + second * u)  # dy is free: the corrector writes it anew
            dot += lam[i, a] * dy[i, a]
            norm += lam[i, a] * lam[i, a]
        low, high = _margin(lam, i, dim)
        c[i, 0] = (lam[i, 0] * head - dot) / (low * high)
        for a in range(1, dim):
            c[i, a] = (dy[i, a] - c[i, 0] * lam[i, a]) / lam[i, 0]
        _unscale(bar, work.eta[i], c, c, i, dim)
        for a in range(1, dim):
            x[at + a - 1] = c[i, a] - g[at + a - 1]
        x[n] = mu[i] * c[i, 0] - g[n]
        if f_min[i] > 0.0:
            floor[i, C] = (target - floor[i, DP] * floor[i, DQ]) / floor[i, P]
            x[n] += floor[i, C]
