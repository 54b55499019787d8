"""The wrench problem with bounds on the wrench, for steps in which the smallest wrench would exceed them.

    min  1/2 w'Q_w w + 1/2 f'Q_f f + rho_a |a| + rho_s |s|   s.t.  J f + w = required + B a + s,  cones,  bounds on w

Here a is the angular acceleration about the contacts that has to be given up, and s whatever else has to be given up.
The penalties are exact: a and s are zero where the bounds allow the required motion, and s is zero where giving up a is
enough. The problem is always feasible.

Where the controller believes in a set of worlds, the cones are moved, and the grip in all of them comes before the
motion: a is given up for it. How far the cones are moved depends on the torque about the contacts, and so on a. The
program knows the slopes, and is solved again with the cones and slopes at the torque that its answer makes, until the
forces are in the cones that belong to it. This is Newton's method: each member's cone moves in proportion to a, but one
that many members share is moved by the worst of them, and its slope jumps. Where it does not succeed, or s is not zero,
no wrench within bounds is known to hold all worlds: then the cones are those of the believed world alone, and the
answer says so.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from pivoting.controller.cone_constraints import ConeConstraints, cone_slack, friction_limits, wrench_limits
from pivoting.controller.kernels.compilation import kernel
from pivoting.controller.mobility import free_axes
from pivoting.controller.plane_and_space import component
from pivoting.controller.rotations import cross, fill_rotation, into
from pivoting.controller.solvers.block_matrix import BlockMatrix, Indices, Part, Sparse
from pivoting.controller.solvers.clarabel_backend import ClarabelWithRetry
from pivoting.controller.solvers.conic_program import Cones, ConicProgram
from pivoting.controller.uncertainty.believed_set import vertices
from pivoting.controller.validate import Array, number
from pivoting.controller.wrench_bounds import WrenchBounds
from pivoting.controller.wrench_controller import WrenchController

GIVE_UP, BREAK = 1e2, 1e4  # rho_a and rho_s, in weights: far above any multiplier of an answer that is worth having
EXACT = 1e-6  # of the weight: less than this is nothing given up
PASSES = 8  # in which the cones are moved for the torque that the last answer makes
NEAR = 1e-4  # the step in a with which the slopes of the cones are measured; they are linear, but for kinks
WITHIN = 1e-8  # of the weight: what a solver leaves of a force on the edge of a cone


class _Moved(NamedTuple):
    """Apexes (V, K, d) and floors (K,) of the contacts' cones at a = 0, and their slopes (..., A) in a [N]."""

    apex: Array
    floor: Array
    apex_slope: Array
    floor_slope: Array


@dataclass(frozen=True, eq=False)
class BoundedWrench:
    """The answer to a wrench problem with bounds.

    Attributes:
        wrench: (nw,) object axes [N, N m].  force: (K, d) contact axes [N].
        lacking: (nw,) the required wrench minus that of the contacts and the applied one, object axes [N, N m].
        residual: relative KKT residual of the problem in the head of this file.
        exact: whether nothing is lacking.
        guaranteed: whether the contacts stick in all worlds that the controller believes possible.
    """

    wrench: Array
    force: Array
    lacking: Array
    residual: float
    exact: bool
    guaranteed: bool


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
        self._controller, self._belief, self._dim = controller, belief, dim
        self._unit, self._scale = controller.units.force, controller.units.wrench
        nw, n = len(belief.source.Q_w), len(belief.contacts.Q_f)
        self._axes = free_axes(belief.contacts.points, belief.contacts.pivot, belief.source.map)
        A, of_set = len(self._axes), float(belief.unknown is not None)
        self._nominal = self._unmoved()
        self._flat = self._slopes(self._nominal)
        own = self._own(*self._nominal[:2])
        bound = self._bounds = wrench_limits(bounds, nw, 0, self._scale, dt)
        wide = n + nw + A + nw + 2
        f, w, a, s, t_a, t_s = np.split(np.arange(wide), np.cumsum([n, nw, A, nw, 1]))
        self._cones = Cones(nw, len(own.linear) + len(bound.linear), own.orders + bound.orders + (1 + A, 1 + nw))
        sides = [np.zeros(nw), own.linear_side, bound.linear_side, own.cone_side, bound.cone_side, np.zeros(2 + A + nw)]
        self._sides = np.concatenate(sides)
        tops = np.cumsum([0, nw, len(own.linear), len(bound.linear), len(own.cone), len(bound.cone), 1, A, 1, nw])
        self._first = int(tops[2]), int(tops[4])
        self._linear, self._cone = slice(tops[1], tops[2]), slice(tops[3], tops[4])

        def part(first: int, columns: Indices, block: Array, changes: bool = False) -> Part:
            rows = tops[first] + np.arange(len(block))
            return Part(rows[None], columns[None], block != 0.0, None if changes else block)

        minus = -np.ones((1, 1))
        self._A = BlockMatrix(
            (int(tops[-1]), wide),
            [
                part(0, f, np.ones((nw, n)), changes=True),
                part(0, a, np.ones((nw, A)), changes=True),
                part(1, a, np.full((len(own.linear), A), of_set), changes=True),
                part(3, a, np.full((len(own.cone), A), of_set), changes=True),
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
        self._P, self._q = self._weights(wide, f, w), np.zeros(wide)
        self._q[t_a], self._q[t_s] = GIVE_UP, BREAK
        self._solve = ClarabelWithRetry(step=0.999)  # 14 iterations in place of 20

    def __call__(
        self,
        orientation: Array,
        required: Array,
        before: Array | None = None,
        omega: Array | None = None,
        external: Array | None = None,
    ) -> BoundedWrench:
        """Solve a problem of the controller within the bounds.

        Args:
            orientation: (4,) of the object in that problem, object axes to world.
            required: (nw,) see `WrenchProblem`.
            before: (nw,) the wrench applied until now, for bounds on the rate; None if it is not known.
            omega: (3,) measured angular velocity, world axes [rad/s], which moves the cones of a set; None: at rest.
            external: (nw,) the known wrench besides, object axes, that was subtracted in `required`; None: none.
        """
        turning = np.empty((len(self._scale), len(self._axes)))
        _fill_turning(self._axes, np.array(orientation), self._belief[:3], self._scale, np.empty((3, 3)), turning)
        problem = orientation, required, before, turning
        if self._belief.unknown is None:
            return self._solved(*problem, self._nominal)[0]
        measured = orientation, np.zeros(3) if omega is None else omega
        total, B = required if external is None else required + external, -self._scale[:, None] * turning
        a = np.zeros(len(self._axes))
        for _ in range(PASSES):
            answer, a = self._solved(*problem, self._moved(measured, total, B, a))
            if not answer.guaranteed:
                break
            if self._slack(answer.force, *self._controller.moved_cones(*measured, total + B @ a)) >= -WITHIN:
                return answer
        return replace(self._solved(*problem, self._nominal)[0], guaranteed=False)

    def _unmoved(self) -> _Moved:
        """The cones of the believed world alone, as often as the set has cones."""
        held, unknown = self._belief.contacts, self._belief.unknown
        K, A = len(held.mu), len(self._axes)
        members = 1 if unknown is None or K * self._dim == 2 else vertices(unknown)
        apex = np.zeros((members, K, self._dim))
        return _Moved(apex, held.f_min, np.zeros((*apex.shape, A)), np.zeros((K, A)))

    def _moved(self, measured: tuple[Array, Array], total: Array, B: Array, a: Array) -> _Moved:
        """The cones near the torque that giving up `a` (A,) leaves of that of the required wrench `total` (nw,)."""
        apex, floor = self._controller.moved_cones(*measured, total + B @ a)
        slopes = np.zeros((*apex.shape, len(a))), np.zeros((*floor.shape, len(a)))
        for j, step in enumerate(NEAR * np.eye(len(a))):
            near = self._controller.moved_cones(*measured, total + B @ (a + step))
            for slope, there, here in zip(slopes, near, (apex, floor), strict=True):
                slope[..., j] = (there - here) / NEAR
        return _Moved(apex - slopes[0] @ a, floor - slopes[1] @ a, *slopes)

    def _own(self, apex: Array, floors: Array) -> ConeConstraints:
        """The cones of the contacts, with apexes (V, K, d) and floors (K,) [N]."""
        return friction_limits(self._belief.contacts.mu, floors / self._unit, self._dim, 0, apex / self._unit)

    def _slopes(self, cones: _Moved) -> tuple[Array, Array]:
        """What the rows of the contacts' cones have in the columns of a: their sides are linear in apex and floor."""
        each = [self._own(cones.apex_slope[..., j], cones.floor_slope[:, j]) for j in range(len(self._axes))]
        own = self._own(*cones[:2])
        linear, cone = np.zeros((1, len(own.linear), len(each))), np.zeros((1, len(own.cone), len(each)))
        for j, slope in enumerate(each):
            linear[0, :, j], cone[0, :, j] = -slope.linear_side, -slope.cone_side
        return linear, cone

    def _slack(self, force: Array, apex: Array, floors: Array) -> float:
        """How far forces (K, d) are from the edges of the cones and from the floors, along the normals, in weights."""
        return cone_slack(force, apex, self._belief.contacts.mu, floors) / self._unit

    def _weights(self, wide: int, f: Indices, w: Indices) -> Sparse:
        """P, of the forces and the wrench in their units."""
        P = np.zeros((wide, wide))
        P[np.ix_(f, f)] = self._belief.contacts.Q_f
        P[np.ix_(w, w)] = self._scale[:, None] * self._belief.source.Q_w * self._scale / self._unit**2
        P, every = np.triu(P), np.arange(wide)[None]
        return BlockMatrix((wide, wide), [Part(every, every, P != 0.0, P)]).filled(())

    def _solved(
        self, orientation: Array, required: Array, before: Array | None, turning: Array, cones: _Moved
    ) -> tuple[BoundedWrench, Array]:
        """The answer with these cones, guaranteed if nothing but a turn is given up; and a (A,), which is that turn."""
        nw, n, A = len(self._scale), len(self._belief.contacts.Q_f), len(self._axes)
        jacobian = self._controller.jacobian(orientation)
        scaled = jacobian * self._unit / self._scale[:, None]
        b, own = self._sides.copy(), self._own(*cones[:2])
        b[:nw], b[self._linear], b[self._cone] = required / self._scale, own.linear_side, own.cone_side
        self._bounds.place(b, self._first, None if before is None else np.asarray(before, dtype=float) / self._scale)
        slopes = self._flat if cones is self._nominal else self._slopes(cones)
        filled = self._A.filled((scaled[None], turning[None], *slopes))
        answer = self._solve(ConicProgram(self._P, self._q, filled, b, self._cones))
        force, wrench = answer.x[:n] * self._unit, answer.x[n : n + nw] * self._scale
        a, s = np.split(answer.x[n + nw : n + nw + A + nw], [A])
        lacking = required - jacobian @ force - wrench
        exact = bool(np.abs(lacking / self._scale).max() <= EXACT)
        if exact:  # to the last bit: what a solver leaves of an equality is no lack, and costs the bound as little
            wrench = required - jacobian @ force
            lacking, a = np.zeros(nw), np.zeros(A)
        forces, kept = force.reshape(len(self._belief.contacts.mu), -1), bool(np.abs(s).max() <= EXACT)
        return BoundedWrench(wrench, forces, lacking, answer.residual, exact, kept), a


@kernel
def _fill_turning(axes, q, belief, scale, R, out):  # type: ignore[no-untyped-def]
    """Write -B (nw, A), the wrenches that accelerate the object about its free axes, in `scale`, with entries up to 1.

    Args:
        axes: (A, 3) object axes.  q: (4,) object axes to world.  R: (3, 3) scratch.
        belief: the first three values of a `Belief`.
    """
    moved, held, source = belief
    p, o, m, inertia = held.pivot, held.offset, moved.mass, moved.inertia
    fill_rotation(q, R)
    o0, o1, o2 = into(R, o[0], o[1], o[2])
    most = 1e-300
    for j in range(axes.shape[0]):
        a0, a1, a2 = axes[j, 0], axes[j, 1], axes[j, 2]
        F0, F1, F2 = cross(a0, a1, a2, p[0] + o0, p[1] + o1, p[2] + o2)  # minus the acceleration of the CoM
        M0 = -(inertia[0, 0] * a0 + inertia[0, 1] * a1 + inertia[0, 2] * a2)
        M1 = -(inertia[1, 0] * a0 + inertia[1, 1] * a1 + inertia[1, 2] * a2)
        M2 = -(inertia[2, 0] * a0 + inertia[2, 1] * a1 + inertia[2, 2] * a2)
        for row in range(out.shape[0]):
            out[row, j] = component(source.map, row, m * F0, m * F1, m * F2, M0, M1, M2) / scale[row]
            most = max(most, abs(out[row, j]))
    for row in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[row, j] /= most
