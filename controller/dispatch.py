"""The one entry of the compiled solvers, for one problem and for the loop over worlds: the right kernel for each."""

import numpy as np
from numba import njit
from pivoting.controller.certificate import kkt_residual
from pivoting.controller.closed_form import balancing_wrench, planar_force, reduce
from pivoting.controller.interior_point import EXACT, contact_forces, views
from pivoting.controller.polish import polish
from pivoting.controller.spatial_form import spatial_force


@njit(cache=True, error_model="numpy", inline="always")  # a call would cost a planar solve a third more
def smallest_wrench(J, b, Q_w, Q_f, mu, f_min, f, w, scratch):  # type: ignore[no-untyped-def]
    """Write the optimal contact forces f (K d,) and wrench w (nw,), and return their relative KKT residual.

    One contact is solved in closed form (`planar_force`; `spatial_force` and a polish), several by the interior point
    `contact_forces`. Bounded in time; all nan where the problem is not finite.

    Args:
        J: (nw, K d); b: (nw,) [N, N m]; Q_w: (nw, nw); Q_f: (K d, K d); mu (planned), f_min [N]: (K,).
        scratch: `workspace(nw, K, d)`, for any number of problems of this shape.
    """
    K = mu.shape[0]
    dim = f.shape[0] // K
    n = f.shape[0]
    H, h = scratch[: n * n].reshape(n, n), scratch[2 * n * n : 2 * n * n + n]  # as `views` has them
    reduce(J, b, Q_w, Q_f, H, h, scratch[n * n : n * n + n])
    if K == 1 and dim == 2:
        planar_force(H, h, mu[0], f_min[0], f)
        balancing_wrench(J, b, f, w)
        return kkt_residual(J, b, Q_w, Q_f, mu, f_min, w, f)
    if not np.isfinite(H.sum() + h.sum() + mu.sum() + f_min.sum()):
        f[:] = np.nan
        w[:] = np.nan
        return np.nan
    work = views(scratch, J.shape[0], K, dim)
    if K == 1:
        work.piece[0] = spatial_force(H, h, mu[0], f_min[0], f)
        balancing_wrench(J, b, f, w)
        polish(J, Q_w, Q_f, H, mu, f_min, dim, work.piece, f, w, work)
        residual = kkt_residual(J, b, Q_w, Q_f, mu, f_min, w, f)
        if residual <= EXACT:
            return residual
    return contact_forces(J, b, Q_w, Q_f, mu, f_min, f, w, work)
