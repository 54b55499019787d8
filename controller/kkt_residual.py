"""The certificate: how far an answer is from satisfying the optimality (KKT) conditions of its own problem.

For  min 1/2 w'Q_w w + 1/2 f'Q_f f  s.t.  J f + w = b,  f_i in K_i = {|f_t| <= mu f_n, f_n >= f_min}
the multiplier of the equality is y = -Q_w w, and z = Q_f f - J'Q_w w is the gradient along f. The answer is optimal if
and only if it is feasible and no point of the cones has a smaller product with z than f has. That is the case if
z_n >= mu |z_t| (z is in the dual cone) and z'f = sum f_min (z_n - mu |z_t|). All four conditions are formulas, in the
plane and in space, for any number K of contacts. For an inscribed pyramid they are the same, with the gauge of its
polygon in place of |f_t| and the support function of the polygon at -z_t in place of |z_t|.
"""

import numpy as np
from pivoting.controller.kernels.compilation import kernel, subroutine


@kernel
def kkt_residual(J, b, Q_w, Q_f, mu, f_min, w, f, pull, linear=None, vertices=None, facets=None):  # type: ignore[no-untyped-def]
    """The relative KKT residual: the largest of those of equilibrium, friction cones, dual cones and duality gap.

    Each of the four is a backward error, relative to the sum of the absolute values of its terms (Oettli and Prager
    1964): |J||f| + |w| + |b| for the equilibrium, |Q_f||f| + |J'||Q_w||w| for the gradient, and both sides for the
    duality gap. Merely rounding w and f to doubles perturbs Q_w w by eps |Q_w||w|, which no solver can avoid. The
    distance of a force from its cone is relative to the forces of the equilibrium, so that 1e-17 N at the apex is no
    violation. A residual of 0 means optimal to the last bit. The residual is nan if the answer is not finite.

    Args:
        J: (nw, K d); b, w: (nw,); f: (K d,); Q_w: (nw, nw); Q_f: (K d, K d); mu (planned), f_min: (K,).
        pull: (2, nw) scratch, for Q_w w and |Q_w||w|.
        linear: (K d,) q of a cost with q'f beside the squares; None: without.
        vertices, facets: (m, 2) of the polygon that replaces the unit disc, see `polygon`; None for the disc itself.
    """
    nw, n = J.shape
    K = mu.shape[0]
    dim = n // K
    worst_w = size_w = size_f = 0.0
    for i in range(nw):
        sum_w, abs_w = w[i] - b[i], abs(w[i]) + abs(b[i])
        for j in range(n):
            sum_w += J[i, j] * f[j]
            abs_w += abs(J[i, j] * f[j])
        worst_w, size_w = max(worst_w, abs(sum_w)), max(size_w, abs_w)
        if i < dim:
            size_f = max(size_f, abs_w)
    for i in range(nw):
        pull[0, i] = pull[1, i] = 0.0
        for j in range(nw):
            pull[0, i] += Q_w[i, j] * w[j]
            pull[1, i] += abs(Q_w[i, j] * w[j])
    worst_f = worst_z = size_z = gap = size_gap = 0.0
    for i in range(nw):
        size_gap += abs(w[i]) * pull[1, i]
    for c in range(K):
        f_t = z_t = f_n = z_n = 0.0
        f_0 = z_0 = 0.0
        for j in range(c * dim, (c + 1) * dim):
            z = abs_z = 0.0
            for i in range(n):
                z += Q_f[j, i] * f[i]
                abs_z += abs(Q_f[j, i] * f[i])
            if linear is not None:  # a branch that the compiler decides
                z += linear[j]
                abs_z += abs(linear[j])
            for i in range(nw):
                z -= J[i, j] * pull[0, i]
                abs_z += abs(J[i, j]) * pull[1, i]
            size_z = max(size_z, abs_z)
            gap += z * f[j]
            size_gap += abs_z * abs(f[j])
            if j < (c + 1) * dim - 1:
                if facets is None:  # likewise
                    f_t, z_t = np.hypot(f_t, f[j]), np.hypot(z_t, z)
                elif j == c * dim:
                    f_0, z_0 = f[j], z
                else:
                    f_t, z_t = _most(facets, f_0, f[j]), _most(vertices, -z_0, -z)
            else:
                f_n, z_n = f[j], z
        gap -= f_min[c] * (z_n - mu[c] * z_t)
        worst_f = max(worst_f, f_t - mu[c] * f_n, f_min[c] - f_n)
        worst_z = max(worst_z, mu[c] * z_t - z_n)
        size_f = max(size_f, abs(f_n), f_min[c])
    if not np.isfinite(size_w + size_f + size_gap):  # comparisons with nan would hide it
        return np.nan
    return max(
        max(_ratio(worst_w, size_w), _ratio(worst_f, size_f)),
        max(_ratio(worst_z, size_z), _ratio(abs(gap), size_gap)),
    )


@subroutine
def _most(rows, x, y):  # type: ignore[no-untyped-def]
    """max over rows (m, 2) of row . (x, y)."""
    most = -np.inf
    for k in range(rows.shape[0]):
        most = max(most, rows[k, 0] * x + rows[k, 1] * y)
    return most


@subroutine
def _ratio(worst, size):  # type: ignore[no-untyped-def]
    """worst / size, where nothing out of nothing is no error."""
    if worst == 0.0 and size == 0.0:
        return 0.0
    return worst / size
