"""Convex quadratic programs over half-lines and second-order cones: their certificate and the solvers that take them.

    min 1/2 x'P x + q'x   s.t.   A x + s = b,   s in {0}^zero x (half-lines)^linear x (second-order cones)

A second-order cone is {(t, u): |u| <= t}. Without one, it is a QP and any backend of qpsolvers will do.
"""

from time import perf_counter
from typing import Any, NamedTuple, Protocol

import numpy as np
from pivoting.controller.conic import CLARABEL, clarabel_solver
from pivoting.controller.kernels.compilation import kernel, subroutine
from pivoting.controller.planning.block_matrix import Sparse
from pivoting.controller.validate import Array, fail
from scipy import sparse

# An answer is off by the square root of its gap: 1e-10 leaves contact forces 1e-5 of the weight from the optimum.
_TIGHT = {
    "tol_gap_abs": 1e-12,
    "tol_gap_rel": 1e-12,
    "tol_feas": 1e-10,
    "static_regularization_constant": 1e-11,  # at its own 1e-8 it gives up where sticking leaves no freedom
}
_CLARABEL = {
    **CLARABEL,
    **_TIGHT,
    # every answer is certified, and programs are stated in units of the order of one: a third less time
    "equilibrate_max_iter": 1,
    "iterative_refinement_enable": False,
    # what an update in place needs: the pattern that it was set up with
    "max_threads": 1,
    "presolve_enable": False,
    "chordal_decomposition_enable": False,
    "input_sparse_dropzeros": False,
}
_CAREFUL = {"max_step_fraction": 0.95, "equilibrate_max_iter": 10, "iterative_refinement_enable": True}
POOR = 1e-8  # relative KKT residual beyond which a program is solved again, carefully
USABLE = 1e-6  # up to which an answer is taken
_QP: dict[str, dict[str, Any]] = {
    "piqp": {
        "eps_abs": 1e-10,
        "eps_rel": 1e-10,
        "eps_duality_gap_abs": 1e-12,
        "eps_duality_gap_rel": 1e-12,
        "eps_primal_inf": 1e-10,  # its own 1e-4 calls programs infeasible whose guess is far off
        "eps_dual_inf": 1e-10,
        "preconditioner_iter": 1,  # programs are stated in units of the order of one
        "kkt_solver": "sparse_ldlt_ineq_cond",  # inequalities taken out first: most rows of a step bear on few columns
    },
    "clarabel": {**_TIGHT, "max_step_fraction": 0.95},
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
    """P: (n, n) upper triangle.  A: (m, n).

    Their patterns hold every entry that may be other than zero, so that two programs of one origin have the same.
    """

    P: Sparse
    q: Array
    A: Sparse
    b: Array
    cones: Cones


class Answer(NamedTuple):
    """x: (n,).  z: (m,) multipliers of the rows.  said: the solver's own word.  residual: of `kkt_residual`.

    seconds: inside the solver.
    """

    x: Array
    z: Array
    said: str
    residual: float
    seconds: float


def _no_answer(program: ConicProgram, said: str, seconds: float) -> Answer:
    return Answer(np.full(len(program.q), np.nan), np.full(len(program.b), np.nan), said, np.nan, seconds)


class Solver(Protocol):
    """What solves programs, one after another."""

    def __call__(self, program: ConicProgram) -> Answer:
        """The answer, in nan where there is none."""
        ...


class ClarabelInPlace:
    """Clarabel set up once, its data replaced as long as the programs have one pattern.

    It is fast because it trusts the first program's scaling and its own linear algebra. Where the certificate is `POOR`
    or there is no answer, it is asked once more, carefully: with a scaling for this program, with refined and shorter
    steps. The better of the two counts, and says so; a proof that there is none counts where no answer is `USABLE`.

    Args:
        step: share of the way to the boundary of the cones that the first try goes at once.
        options: of Clarabel, for both.
    """

    def __init__(self, step: float = 0.99, **options: Any):
        self._step, self._options = {"max_step_fraction": step}, options
        self._solver: Any = None
        self._cones: Cones | None = None

    def __call__(self, program: ConicProgram) -> Answer:
        start = perf_counter()
        if self._solver is None or self._cones != program.cones:
            self._solver, self._cones = self._fresh(program), program.cones
        else:
            data = {"P": program.P.data, "q": program.q, "A": program.A.data, "b": program.b}
            self._solver.update(**{key: values.tolist() for key, values in data.items()})  # it reads arrays slower
        answer = _read(program, self._solver, "", start)
        if answer.residual <= POOR:
            return answer
        again = _read(program, self._fresh(program, **_CAREFUL), ", carefully", start)
        proven = "infeasible" in again.said.lower() and not answer.residual <= USABLE
        return again if proven or (not answer.residual <= again.residual and np.isfinite(again.residual)) else answer

    def _fresh(self, program: ConicProgram, **careful: Any) -> Any:
        options = {**_CLARABEL, **self._step, **careful, **self._options}
        return clarabel_solver(program.P.csc(), program.q, program.A.csc(), program.b, program.cones, options)


def _read(program: ConicProgram, solver: Any, how: str, start: float) -> Answer:
    """What a solver that is set up answers, and its certificate."""
    found = solver.solve()
    x, z, seconds = np.array(found.x), np.array(found.z), perf_counter() - start
    return Answer(x, z, f"{found.status}{how}", kkt_residual(program, x, z), seconds)


class QuadraticBackend:
    """A backend of qpsolvers, which takes programs without second-order cones; conversions are kept for one pattern."""

    def __init__(self, backend: str, **options: Any):
        self._backend = backend
        self._options = {**_QP.get(backend, {}), **options}
        if backend == "piqp" and isinstance(self._options["kkt_solver"], str):
            import piqp

            named = getattr(piqp.KKTSolver, self._options["kkt_solver"], None)
            if named is None:
                raise fail("options", self._options["kkt_solver"], "a KKT solver of this release of piqp")
            self._options["kkt_solver"] = named
        self._split: _Split | None = None

    def __call__(self, program: ConicProgram) -> Answer:
        import qpsolvers

        zero = program.cones.zero
        if program.cones.orders:
            raise fail("method", f"qp:{self._backend}", "clarabel: the program has second-order cones")
        start = perf_counter()
        if self._split is None or not self._split.fits(program):
            self._split = _Split(program)
        P, A, G = self._split(program)
        if self._backend not in qpsolvers.sparse_solvers:
            P, A, G = (matrix.toarray() for matrix in (P, A, G))
        b = program.b
        stated = qpsolvers.Problem(P, program.q, G, b[zero:], A, b[:zero])
        try:
            found = qpsolvers.solve_problem(stated, solver=self._backend, **self._options)
        except TypeError as error:  # an option that it does not have
            raise fail("options", self._options, f"options of {self._backend} ({error})") from None
        except Exception as error:  # each backend has its own: what it says is kept, and there is no answer
            return _no_answer(program, f"{type(error).__name__}: {error}", perf_counter() - start)
        seconds = perf_counter() - start
        if found.x is None or found.y is None or found.z is None:
            return _no_answer(program, "not found", seconds)
        said = "Solved" if found.found else "not found"
        x, z = np.asarray(found.x), np.concatenate([found.y, found.z])
        return Answer(x, z, said, kkt_residual(program, x, z), seconds)


class _Split:
    """Takes programs of one pattern apart: the full P, the rows of equality, the others."""

    def __init__(self, program: ConicProgram):
        self._pattern = [program.P.indptr, program.P.indices, program.A.indptr, program.A.indices]
        zero = program.cones.zero
        upper, rows = (m._replace(data=np.arange(1.0, len(m.data) + 1.0)).csc() for m in (program.P, program.A))
        whole = upper + sparse.triu(upper, 1, format="csc").T
        self._matrices = [part.tocsc() for part in (whole, rows.tocsr()[:zero], rows.tocsr()[zero:])]
        self._entries = [part.data.astype(np.int64) - 1 for part in self._matrices]

    def fits(self, program: ConicProgram) -> bool:
        """Whether a program has this pattern."""
        given = [program.P.indptr, program.P.indices, program.A.indptr, program.A.indices]
        return all(a is b or np.array_equal(a, b) for a, b in zip(self._pattern, given, strict=True))

    def __call__(self, program: ConicProgram) -> list[Any]:
        for part, entries, source in zip(self._matrices, self._entries, (program.P, program.A, program.A), strict=True):
            part.data = source.data[entries]
        return self._matrices


def solver(method: str, **options: Any) -> Solver:
    """What solves programs by "clarabel" (in place) or "qp:<backend>".

    Raises:
        ValueError: an unknown method, or a backend that is not installed.
    """
    from pivoting.controller.solvers import backend

    if method == "clarabel":
        return ClarabelInPlace(**options)
    if method.startswith("qp:"):
        return QuadraticBackend(backend(method), **options)
    raise fail("method", method, "clarabel or qp:<backend>")


def kkt_residual(program: ConicProgram, x: Array, z: Array) -> float:
    """Of x (n,) and multipliers z (m,): the greatest of four, each relative to its own largest term, at least 1.

    Distance of s from its cone, of z from the dual one, stationarity, complementarity; nan if they are not finite.
    """
    P, A, (zero, linear, orders) = program.P, program.A, program.cones
    sizes = np.array(orders, dtype=np.int64)
    matrices = P.data, P.indices, P.indptr, A.data, A.indices, A.indptr
    sums = np.zeros(len(x)), np.zeros(len(x)), program.b.copy(), np.zeros(len(z))
    return float(_residual(*matrices, program.q, program.b, zero, linear, sizes, x, z, *sums))


@kernel
def _residual(  # type: ignore[no-untyped-def]
    P, P_row, P_column, A, A_row, A_column, q, b, zero, linear, orders, x, z, curved, pull, s, terms
):
    """As `kkt_residual`. The last four are scratch: on entry 0, 0, b and 0; on return P x, A'z, b - A x and |A||x|."""
    n, m = q.shape[0], b.shape[0]
    for j in range(n):
        for k in range(P_column[j], P_column[j + 1]):
            i = P_row[k]
            curved[i] += P[k] * x[j]
            if i != j:
                curved[j] += P[k] * x[i]
        for k in range(A_column[j], A_column[j + 1]):
            i = A_row[k]
            pull[j] += A[k] * z[i]
            s[i] -= A[k] * x[j]
            terms[i] += abs(A[k] * x[j])
    primal, dual = _outside(s, zero, linear, orders, False), _outside(z, zero, linear, orders, True)
    largest_term = largest_z = scale = 1.0
    stationary = curve = slope = gap = 0.0
    for i in range(m):
        largest_term, largest_z = max(largest_term, terms[i]), max(largest_z, abs(z[i]))
        gap += s[i] * z[i]
    for j in range(n):
        scale = max(scale, max(abs(curved[j]), max(abs(q[j]), abs(pull[j]))))
        stationary = max(stationary, abs(curved[j] + q[j] + pull[j]))
        curve += x[j] * curved[j]
        slope += q[j] * x[j]
    primal, dual, stationary = primal / largest_term, dual / largest_z, stationary / scale
    gap = abs(gap) / max(1.0, 0.5 * abs(curve) + abs(slope))
    finite = np.isfinite(curve + slope + gap + primal + dual + stationary)  # comparisons with nan hide it
    return max(max(primal, dual), max(stationary, gap)) if finite else np.nan


@subroutine
def _outside(s, zero, linear, orders, dual):  # type: ignore[no-untyped-def]
    """How far s is from its cone, the greatest over its parts; `dual`: the dual cone, which leaves equalities free."""
    worst = 0.0
    for i in range(zero + linear):
        if i >= zero:
            worst = max(worst, -s[i])
        elif not dual:
            worst = max(worst, abs(s[i]))
    first = zero + linear
    for k in range(orders.shape[0]):
        size = orders[k]
        length = 0.0
        for i in range(first + 1, first + size):
            length += s[i] * s[i]
        worst = max(worst, np.sqrt(length) - s[first])
        first += size
    return worst
