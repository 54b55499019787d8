"""The horizon stated as a convex program about a guess: its rows, its cost, and what an answer to it means.

Inside, forces are in units of the weight and lengths in units of the lever. Step t has the columns (correction of pose
t, wrench t, contact forces t), and rows of motion and sticking (equalities), half-lines, and second-order cones.
"""

from typing import NamedTuple

import numpy as np
from pivoting.controller.block_matrix import BlockMatrix, Indices, Part
from pivoting.controller.conic_program import Cones, ConicProgram
from pivoting.controller.contact_set import fixed_pairs
from pivoting.controller.horizon import Horizon
from pivoting.controller.horizon_rows import fill_clearance, fill_sticking, fill_tracking
from pivoting.controller.limits import friction_limits, wrench_limits
from pivoting.controller.so3 import exponential, turn_by
from pivoting.controller.transcription import INTEGRATORS, Mechanics, Path, fill_motion, motion_rows
from pivoting.controller.validate import Array


class Guess(NamedTuple):
    """About what a program is stated: poses in table axes, wrenches (N, nw) and contact forces (N, K d)."""

    path: Path
    wrench: Array
    force: Array


class _Rows(NamedTuple):
    """What depends on a guess: rows of motion (five blocks), sticking and clearance, and their right-hand sides."""

    motion: list[Array]
    sticking: Array
    clearance: Array
    sides: tuple[Array, Array, Array]


class HorizonProgram:
    """States the programs of one horizon; all in it is constant."""

    def __init__(self, horizon: Horizon):
        belief, space, N = horizon.controller.belief, horizon.controller.space, horizon.steps
        self.horizon, self._belief = horizon, belief
        used, component = np.nonzero(belief.wrench_map)
        self._body = Mechanics(
            mass=belief.mass,
            inertia=np.ascontiguousarray(belief.inertia),
            points=belief.points,
            pivot=belief.pivot,
            frames=np.ascontiguousarray(horizon.table.T @ belief.frames @ belief.force_map),
            gravity=horizon.table.T @ belief.gravity,
            pick=component,
            sign=belief.wrench_map[used, component],
        )
        nq, n = len(belief.Q_w), len(belief.Q_f)
        lengths = np.array([1.0] * space.dim + [horizon.length] * (nq - space.dim))
        self._pose_unit, self._wrench_unit = horizon.length / lengths, horizon.unit * lengths
        self._fixed = fixed_pairs(belief.points, belief.pivot, belief.wrench_map)
        self._sticking = space.dim + len(self._fixed) if horizon.stick else 0
        self._friction = friction_limits(belief.mu, belief.f_min / horizon.unit, space.dim)
        self._bounds = wrench_limits(horizon.bounds, nq, horizon.edges, self._wrench_unit, horizon.h)
        self._Q = np.array(horizon.Q) / horizon.unit**2
        weights = [self._wrench_unit[:, None] * belief.Q_w * self._wrench_unit / horizon.unit**2, belief.Q_f]
        linear = [len(self._friction.linear), len(self._bounds.linear), len(horizon.clear)]
        cones = [len(self._friction.cone), len(self._bounds.cone)]
        tall = nq + self._sticking, sum(linear), sum(cones)
        self.cones = Cones(N * tall[0], N * tall[1], N * (self._friction.orders + self._bounds.orders))
        self._wide = 2 * nq + n
        pose, wrench, force = (np.arange(a, b) for a, b in ((0, nq), (nq, 2 * nq), (2 * nq, self._wide)))

        def part(group: int, first: int, mask: Array, columns: Indices, lag: int = 0) -> Part:
            """Rows from `first` on in their group, of every step, against columns of the step `lag` before."""
            steps = np.arange(lag, N)[:, None]
            rows = N * sum(tall[:group]) + tall[group] * steps + first + np.arange(len(mask))
            return Part(rows, self._wide * (steps - lag) + columns, mask != 0.0)

        seen, tracked = self._generic()
        own, bound = self._friction, self._bounds
        rates = bound.linear * bound.linear_rate[:, None], bound.cone * bound.cone_rate[:, None]
        self._A = BlockMatrix(
            (N * sum(tall), N * self._wide),
            [
                *(part(0, 0, mask, pose, lag) for lag, mask in enumerate(seen.motion[:3])),
                part(0, 0, seen.motion[3], wrench),
                part(0, 0, seen.motion[4], force),
                part(0, nq, seen.sticking, pose),
                part(1, linear[0] + linear[1], seen.clearance, pose),
                part(1, 0, own.linear, force),
                part(1, linear[0], bound.linear, wrench),
                part(1, linear[0], rates[0], wrench, 1),
                part(2, 0, own.cone, force),
                part(2, cones[0], bound.cone, wrench),
                part(2, cones[0], rates[1], wrench, 1),
            ],
        )
        self._still = [_repeated(block, N) for block in (own.linear, bound.linear)]
        self._still += [_repeated(-rates[0], N - 1), _repeated(own.cone, N), _repeated(bound.cone, N)]
        self._still += [_repeated(-rates[1], N - 1)]
        self._weights = [_repeated(weight, N) for weight in weights]
        here = np.arange(N)[:, None]
        self._P = BlockMatrix(
            (N * self._wide, N * self._wide),
            [
                Part(self._wide * here + columns, self._wide * here + columns, np.triu(mask) != 0.0)
                for columns, mask in zip((pose, wrench, force), (tracked, *weights), strict=True)
            ],
        )

    def stated(self, desired: tuple[Array, Array], guess: Guess, applied: Array | None = None) -> ConicProgram:
        """The program about a guess.

        Args:
            desired: of `Horizon.desired`.
            guess: its path begins where the object is, see `Horizon.start`.
            applied: (nw,) wrench until now, for bounds on its rate; None: not known, and the first one is free of them.
        """
        N, nq = self.horizon.steps, len(self._pose_unit)
        rows = self._rows(guess)
        A = self._A.filled(
            [
                *(block[lag:] for block, lag in zip(rows.motion, (0, 1, 2, 0, 0), strict=True)),
                rows.sticking,
                rows.clearance,
                *self._still,
            ]
        )
        before = None if applied is None else np.asarray(applied, dtype=float) / self._wrench_unit
        bounds = self._bounds.sides(N, before)
        own = self._friction
        b = np.concatenate(
            [
                np.hstack(rows.sides[:2]).ravel(),
                np.hstack([_repeated(own.linear_side, N), bounds[0], rows.sides[2]]).ravel(),
                np.hstack([_repeated(own.cone_side, N), bounds[1]]).ravel(),
            ]
        )
        curvature, slope, _ = self._tracking(guess.path, desired)
        q = np.zeros((N, self._wide))
        q[:, :nq] = slope * self._pose_unit
        scaled = self._pose_unit[:, None] * curvature * self._pose_unit
        return ConicProgram(self._P.filled([scaled, *self._weights]), q.ravel(), A, b, self.cones)

    def corrected(self, guess: Guess, x: Array) -> tuple[Guess, float]:
        """The guess with an answer's corrections and its wrenches and forces, and the greatest change of any of them.

        The change is in units of the weight and the lever, and of radians.
        """
        nq, unit = len(self._pose_unit), self.horizon.unit
        steps = x.reshape(self.horizon.steps, self._wide)
        moved = (steps[:, :nq] * self._pose_unit) @ self._belief.wrench_map
        position, orientation = guess.path.position.copy(), guess.path.orientation.copy()
        position[1:] += moved[:, :3]
        turn_by(orientation[1:], moved[:, 3:])
        wrench, force = steps[:, nq : 2 * nq] * self._wrench_unit, steps[:, 2 * nq :] * unit
        changes = steps[:, :nq], (wrench - guess.wrench) / self._wrench_unit, (force - guess.force) / unit
        path = guess.path._replace(position=position, orientation=orientation)
        return Guess(path, wrench, force), max(float(np.abs(change).max()) for change in changes)

    def defects(self, guess: Guess) -> tuple[float, float]:
        """How far a guess is from its own equations, not linearised: motion in weights, sticking in levers, radians."""
        rows = self._rows(guess)
        wrench, force = guess.wrench / self._wrench_unit, guess.force / self.horizon.unit
        left = (rows.motion[3] @ wrench[..., None] + rows.motion[4] @ force[..., None])[..., 0] - rows.sides[0]
        return float(np.abs(left).max()), float(np.abs(rows.sides[1]).max(initial=0.0))

    def objective(self, desired: tuple[Array, Array], guess: Guess) -> float:
        """sum 1/2 w'Q_w w + 1/2 f'Q_f f + 1/2 e'Q e, in SI units, poses taken as they are."""
        belief, error = self._belief, self._tracking(guess.path, desired)[2]
        terms = ((guess.wrench, belief.Q_w), (guess.force, belief.Q_f), (error, self.horizon.Q))
        return 0.5 * sum(float((value * (weight @ value[..., None])[..., 0]).sum()) for value, weight in terms)

    def _rows(self, guess: Guess) -> _Rows:
        horizon, body, N = self.horizon, self._body, self.horizon.steps
        nq, length, path = len(self._pose_unit), horizon.length, guess.path
        motion = motion_rows(N, nq, guess.force.shape[1])
        order, lag = INTEGRATORS[horizon.integrator]
        fill_motion(body, order, lag, horizon.h, path, guess.wrench, guess.force, motion)
        sticking, off = np.empty((N, self._sticking, nq)), np.empty((N, self._sticking))
        if self._sticking:
            fill_sticking(body, self._fixed, horizon.controller.space.dim == 2, length, path, sticking, off)
        clearance, room = np.empty((N, len(horizon.clear), nq)), np.empty((N, len(horizon.clear)))
        if len(horizon.clear):
            fill_clearance(body, np.array(horizon.clear), length, path, clearance, room)
        rows = 1.0 / self._wrench_unit
        towards = rows[:, None] * motion.towards * self._pose_unit
        gains = rows[:, None] * motion.by_wrench * self._wrench_unit, rows[:, None] * motion.by_force * horizon.unit
        sides = -motion.constant * rows, off, room
        return _Rows([*towards, *gains], sticking * self._pose_unit, clearance * self._pose_unit, sides)

    def _tracking(self, path: Path, desired: tuple[Array, Array]) -> tuple[Array, Array, Array]:
        """Curvature (N, nq, nq), slope (N, nq) and errors (N, nq) of the cost of tracking, in SI units."""
        N, nq = self.horizon.steps, len(self._pose_unit)
        out = np.empty((N, nq, nq)), np.empty((N, nq)), np.empty((N, nq))
        fill_tracking(self._body, self._Q, path, *desired, *out)
        return out

    def _generic(self) -> tuple[_Rows, Array]:
        """Which entries of the blocks may be other than zero: seen on a path without any symmetry."""
        rng, N, W = np.random.default_rng(0), self.horizon.steps, self._belief.wrench_map
        vectors = rng.normal(size=(2 * N + 3, len(W))) @ W
        turns = exponential(vectors[:, 3:])
        path = Path(vectors[: N + 1, :3], turns[: N + 1], np.concatenate([vectors[-1, :3], turns[-1]]), vectors[-2])
        guess = Guess(path, rng.normal(size=(N, len(W))), rng.normal(size=(N, len(self._belief.Q_f))))
        rows = self._rows(guess)
        wanted = np.ascontiguousarray(vectors[N + 1 : 2 * N + 1, :3]), turns[N + 1 : 2 * N + 1]
        curvature = self._tracking(path, wanted)[0]
        masks = [_pattern(block) for block in (*rows.motion, rows.sticking, rows.clearance, curvature)]
        return _Rows(masks[:5], masks[5], masks[6], rows.sides), masks[7]


def _repeated(block: Array, steps: int) -> Array:
    return np.broadcast_to(block, (steps, *block.shape))


def _pattern(blocks: Array) -> Array:
    """(r, c) which entries of (N, r, c) are more than rounding in any of them."""
    size = np.abs(blocks).max(axis=0, initial=0.0)
    return size > 1e-14 * size.max(initial=0.0)
