"""Solving a wrench problem: compiled kernels, Clarabel, or any QP backend of qpsolvers; every answer is certified."""

import contextlib
import os
import warnings
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from pivoting.controller.conic import CLARABEL, Answer, clarabel_answer, scaled, split
from pivoting.controller.kernels.interior_point import contact_wrench
from pivoting.controller.kernels.planar_closed_form import planar_wrench
from pivoting.controller.kernels.workspace import workspace
from pivoting.controller.solution import INSCRIBED, STATUS, TOLERANCE, Solution, SolveError, certified
from pivoting.controller.validate import fail, number
from pivoting.controller.wrench_problem import WrenchProblem

__all__ = ["INSCRIBED", "STATUS", "TOLERANCE", "Solution", "SolveError", "methods", "pyramid_excess", "solve"]

EDGES = 8  # of the pyramids that a QP solver is given in space

# Backends whose own default tolerance is looser than ours; the problem that they see is scaled to order one.
_TIGHT: dict[str, dict[str, Any]] = {
    "clarabel": CLARABEL,
    "cvxopt": {"feastol": 1e-10, "abstol": 1e-11, "reltol": 1e-10},
    "ecos": {"feastol": 1e-10, "abstol": 1e-10, "reltol": 1e-10},
    "osqp": {"eps_abs": 1e-9, "eps_rel": 1e-9, "polishing": True},
    "piqp": {"eps_abs": 1e-11, "eps_rel": 1e-11},
    "proxqp": {"eps_abs": 1e-11, "eps_rel": 0.0},
    "scs": {"eps_abs": 1e-9, "eps_rel": 1e-9},
}


def solve(
    problem: WrenchProblem, method: str = "closed-form", *, tolerance: float = TOLERANCE, **options: Any
) -> Solution:
    """Solve `problem` and certify the answer.

    Args:
        problem: the wrench problem.
        method: "closed-form" (compiled: closed form for one contact, an interior point with a polish for several),
            "clarabel", or "qp:<backend>" with any backend of qpsolvers that is installed (see `methods`). A QP has no
            round cones: in space it is given inscribed pyramids. Its answer is feasible but costs more than the
            optimum (`pyramid_excess`), so its status is "inscribed", never "solved", and its residual is that of
            the program with pyramids; `problem.residual` tells how far it is from the optimum of the cones.
        tolerance: largest relative KKT residual of an answer that is returned.
        options: `edges` of the pyramids (>= 3, default 8; QP in space only); all others are passed on to the solver,
            on top of the tight tolerances that are the default here.

    Raises:
        SolveError: no answer within tolerance; it carries the problem and what the solver gave.
        ValueError: unknown method, or one that cannot serve this problem.
    """
    number("tolerance", tolerance, above=0.0)
    edges = _edges(problem, method, options)
    route = _route(method)
    start = perf_counter()
    wrench, force, said = route(problem, {key: value for key, value in options.items() if key != "edges"}, edges)
    seconds = perf_counter() - start
    return certified(
        problem, wrench, force, said, method=method, seconds=seconds, tolerance=tolerance, edges=edges
    )  # fmt: skip


def pyramid_excess(problem: WrenchProblem, edges: int = EDGES, *, backend: str = "daqp") -> float:
    """How much more, relatively, the optimum of inscribed pyramids costs than that of the cones: the price of a QP.

    About (1 - cos(pi / edges)) of the friction is given up between two vertices; 0 where there is nothing to pay.

    Raises:
        SolveError, ValueError: as `solve`.
    """
    cone = solve(problem).objective
    pyramid = solve(problem, f"qp:{backend}", edges=edges).objective
    return (pyramid - cone) / cone if cone > 0.0 else 0.0


def methods() -> tuple[str, ...]:
    """Every method that `solve` can use here: the backends of qpsolvers depend on what is installed and licensed."""
    return ("closed-form", "clarabel", *(f"qp:{name}" for name in sorted(_installed()) if _answers(name)))


Options = dict[str, Any]


def _edges(problem: WrenchProblem, method: str, options: Options) -> int:
    """Edges of the pyramids that this method solves for in place of the cones; 0 if it solves for the cones."""
    edges: int = options.get("edges", EDGES if problem.dim == 3 else 0)
    if method.startswith("qp:"):
        if "edges" in options and problem.dim == 2:
            raise fail("edges", edges, "left out in the plane, where the cones are linear")
        return edges
    if "edges" in options:
        raise fail("options", options, f'without "edges": {method} needs no pyramids')
    return 0


def _route(method: str) -> Callable[[WrenchProblem, Options, int], Answer]:
    if method == "closed-form":
        return _compiled
    if method == "clarabel":
        return lambda problem, options, edges: clarabel_answer(problem, options)
    if method.startswith("qp:"):
        return partial(_qp, backend(method))
    raise fail("method", method, "one of closed-form, clarabel, qp:<backend>")


def backend(method: str) -> str:
    """The backend that "qp:<backend>" names; no other is tried.

    Raises:
        ValueError: it is not installed, or does not solve.
    """
    name = method.removeprefix("qp:")
    if name not in _installed():
        raise fail("method", method, "qp:<backend> with an installed backend: " + ", ".join(sorted(_installed())))
    if not _answers(name):
        raise fail("method", method, f"qp:<backend> with one that solves; {name} is installed, but may lack a licence")
    return name


def _installed() -> list[str]:
    with warnings.catch_warnings():  # qpsolvers warns about deprecated backends when it is imported
        warnings.simplefilter("ignore")
        import qpsolvers
    names: list[str] = qpsolvers.available_solvers
    return names


@cache
def _answers(name: str) -> bool:
    """Whether a backend of qpsolvers solves min x^2 / 2 s.t. x >= 1: one that is installed may lack its licence."""
    import qpsolvers
    from scipy import sparse

    if name == "mosek" and not _mosek_licence():
        return False
    one = np.ones((1, 1))
    P, G = (one, -one) if name in qpsolvers.dense_solvers else (sparse.csc_matrix(one), sparse.csc_matrix(-one))
    with contextlib.suppress(Exception), warnings.catch_warnings():  # each backend has exceptions of its own
        warnings.simplefilter("ignore")
        stated = qpsolvers.Problem(P, np.zeros(1), G, -np.ones(1))
        return bool(qpsolvers.solve_problem(stated, solver=name).found)
    return False


def _mosek_licence() -> bool:
    """Without one Mosek complains on stdout; Drake's wheel brings it along."""
    return "MOSEKLM_LICENSE_FILE" in os.environ or (Path.home() / "mosek" / "mosek.lic").exists()


def _compiled(problem: WrenchProblem, options: Options, edges: int) -> Answer:
    if options:
        raise fail("options", options, "empty for the closed form")
    nw, n = problem.jacobian.shape
    f, w = np.empty(n), np.empty(nw)
    # copies that may be written, as in the loop: of read-only arrays numba would compile everything again
    stated = [np.array(values) for values in (problem.jacobian, problem.required, problem.Q_w, problem.Q_f)]
    cones = np.array(problem.mu_planned), np.array(problem.f_min)
    planar, several = workspace(nw, problem.contacts, problem.dim)
    if planar is not None:
        planar_wrench(*stated, *cones, f, w, planar)
    else:
        contact_wrench(*stated, *cones, f, w, several)
    return w, f, "compiled kernel"


def _qp(name: str, problem: WrenchProblem, options: Options, edges: int) -> Answer:
    import qpsolvers
    from scipy import sparse

    form, unit = scaled(problem.standard_form(edges=edges))
    matrices = [form.P, form.C, form.A]
    if name not in qpsolvers.dense_solvers:
        matrices = [sparse.csc_matrix(matrix) for matrix in matrices]
    P, C, A = matrices
    stated = qpsolvers.Problem(P, np.zeros(form.P.shape[0]), C, form.d, A, form.b)
    try:
        answer = qpsolvers.solve_problem(stated, solver=name, **{**_TIGHT.get(name, {}), **options})
    except Exception as error:  # each backend has its own: what it says is kept, and there is no answer
        return split(problem, None, f"{type(error).__name__}: {error}", unit)
    return split(problem, answer.x, "found" if answer.found else "not found", unit)
