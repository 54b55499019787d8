"""Wrench problems as conic programs in x = (f, w), in units of their load; with pyramids for cones they are QPs."""

from functools import cache

import numpy as np
from pivoting.controller.cone_constraints import friction_limits
from pivoting.controller.solvers.block_matrix import BlockMatrix, Indices, Part
from pivoting.controller.solvers.conic_program import Cones, ConicProgram
from pivoting.controller.validate import Array
from pivoting.controller.wrench_problem import WrenchProblem


class WrenchProgram:
    """Assembles the conic programs of wrench problems of one shape.

        min 1/2 f'Q_f f + 1/2 w'Q_w w   s.t.   J f + w = required,   f in its truncated friction cones

    Forces are in units of the load, and the weights are scaled to the order of one. Since the cones are homogeneous,
    this changes nothing except the meaning of a solver's absolute tolerances.

    Args:
        contacts, dim: of the problems.
        edges: number of edges of the pyramids that replace the cones in space; 0 for the cones themselves.
        members: V, of the cones at each contact.
    """

    def __init__(self, contacts: int, dim: int, edges: int = 0, members: int = 1):
        nw, n = 3 * dim - 3, contacts * dim
        self._dim, self._edges = dim, edges
        cones = friction_limits(np.ones(contacts), np.ones(contacts), dim, edges, np.zeros((members, contacts, dim)))
        self.cones = Cones(nw, len(cones.linear), cones.orders)
        f, w = np.arange(n), np.arange(n, n + nw)
        balance, linear, cone = np.split(np.arange(nw + len(cones.linear) + len(cones.cone)), np.cumsum(self.cones[:2]))

        def part(rows: Indices, columns: Indices, mask: Array, still: Array | None = None) -> Part:
            return Part(rows[None], columns[None], mask != 0.0, still)

        self._A = BlockMatrix(
            (nw + len(linear) + len(cone), n + nw),
            [
                part(balance, f, np.ones((nw, n))),
                part(balance, w, np.eye(nw), np.eye(nw)),
                part(linear, f, cones.linear),
                part(cone, f, cones.cone),
            ],
        )
        weights = [part(columns, columns, np.triu(np.ones((len(columns), len(columns))))) for columns in (f, w)]
        self._P = BlockMatrix((n + nw, n + nw), weights)

    def assemble(self, problem: WrenchProblem) -> tuple[ConicProgram, float]:
        """The program and the unit [N] of its forces; without a load the unit is 0, and the answer exactly zero."""
        # lists are faster than NumPy for so few; no entry of a positive definite matrix exceeds those on its diagonal
        tips = problem.apex.ravel().tolist() if problem.moved else []
        unit = max(map(abs, problem.required.tolist() + problem.f_min.tolist() + tips))
        scale = unit or 1.0
        heaviest = max(problem.Q_f.diagonal().tolist() + problem.Q_w.diagonal().tolist())
        cones = friction_limits(problem.mu_planned, problem.f_min / scale, self._dim, self._edges, problem.apex / scale)
        J = np.array(problem.jacobian)  # that may be written: kernels tell the two apart
        A = self._A.filled((J[None], cones.linear[None], cones.cone[None]))
        P = self._P.filled(((problem.Q_f / heaviest)[None], (problem.Q_w / heaviest)[None]))
        b = np.concatenate([problem.required / scale, cones.linear_side, cones.cone_side])
        return ConicProgram(P, np.zeros(A.shape[1]), A, b, self.cones), unit

    def wrench_and_force(self, x: Array, unit: float) -> tuple[Array, Array]:
        """The wrench (nw,) and the forces (K d,) in SI units, from an answer to a program with forces in `unit`."""
        full = unit * x
        n = len(full) - self.cones.zero
        return full[n:].copy(), full[:n].copy()


@cache
def wrench_program(contacts: int, dim: int, edges: int = 0, members: int = 1) -> WrenchProgram:
    """The `WrenchProgram` of a shape, which is made once and kept."""
    return WrenchProgram(contacts, dim, edges, members)
