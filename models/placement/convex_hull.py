"""What of a body touches a table: the convex hull of its colliding geoms, each of them as ellipsoids c + A x, |x| <= 1.

A corner has A = 0, a ball (a sphere, an end of a capsule) three equal semi-axes, the rim of a cylinder two, any other
ellipsoid three. Along a direction w one reaches to w.c + |A'w|: what touches a plane, and when while turning, has a
closed form.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import mujoco
import numpy as np
from numpy.typing import NDArray
from pivoting.models.errors import ModelError
from pivoting.models.frames import Array, matrix
from pivoting.models.names import body_name, label
from scipy.spatial import ConvexHull, QhullError

Indices = NDArray[np.int64]
TOLERANCE = 1e-4  # of the body's size: what is closer to the table touches it
SIDES = 64  # of what is round, in the hull


def circle(sides: int) -> Array:
    """(sides, 3) unit vectors around z, from -x; two sides are the directions of the plane."""
    turn = 2.0 * np.pi * np.arange(sides) / sides
    return np.stack([-np.cos(turn), -np.sin(turn), 0.0 * turn], axis=1).round(15)


def samples(sides: int) -> dict[int, Array]:
    """By the rank of A, the x (M, 3) that stand for |x| <= 1 in polygons and hulls."""
    along = np.linspace(0.0, np.pi, sides // 2 + 1)[:, None, None]
    ball = np.sin(along) * circle(sides) + np.cos(along) * [0.0, 0.0, 1.0]
    return {0: np.zeros((1, 3)), 2: circle(sides), 3: ball.reshape(-1, 3)}


SAMPLES = samples(SIDES)


@dataclass(frozen=True, eq=False)
class Hull:
    """The N ellipsoids of a body, in its frame [m].

    Attributes:
        centre: (N, 3).  axes: (N, 3, 3) the A above.  rank: (N,) of A: 0, 2 or 3.
        radius: (N,) of a ball, else 0.
        geom: (N,) whose each is.  label: of each geom, in words.
        ups: (F, 3) inward normals of the hull's facets.  facets: (F, 3) of which three ellipsoids each is.
        beside: (F, 3) the facet across from each of these, beyond the edge of the other two.
        size: the hull's diagonal.  reach: what is closer to a plane is on it.
    """

    name: str
    label: Mapping[int, str]
    com: Array
    centre: Array
    axes: Array
    rank: Indices
    radius: Array
    geom: Indices
    ups: Array
    facets: Indices
    beside: Indices
    size: float
    reach: float

    @cached_property
    def wide(self) -> Indices:
        """Which are no corners."""
        return np.flatnonzero(self.rank > 0)

    def least(self, up: Array) -> Array:
        """(N,) how far each reaches down along `up` (3,) [m]."""
        least, wide = self.centre @ up, self.wide
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
        egg = found[(self.rank[found] == 3) & (self.radius[found] == 0.0)]
        rolling = [*self.geom[egg], *(geom for geom in tilted if tilted.count(geom) > 1)]
        if rolling:
            rolls = (
                f"its geom {self.label[rolling[0]]} touches the table there, and it rolls: no material point stays put"
            )
            raise ModelError(f"body = {self.name!r}: {rolls}; must be a corner, an edge, a rim or an end of a capsule")
        rings = [self.centre[i] + SAMPLES[2][::every] @ self.axes[i].T for i in found[flat]]
        points = np.concatenate([self.lowest(up, found[~flat]), *rings])
        return points, np.concatenate([found[~flat], np.repeat(found[flat], len(SAMPLES[2][::every]))])

    def support(self, up: Array) -> tuple[Array, Indices]:
        """(K, 3) a point, a line's ends or a face's corners, a flat rim counted as four; (K,) whose each is."""
        points, owner = self.touching(up, SIDES // 4)
        around = outline(points, self.reach)
        return points[around], owner[around]

    def lies(self, owner: Indices) -> bool:
        """Whether on points of these it lies: on a face, or as a capsule does on a line, one end of which is a ball."""
        return len(owner) > 2 or (len(owner) == 2 and bool((self.radius[owner] > 0.0).any()))

    @cached_property
    def bends(self) -> Array:
        """(F, 3) the angle from each facet to the one across each of its edges [rad]."""
        apart = np.linalg.norm(self.ups[:, None] - self.ups[self.beside], axis=2)
        return 2.0 * np.arcsin(np.minimum(0.5 * apart, 1.0))

    @cached_property
    def cones(self) -> Array:
        """(N,) bound on the angle between any two normals of a table on which each touches [rad]."""
        total, away = np.zeros((len(self.centre), 3)), np.zeros(len(self.centre))
        np.add.at(total, self.facets, self.ups[:, None])
        total /= np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300)
        apart = np.linalg.norm(self.ups[:, None] - total[self.facets], axis=2)
        np.maximum.at(away, self.facets, 2.0 * np.arcsin(np.minimum(0.5 * apart, 1.0)))
        return 2.0 * away

    @cached_property
    def _folds(self) -> tuple[Indices, Array]:
        """Edges between two ellipsoids each, as sorted numbers, and the angle by which the hull bends there [rad]."""
        ends = np.sort(np.stack([self.facets[:, [1, 2, 0]], self.facets[:, [2, 0, 1]]]), axis=0)
        numbers = (ends[0] * len(self.centre) + ends[1]).ravel()
        order = np.argsort(numbers, kind="stable")
        return numbers[order], self.bends.ravel()[order]

    def fold(self, one: int, other: int) -> float:
        """By how much the hull bends along the edge between two ellipsoids [rad]; 0 if there is none."""
        numbers, bends = self._folds
        number = min(one, other) * len(self.centre) + max(one, other)
        return float(bends[slice(*np.searchsorted(numbers, [number, number + 1]))].max(initial=0.0))

    @cached_property
    def _facets_by_owner(self) -> tuple[Indices, Indices]:
        """The facets in the order of whose they are, and where each ellipsoid's begin (N + 1,)."""
        order = np.argsort(self.facets, axis=None, kind="stable")
        starts = np.searchsorted(self.facets.ravel()[order], np.arange(len(self.centre) + 1))
        return order // 3, starts

    def facets_of(self, which: Indices) -> Indices:
        """The facets that any of these ellipsoids is of."""
        facets, starts = self._facets_by_owner
        return np.unique(np.concatenate([facets[starts[i] : starts[i + 1]] for i in which]))


def read_hull(model: mujoco.MjModel, index: int, tolerance: float = TOLERANCE) -> Hull:
    """The hull of a body's colliding geoms; corners that are inside it are dropped.

    Args:
        index: of the body.
        tolerance: of the body's size, within which a point touches.

    Raises:
        ModelError: it has no colliding geom, one of a kind without a hull, or is one ball, or ellipsoids.
    """
    name, geoms = body_name(model, index), colliding(model, index)
    if not geoms:
        raise ModelError(f"body = {name!r}: it has no colliding geom; must have one with contype, conaffinity or pair")
    geom, centre, axes = ellipsoids(model, geoms)
    half = np.linalg.norm(axes, axis=1)
    rank = np.count_nonzero(half, axis=1)
    radius = np.where(np.ptp(half, axis=1) <= 1e-9 * half.max(axis=1), half.max(axis=1), 0.0)
    balls = len(np.unique(np.column_stack([centre, radius])[radius > 0.0], axis=0))
    if (rank == 3).all() and (balls == 0 or balls + np.count_nonzero(radius == 0.0) < 2):
        rolls = "it is all sphere or ellipsoid, and these roll: no tilt lifts it off one point"
        raise ModelError(f"body = {name!r}: {rolls}; must have a box, a mesh, a cylinder or a capsule")
    size = _diagonal(centre, axes)
    points, owner = sampled(centre, axes, SAMPLES)
    try:  # C-: facets that are coplanar but for rounding (meshes are float32) become one, their inner corners none
        hull = ConvexHull(points, qhull_options=f"Qt C-{0.1 * TOLERANCE * size}")
    except QhullError:
        raise ModelError(f"body = {name!r}: its colliding geoms are flat; must have a volume") from None
    keep = (rank > 0) | np.isin(np.arange(len(rank)), owner[hull.vertices])
    fields = (centre[keep], axes[keep], rank[keep], radius[keep], geom[keep])
    facets = (np.cumsum(keep) - 1)[owner[hull.simplices]]
    com = np.array(model.body_ipos[index])
    ups, beside = -hull.equations[:, :3], hull.neighbors.astype(int)
    labels = {geom: label(model, geom) for geom in geoms}
    return Hull(name, labels, com, *fields, ups, facets, beside, size, tolerance * size)


def body_size(model: mujoco.MjModel, index: int) -> float:
    """Diagonal of the box, along the body's axes, around its colliding geoms [m]."""
    return _diagonal(*ellipsoids(model, colliding(model, index))[1:])


def _diagonal(centre: Array, axes: Array) -> float:
    """Diagonal of the box around ellipsoids c + A x [m]."""
    reach = np.linalg.norm(axes, axis=2)
    return float(np.linalg.norm((centre + reach).max(axis=0) - (centre - reach).min(axis=0)))


def sampled(centre: Array, axes: Array, shapes: Mapping[int, Array]) -> tuple[Array, Indices]:
    """(M, 3) points of ellipsoids c + A x, whose x are `samples` by the rank of A; (M,) of which each is."""
    rank = np.count_nonzero(axes.any(axis=1), axis=1)
    owner = np.repeat(np.arange(len(rank)), np.array([len(shapes.get(k, ())) for k in range(4)])[rank])
    points, starts = centre[owner], np.searchsorted(owner, np.arange(len(rank)))
    for i in np.flatnonzero(rank):
        some = shapes[int(rank[i])]
        points[starts[i] : starts[i] + len(some)] += some @ axes[i].T
    return points, owner


def colliding(model: mujoco.MjModel, index: int) -> list[int]:
    """The geoms of a body that may collide."""
    paired = {*model.pair_geom1.tolist(), *model.pair_geom2.tolist()}
    first = int(model.body_geomadr[index])
    own = range(first, first + int(model.body_geomnum[index]))
    return [geom for geom in own if model.geom_contype[geom] or model.geom_conaffinity[geom] or geom in paired]


def ellipsoids(model: mujoco.MjModel, geoms: Sequence[int]) -> tuple[Indices, Array, Array]:
    """Of which geom each is (N,), its centre (N, 3) and its semi-axes as columns of A (N, 3, 3), body frame [m]."""
    pieces = [_pieces(model, i) for i in geoms]
    of = np.repeat(np.arange(len(geoms)), [len(centres) for centres, _ in pieces])
    turn = np.array([matrix(model.geom_quat[i]) for i in geoms])[of]
    at = np.concatenate([centres for centres, _ in pieces])
    half, geom = np.array([half for _, half in pieces])[of], np.array(geoms)[of]
    return geom, model.geom_pos[geom] + np.einsum("nij,nj->ni", turn, at), turn * half[:, None, :]


def _pieces(model: mujoco.MjModel, geom: int) -> tuple[Array, Array]:
    """(n, 3) centres of a geom's ellipsoids, and (3,) the semi-axes of each, geom frame [m]."""
    size, mesh = model.geom_size[geom], int(model.geom_dataid[geom])
    kind = mujoco.mjtGeom(int(model.geom_type[geom])).name.removeprefix("mjGEOM_").lower()
    if kind == "mesh":
        start, graph = int(model.mesh_vertadr[mesh]), int(model.mesh_graphadr[mesh])
        vertices = model.mesh_vert[start : start + int(model.mesh_vertnum[mesh])].astype(float)
        if graph < 0:
            return vertices, np.zeros(3)
        count = int(model.mesh_graph[graph])  # the hull that MuJoCo collides with: vertices are after edge addresses
        return vertices[model.mesh_graph[graph + 2 + count : graph + 2 + 2 * count]], np.zeros(3)
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


def outline(points: Array, reach: float) -> Indices:
    """Corners of the convex hull of coplanar (M, 3): one if all are within `reach`, a line's ends, or a polygon's."""
    centred = points - points.mean(axis=0)
    flat = centred @ np.linalg.svd(centred, full_matrices=False)[2][:2].T
    spread = np.ptp(flat, axis=0)
    if spread[0] <= reach:
        return np.zeros(1, dtype=int)
    if len(points) == 2 or spread[1] <= reach:
        return np.array([flat[:, 0].argmin(), flat[:, 0].argmax()])
    return np.array(ConvexHull(flat).vertices)
