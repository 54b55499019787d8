"""The optimum for any number of contacts, by a primal-dual interior-point method on the forces, ended by a polish.

min 1/2 f'H f - h'f  s.t.  s_i = (mu f_n, f_t, f_o) in the second-order cone and f_n >= f_min, contact by contact.
Nesterov-Todd scaling and Mehrotra's predictor and corrector (Vandenberghe, "The CVXOPT linear and quadratic cone
program solvers", 2010) are used with s as a function of f, so that every iterate is strictly feasible. A floor of 0 is
left out as a constraint.
"""

import numpy as np
from pivoting.controller.kernels.cholesky import factor, solve_factored
from pivoting.controller.kernels.compilation import kernel, subroutine
from pivoting.controller.kernels.nesterov_todd import correct, predict
from pivoting.controller.kernels.newton_polish import gradient, polish, release
from pivoting.controller.kernels.planar_closed_form import balancing_wrench, reduce
from pivoting.controller.kernels.spatial_closed_form import APEX, EDGE, FLOOR, INSIDE, RIM, spatial_force
from pivoting.controller.kernels.workspace import DQ, P, Q, opened
from pivoting.controller.kkt_residual import kkt_residual

ITERATIONS = 60  # bound; 6 to 12 are usual
GUESSES = 3  # polishes of one iterate, each on the pieces that the one before asked for
FIRST_GOAL = 1e-3  # relative gap at which the pieces are guessed for the first time
SPREAD = 0.1  # least height of the start above the floors, relative to the largest force
SHORTEST = 1e-12  # share of a step that still counts as one
EXACT = 1e-13  # relative KKT residual at which nothing is left to improve


@kernel
def contact_wrench(J, b, Q_w, Q_f, mu, f_min, f, w, scratch, linear=None):  # type: ignore[no-untyped-def]
    """Write the optimal contact forces f (n,) and wrench w (nw,), and return their relative KKT residual.

    One contact in space is solved in closed form and, if that is not exact, polished. The interior-point method solves
    several contacts, and whatever is still not exact. The number of steps is bounded; the answer is nan where there is
    no finite one.

    Args:
        J: (nw, n); b: (nw,) [N, N m]; Q_w: (nw, nw); Q_f: (n, n); mu (planned), f_min [N]: (K,).
        scratch: of `workspace`.
        linear: (n,) of the cost, see `kkt_residual`; None: without.
    """
    n, K, H, h, pull = f.shape[0], mu.shape[0], scratch[1][0], scratch[2][0], scratch[3][1:]
    best, piece, size = np.inf, INSIDE, reduce(J, b, Q_w, Q_f, H, h, scratch[2][1])
    if linear is not None:
        for i in range(n):
            h[i] -= linear[i]
            size += h[i]
    for i in range(K):
        size += mu[i] + f_min[i]
    for i in range(n):
        f[i] = np.nan
    for i in range(w.shape[0]):
        w[i] = np.nan
    if not np.isfinite(size):
        return np.nan
    if n == 3:  # exact up to eps cond(H): most problems need no more
        piece, best = _closed_form(J, b, Q_w, Q_f, H, h, mu, f_min, f, w, pull, linear)
        if best <= EXACT:
            return best
    work = opened(scratch, K)
    axes, now = work.axes, work.now
    if n == 3:
        work.piece[0] = piece
        for i in range(n):
            now[i] = f[i]
        best = _try(J, b, Q_w, Q_f, mu, f_min, 1, f, w, best, work, linear)
        if best <= EXACT:
            return best
    if _nothing_pulls(h, mu, f_min, axes):  # f = 0 is optimal, exactly
        for i in range(n):
            now[i] = 0.0
        return _try(J, b, Q_w, Q_f, mu, f_min, 0, f, w, best, work, linear)
    free_minimum(work.H, h, work)
    if _inside(mu, f_min, axes, now):
        for i in range(K):
            work.piece[i] = INSIDE
        best = _try(J, b, Q_w, Q_f, mu, f_min, GUESSES, f, w, best, work, linear)
        if best <= EXACT:
            return best
    cones, gap, left, size = start(mu, f_min, axes, work)
    goal, least = FIRST_GOAL, np.inf
    for _ in range(ITERATIONS):
        if not gap + left < np.inf:
            break
        if gap + left <= goal * size:
            _guess(mu, f_min, work)
            best = _try(J, b, Q_w, Q_f, mu, f_min, GUESSES, f, w, best, work, linear)
            if best <= EXACT or goal < 1e-13:
                break
            goal *= 1e-2
        before = gap + left
        alpha, gap, left, size = improve(mu, f_min, axes, gap, left, least, cones, work)
        least = min(least, before)
        if alpha <= SHORTEST:
            break
    if best > EXACT:
        best = _try(J, b, Q_w, Q_f, mu, f_min, 0, f, w, best, work, linear)
    return best if best < np.inf else np.nan


@subroutine
def _closed_form(J, b, Q_w, Q_f, H, h, mu, f_min, f, w, pull, linear):  # type: ignore[no-untyped-def]
    """One contact in space: write its optimum; its piece, and its certificate."""
    piece = spatial_force(H, h, mu[0], f_min[0], f)
    balancing_wrench(J, b, f, w)
    residual = kkt_residual(J, b, Q_w, Q_f, mu, f_min, w, f, pull, linear)
    return piece, residual if np.isfinite(residual) else np.inf  # of an H that rounding made indefinite


@subroutine
def _try(J, b, Q_w, Q_f, mu, f_min, polishes, f, w, best, work, linear):  # type: ignore[no-untyped-def]
    """Polish the iterate, or with no polishes take it as it is; keep it in f and w if its certificate is better."""
    axes, trial_f, trial_w = work.axes, work.trial_f, work.trial_w
    for _ in range(max(polishes, 1)):
        for i in range(f.shape[0]):
            trial_f[i] = work.now[i]
        balancing_wrench(J, b, trial_f, trial_w)
        if polishes > 0:
            polish(J, Q_w, Q_f, work.H, mu, f_min, axes, work.piece, trial_f, trial_w, work, linear)
        residual = kkt_residual(J, b, Q_w, Q_f, mu, f_min, trial_w, trial_f, work.pull, linear)
        if residual < best:
            best = residual
            for i in range(f.shape[0]):
                f[i] = trial_f[i]
            for i in range(w.shape[0]):
                w[i] = trial_w[i]
        if best <= EXACT or polishes == 0:
            return best
        gradient(J, Q_w, Q_f, trial_w, trial_f, work.pull, work.z, linear)
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
def free_minimum(H, h, work):  # type: ignore[no-untyped-def]
    """The minimum without cones, into the iterate."""
    n = h.shape[0]
    for i in range(n):
        work.now[i] = h[i]
        for j in range(i, n):
            work.M[i, j] = H[i, j]
    factor(work.M, n)
    solve_factored(work.M, work.now, n)


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
def start(mu, f_min, axes, work):  # type: ignore[no-untyped-def]
    """From the free minimum in `now` to a strictly feasible start with multipliers on the central path's scale.

    Returns the number of cones, and what `_measure` does.
    """
    dim = len(axes)
    K, M = mu.shape[0], work.of.shape[0]
    now, s, y, floor, tip = work.now, work.s, work.y, work.floor, work.tip
    largest = 0.0
    for i in range(K * dim):
        largest = max(largest, abs(now[i]))
    for i in range(K):
        largest = max(largest, f_min[i])
    for i in range(M):
        largest = max(largest, max(abs(tip[i, 0]), max(abs(tip[i, 1]), abs(tip[i, 2]))))
    for i in range(K):
        normal = (i + 1) * dim - 1
        now[normal] = max(now[normal], f_min[i] + SPREAD * largest)
        size = np.hypot(now[normal - 2], now[normal - 1]) if dim == 3 else abs(now[normal - 1])
        shrink = min(1.0, 0.5 * mu[i] * now[normal] / size) if size > 0.0 else 1.0
        for p in range(i * dim, normal):
            now[p] *= shrink
    for i in range(K, M):  # up, until it is well within the other cones, too
        k = work.of[i]
        t, e = k * dim, (k + 1) * dim - 1
        size = np.hypot(now[t] - tip[i, 1], now[t + 1] - tip[i, 2]) if dim == 3 else abs(now[t] - tip[i, 1])
        now[e] = max(now[e], tip[i, 0] + 2.0 * size / mu[k] + SPREAD * largest)
    for i in range(M):
        for a in range(3):
            y[i, a] = s[i, a] = 0.0
    for i in range(K):
        for a in range(5):
            floor[i, a] = 0.0
    _measure(mu, f_min, axes, work)
    cones = M
    level = 0.0
    for i in range(K * dim):
        level += abs(work.g[i] * now[i])
    for i in range(K):
        if f_min[i] > 0.0:
            cones += 1
    level /= cones
    for i in range(M):  # s o y = level e, p q = level
        scale = level / (s[i, 0] ** 2 - s[i, 1] ** 2 - s[i, 2] ** 2)
        y[i, 0], y[i, 1], y[i, 2] = scale * s[i, 0], -scale * s[i, 1], -scale * s[i, 2]
    for i in range(K):
        if f_min[i] > 0.0:
            floor[i, Q] = level / floor[i, P]
    gap, left, size = _measure(mu, f_min, axes, work)
    return cones, gap, left, size


@subroutine
def _measure(mu, f_min, axes, work):  # type: ignore[no-untyped-def]
    """Slacks and gradient of the iterate; its gap, what is left of the dual residual, and the size of both."""
    dim = len(axes)
    H, h, now, g, s, y, floor = work.H, work.h, work.now, work.g, work.s, work.y, work.floor
    z, n = work.z, h.shape[0]
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
        z[i] = g[i]
    for i in range(work.of.shape[0]):
        k = work.of[i]
        t, e = k * dim, (k + 1) * dim - 1
        s[i, 0], s[i, 1] = mu[k] * (now[e] - work.tip[i, 0]), now[t] - work.tip[i, 1]
        z[t], z[e] = z[t] - y[i, 1], z[e] - mu[k] * y[i, 0]
        if dim == 3:
            s[i, 2] = now[t + 1] - work.tip[i, 2]
            z[t + 1] -= y[i, 2]
        gap += s[i, 0] * y[i, 0] + s[i, 1] * y[i, 1] + s[i, 2] * y[i, 2]
    for i in range(mu.shape[0]):
        e = (i + 1) * dim - 1
        if f_min[i] > 0.0:
            floor[i, P] = now[e] - f_min[i]
            gap += floor[i, P] * floor[i, Q]
            z[e] -= floor[i, Q]
    for i in range(n):
        left += abs(now[i] * z[i])
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
def improve(mu, f_min, axes, gap, left, least, cones, work):  # type: ignore[no-untyped-def]
    """Make one step, unless it is too short; returns its length, and what `_measure` does.

    Args:
        least: sum of gap and dual residual that was reached before.  cones: how many there are, floors among them.
    """
    alpha = predict(mu, f_min, axes, work)
    # Mehrotra's rule alone can cycle: the second-order term is only as good as the predictor is long (Colombo and
    # Gondzio 2008), and without progress one step is taken towards the central path instead. The gap must not run
    # ahead of the dual residual either, or the iterates end at a boundary far from the optimum.
    sigma, second = (1.0 - alpha) ** 3, alpha * alpha
    if gap + left > 0.9 * least:
        sigma, second = max(sigma, 0.5), 0.0
    alpha = correct(mu, f_min, axes, sigma * max(gap, left) / cones, second, work)
    if alpha <= SHORTEST:
        return alpha, gap, left, 0.0
    gap, left, size = _advance(mu, f_min, axes, alpha, work)
    return alpha, gap, left, size


@subroutine
def _advance(mu, f_min, axes, alpha, work):  # type: ignore[no-untyped-def]
    """Follow the step: f, and the multipliers; the slacks are functions of f. Returns what `_measure` does."""
    for i in range(work.x.shape[0]):
        work.now[i] += alpha * work.x[i]
    for i in range(work.of.shape[0]):
        for a in range(3):
            work.y[i, a] += alpha * work.c[i, a]
    for i in range(f_min.shape[0]):
        if f_min[i] > 0.0:
            work.floor[i, Q] += alpha * work.floor[i, DQ]
    return _measure(mu, f_min, axes, work)
