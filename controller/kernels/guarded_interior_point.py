"""The optimum where each contact force has to be in several moved cones at once: one for every member of a set.

min 1/2 f'H f - h'f  s.t.  (mu (f_n - a_n), f_t - a_t, f_o - a_o) in the second-order cone for every apex a, and
f_n >= f_min. Where one cone at each contact decides, it is found in a few tries. Else it is the method of
`interior_point`, without its polish, since several cones bind the same force. Every iterate is strictly feasible, so
that what the last one lacks is optimality, which its multipliers certify.
"""

import numpy as np
from pivoting.controller.kernels.compilation import kernel, subroutine
from pivoting.controller.kernels.interior_point import (
    ITERATIONS,
    SHORTEST,
    contact_wrench,
    free_minimum,
    improve,
    start,
)
from pivoting.controller.kernels.newton_polish import gradient
from pivoting.controller.kernels.planar_closed_form import balancing_wrench, reduce, state_from_tip
from pivoting.controller.kernels.workspace import Q, opened

CHOICES = 4  # of one cone at each contact, before all are taken together
OUTSIDE = 1e-12  # of the forces: what rounding leaves of a force on the edge of its cone
SMALLEST = 1e-15  # relative gap at which there is nothing to improve
STALLED = 4  # steps without progress after which rounding has the last word


@subroutine
def list_cones(apex, highest, mu, scratch):  # type: ignore[no-untyped-def]
    """List the cones that no other one contains, the highest of each contact first, from whose apex all are counted.

    Args:
        apex: (V, K, d).  highest: (K,) the member whose apex is the highest at each contact, which is listed first.
        scratch: of `workspace`, with room for V cones at each contact.

    Returns:
        How many cones are listed, M >= K.
    """
    V, K, dim = apex.shape
    of, tip = scratch[9], scratch[6][4]
    M = K
    for k in range(K):
        of[k], top = k, highest[k]
        for a in range(3):
            tip[k, a] = 0.0
        first = M
        for v in range(V):
            n = apex[v, k, dim - 1] - apex[top, k, dim - 1]
            t = apex[v, k, 0] - apex[top, k, 0]
            o = apex[v, k, 1] - apex[top, k, 1] if dim == 3 else 0.0
            if np.hypot(t, o) <= -mu[k] * n:  # contains the first cone, or is it
                continue
            covered = False
            i = first
            while i < M:
                up, away = n - tip[i, 0], np.hypot(t - tip[i, 1], o - tip[i, 2])
                if away <= -mu[k] * up:
                    covered = True
                    break
                if away <= mu[k] * up:  # that one is covered by this
                    M -= 1
                    for a in range(3):
                        tip[i, a] = tip[M, a]
                else:
                    i += 1
            if not covered:
                of[M], tip[M, 0], tip[M, 1], tip[M, 2] = k, n, t, o
                M += 1
    return M


@kernel
def guarded_wrench(J, b, Q_w, Q_f, mu, f_min, apex, f, w, scratch, guard):  # type: ignore[no-untyped-def]
    """Write the optimal contact forces f (n,) and wrench w (nw,), and return their relative KKT residual.

    Args:
        f_min: (K,) floors [N], from 0.
        apex: (V, K, d) of all cones.
        scratch: of `workspace`, for V cones at each contact.  guard: a `Guard`.
        Others: as `contact_wrench`.
    """
    left, height, linear, chosen = guard.left, guard.height, guard.linear, guard.chosen
    _choose_highest(apex, chosen)
    for _ in range(CHOICES):  # one cone at each contact often decides, and which it is shows
        _state_from_chosen(J, b, Q_f, f_min, apex, guard)
        residual = contact_wrench(J, left, Q_w, Q_f, mu, height, f, w, scratch, linear)
        for i in range(f.shape[0]):
            f[i] += guard.tip[i]
        if not _choose_again(apex, mu, f, chosen):
            return residual
    _choose_highest(apex, chosen)
    cones = list_cones(apex, chosen, mu, scratch)
    _state_from_chosen(J, b, Q_f, f_min, apex, guard)
    residual = _from_tip(J, left, Q_w, Q_f, mu, height, cones, f, w, scratch, linear)
    for i in range(f.shape[0]):
        f[i] += guard.tip[i]
    return residual


@subroutine
def _choose_highest(apex, chosen):  # type: ignore[no-untyped-def]
    """Choose at each contact the cone with the highest apex."""
    V, K, dim = apex.shape
    for k in range(K):
        chosen[k] = 0
        for v in range(1, V):
            if apex[v, k, dim - 1] > apex[chosen[k], k, dim - 1]:
                chosen[k] = v


@subroutine
def _state_from_chosen(J, b, Q_f, f_min, apex, guard):  # type: ignore[no-untyped-def]
    """State the problem from the apexes that are chosen."""
    K, dim = apex.shape[1:]
    for k in range(K):
        for i in range(dim):
            guard.tip[dim * k + i] = apex[guard.chosen[k], k, i]
    state_from_tip(J, b, Q_f, f_min, guard)


@subroutine
def _choose_again(apex, mu, f, chosen):  # type: ignore[no-untyped-def]
    """Choose at each contact the cone that its force is farthest outside of; returns whether there is one."""
    V, K, dim = apex.shape
    again = False
    for k in range(K):
        t, n = dim * k, dim * (k + 1) - 1
        worst = OUTSIDE * (abs(f[n]) + abs(apex[chosen[k], k, dim - 1]))
        for v in range(V):
            x, y = f[t] - apex[v, k, 0], f[t + 1] - apex[v, k, 1] if dim == 3 else 0.0
            outside = np.sqrt(x * x + y * y) - mu[k] * (f[n] - apex[v, k, dim - 1])
            if not outside <= worst:  # also when nan
                worst, chosen[k], again = outside, v, True
    return again


@subroutine
def _from_tip(J, b, Q_w, Q_f, mu, f_min, cones, f, w, scratch, linear):  # type: ignore[no-untyped-def]
    """The same, where forces and floors count from the highest apex of each contact, and `cones` are listed."""
    n, K = f.shape[0], mu.shape[0]
    if cones == K:
        return contact_wrench(J, b, Q_w, Q_f, mu, f_min, f, w, scratch, linear)
    work = opened(scratch, cones)
    axes, h, size = work.axes, work.h, reduce(J, b, Q_w, Q_f, work.H, work.h, work.x)
    for i in range(n):
        h[i] -= linear[i]
        size += h[i]
    for i in range(cones):
        size += work.tip[i, 0] + work.tip[i, 1] + work.tip[i, 2]
    for i in range(n):
        f[i] = np.nan
    for i in range(w.shape[0]):
        w[i] = np.nan
    if not np.isfinite(size):
        return np.nan
    free_minimum(work.H, h, work)
    constraints, gap, left, size = start(mu, f_min, axes, work)
    best, least, stalled = np.inf, np.inf, 0
    for _ in range(ITERATIONS):
        if not gap + left < np.inf:
            break
        if gap + left < best:
            best = gap + left
            for i in range(n):
                f[i] = work.now[i]
            _keep(work)
        if gap + left <= SMALLEST * size or stalled == STALLED:
            break
        before = gap + left
        alpha, gap, left, size = improve(mu, f_min, axes, gap, left, least, constraints, work)
        stalled = stalled + 1 if before > 0.5 * least else 0
        least = min(least, before)
        if alpha <= SHORTEST:
            break
    balancing_wrench(J, b, f, w)
    gradient(J, Q_w, Q_f, w, f, work.pull, work.z, linear)
    return _residual(J, b, Q_f, mu, f_min, f, w, linear, work)


@subroutine
def _keep(work):  # type: ignore[no-untyped-def]
    """Keep the multipliers of an iterate, of the cones and of the floors."""
    for i in range(work.of.shape[0]):
        for a in range(3):
            work.kept[i, a] = work.y[i, a]
    for i in range(work.floor.shape[0]):
        work.kept_floor[i] = work.floor[i, Q]


@subroutine
def _residual(J, b, Q_f, mu, f_min, f, w, linear, work):  # type: ignore[no-untyped-def]
    """The greatest of the residuals of cones, dual cones, stationarity and complementarity, as in `kkt_residual`.

    The gradient along f is in work.z, Q_w w in work.pull[0].
    """
    dim, n, K = len(work.axes), f.shape[0], mu.shape[0]
    size_f = size_z = size_gap = gap = worst_f = worst_y = worst_z = 0.0
    z = work.z
    for i in range(w.shape[0]):
        size_gap += abs(w[i] * work.pull[0, i])
        if i < dim:
            total = abs(w[i]) + abs(b[i])
            for j in range(n):
                total += abs(J[i, j] * f[j])
            size_f = max(size_f, total)
    for j in range(n):
        total = abs(linear[j])
        for i in range(n):
            total += abs(Q_f[j, i] * f[i])
        for i in range(w.shape[0]):
            total += abs(J[i, j] * work.pull[0, i])
        size_z = max(size_z, total)
        size_gap += total * abs(f[j])
    for i in range(work.of.shape[0]):
        k = work.of[i]
        t, e = k * dim, (k + 1) * dim - 1
        s0, s1 = mu[k] * (f[e] - work.tip[i, 0]), f[t] - work.tip[i, 1]
        s2 = f[t + 1] - work.tip[i, 2] if dim == 3 else 0.0
        y0, y1, y2 = work.kept[i, 0], work.kept[i, 1], work.kept[i, 2]
        size_f = max(size_f, abs(work.tip[i, 0]))
        worst_f = max(worst_f, np.hypot(s1, s2) - s0)
        worst_y = max(worst_y, np.hypot(y1, y2) - y0)
        gap += s0 * y0 + s1 * y1 + s2 * y2
        z[t], z[e] = z[t] - y1, z[e] - mu[k] * y0
        if dim == 3:
            z[t + 1] -= y2
    for k in range(K):
        e = (k + 1) * dim - 1
        worst_f = max(worst_f, f_min[k] - f[e])
        if f_min[k] > 0.0:
            gap += (f[e] - f_min[k]) * work.kept_floor[k]
            z[e] -= work.kept_floor[k]
            worst_y = max(worst_y, -work.kept_floor[k])
    for j in range(n):
        worst_z = max(worst_z, abs(z[j]))
    if not np.isfinite(size_f + size_z + size_gap + gap):
        return np.nan
    return max(max(worst_f / size_f, worst_y / size_z), max(worst_z / size_z, abs(gap) / size_gap))
