"""The notes' second figure as geometry: composite wrench cone, the set that cancels the load, and the optimum on it."""

from typing import NamedTuple

import numpy as np
from pivoting.controller.problem import WrenchProblem
from pivoting.controller.solution import Solution
from pivoting.controller.validate import Array, fail


class SolutionSpace(NamedTuple):
    """A planar problem in wrench space (F_u, F_v, M), object axes [N, N, N m].

    J_c has two columns, so the contact's composite wrench cone {J f} is a flat sector of the 3-D wrench space, and the
    wrenches that balance, {required - J f}, are its mirror image with the apex moved to `required`, where the contact
    carries nothing. The optimum is the cheapest point of that set.

    Attributes:
        cone: (P, 3) polygon of the contact's wrenches J f, apex (or floor) first.
        admissible: (P, 3) polygon of the applied wrenches that balance: required - cone.
        required: (3,) what contact and applied wrench make together (-m g for balance).
        wrench: (3,) the optimum w.
        contact: (3,) the contact's part of it, J f; wrench + contact = required.
    """

    cone: Array
    admissible: Array
    required: Array
    wrench: Array
    contact: Array


def solution_space(solution: Solution, reach: float | None = None) -> SolutionSpace:
    """The picture of a solved planar problem with one contact.

    Args:
        solution: of the problem.
        reach: largest normal force that is drawn [N]; default twice the load or the solution's, whichever is larger.

    Raises:
        ValueError: the problem is not planar or has several contacts, whose cones do not fit one picture.
    """
    problem: WrenchProblem = solution.problem
    if problem.dim != 2 or problem.contacts != 1:
        raise fail("solution", f"{problem.contacts} contacts in dimension {problem.dim}", "of one planar contact")
    load = float(np.linalg.norm(problem.required[:2]))
    top = 2.0 * max(load, float(solution.force[0, 1]), 1e-9) if reach is None else reach
    mu, floor = float(problem.mu_planned[0]), float(problem.f_min[0])
    forces = np.array([[-mu * floor, floor], [-mu * top, top], [mu * top, top], [mu * floor, floor]])
    cone = forces @ problem.jacobian.T
    return SolutionSpace(
        cone=cone,
        admissible=problem.required - cone,
        required=np.array(problem.required),
        wrench=np.array(solution.wrench),
        contact=problem.jacobian @ solution.force[0],
    )
