"""Random horizons: any body, table, gravity, contacts, weights, integrator and bounds, with a random guess."""

from typing import NamedTuple

import numpy as np
from pivoting.controller import Body, BodyState, Contact, Horizon, Law, WrenchBounds, WrenchController
from pivoting.controller.planning.horizon_program import Guess
from scipy.spatial.transform import Rotation

from tests.draws import rotation, weight

INTEGRATORS = ("quasi-dynamic", "implicit", "semi-implicit", "forward")


class Case(NamedTuple):
    """A horizon, where the object is and should go, a guess about which to state the program, the wrench until now."""

    horizon: Horizon
    state: BodyState
    desired: tuple[np.ndarray, np.ndarray]
    guess: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]  # positions, orientations (world), wrenches, forces
    applied: np.ndarray | None

    def start(self) -> Guess:
        """The guess as the planner takes it."""
        position, orientation, wrench, force = self.guess
        path = self.horizon.start(self.state)
        c, q = self.horizon.desired(position, orientation)
        path = path._replace(
            position=np.vstack([path.position, c]), orientation=np.vstack([path.orientation, q])
        )  # fmt: skip
        return Guess(path, wrench, force)


def quaternion(turn: Rotation) -> np.ndarray:
    return turn.as_quat(scalar_first=True)


def chance(rng: np.random.Generator, share: float) -> bool:
    return bool(rng.random() < share)


def maybe(rng: np.random.Generator, share: float, low: float, high: float) -> float:
    """Log-uniform with a chance of `share`, else no bound."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high)))) if chance(rng, share) else np.inf


def draw(rng: np.random.Generator, dim: int) -> Case:
    """One case in the plane (dim = 2) or in space (3); a table that is tilted, in the plane also turned about z."""
    nw, K, N = 3 * dim - 3, int(rng.integers(1, 4)), int(rng.integers(1, 7 if dim == 2 else 5))
    h, mass, lever = 10.0 ** rng.uniform(-2.0, -0.5), 10.0 ** rng.uniform(-1.0, 1.0), 10.0 ** rng.uniform(-1.3, 0.3)
    g = 0.0 if chance(rng, 0.05) else 10.0 ** rng.uniform(0.0, 1.2)
    force = mass * (g or 1.0)
    yaw = chance(rng, 0.3) * rng.uniform(-np.pi, np.pi)
    table = (
        Rotation.from_euler("ZY", [yaw, rng.uniform(-0.6, 0.6)]) if dim == 2 else Rotation.from_matrix(rotation(rng))
    )
    fall = rng.uniform(-1.0, 1.0, 3) * [1.0, dim - 2, 0.0] - [0.0, 0.0, 1.0]  # in table axes, mostly into it
    gravity = table.apply(g * fall / np.linalg.norm(fall))
    flat = dim == 2 and yaw == 0.0
    contacts = contact_set(rng, K, dim, lever, force, flat, table)
    units = np.array([1.0] * dim + [lever] * (nw - dim))
    Q_w = force**2 * weight(rng, nw, 3.0) / np.outer(force * units, force * units)
    Q = force**2 * weight(rng, nw, 3.0) * 10.0 ** rng.uniform(0.0, 3.0) * np.outer(units, units) / lever**2
    inertia = mass * lever**2 * rng.uniform(0.1, 1.0) * (1.0 if dim == 2 else weight(rng, 3, 1.0))
    controller = WrenchController(
        Body(mass, inertia),
        contacts,
        Law.static(),
        gravity[[0, 2]] if flat else gravity,
        base=quaternion(table),
        margin=rng.uniform(0.0, 0.3),
        Q_w=Q_w,
        Q_f=weight(rng, K * dim, 3.0),
    )
    stick = chance(rng, 0.5)
    limited, rated = rng.random(2) < 0.5
    each = np.array([maybe(rng, 0.3, 0.5, 5.0) for _ in range(nw)]) * force * units
    bounds = WrenchBounds(
        maybe(rng, 0.6 * limited, 0.6, 5.0) * force,
        maybe(rng, 0.6 * limited, 0.6, 5.0) * force * lever,
        each if limited and chance(rng, 0.5) else None,
        maybe(rng, 0.6 * rated, 0.3, 3.0) * force / h,
        maybe(rng, 0.6 * rated, 0.3, 3.0) * force * lever / h,
    )
    points = np.array([contact.point for contact in contacts])
    began = turn(rng, dim, 1.0)
    clear = np.zeros((0, 3))
    if chance(rng, 0.3):
        clear = above(rng, began, points, lever)
    horizon = Horizon(
        controller, N, h, integrator=INTEGRATORS[rng.integers(4)], Q=Q, bounds=bounds, stick=stick, clear=clear,
        edges=0 if chance(rng, 0.2) else 16,
    )  # fmt: skip
    return placed(rng, horizon, table, began, points, lever, force * units)


def turn(rng: np.random.Generator, dim: int, size: float, count: int | None = None) -> Rotation:
    """About any axis, or the plane's."""
    vector = rng.normal(size=3 if count is None else (count, 3)) * size
    return Rotation.from_rotvec(vector * [0.0, 1.0, 0.0] if dim == 2 else vector)


def above(rng: np.random.Generator, began: Rotation, points: np.ndarray, lever: float) -> np.ndarray:
    """(P, 3) points of the object that begin above the lowest contact, but not by much."""
    dim = points.shape[1]
    contacts = began.apply(points if dim == 3 else points @ np.eye(3)[[0, 2]])
    somewhere = rng.normal(size=(int(rng.integers(1, 3)), 3)) * lever * [1.0, dim - 2, 1.0]
    somewhere[:, 2] = contacts[:, 2].min() + rng.uniform(0.0, 0.3, len(somewhere)) * lever
    return began.inv().apply(somewhere)


def contact_set(
    rng: np.random.Generator, K: int, dim: int, lever: float, force: float, flat: bool, table: Rotation
) -> list[Contact]:
    """K contacts, a third of the sets of three on one line; frames of their own where the plane has one."""
    points = lever * (rng.normal(size=dim) + 0.7 * rng.normal(size=(K, dim)))
    if K == 3 and chance(rng, 0.3):
        points[2] = points[0] + rng.uniform(-1.0, 2.0) * (points[1] - points[0])
    out = []
    for point in points:
        frame = None
        if chance(rng, 0.3) and dim == 3:
            frame = (table * Rotation.from_rotvec(rng.normal(size=3) * 0.3)).as_matrix()
        elif chance(rng, 0.3) and flat:
            up = (table * Rotation.from_euler("Y", rng.normal() * 0.3)).as_matrix()
            frame = up[np.ix_([0, 2], [0, 2])]
        floor = rng.uniform(0.0, 0.5) * force if chance(rng, 0.5) else 0.0
        out.append(Contact(point, rng.uniform(0.1, 1.2), floor, frame))
    return out


def placed(
    rng: np.random.Generator,
    horizon: Horizon,
    table: Rotation,
    began: Rotation,
    points: np.ndarray,
    lever: float,
    units: np.ndarray,
) -> Case:
    """Where the object is and goes, all within the plane of the table; the guess is as far off as the desired poses."""
    K, dim, N, h = len(points), points.shape[1], horizon.steps, horizon.h
    lift = np.eye(3)[:, [0, 2]] if dim == 2 else np.eye(3)

    def shift(size: float, *shape: int) -> np.ndarray:
        return table.apply(rng.normal(size=(*shape, dim)) @ lift.T * size)

    here, at = shift(lever), table * began
    pace = units[0] / horizon.controller.body.mass * h  # what gravity makes of a step
    pace *= 0.2 if horizon.bounds.any and (horizon.stick or len(horizon.clear)) else 3.0
    spin = turn(rng, dim, pace / lever).as_rotvec()
    state = BodyState(here, quaternion(at), shift(pace), table.apply(spin))
    lifted = points @ lift.T
    axes = np.linalg.svd(lifted - lifted.mean(axis=0))[2]
    on_line = dim == 3 and np.linalg.matrix_rank(lifted - lifted.mean(axis=0), tol=1e-9 * lever) < 2

    def stuck(size: float) -> tuple[np.ndarray, np.ndarray]:
        """Poses about which the contacts that stick do not move."""
        turns = turn(rng, dim, size, N) if K == 1 else None
        about = at * (turns or Rotation.from_rotvec(np.outer(rng.normal(size=N) * size * on_line, axes[0])))
        return here + at.apply(lifted[0]) - about.apply(lifted[0]), quaternion(about)

    def anywhere(size: float) -> tuple[np.ndarray, np.ndarray]:
        return here + shift(0.2 * lever, N), quaternion(at * turn(rng, dim, size, N))

    desired = stuck(0.3) if horizon.stick else anywhere(0.3)
    tight = (
        horizon.bounds.any or len(horizon.clear) > 0
    )  # about poses that do not stick, few such programs have an answer
    poses = stuck(0.2) if horizon.stick and K > 1 and (tight or chance(rng, 0.5)) else anywhere(0.2)
    wrench = rng.normal(size=(N, len(units))) * units
    force = rng.normal(size=(N, K * dim)) * units[0]
    applied = 0.3 * rng.normal(size=len(units)) * units if chance(rng, 0.5) else None
    return Case(horizon, state, desired, (*poses, wrench, force), applied)
