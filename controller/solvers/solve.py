"""Solves wrench problems by compiled kernels, Clarabel or any QP backend of qpsolvers, and certifies every answer."""

from collections.abc import Callable
from functools import partial
from time import perf_counter
from typing import Any

from pivoting.controller.friction_pyramid import check_edges
from pivoting.controller.solution import TOLERANCE, Solution, certified
from pivoting.controller.solvers.clarabel_backend import SETTINGS, Clarabel
from pivoting.controller.solvers.closed_form_backend import closed_form
from pivoting.controller.solvers.conic_program import ConicSolver
from pivoting.controller.solvers.qpsolvers_backend import QuadraticBackend, installed_backend, installed_backends
from pivoting.controller.solvers.wrench_program import wrench_program
from pivoting.controller.validate import Array, fail, number
from pivoting.controller.wrench_problem import WrenchProblem

EDGES = 8  # of the pyramids that a QP solver is given in space
Route = Callable[[WrenchProblem, int], tuple[Array, Array, str, float]]
"""Of a problem and edges: wrench (nw,), force (K d,), message, residual with the method's own multipliers."""


def solve(
    problem: WrenchProblem, method: str = "closed-form", *, tolerance: float = TOLERANCE, **options: Any
) -> Solution:
    """Solve a wrench problem and certify the answer.

    Args:
        problem: the wrench problem.
        method: "closed-form" (compiled: closed form for one contact, an interior point with a polish for several),
            "clarabel", or "qp:<backend>" with any backend of qpsolvers that is installed (see `methods`). A QP has no
            round cones, so in space it gets inscribed pyramids. Its answer is feasible but costs more than the
            optimum (`pyramid_excess`), so its status is "inscribed", never "solved", and its residual is that of
            the program with pyramids; `problem.residual` tells how far it is from the optimum of the cones.
        tolerance: largest relative KKT residual of an answer that is returned.
        options: `edges` of the pyramids (>= 3, default 8; QP in space only); all others are passed on to the solver,
            on top of the tight tolerances that are the default here.

    Raises:
        SolveError: no answer within tolerance; it carries the problem and what the solver gave.
        ValueError: unknown method, one that cannot serve this problem, or an option that it does not have.
    """
    number("tolerance", tolerance, above=0.0)
    edges = _edges(problem, method, options)
    route = _route(method, {key: value for key, value in options.items() if key != "edges"})
    start = perf_counter()
    wrench, force, message, own = route(problem, edges)
    seconds = perf_counter() - start
    return certified(
        problem, wrench, force, message, own=own, method=method, seconds=seconds, tolerance=tolerance, edges=edges
    )  # fmt: skip


def pyramid_excess(problem: WrenchProblem, edges: int = EDGES, *, backend: str = "daqp") -> float:
    """How much more the optimum with inscribed pyramids costs than that with round cones, relative to the latter.

    Between two vertices a pyramid gives up about (1 - cos(pi / edges)) of the friction. 0 if it costs nothing.

    Raises:
        SolveError, ValueError: as `solve`.
    """
    cone = solve(problem).objective
    pyramid = solve(problem, f"qp:{backend}", edges=edges).objective
    return (pyramid - cone) / cone if cone > 0.0 else 0.0


def methods() -> tuple[str, ...]:
    """The names of all methods that `solve` can use here, which depends on what is installed and licensed."""
    return ("closed-form", "clarabel", *(f"qp:{name}" for name in installed_backends()))


def _edges(problem: WrenchProblem, method: str, options: dict[str, Any]) -> int:
    """Edges of the pyramids that this method solves for in place of the cones; 0 if it solves for the cones."""
    if not isinstance(method, str):
        raise fail("method", method, "text")
    if not method.startswith("qp:"):
        if "edges" in options:
            raise fail("options", options, f'without "edges": {method} needs no pyramids')
        return 0
    if problem.dim == 3:
        return check_edges(options.get("edges", EDGES))
    if "edges" in options:
        raise fail("edges", options["edges"], "left out in the plane, where the cones are linear")
    return 0


def _route(method: str, options: dict[str, Any]) -> Route:
    if method == "closed-form":
        if options:
            raise fail("options", options, "empty for the closed form")
        return _by_closed_form
    if method == "clarabel":
        settings = {**SETTINGS["wrench"], **options}
        return partial(_by_program, lambda program: Clarabel(program, settings).solve())
    if method.startswith("qp:"):
        return partial(_by_program, QuadraticBackend(installed_backend(method), **options))
    raise fail("method", method, "one of closed-form, clarabel, qp:<backend>")


def _by_closed_form(problem: WrenchProblem, edges: int) -> tuple[Array, Array, str, float]:
    wrench, force, residual = closed_form(problem)
    return wrench, force, "compiled kernel", residual


def _by_program(solver: ConicSolver, problem: WrenchProblem, edges: int) -> tuple[Array, Array, str, float]:
    assembler = wrench_program(problem.contacts, problem.dim, edges, len(problem.apex))
    program, unit = assembler.assemble(problem)
    answer = solver(program)
    return *assembler.wrench_and_force(answer.x, unit), answer.message, answer.residual
