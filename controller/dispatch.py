"""The one entry of the compiled solvers, for one problem and for the loop over worlds: the right kernel for each."""

import numpy as np
from pivoting.controller.certificate import kkt_residual
from pivoting.controller.closed_form import balancing_wrench, planar_force, reduce
from pivoting.controller.interior_point import EXACT, contact_forces, reduced_views, scratch_size, views
from pivoting.controller.kernel import inlined, kernel
from pivoting.controller.spatial_form import INSIDE, spatial_force
from pivoting.controller.validate import Array


def workspace(nw: int, K: int, dim: int) -> tuple[Array | None, Array, Array | None]:
    """The last three arguments of `smallest_wrench`, for any number of problems of K contacts of `dim` forces.

    One contact in the plane needs no more than the reduced problem. None tells the compiler so, and it leaves all other
    kernels out, which is most of its work.
    """
    if K == 1 and dim == 2:
        return np.zeros((4, 2)), np.zeros((2, nw)), None
    return None, np.zeros((2, nw)), np.zeros(scratch_size(nw, K, dim))


@inlined
def smallest_wrench(J, b, Q_w, Q_f, mu, f_min, f, w, reduced, pull, scratch):  # type: ignore[no-untyped-def]
    """Write the optimal contact forces f (K d,) and wrench w (nw,), and return their relative KKT residual.

    One contact is solved in closed form (`planar_force`; `spatial_force` and a polish), several by the interior point
    `contact_forces`. Bounded in time; all nan where the problem is not finite.

    Args:
        J: (nw, K d); b: (nw,) [N, N m]; Q_w: (nw, nw); Q_f: (K d, K d); mu (planned), f_min [N]: (K,).
        reduced, pull, scratch: of `workspace(nw, K, d)`.
    """
    n, K = f.shape[0], mu.shape[0]
    if reduced is not None:
        H, h = reduced[:n], reduced[n]
        reduce(J, b, Q_w, Q_f, H, h, reduced[n + 1])
        planar_force(H, h, mu[0], f_min[0], f)
        balancing_wrench(J, b, f, w)
        return kkt_residual(J, b, Q_w, Q_f, mu, f_min, w, f, pull)
    if scratch is not None:
        H, h, row = reduced_views(scratch, n)
        reduce(J, b, Q_w, Q_f, H, h, row)
        piece = INSIDE
        if n == 3:  # one contact: exact up to eps cond(H), and most problems need no more
            piece = spatial_force(H, h, mu[0], f_min[0], f)
            balancing_wrench(J, b, f, w)
            residual = kkt_residual(J, b, Q_w, Q_f, mu, f_min, w, f, pull)
            if residual <= EXACT:
                return residual
        work = views(scratch, pull, K, n // K)
        work.piece[0] = piece
        return contact_forces(J, b, Q_w, Q_f, mu, f_min, n == 3, f, w, work)
    return np.nan


solve_one = kernel(smallest_wrench)  # called from Python
