"""The wrench problem with bounds on the wrench, for steps in which the smallest wrench would exceed them.

    min  1/2 w'Q_w w + 1/2 f'Q_f f + rho_a |a| + rho_s |s|   s.t.  J f + w = required + B a + s,  cones,  bounds on w

Here a is the angular acceleration about the contacts that has to be given up, and s whatever else has to be given up.
The penalties are exact: a and s are zero where the bounds allow the required motion, and s is zero where giving up a is
enough. The problem is always feasible.
"""

from dataclasses import dataclass

import numpy as np
from pivoting.controller.cone_constraints import friction_limits, wrench_limits
from pivoting.controller.kernels.compilation import kernel
from pivoting.controller.mobility import free_axes
from pivoting.controller.plane_and_space import component
from pivoting.controller.rotations import cross, fill_rotation, into
from pivoting.controller.solvers.block_matrix import BlockMatrix, Indices, Part
from pivoting.controller.solvers.clarabel_backend import ClarabelWithRetry
from pivoting.controller.solvers.conic_program import Cones, ConicProgram
from pivoting.controller.validate import Array, number
from pivoting.controller.wrench_bounds import WrenchBounds
from pivoting.controller.wrench_controller import WrenchController

GIVE_UP, BREAK = 1e2, 1e4  # rho_a and rho_s, in weights: far above any multiplier of an answer that is worth having
EXACT = 1e-6  # of the weight: less than this is nothing given up


@dataclass(frozen=True, eq=False)
class BoundedWrench:
    """The answer to a wrench problem with bounds.

    Attributes:
        wrench: (nw,) object axes [N, N m].  force: (K, d) contact axes [N].
        lacking: (nw,) the required wrench minus that of the contacts and the applied one, object axes [N, N m].
        residual: relative KKT residual of the problem in the head of this file.
        exact: whether nothing is lacking.
    """

    wrench: Array
    force: Array
    lacking: Array
    residual: float
    exact: bool


class BoundedSolver:
    """Solves the wrench problems of one controller within bounds, with Clarabel, which is set up once.

    Args:
        controller: the one whose problems are solved.
        bounds: on the applied wrench.
        dt: time between two wrenches, for bounds on the rate [s].
    """

    def __init__(self, controller: WrenchController, bounds: WrenchBounds, dt: float):
        number("dt", dt, above=0.0, unit="s")
        belief, dim = controller.belief, controller.space.dim
        self._controller, self._belief = controller, belief
        self._unit, self._scale = controller.units.force, controller.units.wrench
        nw, n = len(belief.source.Q_w), len(belief.contacts.Q_f)
        self._axes = free_axes(belief.contacts.points, belief.contacts.pivot, belief.source.map)
        A = len(self._axes)
        own = friction_limits(belief.contacts.mu, belief.contacts.f_min / self._unit, dim)
        bound = self._bounds = wrench_limits(bounds, nw, 0, self._scale, dt)
        wide = n + nw + A + nw + 2
        f, w, a, s, t_a, t_s = np.split(np.arange(wide), np.cumsum([n, nw, A, nw, 1]))
        self._cones = Cones(nw, len(own.linear) + len(bound.linear), own.orders + bound.orders + (1 + A, 1 + nw))
        sides = [np.zeros(nw), own.linear_side, bound.linear_side, own.cone_side, bound.cone_side, np.zeros(2 + A + nw)]
        self._sides = np.concatenate(sides)
        tops = np.cumsum([0, nw, len(own.linear), len(bound.linear), len(own.cone), len(bound.cone), 1, A, 1, nw])

        self._first = int(tops[2]), int(tops[4])

        def part(first: int, columns: Indices, block: Array, changes: bool = False) -> Part:
            rows = tops[first] + np.arange(len(block))
            return Part(rows[None], columns[None], block != 0.0, None if changes else block)

        minus = -np.ones((1, 1))
        self._A = BlockMatrix(
            (int(tops[-1]), wide),
            [
                part(0, f, np.ones((nw, n)), changes=True),
                part(0, a, np.ones((nw, A)), changes=True),
                part(0, w, np.eye(nw)),
                part(0, s, -np.eye(nw)),
                part(1, f, own.linear),
                part(2, w, bound.linear),
                part(3, f, own.cone),
                part(4, w, bound.cone),
                part(5, t_a, minus),
                part(6, a, -np.eye(A)),
                part(7, t_s, minus),
                part(8, s, -np.eye(nw)),
            ],
        )
        P = np.zeros((wide, wide))
        P[np.ix_(f, f)] = belief.contacts.Q_f
        P[np.ix_(w, w)] = self._scale[:, None] * belief.source.Q_w * self._scale / self._unit**2
        P, every = np.triu(P), np.arange(wide)[None]
        self._P = BlockMatrix((wide, wide), [Part(every, every, P != 0.0, P)]).filled(())
        self._q = np.zeros(wide)
        self._q[t_a], self._q[t_s] = GIVE_UP, BREAK
        self._solve = ClarabelWithRetry(step=0.999)  # 14 iterations in place of 20

    def __call__(self, orientation: Array, required: Array, before: Array | None = None) -> BoundedWrench:
        """Solve a problem of the controller within the bounds.

        Args:
            orientation: (4,) of the object in that problem, object axes to world.
            required: (nw,) see `WrenchProblem`.
            before: (nw,) the wrench applied until now, for bounds on the rate; None if it is not known.
        """
        nw, n = len(self._scale), len(self._belief.contacts.Q_f)
        jacobian = self._controller.jacobian(orientation)
        scaled = jacobian * self._unit / self._scale[:, None]
        b = self._sides.copy()
        b[:nw] = required / self._scale
        self._bounds.place(b, self._first, None if before is None else np.asarray(before, dtype=float) / self._scale)
        turning = np.empty((nw, len(self._axes)))
        _fill_turning(self._axes, np.array(orientation), self._belief, self._scale, np.empty((3, 3)), turning)
        program = ConicProgram(self._P, self._q, self._A.filled((scaled[None], turning[None])), b, self._cones)
        answer = self._solve(program)
        force, wrench = answer.x[:n] * self._unit, answer.x[n : n + nw] * self._scale
        lacking = required - jacobian @ force - wrench
        exact = bool(np.abs(lacking / self._scale).max() <= EXACT)
        if exact:  # to the last bit: what a solver leaves of an equality is no lack, and costs the bound as little
            wrench = required - jacobian @ force
            lacking = np.zeros(nw)
        return BoundedWrench(
            wrench, force.reshape(len(self._belief.contacts.mu), -1), lacking, answer.residual, exact
        )  # fmt: skip


@kernel
def _fill_turning(axes, q, belief, scale, R, out):  # type: ignore[no-untyped-def]
    """Write -B (nw, A), the wrenches that accelerate the object about its free axes, in `scale`, with entries up to 1.

    Args:
        axes: (A, 3) object axes.  q: (4,) object axes to world.  R: (3, 3) scratch.
    """
    p, o, inertia = belief.contacts.pivot, belief.contacts.offset, belief.object.inertia
    fill_rotation(q, R)
    o0, o1, o2 = into(R, o[0], o[1], o[2])
    most = 1e-300
    for j in range(axes.shape[0]):
        a0, a1, a2 = axes[j, 0], axes[j, 1], axes[j, 2]
        F0, F1, F2 = cross(a0, a1, a2, p[0] + o0, p[1] + o1, p[2] + o2)  # minus the acceleration of the CoM
        M0 = -(inertia[0, 0] * a0 + inertia[0, 1] * a1 + inertia[0, 2] * a2)
        M1 = -(inertia[1, 0] * a0 + inertia[1, 1] * a1 + inertia[1, 2] * a2)
        M2 = -(inertia[2, 0] * a0 + inertia[2, 1] * a1 + inertia[2, 2] * a2)
        m = belief.object.mass
        for row in range(out.shape[0]):
            out[row, j] = component(belief.source.map, row, m * F0, m * F1, m * F2, M0, M1, M2) / scale[row]
            most = max(most, abs(out[row, j]))
    for row in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[row, j] /= most
