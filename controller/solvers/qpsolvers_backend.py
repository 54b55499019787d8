"""Calls a QP solver through the package qpsolvers: the backends that are installed, their options, their answers."""

import contextlib
import os
import warnings
from functools import cache
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from pivoting.controller.solvers.clarabel_backend import SETTINGS
from pivoting.controller.solvers.conic_program import ConicAnswer, ConicProgram, no_answer
from pivoting.controller.validate import fail
from scipy import sparse

# Options of backends whose own default tolerance is looser than ours; programs are in units of the order of one.
OPTIONS: dict[str, dict[str, Any]] = {
    "clarabel": {**SETTINGS["horizon, carefully"], "static_regularization_constant": 1e-9},  # for QPs this serves all
    "cvxopt": {"feastol": 1e-10, "abstol": 1e-11, "reltol": 1e-10},
    "ecos": {"feastol": 1e-10, "abstol": 1e-10, "reltol": 1e-10},
    "osqp": {"eps_abs": 1e-9, "eps_rel": 1e-9, "polishing": True, "max_iter": 100_000},
    "piqp": {
        "eps_abs": 1e-11,
        "eps_rel": 1e-11,
        "eps_duality_gap_abs": 1e-12,
        "eps_duality_gap_rel": 1e-12,
        "eps_primal_inf": 1e-10,  # its own 1e-4 calls programs infeasible whose guess is far off
        "eps_dual_inf": 1e-10,
        "preconditioner_iter": 1,
    },
    "proxqp": {"eps_abs": 1e-11, "eps_rel": 0.0},
    "scs": {"eps_abs": 1e-9, "eps_rel": 1e-9},
}
SPARSE_OPTIONS: dict[str, dict[str, Any]] = {  # on top of those, for sparse matrices
    "piqp": {
        "eps_abs": 1e-10,  # with 1e-11, as above, no more of 600 random horizons are solved
        "eps_rel": 1e-10,
        "kkt_solver": "sparse_ldlt_ineq_cond",  # inequalities are taken out first: most rows bear on few columns
    },
}
SMALL = 30  # columns up to which matrices are dense where a backend takes both kinds: piqp is then faster


def installed_backend(method: str) -> str:
    """The backend that "qp:<backend>" names; no other backend takes its place.

    Raises:
        ValueError: it is not installed, or does not solve.
    """
    name, installed = method.removeprefix("qp:"), _qpsolvers().available_solvers
    if name not in installed:
        raise fail("method", method, "qp:<backend> with an installed backend: " + ", ".join(sorted(installed)))
    if not _answers(name):
        raise fail("method", method, f"qp:<backend> with one that solves; {name} is installed, but may lack a licence")
    return name


def installed_backends() -> list[str]:
    """The names of all backends that can solve here, which depends on what is installed and licensed."""
    return [name for name in sorted(_qpsolvers().available_solvers) if _answers(name)]


class QuadraticBackend:
    """Solves programs without second-order cones with a backend of qpsolvers.

    What it converts, it keeps as long as the pattern of the programs stays the same.

    Args:
        name: of the backend, see `installed_backend`.
        options: of the backend, on top of `OPTIONS`.

    Raises:
        ValueError: a KKT solver that piqp does not have.
    """

    def __init__(self, name: str, **options: Any):
        self._name = name
        self._dense, self._sparse = name in _qpsolvers().dense_solvers, name in _qpsolvers().sparse_solvers
        self._small = 0 if "kkt_solver" in options else SMALL  # such a solver of piqp's is for sparse matrices
        self._options = {**OPTIONS.get(name, {}), **options}
        self._sparse_options = {**self._options, **SPARSE_OPTIONS.get(name, {}), **options}
        if name == "piqp":
            self._sparse_options["kkt_solver"] = _piqp_kkt_solver(self._sparse_options["kkt_solver"])
        self._split: _Split | None = None

    def __call__(self, program: ConicProgram) -> ConicAnswer:
        """Solve a program; the answer is nan where there is none.

        Raises:
            ValueError: an option that the backend does not have, or a program with second-order cones.
        """
        if program.cones.orders:
            raise fail("method", f"qp:{self._name}", "clarabel: the program has second-order cones")
        start = perf_counter()
        large = self._sparse and len(program.q) > self._small
        P, A, G = self._sparse_matrices(program) if large else self._dense_matrices(program)
        options = self._sparse_options if large else self._options
        zero, b = program.cones.zero, program.b
        problem = _qpsolvers().Problem(P, program.q, G, b[zero:], A, b[:zero])
        try:
            found = _qpsolvers().solve_problem(problem, solver=self._name, **options)
        except TypeError as error:  # an option that it does not have
            raise fail("options", options, f"options of {self._name} ({error})") from None
        except Exception as error:  # each backend has its own: what it says is kept, and there is no answer
            return no_answer(program, f"{type(error).__name__}: {error}", perf_counter() - start)
        seconds = perf_counter() - start
        if found.x is None or np.shape(found.x) != program.q.shape:
            return no_answer(program, "not found", seconds)
        z = np.full(len(b), np.nan)
        if found.y is not None and found.z is not None:
            z[:zero], z[zero:] = found.y, found.z
        return ConicAnswer(program, np.asarray(found.x), z, "Solved" if found.found else "not found", seconds)

    def _sparse_matrices(self, program: ConicProgram) -> list[Any]:
        """The full P, the rows of equality, the others."""
        if self._split is None or not self._split.fits(program):
            self._split = _Split(program)
        return self._split(program)

    def _dense_matrices(self, program: ConicProgram) -> list[Any]:
        """The same as dense arrays, or converted from them for a backend that takes sparse matrices alone."""
        rows, zero = program.A.dense(), program.cones.zero
        matrices = [program.P.dense(mirrored=True), rows[:zero], rows[zero:]]
        return matrices if self._dense else [sparse.csc_matrix(matrix) for matrix in matrices]


class _Split:
    """Takes programs of one pattern apart, as sparse matrices: the full P, the rows of equality, the others."""

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


@cache
def _qpsolvers() -> Any:
    """The package, which warns about deprecated backends when it is imported."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import qpsolvers
    return qpsolvers


@cache
def _answers(name: str) -> bool:
    """Whether a backend solves min x^2 / 2 s.t. x >= 1: one that is installed may lack its licence."""
    if name == "mosek" and not _mosek_licence():
        return False
    one = np.ones((1, 1))
    P, G = (one, -one)
    if name not in _qpsolvers().dense_solvers:
        P, G = sparse.csc_matrix(P), sparse.csc_matrix(G)
    with contextlib.suppress(Exception), warnings.catch_warnings():  # each backend has exceptions of its own
        warnings.simplefilter("ignore")
        problem = _qpsolvers().Problem(P, np.zeros(1), G, -np.ones(1))
        return bool(_qpsolvers().solve_problem(problem, solver=name).found)
    return False


def _mosek_licence() -> bool:
    """Without one Mosek complains on stdout; Drake's wheel brings it along."""
    return "MOSEKLM_LICENSE_FILE" in os.environ or (Path.home() / "mosek" / "mosek.lic").exists()


def _piqp_kkt_solver(named: Any) -> Any:
    """piqp's own value for a name; what is no name is handed on."""
    import piqp

    found = getattr(piqp.KKTSolver, named, None) if isinstance(named, str) else named
    if found is None:
        raise fail("options", named, "a KKT solver of this release of piqp")
    return found
