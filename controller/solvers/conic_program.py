"""Convex quadratic programs over half-lines and second-order cones, their answers, and the residual of an answer.

    min 1/2 x'P x + q'x   s.t.   A x + s = b,   s in {0}^zero x (half-lines)^linear x (second-order cones)

A second-order cone is {(t, u): |u| <= t}. A program without one is a QP, which any backend of qpsolvers can solve.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np
from pivoting.controller.kernels.compilation import kernel, subroutine
from pivoting.controller.solvers.block_matrix import Sparse
from pivoting.controller.validate import Array

USABLE = 1e-6  # relative KKT residual up to which an answer is taken


class Cones(NamedTuple):
    """The kinds of a program's rows, in this order.

    Attributes:
        zero, linear: numbers of equalities and of half-lines.
        orders: sizes of the second-order cones, in rows.
    """

    zero: int
    linear: int
    orders: tuple[int, ...]


class ConicProgram(NamedTuple):
    """A conic program, with P (n, n), of which the upper triangle is stored, and A (m, n).

    Their patterns contain every entry that may be nonzero, so that all programs from one source have the same pattern.
    """

    P: Sparse
    q: Array
    A: Sparse
    b: Array
    cones: Cones


@dataclass(frozen=True, eq=False)
class ConicAnswer:
    """The answer of a solver to a program.

    Attributes:
        program: the program that was to be solved.
        x: (n,), z: (m,) multipliers of the rows; nan where the solver gave none.
        message: the solver's own report.
        seconds: inside the solver.
    """

    program: ConicProgram
    x: Array
    z: Array
    message: str
    seconds: float

    @cached_property
    def residual(self) -> float:
        """The relative KKT residual, see `program_residual`, computed here and not by the solver."""
        return program_residual(self.program, self.x, self.z)


def no_answer(program: ConicProgram, message: str, seconds: float) -> ConicAnswer:
    """The answer that stands for none: it consists of nan, which never passes as certified."""
    return ConicAnswer(program, np.full(len(program.q), np.nan), np.full(len(program.b), np.nan), message, seconds)


class ConicSolver(Protocol):
    """A function that solves one program after another."""

    def __call__(self, program: ConicProgram) -> ConicAnswer:
        """Solve a program; the answer is nan where there is none."""
        ...


def program_residual(program: ConicProgram, x: Array, z: Array) -> float:
    """The relative KKT residual of x (n,) and multipliers z (m,): the greatest of four residuals.

    They are the distance of s from its cone and of z from the dual cone, stationarity, and complementarity. Each is
    relative to its own largest term or to 1, whichever is greater. The result is nan if they are not finite.
    """
    P, A, (zero, linear, orders) = program.P, program.A, program.cones
    cones = zero, linear, np.array(orders, dtype=np.int64)
    matrices = (P.data, P.indices, P.indptr), (A.data, A.indices, A.indptr)
    sums = np.zeros(len(x)), np.zeros(len(x)), program.b.copy(), np.zeros(len(z))
    return float(_residual(*matrices, program.q, program.b, cones, x, z, sums))


@kernel
def _residual(curvature, rows, q, b, cones, x, z, sums):  # type: ignore[no-untyped-def]
    """As `program_residual`, of matrices by columns; `sums` are 0, 0, b, 0, and become P x, A'z, b - A x, |A||x|."""
    P, P_row, P_column = curvature
    A, A_row, A_column = rows
    zero, linear, orders = cones
    curved, pull, s, terms = sums
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
