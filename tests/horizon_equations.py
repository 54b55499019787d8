"""The horizon's equations written once more, from the notes and the docstrings: plain NumPy and SciPy, linearised by
differences and stated in cvxpy. Nothing of the planner's own matrices, maps or kernels is used.

Poses are (position, rotation matrix) in the plane's two axes or in world axes; the planner works in table axes.
"""

import warnings
from collections.abc import Callable
from typing import NamedTuple

import cvxpy as cp
import numpy as np
from pivoting.controller import BodyState, Horizon
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

DIFFERENCES = {"quasi-dynamic": 1, "implicit": 2, "semi-implicit": 2, "forward": 2}
FORCES_ACT_AT = {"quasi-dynamic": 0, "implicit": 0, "semi-implicit": -1, "forward": -2}  # from the pose reached
GAPS = [{"tol_gap_abs": gap, "tol_gap_rel": gap} for gap in (1e-16, 1e-14, 1e-13)]


def matrix(quaternion: np.ndarray) -> np.ndarray:
    """(..., 3, 3) of quaternions (..., 4), scalar first."""
    flat = Rotation.from_quat(np.reshape(quaternion, (-1, 4)), scalar_first=True).as_matrix()
    return flat.reshape(*np.shape(quaternion)[:-1], 3, 3)


def turned(R: np.ndarray, by: np.ndarray) -> np.ndarray:
    """R exp(by): (..., d, d) turned by (..., 1) angles or (..., 3) rotation vectors in object axes."""
    if R.shape[-1] == 2:
        c, s = np.cos(by[..., 0]), np.sin(by[..., 0])
        return R @ np.moveaxis(np.array([[c, -s], [s, c]]), (0, 1), (-2, -1))
    return R @ Rotation.from_rotvec(by.reshape(-1, 3)).as_matrix().reshape(*by.shape, 3)


def rotation_between(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """by with A exp(by) = B: (..., 1) or (..., 3)."""
    change = np.swapaxes(A, -1, -2) @ B
    if A.shape[-1] == 2:
        return np.arctan2(change[..., 1, 0], change[..., 0, 0])[..., None]
    return Rotation.from_matrix(change.reshape(-1, 3, 3)).as_rotvec().reshape(*change.shape[:-1])


def moment(arm: np.ndarray, force: np.ndarray) -> np.ndarray:
    """arm x force: (..., 3), or (..., 1) counter-clockwise in the plane."""
    if arm.shape[-1] == 3:
        return np.cross(arm, force)
    return (arm[..., 0] * force[..., 1] - arm[..., 1] * force[..., 0])[..., None]


class Poses(NamedTuple):
    """position (..., d), rotation (..., d, d) of object axes."""

    position: np.ndarray
    rotation: np.ndarray


class Terms(NamedTuple):
    """What is to vanish (motion (..., N, nq) [N, N m], sticking (..., N, K d) [m]), errors (..., N, nq) and clearances
    (..., N, P) [m], of any number of guesses at once; reduced (..., N, S) is sticking without saying anything twice."""

    motion: np.ndarray
    sticking: np.ndarray
    reduced: np.ndarray
    error: np.ndarray
    height: np.ndarray


class Equations:
    """The equations of one horizon from one state towards desired poses."""

    def __init__(self, horizon: Horizon, state: BodyState, desired: tuple[np.ndarray, np.ndarray]):
        mine, h = horizon.controller, horizon.h
        contacts = mine.contacts
        d = self.dim = contacts[0].dim
        self.horizon, self.K, self.N, self.nq = horizon, len(contacts), horizon.steps, 3 * d - 3
        self.B = matrix(mine.base)
        lift = np.eye(3)[:, [0, 2]] if d == 2 else np.eye(3)
        self.axes = self.B @ lift if d == 2 else lift  # of positions and forces here, as world vectors
        self.lift = lift
        gravity = mine.gravity if len(mine.gravity) == 3 else lift @ mine.gravity
        self.gravity = self.axes.T @ gravity
        self.points = np.array([contact.point for contact in contacts])
        self.frames = np.array(
            [self.axes.T @ (self.B @ lift if contact.frame is None else lift @ contact.frame) for contact in contacts]
        )
        self.inertia = np.reshape(mine.body.inertia, (self.nq - d, self.nq - d))
        self.weight = mine.body.mass * (np.linalg.norm(gravity) or 1.0)
        middle = self.points.mean(axis=0)
        self.lever = np.linalg.norm(middle) or np.linalg.norm(self.points, axis=1).max()
        self.clear = horizon.clear @ lift
        _, spread, axes = np.linalg.svd(self.points - middle)  # the contacts' directions, the widest spread first
        rank = min(int(np.count_nonzero(spread > 1e-9 * self.lever)), d - 1)
        rows = [(u, e) for e in range(rank) for u in range(e + 1, d)]  # axis e does not turn towards axis u
        self.pairs = np.array([(axes[u], axes[e]) for u, e in rows]).reshape(-1, 2, d)
        self.desired = self.read(*desired)
        self.now = self.read(np.array([state.position]), np.array([state.orientation]))
        spin = np.asarray(state.angular_velocity)
        omega = self.now.rotation[0].T @ spin if d == 3 else -self.B[:, 1:2].T @ spin
        self.first = h * self.axes.T @ state.velocity, h * omega
        self.start = self.now
        if horizon.integrator == "forward":
            self.start = Poses(self.now.position + self.first[0], turned(self.now.rotation, self.first[1][None]))
        each = [self.lever] * d + [1.0] * (self.nq - d), [1.0] * d + [self.lever] * (self.nq - d)
        self.units = np.concatenate([each[0], self.weight * np.array(each[1]), np.full(self.K * d, self.weight)])

    def read(self, position: np.ndarray, orientation: np.ndarray) -> Poses:
        """World positions (..., 3) and quaternions (..., 4) as they are used here."""
        return Poses(position @ self.axes, self.axes.T @ matrix(orientation) @ self.lift)

    def split(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Corrections (..., N, nq), wrenches (..., N, nq), contact forces (..., N, K, d) out of x (..., n) in units."""
        steps = x.reshape(*x.shape[:-1], self.N, -1) * self.units
        d, w, f = np.split(steps, [self.nq, 2 * self.nq], axis=-1)
        return d, w, f.reshape(*f.shape[:-1], self.K, self.dim)

    def joined(self, wrench: np.ndarray, force: np.ndarray) -> np.ndarray:
        """x (n,) in units, without corrections."""
        steps = np.hstack([np.zeros((self.N, self.nq)), wrench, np.reshape(force, (self.N, -1))])
        return (steps / self.units).ravel()

    def corrected(self, poses: Poses, d: np.ndarray) -> Poses:
        """Poses (N,) moved by (..., N, nq)."""
        by = d[..., self.dim :]
        R = np.broadcast_to(poses.rotation, (*by.shape[:-1], self.dim, self.dim))
        return Poses(poses.position + d[..., : self.dim], turned(R, by))

    def terms(self, poses: Poses, w: np.ndarray, f: np.ndarray) -> Terms:
        """At poses 1 to N, which need not satisfy anything, with leading axes as they come."""
        horizon, mass, many = self.horizon, self.horizon.controller.body.mass, w.shape[:-2]

        def whole(given: np.ndarray, *before: np.ndarray) -> np.ndarray:
            ahead = np.stack(before)
            return np.concatenate([np.broadcast_to(ahead, (*many, *ahead.shape)), given], axis=len(many))

        p = whole(poses.position, self.start.position[0])
        R = whole(poses.rotation, self.now.rotation[0], self.start.rotation[0])  # poses -1, 0, ..., N
        along, around = np.diff(p, axis=-2), rotation_between(R[..., 1:-1, :, :], R[..., 2:, :, :])
        moved, rolled = whole(along, self.first[0]), whole(around, self.first[1])  # y_0, ..., y_N
        change = along, around
        omega = 0.0 * around
        if DIFFERENCES[horizon.integrator] == 2:
            change = np.diff(moved, axis=-2), np.diff(rolled, axis=-2)
            omega = rolled[..., :-1, :] / horizon.h
        at = 2 + FORCES_ACT_AT[horizon.integrator]
        Q = R[..., at : at + self.N, :, :]
        push = np.einsum("kij,...kj->...ki", self.frames, f)  # (..., N, K, d)
        F = np.einsum("...ij,...j->...i", Q, w[..., : self.dim]) + push.sum(axis=-2) + mass * self.gravity
        local = np.einsum("...ji,...kj->...ki", Q, push)
        M = w[..., self.dim :] + moment(self.points, local).sum(axis=-2)
        if self.dim == 3:
            M = M - np.cross(omega, omega @ self.inertia)
        inertial = mass * change[0] / horizon.h**2 - F, change[1] @ self.inertia / horizon.h**2 - M
        here = self.places(poses, self.points)
        there = self.places(self.now, self.points)
        error = self.desired.position - poses.position
        if self.dim == 3:
            error = error @ self.B
        off = np.concatenate([error, rotation_between(poses.rotation, self.desired.rotation)], axis=-1)
        up = self.axes.T @ self.B[:, 2]
        height = self.places(poses, self.clear) @ up - (there @ up).min()
        back = np.swapaxes(poses.rotation, -1, -2) @ self.now.rotation[0]  # the object's axes at the start, in its own
        turned_to = np.einsum("ru,...uv,rv->...r", self.pairs[:, 0], back, self.pairs[:, 1])
        mean = (here - there).mean(axis=-2)
        return Terms(
            np.concatenate(inertial, axis=-1),
            (here - there).reshape(*many, self.N, -1),
            np.concatenate([mean, self.lever * turned_to], axis=-1),
            off,
            height,
        )

    def places(self, poses: Poses, points: np.ndarray) -> np.ndarray:
        """(..., P, d) where points of the object are."""
        return poses.position[..., None, :] + np.einsum("...ij,pj->...pi", poses.rotation, points)

    def objective(self, poses: Poses, w: np.ndarray, f: np.ndarray) -> float:
        """sum 1/2 w'Q_w w + 1/2 f'Q_f f + 1/2 e'Q e."""
        mine, flat = self.horizon.controller, f.reshape(self.N, -1)
        error = self.terms(poses, w, f).error
        effort = sum(float(np.einsum("ti,ij,tj", value, Q, value)) for value, Q in ((w, mine.Q_w), (flat, mine.Q_f)))
        return 0.5 * (effort + float(np.einsum("ti,tij,tj", error, self.horizon.Q, error)))

    def linearised(self, guess: Poses, x: np.ndarray) -> tuple[Terms, Terms]:
        """Values of the terms at a guess x (n,) about poses, each flat, and their derivatives (., n) by differences."""

        def of(x: np.ndarray) -> Terms:
            d, w, f = self.split(x)
            return Terms(*(term.reshape(len(x), -1) for term in self.terms(self.corrected(guess, d), w, f)))

        derivatives = differences(of, x)
        return Terms(*(term[0] for term in of(x[None]))), derivatives


def differences(of: Callable[[np.ndarray], Terms], x: np.ndarray, step: float = 2e-3) -> Terms:
    """Central differences of two steps, extrapolated: derivatives (m, n) of terms (n, m) of many x (n, n) at once."""
    n, found = len(x), []
    for s in (step, 0.5 * step):
        up, down = of(x + s * np.eye(n)), of(x - s * np.eye(n))
        found.append([(a - b).T / (2.0 * s) for a, b in zip(up, down, strict=True)])
    return Terms(*((4.0 * fine - coarse) / 3.0 for coarse, fine in zip(*found, strict=True)))


def row_space(A: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Orthonormal rows that say what A x = b says, however often it says it; it may not contradict itself."""
    U, size, V = np.linalg.svd(A, full_matrices=False)
    rank = int(np.count_nonzero(size > 1e-8 * size[0]))
    c = U.T @ b
    assert np.abs(b - U[:, :rank] @ c[:rank]).max() < 1e-9, "sticking contradicts itself"
    return V[:rank], c[:rank] / size[:rank]


class Independent(NamedTuple):
    """status of cvxpy, poses, wrench (N, nq), force (N, K, d); None without an answer."""

    status: str
    poses: Poses
    wrench: np.ndarray
    force: np.ndarray


def solved(eq: Equations, guess: Poses, w: np.ndarray, f: np.ndarray, applied: np.ndarray | None) -> Independent:
    """The convex program about a guess, in cvxpy, to its answer."""
    horizon, mine = eq.horizon, eq.horizon.controller
    at = eq.joined(w, f)
    value, by = eq.linearised(guess, at)
    x = cp.Variable(len(at))
    weigh = np.tile(1.0 / np.array(eq.units[eq.nq : 2 * eq.nq]), eq.N)
    must = [(weigh[:, None] * by.motion) @ (x - at) == -weigh * value.motion]
    if horizon.stick:
        # About poses that stick, every contact has its rows. About others all rows together contradict each other.
        rows = (by.sticking, value.sticking) if np.abs(value.sticking).max() < 1e-9 else (by.reduced, value.reduced)
        A, b = row_space(rows[0] / eq.lever, -rows[1] / eq.lever)
        must.append(A @ (x - at) == b)
    if len(eq.clear):
        must.append((by.height @ (x - at) + value.height) / eq.lever >= 0.0)
    steps = cp.reshape(x, (eq.N, len(eq.units)), order="C")
    wrench, force = steps[:, eq.nq : 2 * eq.nq], steps[:, 2 * eq.nq :]
    for k, contact in enumerate(mine.contacts):
        mu, own = (1.0 - mine.margin) * contact.mu, force[:, eq.dim * k : eq.dim * (k + 1)]
        tangents, normal = own[:, :-1], own[:, -1]
        must.append(normal >= contact.f_min / eq.weight)
        size = cp.abs(tangents[:, 0]) if eq.dim == 2 else cp.norm(tangents, axis=1)
        must.append(size <= mu * normal)
    must += bounded(eq, wrench, applied)
    # 1/2 |C x + c|^2, from the Cholesky factors of the weights
    error = value.error - by.error @ at
    unit = np.diag(eq.units)
    blocks = [block_diag(0.0 * horizon.Q[0], mine.Q_w, mine.Q_f)] * eq.N
    heavy = np.kron(np.eye(eq.N), unit) @ block_diag(*blocks) @ np.kron(np.eye(eq.N), unit)
    kept = np.flatnonzero(np.diag(heavy))
    C = np.zeros((len(kept), len(at)))
    C[:, kept] = np.linalg.cholesky(heavy[np.ix_(kept, kept)]).T
    D = block_diag(*(np.linalg.cholesky(Q).T for Q in horizon.Q))
    cost = cp.sum_squares(C @ x / eq.weight) + cp.sum_squares((D @ by.error @ x + D @ error) / eq.weight)
    problem = cp.Problem(cp.Minimize(0.5 * cost), must)
    routes = [
        {
            "solver": "CLARABEL",
            "max_step_fraction": 0.95,
            "tol_feas": 1e-13,
            "static_regularization_constant": 1e-11,
            **gap,
        }
        for gap in GAPS
    ]
    if problem.is_qp():
        routes.append({"solver": "DAQP"})
    for route in routes:  # until one says that it got there: the smallest gap is often out of reach
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that an answer may be inaccurate
            problem.solve(**route)
        if problem.status != "optimal_inaccurate":
            break
    if x.value is None:
        return Independent(problem.status, eq.start, w, f)
    d, w, f = eq.split(x.value)
    return Independent(problem.status, eq.corrected(guess, d), w, f)


def bounded(eq: Equations, wrench: cp.Expression, applied: np.ndarray | None) -> list[cp.Constraint]:
    """Bounds on wrenches (N, nq) in units, and on their changes from step to step and, if known, from `applied`."""
    horizon, bounds = eq.horizon, eq.horizon.bounds
    units = eq.units[eq.nq : 2 * eq.nq]
    changes = [wrench[t] - wrench[t - 1] for t in range(1, eq.N)]
    if applied is not None:
        changes.insert(0, wrench[0] - applied / units)
    out = []

    def within(vector: cp.Expression, radius: float) -> None:
        if not np.isfinite(radius):
            return
        if vector.size == 2 and horizon.edges:  # a polygon whose corners are on the circle
            middle = 2.0 * np.pi / horizon.edges * (np.arange(horizon.edges) + 0.5)
            normals = np.column_stack([np.cos(middle), np.sin(middle)])
            out.append(normals @ vector <= radius * np.cos(np.pi / horizon.edges))
        else:
            out.append(cp.norm(vector) <= radius)

    force, torque = eq.weight, eq.weight * eq.lever
    for t in range(eq.N):
        within(wrench[t, : eq.dim], bounds.force / force)
        within(wrench[t, eq.dim :], bounds.moment / torque)
        if bounds.component is not None:
            limited = np.flatnonzero(np.isfinite(bounds.component))
            if len(limited):
                out.append(cp.abs(wrench[t, limited]) <= (bounds.component / units)[limited])
    for change in changes:
        within(change[: eq.dim], bounds.force_rate * horizon.h / force)
        within(change[eq.dim :], bounds.moment_rate * horizon.h / torque)
    return out
