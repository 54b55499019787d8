"""Where a body may be pivoted: the corners, edges and rims of it that stay put on the table while it tilts.

A body is taken as the convex hull of its colliding geoms, and each of those as ellipsoids c + A x, |x| <= 1: a corner
has A = 0, the rim of a cylinder two semi-axes, and what is round (a sphere, an ellipsoid, an end of a capsule) three.
Along a direction w one reaches to w.c + |A'w|: what touches the table, and when while turning, has a closed form.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import chain, product

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray
from pivoting.models.reading import Array, ModelError, matrix
from scipy.spatial import ConvexHull, QhullError

Indices = NDArray[np.int64]
TOLERANCE = 1e-4  # of the body's size: what is closer to the table touches it
NEAR = 1e-3  # of the body's size: a contact given by hand is a corner if it is closer to it
LEAST = 1e-3  # [rad]: a range of less is none
ALLOWED = "vertex, edge, lowest, or one or two corners (x, y, z) in the body frame [m]"
TURN, HEIGHT = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False), np.linspace(-1.0, 1.0, 33)
CIRCLE = np.stack([np.cos(TURN), np.sin(TURN), 0.0 * TURN], axis=1)
BALL = np.concatenate([np.sqrt(1.0 - z * z) * CIRCLE + [0.0, 0.0, z] for z in HEIGHT])
SAMPLES = {0: np.zeros((1, 3)), 2: CIRCLE, 3: BALL}  # x that stand for |x| <= 1 in polygons and hulls, by rank of A


@dataclass(frozen=True, eq=False)
class Stance:
    """Points of a body to pivot about. At theta = 0 it lies on more of itself, and theta > 0 lifts it off that.

    Attributes:
        points: (K, 3) one point or the two ends of an edge, body frame [m].
        rotation: (3, 3) body to table frame (t, o, n) at theta = 0, n the table's normal.
        axis: (3,) about which theta turns, in the table frame, horizontal.
        range: (0, theta_max), open: in it nothing but `points`, and the edge between them, touches the table [rad].
        balance: theta at which the CoM is straight above them [rad].
        start: theta of the orientation that "lowest" is about, else 0 [rad].
    """

    points: Array
    rotation: Array
    axis: Array
    range: tuple[float, float]
    balance: float
    start: float


@dataclass(frozen=True, eq=False)
class _Body:
    """The N ellipsoids of a body, in its frame [m]."""

    name: str
    com: Array
    centre: Array  # (N, 3)
    axes: Array  # (N, 3, 3) the A above
    rank: Indices  # (N,) 0, 2 or 3
    geom: Indices  # (N,)
    ups: Array  # (F, 3) inward normals of the hull's facets
    size: float  # the hull's diagonal
    reach: float  # what is closer to a plane is on it

    def least(self, up: Array) -> Array:
        """(N,) how far each reaches down along `up` (3,) [m]."""
        least, wide = self.centre @ up, self.rank > 0
        least[wide] -= np.linalg.norm(up @ self.axes[wide], axis=1)
        return least

    def lowest(self, up: Array, which: Indices) -> Array:
        """(len(which), 3) their lowest points, along `up` (3,) or one (len(which), 3) for each."""
        half = np.einsum("nij,ni->nj", self.axes[which], np.broadcast_to(up, (len(which), 3)))
        unit = half / np.maximum(np.linalg.norm(half, axis=1, keepdims=True), 1e-300)
        return self.centre[which] - np.einsum("nij,nj->ni", self.axes[which], unit)

    def rims(self, point: Array) -> Array:
        """(R, 3) of each rim the point closest to `point` (3,); from its axis all are as close: one is picked."""
        which = np.flatnonzero(self.rank == 2)
        return self.lowest(self.centre[which] - point - 1e-12 * self.axes[which, :, 0], which)

    def touching(self, up: Array, every: int = 1) -> tuple[Array, Indices]:
        """(M, 3) points on a table of normal `up`, `every`-th sample of a rim that lies flat; (M,) whose each is."""
        least = self.least(up)
        found = np.flatnonzero(least <= least.min() + self.reach)
        flat = (self.rank[found] == 2) & (np.linalg.norm(up @ self.axes[found], axis=1) <= self.reach)
        tilted = self.geom[found[(self.rank[found] == 2) & ~flat]].tolist()
        rolling = [*self.geom[found[self.rank[found] == 3]], *(geom for geom in tilted if tilted.count(geom) > 1)]
        if rolling:
            rolls = f"its geom {rolling[0]} touches the table there, and it rolls: no material point stays put"
            raise ModelError(f"body = {self.name!r}: {rolls}; must be a corner, an edge or a rim")
        rings = [self.centre[i] + CIRCLE[::every] @ self.axes[i].T for i in found[flat]]
        points = np.concatenate([self.lowest(up, found[~flat]), *rings])
        return points, np.concatenate([found[~flat], np.repeat(found[flat], len(CIRCLE[::every]))])

    def support(self, up: Array) -> Array:
        """(K, 3) a vertex, the ends of an edge or the corners of a face; a rim that lies flat counts as four."""
        points, _ = self.touching(up, len(CIRCLE) // 4)
        return points[_outline(points, self.reach)]


def contact_points(model: mujoco.MjModel, body_index: int) -> Array:
    """(P, 3) corners of a body's colliding geoms that are on its hull, body frame [m]; (0, 3) for a cylinder's rims."""
    body = _read(model, body_index)
    return body.centre[body.rank == 0]


def support_points(model: mujoco.MjModel, body_index: int, down: ArrayLike, tolerance: float = TOLERANCE) -> Array:
    """(K, 3) what of a body touches a table below it, body frame [m]: a vertex, the ends of an edge, or a face.

    A face is the corners of its convex polygon, in order around it; a rim that lies flat counts as four.

    Args:
        down: (3,) towards the table, body frame.
        tolerance: of the body's size, within which a point touches.

    Raises:
        ModelError: what touches is round: it rolls, and no material point of it stays put.
    """
    return _read(model, body_index, tolerance).support(-np.asarray(down, dtype=float) / np.linalg.norm(down))


def stance(
    model: mujoco.MjModel,
    body_index: int,
    contact: str | ArrayLike,
    xquat: ArrayLike | None = None,
    table: ArrayLike = (1.0, 0.0, 0.0, 0.0),
) -> Stance:
    """How to pivot a body about a contact.

    "vertex" and "edge" are of the face on which it rests with its CoM lowest. "lowest" is what touches the table in
    the orientation that it has; of a face, an edge, or else a vertex. Given corners, or a point of a rim: at theta = 0
    it lies on that face of theirs on which its CoM is lowest, one on which it rests if there is one. Of several edges
    or vertices of a face, the CoM is closest to the one chosen, among those above which it can be brought.
    About a vertex the axis is perpendicular to the lever from it to the CoM; about a point of a rim, tangent to that.
    The table's t points into the body, but with "lowest" the body's yaw is kept.

    Args:
        contact: "vertex", "edge", "lowest", or corners (3,), (1, 3) or (2, 3) in the body frame [m].
        xquat: (4,) body to world, what "lowest" is about, by default that of a child of the world at qpos0; given
            corners lie on the face that the body has down in it, if they are of that.
        table: (4,) table frame (t, o, n) to world, that goes with it.

    Raises:
        ModelError: the body has no such contact, or cannot be tilted about it alone.
    """
    body = _read(model, body_index)
    found: Iterable[Stance | None]
    if not isinstance(contact, str):
        points = _given(body, contact)
        # as it stands already, if it stands on a face of theirs
        down = [] if xquat is None else [matrix(np.asarray(table)).T @ matrix(np.asarray(xquat))]
        first = [_turn(body, points, now[2], now) for now in down if len(body.support(now[2])) > 2]
        found = chain(first, (_turn(body, points, up) for up in _faces(body)))
    elif contact == "lowest":
        now = matrix(np.asarray(table)).T @ matrix(np.asarray(model.body_quat[body_index] if xquat is None else xquat))
        points = body.support(now[2])
        flat = (_best(body, now[2], kind, now) for kind in ("edge", "vertex"))
        found = flat if len(points) > 2 else [_turn(body, points, now[2], now)]
    elif contact in ("vertex", "edge"):
        found = (_best(body, up, contact) for up in _faces(body))
    else:
        raise ModelError(f"contact = {contact!r}: must be {ALLOWED}")
    one = next(filter(None, found), None)
    if one is None:
        tilted = "lies on no face from which it can be tilted so, towards its CoM and with nothing else touching"
        raise ModelError(f"contact = {contact!r}: body {body.name!r} {tilted}; must be {ALLOWED}")
    return one


def _read(model: mujoco.MjModel, index: int, tolerance: float = TOLERANCE) -> _Body:
    """The colliding geoms of a body; corners that are inside its convex hull are dropped."""
    name, paired = model.body(index).name, [*model.pair_geom1, *model.pair_geom2]
    collides = (model.geom_contype != 0) | (model.geom_conaffinity != 0) | np.isin(np.arange(model.ngeom), paired)
    geoms = np.flatnonzero((model.geom_bodyid == index) & collides).tolist()
    if not geoms:
        raise ModelError(f"body = {name!r}: it has no colliding geom; must have one with contype, conaffinity or pair")
    pieces = [(i, at, half) for i in geoms for centres, half in [_pieces(model, int(i))] for at in centres]
    geom, at, half = (np.array(column) for column in zip(*pieces, strict=True))
    turn = np.array([matrix(model.geom_quat[i]) for i in geom])
    centre = model.geom_pos[geom] + np.einsum("nij,nj->ni", turn, at)
    axes, rank = turn * half[:, None, :], np.count_nonzero(half, axis=1)
    if (rank == 3).all():
        rolls = "it is all sphere, ellipsoid or capsule, and these roll: no material point stays put"
        raise ModelError(f"body = {name!r}: {rolls}; must have a box, a mesh or a cylinder")
    extent = np.linalg.norm(axes, axis=2)
    size = float(np.linalg.norm((centre + extent).max(axis=0) - (centre - extent).min(axis=0)))
    clouds = [c + SAMPLES[k] @ A.T for c, A, k in zip(centre, axes, rank.tolist(), strict=True)]
    try:  # C-: facets that are coplanar but for rounding (meshes are float32) become one, their inner corners none
        hull = ConvexHull(np.concatenate(clouds), qhull_options=f"Qt C-{0.1 * TOLERANCE * size}")
    except QhullError:
        raise ModelError(f"body = {name!r}: its colliding geoms are flat; must have a volume") from None
    owner = np.repeat(np.arange(len(rank)), [len(cloud) for cloud in clouds])
    keep = (rank > 0) | np.isin(np.arange(len(rank)), owner[hull.vertices])
    fields = (centre[keep], axes[keep], rank[keep], geom[keep])
    return _Body(name, np.array(model.body_ipos[index]), *fields, -hull.equations[:, :3], size, tolerance * size)


def _pieces(model: mujoco.MjModel, geom: int) -> tuple[Array, Array]:
    """(n, 3) centres of a geom's ellipsoids, and (3,) the semi-axes of each, geom frame [m]."""
    size, mesh = model.geom_size[geom], int(model.geom_dataid[geom])
    kind = mujoco.mjtGeom(int(model.geom_type[geom])).name.removeprefix("mjGEOM_").lower()
    if kind == "mesh":
        graph, vertices = int(model.mesh_graphadr[mesh]), model.mesh_vert[model.mesh_vertadr[mesh] :]
        count = int(model.mesh_graph[graph])  # the hull that MuJoCo collides with: vertices are after edge addresses
        return vertices[model.mesh_graph[graph + 2 + count : graph + 2 + 2 * count]].astype(float), np.zeros(3)
    one, ends = np.zeros((1, 3)), np.array([[0.0, 0.0, -size[1]], [0.0, 0.0, size[1]]])
    shapes = {
        "box": (size * list(product((-1.0, 1.0), repeat=3)), np.zeros(3)),
        "cylinder": (ends, size[0] * np.array([1.0, 1.0, 0.0])),
        "capsule": (ends, size[0] * np.ones(3)),
        "sphere": (one, size[0] * np.ones(3)),
        "ellipsoid": (one, size),
    }
    if kind not in shapes:
        raise ModelError(f"body: its geom {geom} is of type {kind}; must be mesh, {', '.join(shapes)}")
    return shapes[kind]


def _outline(points: Array, reach: float) -> Indices:
    """Corners of the convex hull of coplanar (M, 3): one if all are within `reach`, a line's ends, or a polygon's."""
    centred = points - points.mean(axis=0)
    flat = centred @ np.linalg.svd(centred, full_matrices=False)[2][:2].T
    spread = np.ptp(flat, axis=0)
    if spread[0] <= reach:
        return np.zeros(1, dtype=int)
    if len(points) == 2 or spread[1] <= reach:
        return np.array([flat[:, 0].argmin(), flat[:, 0].argmax()])
    return np.array(ConvexHull(flat).vertices)


def _faces(body: _Body) -> list[Array]:
    """Inward normals of the faces: first those on which the body rests, then by the CoM's height, then the most up."""
    found = []
    for up in body.ups[np.unique(np.round(body.ups, 6), axis=0, return_index=True)[1]]:
        try:
            points, _ = body.touching(up)
        except ModelError:  # it rolls there
            continue
        around = points[_outline(points, body.reach)]
        if len(around) > 2:
            side = np.cross(np.roll(around, -1, axis=0) - around, body.com - around) @ up
            height = float(body.com @ up - body.least(up).min()) / body.size
            tips = not ((side >= 0.0).all() or (side <= 0.0).all()) or height <= 0.0
            found.append((tips, round(height, 6), *-np.round(up[::-1], 6), up))
    return [up for *_, up in sorted(found, key=lambda item: item[:-1])]


def _best(body: _Body, up: Array, kind: str, now: Array | None = None) -> Stance | None:
    """Of the edges or vertices of the face with inward normal `up` the one to pivot about, if there is one."""
    points, owner = body.touching(up)
    around = _outline(points, body.reach)
    if kind == "vertex":
        near = body.rims(body.com)
        far = 2.0 * body.centre[body.rank == 2] - near
        some = [points[[i]] for i in around if body.rank[owner[i]] == 0] + [*near[:, None], *far[:, None]]
    else:
        pairs = np.stack([around, np.roll(around, -1)], axis=1)
        some = [_edge(body, points, owner, pair) for pair in pairs if owner[pair[0]] != owner[pair[1]]]
    found = [one for one in (_turn(body, ends, up, now) for ends in some) if one is not None]
    return min(
        found,
        key=lambda one: (one.balance >= one.range[1], round(one.balance, 6), *np.round(one.points.mean(axis=0), 9)),
        default=None,
    )


def _edge(body: _Body, points: Array, owner: Indices, pair: Indices) -> Array:
    """(2, 3) of two of the `points` around a face; moved, if they are of rims, to where their line is a tangent."""
    ends, middle = points[pair], points.mean(axis=0)
    up = np.cross(ends[1] - ends[0], middle - ends[0])
    for _ in range(50):
        ends = body.lowest(np.cross(up, ends[1] - ends[0]), owner[pair])
    return ends


def _turn(body: _Body, points: Array, up: Array, now: Array | None = None) -> Stance | None:
    """The stance about `points` of a body on a table of normal `up`, or None if it cannot be tilted about them alone.

    `now`: (3, 3) body to table frame, to keep the yaw of.
    """
    if (points @ up).max() > body.least(up).min() + body.reach:
        return None
    points = points[np.lexsort(np.round(points, 9).T[::-1])]
    lever, along = body.com - points[0], points[-1] - points[0]
    if len(points) == 2:
        along = along / np.linalg.norm(along)
        up = (up - (up @ along) * along) / np.linalg.norm(np.cross(up, along))
        inward = np.cross(along, up) if np.cross(along, up) @ lever >= -body.reach else np.cross(up, along)
    else:
        on = np.linalg.norm(body.rims(points[0]) - points[0], axis=1) <= body.reach
        inward = [*(body.centre[body.rank == 2][on] - points[0]), lever][0]
        inward = inward - (inward @ up) * up
        if np.linalg.norm(inward) <= body.reach:  # balanced
            inward = np.cross(np.eye(3)[np.abs(up).argmin()], up)
        inward = inward / np.linalg.norm(inward)
    low, high = _interval(body, points, up, inward)
    if high - low <= LEAST:
        return None
    t, n = np.cos(low) * inward - np.sin(low) * up, np.sin(low) * inward + np.cos(low) * up
    x, y = (1.0, 0.0) if now is None else (now @ inward)[:2] / np.linalg.norm((now @ inward)[:2])
    yaw = np.array([[x, -y, 0.0], [y, x, 0.0], [0.0, 0.0, 1.0]])
    balance, start = float(np.arctan2(lever @ t, lever @ n)), 0.0 if now is None else max(0.0, -low)
    return Stance(points, yaw @ np.stack([t, np.cross(n, t), n]), -yaw[:, 1], (0.0, high - low), balance, start)


def _interval(body: _Body, points: Array, up: Array, inward: Array) -> tuple[float, float]:
    """Between which angles [rad] from here nothing but `points` is on the table, when `inward` is lifted about them.

    At theta the table's normal is n = cos(theta) up + sin(theta) inward, and an ellipsoid is above it while
    n.c > |A'n|, c from the axis: a cone of n in the plane of both, about an eigenvector of c c' - A A'.
    """
    plane, along = np.stack([up, inward]), points[-1] - points[0]
    c, A = (body.centre - points[0]) @ plane.T, plane @ body.axes
    Q = c[:, :, None] * c[:, None, :] - A @ A.transpose(0, 2, 1)
    lowest = body.lowest(inward, np.arange(len(c))) - points[0]
    share = np.clip(lowest @ along / max(float(along @ along), 1e-300), 0.0, 1.0)
    own = np.linalg.norm(lowest - share[:, None] * along, axis=1) <= body.reach
    values, vectors = np.linalg.eigh(Q)
    v = vectors[:, :, 1] * np.sign((vectors[:, :, 1] * c).sum(axis=1, keepdims=True))
    half = np.arctan2(np.sqrt(np.maximum(values[:, 1], 0.0)), np.sqrt(np.maximum(-values[:, 0], 0.0)))
    half[own | (body.rank == 0)] = 0.5 * np.pi  # a half-plane: of a corner, or of a rim that the points are on
    half[~own & (body.rank == 0) & (np.linalg.norm(c, axis=1) <= body.reach)] = -np.inf  # on the axis: it stays there
    v[own] = c[own]
    middle, others = np.arctan2(v[:, 1], v[:, 0]), ~own | (body.rank > 0)
    return float((middle - half)[others].max()), float((middle + half)[others].min())


def _given(body: _Body, contact: ArrayLike) -> Array:
    """(K, 3) the corners, or points of rims, that a user's points are."""
    given = np.atleast_2d(np.asarray(contact))
    if given.dtype.kind not in "iuf" or given.shape not in ((1, 3), (2, 3)) or not np.isfinite(given).all():
        raise ModelError(f"contact = {given.tolist()}: must be {ALLOWED}")
    corners = [np.concatenate([body.centre[body.rank == 0], body.rims(point)]) for point in given]
    nearest = np.array([c[np.linalg.norm(c - p, axis=1).argmin()] for c, p in zip(corners, given, strict=True)])
    for point, corner in zip(given, nearest, strict=True):
        if np.linalg.norm(point - corner) > NEAR * body.size:
            shown = ", ".join(f"{x:.6g}" for x in corner)
            raise ModelError(f"contact = {point.tolist()}: no corner of body {body.name!r}; the nearest is {shown}")
    if len(given) == 2 and np.linalg.norm(nearest[0] - nearest[1]) <= NEAR * body.size:
        raise ModelError(f"contact = {given.tolist()}: twice the same corner; must be {ALLOWED}")
    return nearest
