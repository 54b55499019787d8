"""Clarabel, set up once for many wrench problems of the same shape."""

from time import perf_counter
from typing import Any

from pivoting.controller.solution import TOLERANCE, Solution, certified
from pivoting.controller.solvers.clarabel_backend import SETTINGS, Clarabel
from pivoting.controller.solvers.wrench_program import wrench_program
from pivoting.controller.validate import fail, number
from pivoting.controller.wrench_problem import WrenchProblem


class ClarabelWorkspace:
    """Solves many wrench problems of one shape with Clarabel, which is set up once; each problem replaces its data.

    Args:
        problem: the first problem, which determines the number of contacts and the dimension.
        options: settings of Clarabel, on top of the tight ones that are the default here.

    Raises:
        ValueError: a setting that Clarabel does not have, or with which the data cannot be replaced.
    """

    def __init__(self, problem: WrenchProblem, **options: Any):
        self._problem = problem
        self._assembler = wrench_program(problem.contacts, problem.dim, 0, len(problem.apex))
        program, self._unit = self._assembler.assemble(problem)
        self._clarabel = Clarabel(program, {**SETTINGS["wrench, in place"], **options})
        if not self._clarabel.replaceable:
            raise fail("options", options, "such that Clarabel allows its data to be replaced")

    def update(self, problem: WrenchProblem) -> None:
        """Replace the problem by another of the same shape.

        Raises:
            ValueError: the number of contacts or the dimension differs.
        """
        if problem.jacobian.shape != self._problem.jacobian.shape:
            raise fail("problem", problem.jacobian.shape, f"of the workspace's shape {self._problem.jacobian.shape}")
        if len(problem.apex) != len(self._problem.apex):
            raise fail("problem", f"one with {len(problem.apex)} cones a contact", f"{len(self._problem.apex)} of them")
        program, unit = self._assembler.assemble(problem)
        self._clarabel.replace(program)
        self._problem, self._unit = problem, unit

    def solve(self, *, tolerance: float = TOLERANCE) -> Solution:
        """The certified answer to the current problem, see `solve`.

        Raises:
            SolveError: no answer within tolerance.
        """
        number("tolerance", tolerance, above=0.0)
        start = perf_counter()
        answer = self._clarabel.solve()
        wrench, force = self._assembler.wrench_and_force(answer.x, self._unit)
        seconds = perf_counter() - start
        said, own = answer.message, answer.residual
        return certified(
            self._problem, wrench, force, said, own=own, method="clarabel", seconds=seconds, tolerance=tolerance
        )  # fmt: skip
