"""The exceptions for problems without an answer: `SolveError` of a wrench problem, `PlanError` of a plan."""

from typing import TYPE_CHECKING

from pivoting.errors import PivotingError

if TYPE_CHECKING:  # they carry what was refused, but do nothing with it
    from pivoting.controller.planning.sequential_convex import Plan
    from pivoting.controller.solution import Solution


class SolveError(PivotingError, RuntimeError):
    """A wrench problem has no answer within tolerance.

    The error carries the `problem` and the rejected `solution`, with its status and residual.
    """

    def __init__(self, solution: "Solution", tolerance: float, message: str):
        self.problem = solution.problem
        self.solution = solution
        super().__init__(
            f"{solution.method}: {solution.status}, KKT residual {solution.residual:.3g} above tolerance "
            f"{tolerance:g}; the solver said: {message}"
        )


class PlanError(PivotingError, RuntimeError):
    """There is no plan. The error carries the rejected `plan`, with its status and residual."""

    def __init__(self, plan: "Plan"):
        self.plan = plan
        last = f"its last change was {plan.changes[-1]:.2g}" if plan.changes else "no program had an answer"
        super().__init__(
            f"plan: {plan.status} after {plan.passes} passes, {last}, KKT residual {plan.residual:.3g}; "
            f"the solver said: {plan.said}"
        )
