"""Solving a wrench problem: closed form, Clarabel, or any QP backend of qpsolvers; every answer is certified."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np
from pivoting.controller.closed_form import balancing_wrench, planar_force, reduce
from pivoting.controller.problem import StandardForm, WrenchProblem
from pivoting.controller.validate import Array, fail, number

TOLERANCE = 1e-7  # relative KKT residual; the closed form stays below 1e-11, interior points reach about 1e-9
STATUS = ("solved", "inaccurate", "failed")  # indexed by the status codes of the compiled loop


@dataclass(frozen=True, eq=False)
class Solution:
    """An answer with its certificate.

    Attributes:
        problem: what was solved.
        wrench: (nw,) applied wrench w about the CoM, in the problem's frame (the object's) [N, N m].
        force: (K, d) contact forces, (f_t, f_n) or (f_t, f_o, f_n), in each contact's frame [N].
        residual: relative KKT residual, computed here whatever the solver said.
        status: "solved", "inaccurate" (residual above tolerance) or "failed" (no finite answer).
        method: the method that gave it.
        seconds: wall time of the solver alone.
    """

    problem: WrenchProblem = field(repr=False)
    wrench: Array
    force: Array
    residual: float
    status: str
    method: str
    seconds: float

    @property
    def objective(self) -> float:
        """1/2 w'Q_w w + 1/2 f'Q_f f, the program as the notes state it (their printed Obj is twice that)."""
        return self.problem.objective(self.wrench, self.force)


class SolveError(RuntimeError):
    """No answer within tolerance. Carries the `problem` and the refused `solution` (with status and residual)."""

    def __init__(self, solution: Solution, tolerance: float, said: str):
        self.problem = solution.problem
        self.solution = solution
        super().__init__(
            f"{solution.method}: {solution.status}, KKT residual {solution.residual:.3g} above tolerance "
            f"{tolerance:g}; the solver said: {said}"
        )


# Backends whose own default tolerance is looser than ours; the problem that they see is scaled to order one.
_TIGHT: dict[str, dict[str, Any]] = {
    "clarabel": {"tol_gap_abs": 1e-11, "tol_gap_rel": 1e-11, "tol_feas": 1e-11, "max_step_fraction": 0.95},
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
        method: "closed-form" (one planar contact), "clarabel", or "qp:<backend>" with any backend of qpsolvers that is
            installed (planar problems; see `methods`).
        tolerance: largest relative KKT residual of an answer that is returned.
        options: passed on to the solver, on top of the tight tolerances that are the default here.

    Raises:
        SolveError: no answer within tolerance; it carries the problem and what the solver gave.
        ValueError: unknown method, or one that cannot serve this problem.
    """
    number("tolerance", tolerance, above=0.0)
    route = _route(problem, method)
    start = perf_counter()
    wrench, force, said = route(problem, options)
    seconds = perf_counter() - start
    residual = problem.residual(wrench, force)
    status = STATUS[2] if not np.isfinite(residual) else STATUS[0] if residual <= tolerance else STATUS[1]
    for values in (wrench, force):
        values.flags.writeable = False
    solution = Solution(problem, wrench, force.reshape(-1, problem.dim), residual, status, method, seconds)
    if status != "solved":
        raise SolveError(solution, tolerance, said)
    return solution


def methods() -> tuple[str, ...]:
    """Every method that `solve` can use here: the backends of qpsolvers depend on what is installed."""
    return ("closed-form", "clarabel", *(f"qp:{name}" for name in sorted(_backends())))


Answer = tuple[Array, Array, str]  # wrench (nw,), force (K d,), the solver's own word
Options = dict[str, Any]


def _route(problem: WrenchProblem, method: str) -> Callable[[WrenchProblem, Options], Answer]:
    if method == "closed-form":
        if problem.dim != 2 or problem.contacts != 1:
            raise fail("method", method, f'another for this problem ({problem.contacts} contacts): try "clarabel"')
        return _closed_form
    if problem.dim != 2:
        raise fail("method", method, "used on a planar problem")
    if method == "clarabel":
        return _clarabel
    if method.startswith("qp:"):
        installed = _backends()
        if method[3:] not in installed:
            raise fail("method", method, "qp:<backend> with an installed backend: " + ", ".join(sorted(installed)))
        return partial(_qp, method[3:])
    raise fail("method", method, "one of closed-form, clarabel, qp:<backend>")


def _backends() -> list[str]:
    with warnings.catch_warnings():  # qpsolvers warns about deprecated backends when it is imported
        warnings.simplefilter("ignore")
        import qpsolvers
    return list(qpsolvers.available_solvers)


def _closed_form(problem: WrenchProblem, options: Options) -> Answer:
    if options:
        raise fail("options", options, "empty for the closed form")
    n = problem.jacobian.shape[1]
    H, h, f, w = np.empty((n, n)), np.empty(n), np.empty(n), np.empty(problem.jacobian.shape[0])
    reduce(problem.jacobian, problem.required, problem.Q_w, problem.Q_f, H, h)
    planar_force(H, h, problem.mu_planned[0], problem.f_min[0], f)
    balancing_wrench(problem.jacobian, problem.required, f, w)
    return w, f, "closed form"


def _scaled(problem: WrenchProblem) -> tuple[StandardForm, float]:
    """The standard form with forces in units of the load and weights of order one, and the unit [N].

    The cones are homogeneous, so scaling changes nothing but what a solver's absolute tolerances mean. Answers are
    proportional to the unit, so that without a load (unit 0) the answer is exactly nothing.
    """
    form = problem.standard_form()
    unit = max(float(np.abs(form.b).max()), float(np.abs(form.d).max()))
    scale = unit or 1.0
    return form._replace(P=form.P / np.abs(form.P).max(), b=form.b / scale, d=form.d / scale), unit


def _clarabel(problem: WrenchProblem, options: Options) -> Answer:
    import clarabel
    from scipy import sparse

    form, unit = _scaled(problem)
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    for key, value in {**_TIGHT["clarabel"], **options}.items():
        if not hasattr(settings, key):
            raise fail("options", key, "a setting of Clarabel")
        setattr(settings, key, value)
    answer = clarabel.DefaultSolver(
        sparse.csc_matrix(np.triu(form.P)),
        np.zeros(form.P.shape[0]),
        sparse.csc_matrix(np.vstack([form.A, form.C])),
        np.concatenate([form.b, form.d]),
        [clarabel.ZeroConeT(form.b.size), clarabel.NonnegativeConeT(form.d.size)],
        settings,
    ).solve()
    return _split(problem, np.array(answer.x), unit, str(answer.status))


def _qp(backend: str, problem: WrenchProblem, options: Options) -> Answer:
    import qpsolvers
    from scipy import sparse

    form, unit = _scaled(problem)
    matrices = [form.P, form.C, form.A]
    if backend not in qpsolvers.dense_solvers:
        matrices = [sparse.csc_matrix(matrix) for matrix in matrices]
    P, C, A = matrices
    stated = qpsolvers.Problem(P, np.zeros(form.P.shape[0]), C, form.d, A, form.b)
    try:
        answer = qpsolvers.solve_problem(stated, solver=backend, **{**_TIGHT.get(backend, {}), **options})
    except qpsolvers.exceptions.SolverError as error:
        return _split(problem, None, unit, f"{type(error).__name__}: {error}")
    return _split(problem, answer.x, unit, "found" if answer.found else "not found")


def _split(problem: WrenchProblem, x: Array | None, unit: float, said: str) -> Answer:
    """x = (f, w) / unit of the standard form into (w, f); a missing answer becomes nan, which no one can use."""
    nw, n = problem.jacobian.shape
    full = np.full(n + nw, np.nan) if x is None or np.size(x) != n + nw else unit * np.asarray(x, dtype=float)
    return full[n:].copy(), full[:n].copy(), said
