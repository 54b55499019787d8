"""The convex program of a horizon, linearised about a guess, and how its answer corrects the guess.

Everything is in `Units`. Step t has the columns (correction of pose t, wrench t, contact forces t), and the rows of
motion and sticking (equalities), half-lines, and second-order cones.
"""

from typing import NamedTuple

import numpy as np
from pivoting.controller.cone_constraints import friction_limits, wrench_limits
from pivoting.controller.mobility import fixed_pairs
from pivoting.controller.planning.equations_of_motion import Mechanics, Path, Scratch
from pivoting.controller.planning.horizon import Horizon
from pivoting.controller.planning.horizon_rows import (
    Rows,
    defects,
    fill_corrected,
    fill_rows,
    fill_sides,
    fill_tracking,
)
from pivoting.controller.planning.integrators import INTEGRATORS
from pivoting.controller.rotations import exponential
from pivoting.controller.solvers.block_matrix import BlockMatrix, Indices, Part
from pivoting.controller.solvers.conic_program import Cones, ConicProgram
from pivoting.controller.validate import Array


class Guess(NamedTuple):
    """What a program is linearised about: poses in table axes, wrenches (N, nw), contact forces (N, K d) [N, N m]."""

    path: Path
    wrench: Array
    force: Array


class HorizonProgram:
    """Makes the convex programs of one horizon."""

    def __init__(self, horizon: Horizon):
        belief, space, N = horizon.controller.belief, horizon.controller.space, horizon.steps
        self.horizon, self._belief, self._units = horizon, belief, horizon.controller.units
        self._body = _mechanics(horizon)
        force, scale = self._units.force, self._units.wrench
        nq, n = len(belief.source.Q_w), len(belief.contacts.Q_f)
        self._fixed = fixed_pairs(belief.contacts.points, belief.contacts.pivot, belief.source.map)
        self._sticking = space.dim + len(self._fixed) if horizon.stick else 0
        self._clear = np.array(horizon.clear)
        self._Q = np.array(horizon.Q, order="C") / force**2  # one weight for all poses has strides of 0
        own = friction_limits(belief.contacts.mu, belief.contacts.f_min / force, space.dim)
        bound = wrench_limits(horizon.bounds, nq, horizon.edges, scale, horizon.h)
        linear = [len(own.linear), len(bound.linear), len(self._clear)]
        cones = [len(own.cone), len(bound.cone)]
        tall = nq + self._sticking, sum(linear), sum(cones)
        self._bounds, self._tall = bound, tall[:2]
        self._first = N * tall[0] + linear[0], N * sum(tall[:2]) + cones[0]  # rows of the first step's bounds
        self.cones = Cones(N * tall[0], N * tall[1], N * (own.orders + bound.orders))
        self._wide = 2 * nq + n
        pose, wrench, push = (np.arange(a, b) for a, b in ((0, nq), (nq, 2 * nq), (2 * nq, self._wide)))

        def part(group: int, first: int, mask: Array, columns: Indices, still: bool, lag: int = 0) -> Part:
            """Rows from `first` on in their group, of every step, against columns of the step `lag` before."""
            steps = np.arange(lag, N)[:, None]
            rows = N * sum(tall[:group]) + tall[group] * steps + first + np.arange(len(mask))
            return Part(rows, self._wide * (steps - lag) + columns, mask != 0.0, mask if still else None)

        seen, tracked = self._generic()
        rates = -bound.linear * bound.linear_rate[:, None], -bound.cone * bound.cone_rate[:, None]
        self._A = BlockMatrix(
            (N * sum(tall), N * self._wide),
            [
                *(part(0, 0, _pattern(mask), pose, False, lag) for lag, mask in enumerate(seen.motion.towards)),
                part(0, 0, _pattern(seen.motion.by_wrench), wrench, False),
                part(0, 0, _pattern(seen.motion.by_force), push, False),
                part(0, nq, _pattern(seen.sticking), pose, False),
                part(1, linear[0] + linear[1], _pattern(seen.clearance), pose, False),
                part(1, 0, own.linear, push, True),
                part(1, linear[0], bound.linear, wrench, True),
                part(1, linear[0], rates[0], wrench, True, 1),
                part(2, 0, own.cone, push, True),
                part(2, cones[0], bound.cone, wrench, True),
                part(2, cones[0], rates[1], wrench, True, 1),
            ],
        )
        sides = [np.zeros(tall[0]), own.linear_side, bound.linear_side, np.zeros(linear[2])]
        sides += [own.cone_side, bound.cone_side]
        groups = sides[0], np.concatenate(sides[1:4]), np.concatenate(sides[4:])
        self._sides = np.concatenate([np.tile(group, N) for group in groups])
        weights = np.triu(scale[:, None] * belief.source.Q_w * scale / force**2), np.triu(belief.contacts.Q_f)
        here = self._wide * np.arange(N)[:, None]
        square = [(pose, np.triu(_pattern(tracked)), None), (wrench, weights[0] != 0.0, weights[0])]
        square.append((push, weights[1] != 0.0, weights[1]))
        self._P = BlockMatrix(
            (N * self._wide, N * self._wide),
            [Part(here + columns, here + columns, mask, still) for columns, mask, still in square],
        )

    def stated(self, desired: tuple[Array, Array], guess: Guess, applied: Array | None = None) -> ConicProgram:
        """The convex program about a guess.

        Args:
            desired: of `Horizon.desired`.
            guess: its path begins where the object is, see `Horizon.start`.
            applied: (nw,) the wrench applied until now, for bounds on its rate; None if it is not known, and then the
                first wrench has no such bounds.
        """
        N, nq = self.horizon.steps, len(self._units.pose)
        rows = self._rows(guess)
        motion = rows.motion
        A = self._A.filled(
            (motion.towards[0], motion.towards[1, 1:], motion.towards[2, 2:], motion.by_wrench, motion.by_force,
             rows.sticking, rows.clearance)
        )  # fmt: skip
        b = self._sides.copy()
        fill_sides(rows, *self._tall, b)
        self._bounds.place(b, self._first, None if applied is None else applied / self._units.wrench)
        curvature, q = np.empty((N, nq, nq)), np.zeros((N, self._wide))
        fill_tracking(self._body, self._Q, guess.path, *desired, Scratch.empty(), curvature, q)
        return ConicProgram(self._P.filled((curvature,)), q.ravel(), A, b, self.cones)

    def corrected(self, guess: Guess, x: Array) -> tuple[Guess, float]:
        """The guess as an answer corrects it, with the answer's wrenches and forces, and the greatest change of all.

        The change is in weights, levers and radians.
        """
        N, path = self.horizon.steps, guess.path
        poses = path._replace(position=np.empty(path.position.shape), orientation=np.empty(path.orientation.shape))
        out = Guess(poses, np.empty(guess.wrench.shape), np.empty(guess.force.shape))
        return out, fill_corrected(self._body, x.reshape(N, self._wide), guess, Scratch.empty(), out)

    def defects(self, guess: Guess) -> tuple[float, float]:
        """How far a guess is from the nonlinear equations: motion in weights, sticking in levers, radians."""
        return defects(self._rows(guess), self._units, guess.wrench, guess.force)

    def objective(self, desired: tuple[Array, Array], guess: Guess) -> float:
        """sum 1/2 w'Q_w w + 1/2 f'Q_f f + 1/2 e'Q e, in SI units, poses taken as they are."""
        applied = np.vdot(guess.wrench @ self._belief.source.Q_w, guess.wrench)
        pushed = np.vdot(guess.force @ self._belief.contacts.Q_f, guess.force)
        N, nq = self.horizon.steps, len(self._units.pose)
        out = np.empty((N, nq, nq)), np.empty((N, nq))
        tracking = fill_tracking(self._body, self._Q, guess.path, *desired, Scratch.empty(), *out)
        return float(0.5 * (applied + pushed) + tracking * self._units.force**2)

    def _rows(self, guess: Guess) -> Rows:
        horizon, planar = self.horizon, self.horizon.controller.space.dim == 2
        nq, n = guess.wrench.shape[1], guess.force.shape[1]
        rows = Rows.empty(horizon.steps, nq, n, self._sticking, len(self._clear))
        order, lag = INTEGRATORS[horizon.integrator]
        about = self._fixed, planar, self._clear, *guess
        fill_rows(self._body, order, lag, horizon.h, *about, Scratch.empty(), rows)
        return rows

    def _generic(self) -> tuple[Rows, Array]:
        """Rows and curvature about a path without any symmetry, which show what may be other than zero."""
        rng, N, W = np.random.default_rng(0), self.horizon.steps, self._belief.source.map
        vectors = rng.normal(size=(2 * N + 3, len(W))) @ W
        turns = exponential(vectors[:, 3:])
        path = Path(
            np.ascontiguousarray(vectors[: N + 1, :3]),
            turns[: N + 1],
            np.concatenate([vectors[-1, :3], turns[-1]]),
            vectors[-2],
        )
        guess = Guess(path, rng.normal(size=(N, len(W))), rng.normal(size=(N, len(self._belief.contacts.Q_f))))
        wanted = np.ascontiguousarray(vectors[N + 1 : 2 * N + 1, :3]), turns[N + 1 : 2 * N + 1]
        curvature = np.empty((N, len(W), len(W)))
        fill_tracking(self._body, self._Q, path, *wanted, Scratch.empty(), curvature, np.empty((N, len(W))))
        return self._rows(guess), curvature


def _mechanics(horizon: Horizon) -> Mechanics:
    """The object of a horizon, in table axes."""
    belief = horizon.controller.belief
    used, component = np.nonzero(belief.source.map)
    return Mechanics(
        mass=belief.object.mass,
        inertia=np.array(belief.object.inertia),
        points=belief.contacts.points,
        pivot=belief.contacts.pivot,
        frames=np.ascontiguousarray(horizon.table.T @ belief.contacts.frames @ belief.contacts.force_map),
        gravity=horizon.table.T @ belief.object.gravity,
        pick=component,
        sign=belief.source.map[used, component],
        units=horizon.controller.units,
    )


def _pattern(blocks: Array) -> Array:
    """(r, c) which entries of (N, r, c) are more than rounding in any of them."""
    size = np.abs(blocks).max(axis=0, initial=0.0)
    return size > 1e-14 * size.max(initial=0.0)
