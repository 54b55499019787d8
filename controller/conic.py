"""Clarabel: the problem in full, x = (f, w), its cones as they are; a route that shares nothing with the kernels."""

from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from pivoting.controller.solution import TOLERANCE, Solution, certified
from pivoting.controller.validate import Array, fail, number
from pivoting.controller.wrench_problem import StandardForm, WrenchProblem

CLARABEL: dict[str, Any] = {
    "tol_gap_abs": 1e-11,
    "tol_gap_rel": 1e-11,
    "tol_feas": 1e-11,
    "max_step_fraction": 0.95,  # at its default of 0.99, 9 of 20,000 planar problems ended in MaxIterations
}
# An in-place update keeps the first equilibration and the first sparsity pattern: have neither.
_IN_PLACE: dict[str, Any] = {
    "equilibrate_enable": False,
    "presolve_enable": False,
    "chordal_decomposition_enable": False,
    "input_sparse_dropzeros": False,
}
Answer = tuple[Array, Array, str]  # wrench (nw,), force (K d,), the solver's own word


class ConicForm(NamedTuple):
    """min 1/2 x'P x  s.t.  b - A x in {0}^nw x (half-lines) x (second-order cones in space), x = (f, w) / unit.

    P: (n + nw, n + nw) upper triangle.  A: rows of balance, half-lines, cones.  balance, linear: rows of the first two.
    pattern: (of P, of A), True where an entry may be other than zero, the same for every problem of one shape.
    unit: [N].
    """

    P: Array
    A: Array
    b: Array
    balance: int
    linear: int
    pattern: tuple[Array, Array]
    unit: float


def scaled(form: StandardForm) -> tuple[StandardForm, float]:
    """The standard form with forces in units of the load and weights of order one, and the unit [N].

    The cones are homogeneous, so scaling changes nothing but what a solver's absolute tolerances mean. Answers are
    proportional to the unit, so that without a load (unit 0) the answer is exactly nothing.
    """
    unit = max(float(np.abs(form.b).max()), float(np.abs(form.d).max()))
    scale = unit or 1.0
    return form._replace(P=form.P / np.abs(form.P).max(), b=form.b / scale, d=form.d / scale), unit


def conic_form(problem: WrenchProblem) -> ConicForm:
    """The problem as Clarabel wants it, scaled as in `scaled`; the plane's cones are half-lines."""
    nw, n = problem.jacobian.shape
    K, dim = problem.contacts, problem.dim
    form, unit = scaled(problem.standard_form(edges=0 if dim == 2 else 3))
    C, d = form.C, form.d
    if dim == 3:  # of the rows of a pyramid, keep the floors
        C, d = C[::4], d[::4]
    cones = np.zeros((0 if dim == 2 else 3 * K, n + nw))
    for i in range(len(cones) // 3):  # s = -(rows) x = (mu f_n, f_t, f_o)
        cones[3 * i, 3 * i + 2] = -problem.mu_planned[i]
        cones[3 * i + 1, 3 * i] = cones[3 * i + 2, 3 * i + 1] = -1.0
    blocks = np.zeros((n + nw, n + nw), dtype=bool)
    blocks[:n, :n] = blocks[n:, n:] = True
    balance = np.hstack([np.ones((nw, n), dtype=bool), np.eye(nw, dtype=bool)])
    rest = np.vstack([C, cones])
    return ConicForm(
        P=np.triu(form.P),
        A=np.vstack([form.A, rest]),
        b=np.concatenate([form.b, d, np.zeros(len(cones))]),
        balance=nw,
        linear=len(d),
        pattern=(np.triu(blocks), np.vstack([balance, rest != 0.0])),
        unit=unit,
    )


class ClarabelWorkspace:
    """Clarabel set up once for problems of one shape, whose data is replaced in place: half the time of a fresh one.

    Args:
        problem: the first one, which fixes number of contacts and dimension.
        options: settings of Clarabel, on top of the tight ones that are the default here.

    Raises:
        ValueError: a setting that Clarabel does not have.
    """

    def __init__(self, problem: WrenchProblem, **options: Any):
        self._problem = problem
        self._form = conic_form(problem)
        self._solver = _solver(self._form, {**CLARABEL, **_IN_PLACE, **options})
        if not self._solver.is_data_update_allowed():
            raise fail("options", options, "such that Clarabel allows updates")

    def update(self, problem: WrenchProblem) -> None:
        """Replace the problem by another of the same shape.

        Raises:
            ValueError: another number of contacts or dimension.
        """
        if problem.jacobian.shape != self._problem.jacobian.shape:
            raise fail("problem", problem.jacobian.shape, f"of the workspace's shape {self._problem.jacobian.shape}")
        self._problem, self._form = problem, conic_form(problem)
        P, A = (_entries(m, p) for m, p in zip(self._form[:2], self._form.pattern, strict=True))
        self._solver.update(P=P.tolist(), A=A.tolist(), b=self._form.b.tolist())  # it reads arrays slower

    def solve(self, *, tolerance: float = TOLERANCE) -> Solution:
        """The certified answer to the problem set last, see `solve`.

        Raises:
            SolveError: no answer within tolerance.
        """
        number("tolerance", tolerance, above=0.0)
        start = perf_counter()
        answer = split(self._problem, *_run(self._solver), self._form.unit)
        seconds = perf_counter() - start
        return certified(self._problem, *answer, method="clarabel", seconds=seconds, tolerance=tolerance)


def clarabel_answer(problem: WrenchProblem, options: dict[str, Any]) -> Answer:
    """A fresh Clarabel's answer."""
    form = conic_form(problem)
    return split(problem, *_run(_solver(form, {**CLARABEL, **options})), form.unit)


def split(problem: WrenchProblem, x: Array | None, said: str, unit: float) -> Answer:
    """x = (f, w) / unit into (w, f); a missing answer becomes nan, which no one can use."""
    nw, n = problem.jacobian.shape
    full = np.full(n + nw, np.nan) if x is None or np.size(x) != n + nw else unit * np.asarray(x, dtype=float)
    return full[n:].copy(), full[:n].copy(), said


def _run(solver: Any) -> tuple[Array, str]:
    answer = solver.solve()
    return np.array(answer.x), str(answer.status)


def _entries(matrix: Array, pattern: Array) -> Array:
    """The entries of the pattern, column after column, zero or not."""
    return matrix.T[pattern.T]


def _sparse(matrix: Array, pattern: Array) -> Any:
    """The matrix in compressed columns with every entry of the pattern, zero or not."""
    from scipy import sparse

    out = sparse.csc_matrix(pattern.astype(float))
    out.data = _entries(matrix, pattern)
    return out


def _solver(form: ConicForm, options: dict[str, Any]) -> Any:
    P, A = (_sparse(m, p) for m, p in zip(form[:2], form.pattern, strict=True))
    orders = (3,) * ((len(form.b) - form.balance - form.linear) // 3)
    return clarabel_solver(P, np.zeros(form.P.shape[0]), A, form.b, (form.balance, form.linear, orders), options)


def clarabel_solver(
    P: Any, q: Array, A: Any, b: Array, cones: tuple[int, int, tuple[int, ...]], options: dict[str, Any]
) -> Any:
    """Clarabel, set up.

    Args:
        P, A: sparse in compressed columns, of P the upper triangle.
        cones: numbers of equalities and half-lines, sizes of the second-order cones.

    Raises:
        ValueError: a setting that Clarabel does not have.
    """
    import clarabel

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    for key, value in options.items():
        if not hasattr(settings, key):
            raise fail("options", key, "a setting of Clarabel")
        setattr(settings, key, value)
    zero, linear, orders = cones
    kinds = [clarabel.ZeroConeT(zero), clarabel.NonnegativeConeT(linear)]
    return clarabel.DefaultSolver(P, q, A, b, kinds + [clarabel.SecondOrderConeT(order) for order in orders], settings)
