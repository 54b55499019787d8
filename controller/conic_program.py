"""Convex quadratic programs over half-lines and second-order cones: their certificate and the solvers that take them.

    min 1/2 x'P x + q'x   s.t.   A x + s = b,   s in {0}^zero x (half-lines)^linear x (second-order cones)

A second-order cone is {(t, u): |u| <= t}. Without one, it is a QP and any backend of qpsolvers will do.
"""

from time import perf_counter
from typing import Any, NamedTuple, Protocol

import numpy as np
from pivoting.controller.conic import CLARABEL
from pivoting.controller.validate import Array, fail
from scipy import sparse

_CLARABEL = {
    **CLARABEL,
    "tol_gap_abs": 1e-10,
    "tol_gap_rel": 1e-10,
    "tol_feas": 1e-10,
    # what an update in place needs: the pattern that it was set up with
    "presolve_enable": False,
    "chordal_decomposition_enable": False,
    "input_sparse_dropzeros": False,
}
_QP: dict[str, dict[str, Any]] = {
    "piqp": {"eps_abs": 1e-10, "eps_rel": 1e-10},
    "clarabel": {"tol_gap_abs": 1e-10, "tol_gap_rel": 1e-10, "tol_feas": 1e-10, "max_step_fraction": 0.95},
    "osqp": {"eps_abs": 1e-9, "eps_rel": 1e-9, "polishing": True, "max_iter": 100_000},
    "proxqp": {"eps_abs": 1e-10, "eps_rel": 0.0},
    "scs": {"eps_abs": 1e-9, "eps_rel": 1e-9},
    "highs": {},
}


class Cones(NamedTuple):
    """zero, linear: numbers of rows.  orders: sizes of the second-order cones, in rows that come after those."""

    zero: int
    linear: int
    orders: tuple[int, ...]


class ConicProgram(NamedTuple):
    """P: (n, n) upper triangle, sparse.  A: (m, n), sparse.  The sparsity patterns hold every entry that may be other
    than zero, so that two programs of one origin have the same."""

    P: Any
    q: Array
    A: Any
    b: Array
    cones: Cones


class Answer(NamedTuple):
    """x: (n,).  z: (m,) multipliers of the rows.  said: the solver's own word.  seconds: inside it."""

    x: Array
    z: Array
    said: str
    seconds: float


class Solver(Protocol):
    """What solves programs, one after another."""

    def __call__(self, program: ConicProgram) -> Answer:
        """The answer, in nan where there is none."""
        ...


class ClarabelInPlace:
    """Clarabel set up once, its data replaced as long as the programs have one pattern."""

    def __init__(self, **options: Any):
        self._options = {**_CLARABEL, **options}
        self._solver: Any = None
        self._cones: Cones | None = None

    def __call__(self, program: ConicProgram) -> Answer:
        start = perf_counter()
        if self._solver is None or self._cones != program.cones:
            self._solver, self._cones = self._fresh(program), program.cones
        else:
            self._solver.update(P=program.P.data, q=program.q, A=program.A.data, b=program.b)
        answer = self._solver.solve()
        found = np.array(answer.x), np.array(answer.z)
        return Answer(*found, str(answer.status), perf_counter() - start)

    def _fresh(self, program: ConicProgram) -> Any:
        import clarabel

        settings = clarabel.DefaultSettings()
        settings.verbose = False
        for key, value in self._options.items():
            if not hasattr(settings, key):
                raise fail("options", key, "a setting of Clarabel")
            setattr(settings, key, value)
        zero, linear, orders = program.cones
        cones = [clarabel.ZeroConeT(zero), clarabel.NonnegativeConeT(linear)]
        cones += [clarabel.SecondOrderConeT(order) for order in orders]
        return clarabel.DefaultSolver(program.P, program.q, program.A, program.b, cones, settings)


class QuadraticBackend:
    """A backend of qpsolvers, which takes programs without second-order cones."""

    def __init__(self, backend: str, **options: Any):
        self._backend = backend
        self._options = {**_QP.get(backend, {}), **options}

    def __call__(self, program: ConicProgram) -> Answer:
        import qpsolvers

        zero, linear, orders = program.cones
        if orders:
            raise fail("method", f"qp:{self._backend}", "clarabel: the program has second-order cones")
        start = perf_counter()
        P = program.P + sparse.triu(program.P, 1, format="csc").T
        rows = program.A.tocsr()
        A, G = rows[:zero].tocsc(), rows[zero:].tocsc()
        if self._backend in qpsolvers.dense_solvers:
            P, A, G = (matrix.toarray() for matrix in (P, A, G))
        stated = qpsolvers.Problem(P, program.q, G, program.b[zero:], A, program.b[:zero])
        none = Answer(np.full(P.shape[0], np.nan), np.full(len(program.b), np.nan), "", 0.0)
        try:
            found = qpsolvers.solve_problem(stated, solver=self._backend, **self._options)
        except Exception as error:  # each backend has its own: what it says is kept, and there is no answer
            return none._replace(said=f"{type(error).__name__}: {error}", seconds=perf_counter() - start)
        seconds = perf_counter() - start
        if found.x is None or found.y is None or found.z is None:
            return none._replace(said="not found", seconds=seconds)
        said = "Solved" if found.found else "not found"
        return Answer(np.asarray(found.x), np.concatenate([found.y, found.z]), said, seconds)


def solver(method: str, **options: Any) -> Solver:
    """What solves programs by "clarabel" (in place) or "qp:<backend>".

    Raises:
        ValueError: an unknown method, or a backend that is not installed.
    """
    from pivoting.controller.solvers import methods

    if method == "clarabel":
        return ClarabelInPlace(**options)
    if method in methods() and method.startswith("qp:"):
        return QuadraticBackend(method[3:], **options)
    known = [name for name in methods() if name != "closed-form"]
    raise fail("method", method, "one of " + ", ".join(known))


def kkt_residual(program: ConicProgram, answer: Answer) -> float:
    """Greatest of four: distance of s from its cone, of z from the dual one, stationarity, complementarity.

    Each relative to its own largest term, at least 1; nan if the answer is not finite.
    """
    x, z = answer.x, answer.z
    P = program.P
    curved = P @ x + P.T @ x - P.diagonal() * x
    s = program.b - program.A @ x
    terms = abs(program.A) @ np.abs(x)
    primal = outside(s, program.cones) / max(1.0, float(np.max(terms, initial=0.0)))
    dual = outside(z, program.cones, dual=True) / max(1.0, float(np.max(np.abs(z), initial=0.0)))
    pull = program.A.T @ z
    scale = max(1.0, *(float(np.abs(part).max(initial=0.0)) for part in (curved, program.q, pull)))
    stationary = float(np.abs(curved + program.q + pull).max()) / scale
    cost = abs(0.5 * x @ curved) + abs(program.q @ x)
    gap = abs(float(s @ z)) / max(1.0, cost)
    return float(np.max([primal, dual, stationary, gap]))


def outside(s: Array, cones: Cones, *, dual: bool = False) -> float:
    """How far s is from its cone, the greatest over its parts; `dual`: the dual cone, which leaves equalities free."""
    zero, linear, orders = cones
    worst = 0.0 if dual else float(np.abs(s[:zero]).max(initial=0.0))
    worst = max(worst, float((-s[zero : zero + linear]).max(initial=0.0)))
    if orders:
        at = zero + linear
        for size in sorted(set(orders)):
            starts = at + np.concatenate([[0], np.cumsum(orders)[:-1]])[np.array(orders) == size]
            part = s[starts[:, None] + np.arange(size)]
            worst = max(worst, float((np.linalg.norm(part[:, 1:], axis=1) - part[:, 0]).max()))
    return worst if np.isfinite(s).all() else float("nan")
