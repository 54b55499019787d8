"""Calls the compiled solvers: the closed forms for one contact, and the interior point for several."""

import numpy as np
from pivoting.controller.kernels.guarded_interior_point import guarded_wrench
from pivoting.controller.kernels.interior_point import contact_wrench
from pivoting.controller.kernels.planar_closed_form import planar_wrench
from pivoting.controller.kernels.workspace import guard, several_workspace, workspace
from pivoting.controller.validate import Array
from pivoting.controller.wrench_problem import WrenchProblem


def closed_form(problem: WrenchProblem) -> tuple[Array, Array, float]:
    """The smallest wrench w (nw,), its contact forces f (K d,) [N, N m], with their relative KKT residual."""
    (nw, n), K, dim = problem.jacobian.shape, problem.contacts, problem.dim
    f, w = np.empty(n), np.empty(nw)
    # copies that may be written, as in the loop: of read-only arrays numba would compile everything again
    stated = problem.jacobian, problem.required, problem.Q_w, problem.Q_f, problem.mu_planned, problem.f_min
    data = tuple(np.array(values) for values in stated)
    if problem.several:
        scratch = several_workspace(nw, K, dim, len(problem.apex))
        residual = guarded_wrench(*data, np.array(problem.apex), f, w, scratch, guard(nw, K, dim))
        return w, f, residual
    planar, several = workspace(nw, K, dim)
    kernel, work = (contact_wrench, several) if planar is None else (planar_wrench, planar)
    if not problem.moved:
        return w, f, kernel(*data, f, w, work)
    apex, (*moved, linear) = problem.from_apex
    residual = kernel(*moved, f, w, work, linear)
    return w, f + apex, residual
