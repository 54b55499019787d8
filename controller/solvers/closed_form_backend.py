"""Calls the compiled solvers: the closed forms for one contact, and the interior point for several."""

import numpy as np
from pivoting.controller.kernels.interior_point import contact_wrench
from pivoting.controller.kernels.planar_closed_form import planar_wrench
from pivoting.controller.kernels.workspace import workspace
from pivoting.controller.validate import Array
from pivoting.controller.wrench_problem import WrenchProblem


def closed_form(problem: WrenchProblem) -> tuple[Array, Array]:
    """Compute the smallest wrench w (nw,) and its contact forces f (K d,) [N, N m], without certifying them."""
    nw, n = problem.jacobian.shape
    f, w = np.empty(n), np.empty(nw)
    # copies that may be written, as in the loop: of read-only arrays numba would compile everything again
    data = [np.array(values) for values in (problem.jacobian, problem.required, problem.Q_w, problem.Q_f)]
    cones = np.array(problem.mu_planned), np.array(problem.f_min)
    planar, several = workspace(nw, problem.contacts, problem.dim)
    if planar is not None:
        planar_wrench(*data, *cones, f, w, planar)
    else:
        contact_wrench(*data, *cones, f, w, several)
    return w, f
