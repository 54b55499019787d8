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
    planar, several = workspace(nw, problem.contacts, problem.dim)
    kernel, scratch = (contact_wrench, several) if planar is None else (planar_wrench, planar)
    if not problem.moved:
        # copies that may be written, as in the loop: of read-only arrays numba would compile everything again
        stated = problem.jacobian, problem.required, problem.Q_w, problem.Q_f, problem.mu_planned, problem.f_min
        kernel(*(np.array(values) for values in stated), f, w, scratch)
        return w, f
    apex, (*moved, linear) = problem.from_apex
    kernel(*moved, f, w, scratch, linear)
    return w, f + apex
