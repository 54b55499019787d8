"""What is raised when there is no answer: `SolveError` of a wrench problem, `PlanError` of a horizon."""

from typing import TYPE_CHECKING

from pivoting.errors import PivotingError

if TYPE_CHECKING:  # they carry what was refused, but do nothing with it
    from pivoting.controller.planning.sequential_convex import Plan
    from pivoting.controller.solution import Solution


class SolveError(PivotingError, RuntimeError):
    """No answer within tolerance. Carries the `problem` and the refused `solution` (with its status and residual)."""

    def __init__(self, solution: "Solution", tolerance: float, message: str):
        self.problem = solution.problem
        self.solution = solution
        super().__init__(
            f"{solution.method}: {solution.status}, KKT residual {solution.residual:.3g} above tolerance "
            f"{tolerance:g}; the solver said: {message}"
        )


class PlanError(PivotingError, RuntimeError):
    """No plan. Carries the `plan` that was refused, with its status and residual."""

    def __init__(self, plan: "Plan"):
        self.plan = plan
        last = f"its last change was {plan.changes[-1]:.2g}" if plan.changes else "no program had an answer"
        super().__init__(
            f"plan: {plan.status} after {plan.passes} passes, {last}, KKT residual {plan.residual:.3g}; "
            f"the solver said: {plan.said}"
        )
