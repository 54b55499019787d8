"""The answer to a wrench problem, with its certificate."""

from dataclasses import dataclass, field

import numpy as np
from pivoting.controller.cone_constraints import cone_slack
from pivoting.controller.errors import SolveError
from pivoting.controller.validate import Array, frozen
from pivoting.controller.wrench_problem import WrenchProblem

TOLERANCE = 1e-7  # relative KKT residual; the closed form stays below 1e-11, interior points reach about 1e-9
INSCRIBED = "inscribed"  # optimal for an inscribed pyramid, which is not the problem that was asked
# Indexed by the status codes of a loop. "bounded": certified, but the bounds did not allow what was required;
# "uncertified": by a control of the user's own, which solves no problem; "repeated": no new answer, but the last one
# again; "safe": no answer, but the action of a safe state; "unguaranteed": certified for the believed world, but the
# bounds did not allow a grip in all worlds of the controller's set.
STATUS = ("solved", "inaccurate", "failed", "bounded", "uncertified", "repeated", "safe", "unguaranteed")
SOLVED, INACCURATE, FAILED, BOUNDED, UNCERTIFIED, REPEATED, SAFE, UNGUARANTEED = range(len(STATUS))


@dataclass(frozen=True, eq=False)
class Solution:
    """An answer to a wrench problem, with the residual that certifies it.

    Attributes:
        problem: the problem that was solved.
        wrench: (nw,) applied wrench w about the CoM, in the problem's frame (the object's) [N, N m].
        force: (K, d) contact forces, (f_t, f_n) or (f_t, f_o, f_n), in each contact's frame [N].
        residual: relative KKT residual, computed here and not by the solver; with edges > 0 that of the problem with
            pyramids.
        status: "solved"; "inscribed" (solved with inscribed pyramids: feasible, but not the optimum of `problem`);
            "inaccurate" (residual above tolerance) or "failed" (no finite answer).
        method: the method that gave the answer.
        seconds: wall time of the solver alone.
        edges: number of edges of the pyramids that replaced the cones in space; 0 for the cones themselves.
    """

    problem: WrenchProblem = field(repr=False)
    wrench: Array
    force: Array
    residual: float
    status: str
    method: str
    seconds: float
    edges: int = 0

    @property
    def objective(self) -> float:
        """The cost 1/2 w'Q_w w + 1/2 f'Q_f f, as the notes define it (the number that they print is twice this)."""
        return self.problem.objective(self.wrench, self.force)

    @property
    def slack(self) -> float:
        """The least of f_n - |f_t| / mu and f_n - f_min over all contacts and all their cones [N].

        Each cone counts from its apex, with the mu that the answer may use; so where the problem is that of an
        uncertain object, this is the slack of the worst member, as the guarantee counts it, of two contacts with the
        squeeze of this answer. `WrenchController.margins` tells more, and of any wrench.
        """
        return cone_slack(self.force, self.problem.apex, self.problem.mu_planned, self.problem.f_min)

    @property
    def share(self) -> float:
        """The slack over the mean normal force; -inf if that is not above 0."""
        normal = float(self.force[:, -1].mean())
        return self.slack / normal if normal > 0.0 else -np.inf


def certified(
    problem: WrenchProblem,
    wrench: Array,
    force: Array,
    message: str,
    *,
    own: float = np.nan,
    method: str,
    seconds: float,
    tolerance: float = TOLERANCE,
    edges: int = 0,
) -> Solution:
    """Certify the answer of a solver, wrench (nw,) and force (K d,), and return it as a `Solution`.

    Args:
        message: what the solver reported; an error quotes it.
        own: the relative KKT residual with the solver's own multipliers, computed here, which is the certificate where
            contacts have several cones; where each has one, the multipliers follow from the answer.

    Raises:
        SolveError: the residual is above `tolerance`, or the answer is not finite.
    """
    residual = own if problem.several else problem.residual(wrench, force, edges=edges)
    if residual <= tolerance:
        status = INSCRIBED if edges else STATUS[0]
    else:
        status = STATUS[1] if np.isfinite(residual) else STATUS[2]
    solution = Solution(
        problem, frozen(wrench), frozen(force).reshape(-1, problem.dim), residual, status, method, seconds, edges
    )
    if not residual <= tolerance:
        raise SolveError(solution, tolerance, message)
    return solution
