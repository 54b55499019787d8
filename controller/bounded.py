"""The wrench problem with bounds: what is applied where the smallest wrench is more than an actuator can give.

    min  1/2 w'Q_w w + 1/2 f'Q_f f + rho_a |a| + rho_s |s|   s.t.  J f + w = required + B a + s,  cones,  bounds on w

a is an angular acceleration about the contacts that is given up, s what else has to be; the penalties are exact, so
that both are zero where the bounds allow it, and s is where giving up a is enough. Always feasible.
"""

from dataclasses import dataclass

import numpy as np
from pivoting.controller.block_matrix import BlockMatrix, Part
from pivoting.controller.bounds import WrenchBounds
from pivoting.controller.conic_program import ClarabelInPlace, Cones, ConicProgram, kkt_residual
from pivoting.controller.contact_set import free_axes
from pivoting.controller.controller import WrenchController
from pivoting.controller.limits import friction_limits, wrench_limits
from pivoting.controller.so3 import fill_hat
from pivoting.controller.space import rotation_matrix
from pivoting.controller.validate import Array, number

GIVE_UP, BREAK = 1e2, 1e4  # rho_a and rho_s, in weights: far above any multiplier of an answer that is worth having
POOR = 1e-8  # relative KKT residual
EXACT = 1e-6  # of the weight: less than this is nothing given up


@dataclass(frozen=True, eq=False)
class BoundedWrench:
    """An answer within bounds.

    Attributes:
        wrench: (nw,) object axes [N, N m].  force: (K, d) contact axes [N].
        lacking: (nw,) required minus what contact and wrench make together, object axes [N, N m].
        residual: relative KKT residual of the program above.
        exact: nothing is lacking.
    """

    wrench: Array
    force: Array
    lacking: Array
    residual: float
    exact: bool


class BoundedSolver:
    """Solves wrench problems of one controller within bounds; Clarabel is set up once.

    Args:
        controller: whose problems they are.
        bounds: on the wrench.
        dt: time between two wrenches, for bounds on the rate [s].
    """

    def __init__(self, controller: WrenchController, bounds: WrenchBounds, dt: float):
        number("dt", dt, above=0.0, unit="s")
        belief, dim = controller.belief, controller.space.dim
        self._controller, self._belief = controller, belief
        self._unit = belief.mass * (float(np.linalg.norm(belief.gravity)) or 1.0)
        length = float(np.linalg.norm(belief.pivot)) or 1.0
        nw, n = len(belief.Q_w), len(belief.Q_f)
        self._scale = self._unit * np.array([1.0] * dim + [length] * (nw - dim))
        self._friction = friction_limits(belief.mu, belief.f_min / self._unit, dim)
        self._bounds = wrench_limits(bounds, nw, 0, self._scale, dt)
        self._axes = free_axes(belief.points, belief.pivot, belief.wrench_map)
        A = len(self._axes)
        self._shape = nw, n, A
        wide = n + nw + A + nw + 2
        f, w, a, s = np.split(np.arange(wide - 2), np.cumsum([n, nw, A]))
        t_a, t_s = wide - 2, wide - 1
        own, bound = self._friction, self._bounds
        linear, cone = np.zeros((len(own.linear) + len(bound.linear), wide)), []
        linear[: len(own.linear), f], linear[len(own.linear) :, w] = own.linear, bound.linear
        for rows, columns in ((own.cone, f), (bound.cone, w)):
            block = np.zeros((len(rows), wide))
            block[:, columns] = rows
            cone.append(block)
        for top, columns in ((t_a, a), (t_s, s)):
            block = np.zeros((1 + len(columns), wide))
            block[0, top] = -1.0
            block[1:, columns] = -np.eye(len(columns))
            cone.append(block)
        balance = np.zeros((nw, wide))
        balance[:, f], balance[:, w], balance[:, a], balance[:, s] = 1.0, np.eye(nw), 1.0, -np.eye(nw)
        self._rows = np.vstack([balance, linear, *cone])
        self._given = a
        self._cones = Cones(nw, len(linear), own.orders + bound.orders + (1 + A, 1 + nw))
        P = np.zeros((wide, wide))
        P[np.ix_(f, f)] = belief.Q_f
        P[np.ix_(w, w)] = self._scale[:, None] * belief.Q_w * self._scale / self._unit**2
        self._P = _pattern(np.triu(P)).filled([np.triu(P)[None]])
        self._A = _pattern(self._rows)
        self._q = np.zeros(wide)
        self._q[t_a], self._q[t_s] = GIVE_UP, BREAK
        self._solve = ClarabelInPlace()

    def __call__(self, orientation: Array, required: Array, before: Array | None = None) -> BoundedWrench:
        """The answer to a problem of the controller.

        Args:
            orientation: (4,) object axes to world, at which it was stated.
            required: (nw,) see `WrenchProblem`.
            before: (nw,) wrench applied until now, for bounds on the rate; None: not known.
        """
        nw, n, _ = self._shape
        jacobian = self._controller.jacobian(orientation)
        rows = self._rows.copy()
        rows[:nw, :n] = jacobian * self._unit / self._scale[:, None]
        rows[:nw, self._given] = -self._turning(orientation)
        last = None if before is None else np.asarray(before, dtype=float) / self._scale
        sides = self._bounds.sides(1, last)
        rest = np.zeros(sum(self._cones.orders[-2:]))
        b = [
            required / self._scale,
            self._friction.linear_side,
            sides[0][0],
            self._friction.cone_side,
            sides[1][0],
            rest,
        ]
        program = ConicProgram(self._P, self._q, self._A.filled([rows[None]]), np.concatenate(b), self._cones)
        answer = self._solve(program)
        residual = kkt_residual(program, answer)
        if not residual <= POOR:  # scaled for another problem: begin anew, and keep the better of the two
            again = ClarabelInPlace()(program)
            better = kkt_residual(program, again)
            if better < residual or not np.isfinite(residual):
                answer, residual = again, better
        force, wrench = answer.x[:n] * self._unit, answer.x[n : n + nw] * self._scale
        lacking = required - jacobian @ force - wrench
        exact = bool(np.abs(lacking / self._scale).max() <= EXACT)
        return BoundedWrench(
            wrench, force.reshape(len(self._belief.mu), -1), lacking, residual, exact
        )  # fmt: skip

    def _turning(self, orientation: Array) -> Array:
        """(nw, A) B, the wrenches that accelerate the object about its free axes, with entries up to 1."""
        belief = self._belief
        lever, hat = belief.pivot + rotation_matrix(orientation).T @ belief.offset, np.empty((3, 3))
        fill_hat(*-lever, hat)
        push = np.hstack([belief.mass * self._axes @ hat, self._axes @ belief.inertia])  # a x (-lever) = a hat(-lever)
        B = belief.wrench_map @ push.T / self._scale[:, None]
        return B / max(1e-300, float(np.abs(B).max(initial=0.0)))


def _pattern(matrix: Array) -> BlockMatrix:
    """Of a matrix (r, c), all of whose entries that may be other than zero are so."""
    r, c = matrix.shape
    return BlockMatrix((r, c), [Part(np.arange(r)[None], np.arange(c)[None], matrix != 0.0)])
