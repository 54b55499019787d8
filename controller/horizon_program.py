"""The horizon stated as a convex program about a guess: its rows, its cost, and what an answer to it means.

Inside, forces are in units of the weight and lengths in units of the lever. Step t has the columns (correction of pose
t, wrench t, contact forces t), and rows of motion and sticking (equalities), half-lines, and second-order cones.
"""

from typing import NamedTuple

import numpy as np
from pivoting.controller.block_matrix import BlockMatrix, Part
from pivoting.controller.conic_program import ConicProgram, Cones
from pivoting.controller.horizon import Horizon
from pivoting.controller.limits import friction_limits, wrench_limits
from pivoting.controller.so3 import difference, difference_jacobians, exponential, hat, matrices, turned
from pivoting.controller.transcription import Path, linearised
from pivoting.controller.validate import Array


class Guess(NamedTuple):
    """About what a program is stated: poses in table axes, wrenches (N, nw) and contact forces (N, K d)."""

    path: Path
    wrench: Array
    force: Array


class HorizonProgram:
    """States the programs of one horizon; all in it is constant."""

    def __init__(self, horizon: Horizon):
        belief, space, N = horizon.controller.belief, horizon.controller.space, horizon.steps
        self.horizon, self._belief = horizon, belief
        self._gravity = horizon.table.T @ belief.gravity
        self._frames = horizon.table.T @ belief.frames @ belief.force_map  # (K, 3, d)
        nq, n = len(belief.Q_w), len(belief.Q_f)
        lengths = np.array([1.0] * space.dim + [horizon.length] * (nq - space.dim))
        self._pose_unit, self._wrench_unit = horizon.length / lengths, horizon.unit * lengths
        self._fixed = _fixed(belief.points, belief.pivot, belief.wrench_map, horizon.length)
        self._friction = friction_limits(belief.mu, belief.f_min / horizon.unit, space.dim)
        self._bounds = wrench_limits(horizon.bounds, nq, horizon.edges, self._wrench_unit, horizon.h)
        self._weights = [self._wrench_unit[:, None] * belief.Q_w * self._wrench_unit / horizon.unit**2, belief.Q_f]
        sticking = space.dim + len(self._fixed) if horizon.stick else 0
        linear = [len(self._friction.linear), len(self._bounds.linear), len(horizon.clear)]
        cones = [len(self._friction.cone), len(self._bounds.cone)]
        tall = nq + sticking, sum(linear), sum(cones)
        self.cones = Cones(N * tall[0], N * tall[1], N * (self._friction.orders + self._bounds.orders))
        self._wide = 2 * nq + n
        pose, wrench, force = (np.arange(a, b) for a, b in ((0, nq), (nq, 2 * nq), (2 * nq, self._wide)))

        def part(group: int, first: int, mask: Array, columns: Array, lag: int = 0) -> Part:
            """Rows from `first` on in their group, of every step, against columns of the step `lag` before."""
            steps = np.arange(lag, N)[:, None]
            rows = N * sum(tall[:group]) + tall[group] * steps + first + np.arange(len(mask))
            return Part(rows, self._wide * (steps - lag) + columns, mask != 0.0)

        motion, sticks, cleared, tracked = self._generic_masks()
        limits, bound = (self._friction, self._bounds), self._bounds
        self._A = BlockMatrix(
            (N * sum(tall), N * self._wide),
            [
                *(part(0, 0, mask, pose, lag) for lag, mask in enumerate(motion[:3])),
                *(part(0, 0, mask, columns) for mask, columns in zip(motion[3:], (wrench, force), strict=True)),
                part(0, nq, sticks, pose),
                part(1, 0, limits[0].linear, force),
                part(1, linear[0], bound.linear, wrench),
                part(1, linear[0], bound.linear * bound.linear_rate[:, None], wrench, 1),
                part(1, linear[0] + linear[1], cleared, pose),
                part(2, 0, limits[0].cone, force),
                part(2, cones[0], bound.cone, wrench),
                part(2, cones[0], bound.cone * bound.cone_rate[:, None], wrench, 1),
            ],
        )
        self._constant = [
            [limits[0].linear, bound.linear, -bound.linear * bound.linear_rate[:, None]],
            [limits[0].cone, bound.cone, -bound.cone * bound.cone_rate[:, None]],
        ]
        here = np.arange(N)[:, None]
        self._P = BlockMatrix(
            (N * self._wide, N * self._wide),
            [
                Part(self._wide * here + columns, self._wide * here + columns, np.triu(mask) != 0.0)
                for columns, mask in zip((pose, wrench, force), (tracked, *self._weights), strict=True)
            ],
        )

    def stated(
        self, desired: tuple[Array, Array], guess: Guess, applied: Array | None = None
    ) -> ConicProgram:
        """The program about a guess.

        Args:
            desired: of `Horizon.desired`.
            guess: its path begins where the object is, see `Horizon.start`.
            applied: (nw,) wrench until now, for bounds on its rate; None: not known, and the first one is free of them.
        """
        N = self.horizon.steps
        motion, sticks, cleared, sides = self._rows(guess)
        before = None if applied is None else np.asarray(applied, dtype=float) / self._wrench_unit
        linear, cone = self._bounds.sides(N, before)
        constant = [
            [np.broadcast_to(block, (N - lag, *block.shape)) for block, lag in zip(blocks, (0, 0, 1), strict=True)]
            for blocks in self._constant
        ]
        A = self._A.filled([*(block[lag:] for block, lag in zip(motion, (0, 1, 2, 0, 0), strict=True)), sticks, *constant[0], cleared, *constant[1]])
        friction = (np.broadcast_to(side, (N, len(side))) for side in (self._friction.linear_side, self._friction.cone_side))
        linear, cone = (np.hstack([own, side]) for own, side in zip(friction, (linear, cone), strict=True))
        b = np.concatenate([np.hstack(sides[:2]).ravel(), np.hstack([linear, sides[2]]).ravel(), cone.ravel()])
        cost, slope = self._tracking(guess.path, desired)
        weights = [np.broadcast_to(weight, (N, *weight.shape)) for weight in self._weights]
        q = np.zeros((N, self._wide))
        q[:, : slope.shape[1]] = slope
        return ConicProgram(self._P.filled([cost, *weights]), q.ravel(), A, b, self.cones)

    def corrected(self, guess: Guess, x: Array) -> tuple[Guess, float]:
        """The guess with an answer's corrections and its wrenches and forces, and the greatest change of any of them.

        The change is in units of the weight and the lever, and of radians.
        """
        nq = len(self._pose_unit)
        steps = x.reshape(self.horizon.steps, self._wide)
        moved = steps[:, :nq] * self._pose_unit @ self._belief.wrench_map
        path = guess.path._replace(
            position=np.concatenate([guess.path.position[:1], guess.path.position[1:] + moved[:, :3]]),
            orientation=np.concatenate([guess.path.orientation[:1], turned(guess.path.orientation[1:], moved[:, 3:])]),
        )
        wrench, force = steps[:, nq : 2 * nq] * self._wrench_unit, steps[:, 2 * nq :] * self.horizon.unit
        changes = steps[:, :nq], (wrench - guess.wrench) / self._wrench_unit, (force - guess.force) / self.horizon.unit
        return Guess(path, wrench, force), max(float(np.abs(change).max()) for change in changes)

    def defects(self, guess: Guess) -> tuple[float, float]:
        """How far a guess is from its own equations, not linearised: of motion, in weights, and of sticking, in levers."""
        motion, _, _, sides = self._rows(guess)
        wrench, force = guess.wrench / self._wrench_unit, guess.force / self.horizon.unit
        left = (motion[3] @ wrench[..., None] + motion[4] @ force[..., None])[..., 0] - sides[0]
        return float(np.abs(left).max()), float(np.abs(sides[1]).max(initial=0.0))

    def objective(self, desired: tuple[Array, Array], guess: Guess) -> float:
        """sum 1/2 w'Q_w w + 1/2 f'Q_f f + 1/2 e'Q e, in SI units, poses taken as they are."""
        belief, error = self._belief, self._error(guess.path, desired)
        terms = ((guess.wrench, belief.Q_w), (guess.force, belief.Q_f), (error, self.horizon.Q))
        return 0.5 * sum(float(np.einsum("ti,ij,tj->", value, weight, value)) for value, weight in terms)

    def _rows(self, guess: Guess) -> tuple[list[Array], Array, Array, list[Array]]:
        """What depends on the guess: blocks of motion, sticking and clearance, and the right-hand sides of the three."""
        horizon, belief, path = self.horizon, self._belief, guess.path
        motion = linearised(
            belief, self._frames, self._gravity, horizon.h, horizon.integrator, path, guess.wrench, guess.force
        )
        rows = 1.0 / self._wrench_unit
        blocks = [rows[:, None] * block * self._pose_unit for block in motion.towards]
        blocks.append(-rows[:, None] * motion.wrench_gain * self._wrench_unit)
        blocks.append(-rows[:, None] * motion.force_gain * horizon.unit)
        N, length = horizon.steps, horizon.length
        R, (there, then) = matrices(path.orientation[1:]), path.before
        R_0, W = matrices(then), belief.wrench_map
        sticks, off = np.zeros((N, 0, len(W))), np.zeros((N, 0))
        if horizon.stick:
            moving = np.concatenate([np.broadcast_to(np.eye(3), R.shape), -R @ hat(belief.pivot)], axis=2)
            seen = R.transpose(0, 2, 1) @ (R_0 @ self._fixed[:, 1].T)  # (N, 3, D): each e_0 in object axes
            seen = np.moveaxis(seen, 2, 1)
            turning = np.zeros((N, len(self._fixed), 6))
            turning[:, :, 3:] = (self._fixed[:, 0, None, :] @ hat(seen))[:, :, 0]
            shift = path.position[1:] + R @ belief.pivot - there - R_0 @ belief.pivot
            picked = belief.force_map.T
            sticks = np.concatenate([picked @ moving / length, turning], axis=1) @ W.T * self._pose_unit
            off = np.concatenate([shift @ picked.T / length, (self._fixed[:, 0] * seen).sum(axis=2)], axis=1)
        cleared, height = np.zeros((N, 0, len(W))), np.zeros((N, 0))
        if len(horizon.clear):
            floor = there[2] + (belief.points @ R_0.T)[:, 2].min()
            height = path.position[1:, 2:] + (R @ horizon.clear.T)[:, 2] - floor
            lifting = np.zeros((N, len(horizon.clear), 6))
            lifting[:, :, 2] = 1.0
            lifting[:, :, 3:] = -(R[:, None] @ hat(horizon.clear))[:, :, 2]
            cleared, height = -lifting @ W.T * self._pose_unit / length, height / length
        return blocks, sticks, cleared, [-motion.constant * rows, -off, height]

    def _error(self, path: Path, desired: tuple[Array, Array]) -> Array:
        """(N, nq) from the path's poses to the desired ones."""
        shift, turn = desired[0] - path.position[1:], difference(path.orientation[1:], desired[1])
        return np.hstack([shift, turn]) @ self._belief.wrench_map.T

    def _tracking(self, path: Path, desired: tuple[Array, Array]) -> tuple[Array, Array]:
        """Curvature (N, nq, nq) and slope (N, nq) of the cost of tracking, by corrections of the poses."""
        W, Q = self._belief.wrench_map, self.horizon.Q / self.horizon.unit**2
        turn = difference(path.orientation[1:], desired[1])
        by_pose = np.zeros((len(turn), 6, 6))
        by_pose[:, :3, :3], by_pose[:, 3:, 3:] = -np.eye(3), difference_jacobians(turn)[1]
        J = W @ by_pose @ W.T * self._pose_unit
        error = self._error(path, desired)
        return J.transpose(0, 2, 1) @ Q @ J, ((error @ Q)[:, None] @ J)[:, 0]

    def _generic_masks(self) -> tuple[list[Array], Array, Array, Array]:
        """What of the blocks may be other than zero: seen on a path without any symmetry."""
        rng, N, W = np.random.default_rng(0), self.horizon.steps, self._belief.wrench_map
        vectors = rng.normal(size=(2 * N + 3, len(W))) @ W
        poses = 0.3 * vectors[: N + 1, :3], exponential(vectors[: N + 1, 3:])
        before = (vectors[-1, :3], exponential(vectors[-1, 3:]))
        path = Path(*poses, before, vectors[-2])
        guess = Guess(path, rng.normal(size=(N, len(W))), rng.normal(size=(N, len(self._belief.Q_f))))
        motion, sticks, cleared, _ = self._rows(guess)
        wanted = vectors[N + 1 : 2 * N + 1]
        tracked, _ = self._tracking(path, (wanted[:, :3], exponential(wanted[:, 3:])))
        masks = [np.abs(block).max(axis=0) > 1e-14 for block in (*motion, sticks, cleared, tracked)]
        return masks[:5], *masks[5:]  # type: ignore[return-value]


def _fixed(points: Array, pivot: Array, wrench_map: Array, length: float) -> Array:
    """(D, 2, 3) pairs (u, e) of object axes: e, where it pointed at the start, does not turn towards u.

    Contacts stay put if their mean does and, where they are on a line, that line does not turn; off a line, nothing
    turns. Rows for every point would say the same several times over.
    """
    _, spread, axes = np.linalg.svd(points - pivot)
    along, across, normal = axes
    rank = min(2, int(np.count_nonzero(spread > 1e-9 * length)))
    pairs = [[], [(across, along), (normal, along)], [(across, along), (normal, along), (normal, across)]][rank]
    kept = np.array(pairs, dtype=float).reshape(-1, 2, 3)
    moves = np.abs(np.cross(kept[:, 0], kept[:, 1]) @ wrench_map[:, 3:].T).max(axis=1, initial=0.0)
    return kept[moves > 1e-9]
