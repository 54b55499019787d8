"""Whether a body has a contact to be tilted about, found by turning it in steps: a second implementation.

What touches a table is the convex hull of a body's colliding geoms. Every face of it is laid on the table in turn, and
the body is turned off that about each corner and each edge of the face, in steps, each time with the heights of all
points of the surface. No formula of `pivoting.models` is used, and nothing of that package is imported.

A contact counts as there ("yes") if nothing else comes closer to the table than 1e-4 of the body's size on an arc a
little longer than asked, and as not there ("no") if even on a shorter arc something else comes lower by more than that.
All between is "borderline": rounding, bevels finer than the tolerance, smooth shapes made of small facets.
"""

from collections.abc import Callable, Iterable, Iterator
from itertools import product
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

Array = NDArray[np.float64]
TOLERANCE = 1e-4  # of the body's size
ARC = (5.0, 25.0)  # [deg] off the face
SLACK = 0.25  # [deg] by which the arc is longer for a "yes", and shorter for a "no"
OWN = 1e-3  # of the size: points that close to a corner or an edge belong to it
LEAST_EDGE = 1e-2  # of the size: a shorter edge is borderline
SAMPLES = 720  # of a rim
CORNER, RIM, BALL, EGG = range(4)


class Surface(NamedTuple):
    """Points of a body's colliding geoms, body frame [m].

    Attributes:
        points: (N, 3) corners, samples of rims and ellipsoids, and of balls the centre.
        radius: (N,) of a ball, else 0.
        piece: (N,) which corner, rim, ball or ellipsoid each is of.
        kind: (N,) CORNER, RIM, BALL or EGG.
        geom: (N,) whose it is.
    """

    points: Array
    radius: Array
    piece: NDArray[np.int64]
    kind: NDArray[np.int64]
    geom: NDArray[np.int64]

    def heights(self, up: Array) -> Array:
        """(..., N) lowest points along `up` (..., 3)."""
        return up @ self.points.T - self.radius


def surface(model: mujoco.MjModel, index: int) -> Surface:
    """The surface of a body's colliding geoms, and of those of bodies that hang on it without a joint."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    paired = {*model.pair_geom1.tolist(), *model.pair_geom2.tolist()}
    found = []
    for geom in range(model.ngeom):
        collides = model.geom_contype[geom] or model.geom_conaffinity[geom] or geom in paired
        if model.body_weldid[model.geom_bodyid[geom]] == model.body_weldid[index] and collides:
            R = data.geom_xmat[geom].reshape(3, 3)
            for kind, local, radius in _pieces(model, geom):
                world = data.geom_xpos[geom] + local @ R.T
                body = (world - data.xpos[index]) @ data.xmat[index].reshape(3, 3)
                found += [(body[[i]], radius, kind, geom) for i in range(len(body))] if kind == CORNER else []
                found += [(body, radius, kind, geom)] if kind != CORNER else []
    counts = [len(points) for points, *_ in found]
    points = np.concatenate([points for points, *_ in found])
    radius, kind, geom = (np.repeat([row[k] for row in found], counts) for k in (1, 2, 3))
    return Surface(points, radius.astype(float), np.repeat(np.arange(len(found)), counts), kind, geom)


def _pieces(model: mujoco.MjModel, geom: int) -> Iterator[tuple[int, Array, float]]:
    """Kind, points (M, 3) in the geom's frame and radius of what a geom is made of."""
    size, kind = model.geom_size[geom], mujoco.mjtGeom(int(model.geom_type[geom])).name.removeprefix("mjGEOM_")
    turn = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
    if kind == "MESH":
        mesh = int(model.geom_dataid[geom])
        first = int(model.mesh_vertadr[mesh])
        vertices = model.mesh_vert[first : first + int(model.mesh_vertnum[mesh])].astype(float)
        yield CORNER, vertices[np.unique(ConvexHull(vertices).vertices)], 0.0
    elif kind == "BOX":
        yield CORNER, size * np.array(list(product((-1.0, 1.0), repeat=3))), 0.0
    elif kind == "CYLINDER":
        for end in (-size[1], size[1]):
            yield RIM, np.stack([size[0] * np.cos(turn), size[0] * np.sin(turn), np.full(SAMPLES, end)], axis=1), 0.0
    elif kind == "CAPSULE":
        for end in (-size[1], size[1]):
            yield BALL, np.array([[0.0, 0.0, end]]), float(size[0])
    elif kind == "SPHERE":
        yield BALL, np.zeros((1, 3)), float(size[0])
    elif kind == "ELLIPSOID":
        yield EGG, size * _globe(4000), 0.0
    else:
        raise ValueError(f"geom {geom}: of type {kind}, whose hull is not known here")


def _globe(count: int) -> Array:
    """(count, 3) unit vectors, spread evenly (a Fibonacci lattice)."""
    i = np.arange(count) + 0.5
    polar, turn = np.arccos(1.0 - 2.0 * i / count), np.pi * (1.0 + 5.0**0.5) * i
    return np.stack([np.cos(turn) * np.sin(polar), np.sin(turn) * np.sin(polar), np.cos(polar)], axis=1)


class Face(NamedTuple):
    """A plane: its inward normal (3,), which of the surface's points touch it, and whether the body lies on it."""

    up: Array
    touching: NDArray[np.int64]
    lies: bool


class Body:
    """A body's hull, its faces, and the search for contacts about which it can be tilted."""

    def __init__(self, model: mujoco.MjModel, index: int, arc: tuple[float, float] = ARC):
        self.arc = arc
        every = surface(model, index)
        globe = _globe(1500)
        clouds = [c + r * globe if r else c[None] for c, r in zip(every.points, every.radius, strict=True)]
        owner = np.repeat(np.arange(len(clouds)), [len(cloud) for cloud in clouds])
        hull = ConvexHull(np.concatenate(clouds))
        used = np.unique(owner[hull.vertices])
        self.surface = Surface(*(column[used] for column in every))
        self.size = float(np.linalg.norm(np.ptp(np.concatenate(clouds), axis=0)))
        self.com = _com(model, index)
        which = np.searchsorted(used, owner[hull.simplices])
        faces = self._faces(-hull.equations[:, :3], which)
        self.faces = sorted(faces, key=lambda face: len(face.touching), reverse=True)  # what is found is found sooner

    def _faces(self, ups: Array, facets: NDArray[np.int64]) -> Iterator[Face]:
        """The planes of the hull's facets, each once; not those of a ball alone."""
        seen = set()
        for up, facet in zip(ups, facets, strict=True):
            corners = np.unique(facet)
            if (self.surface.kind[corners] == BALL).any():
                if len(corners) == 1:
                    continue
                up = self._settled(up, corners)
            key = tuple(np.round(up, 4) + 0.0)
            if key not in seen:
                seen.add(key)
                touching = self.touching(up, TOLERANCE)
                yield Face(up, touching, self.lies(touching))

    def _settled(self, up: Array, which: NDArray[np.int64]) -> Array:
        """`up` turned until the points or balls `which` are all at one height: the facet was of samples."""
        for _ in range(20):
            points = self.surface.points[which]
            wrong = self.surface.heights(up)[which]
            step = np.linalg.lstsq(points - points.mean(axis=0), wrong.mean() - wrong, rcond=1e-9)[0]
            up = (up + step) / np.linalg.norm(up + step)
        return up

    def touching(self, up: Array, tolerance: float) -> NDArray[np.int64]:
        """Which points are on a table of normal `up`, within `tolerance` of the size."""
        heights = self.surface.heights(up)
        return np.flatnonzero(heights <= heights.min() + tolerance * self.size)

    def rolls(self, touching: NDArray[np.int64]) -> bool:
        """Whether what touches is an ellipsoid or the side of a cylinder."""
        s = self.surface
        if (s.kind[touching] == EGG).any():
            return True
        rims = {
            piece: np.count_nonzero(s.piece[touching] == piece) for piece in s.piece[touching[s.kind[touching] == RIM]]
        }
        tilted = [int(s.geom[s.piece == piece][0]) for piece, count in rims.items() if count < SAMPLES // 2]
        return len(tilted) != len(set(tilted))

    def spread(self, touching: NDArray[np.int64]) -> int:
        """Of how many dimensions what touches is: 0 a point, 1 a line, 2 a face."""
        points = self.surface.points[touching]
        extent = np.linalg.svd(points - points.mean(axis=0), compute_uv=False) / np.sqrt(len(points))
        return int(np.count_nonzero(extent > OWN * self.size))

    def lies(self, touching: NDArray[np.int64]) -> bool:
        """Whether that is a face, or a line that ends on a ball."""
        flat = self.spread(touching)
        balls = (self.surface.kind[touching] == BALL).any()
        return not self.rolls(touching) and (flat == 2 or (flat == 1 and bool(balls)))

    def vertex(self, faces: list[Face], only: NDArray[np.int64] | None = None) -> str:
        """Whether it can be tilted off one of `faces` about a corner, a point of a rim or a ball of it (of `only`)."""
        pieces = self.surface.piece if only is None else self.surface.piece[only]
        allowed = np.isin(self.surface.piece, pieces)
        # a corner that stays lowest over the arc is of planes that differ by as much
        ups: dict[int, list[Array]] = {}
        for face in self.faces:
            for v in face.touching.tolist():
                ups.setdefault(v, []).append(face.up)
        wide = {v for v, some in ups.items() if (np.array(some) @ np.array(some).T).min() < np.cos(np.deg2rad(15.0))}
        round_ = self.surface.kind != CORNER
        return best(
            self._about(v, face)
            for face in faces
            if face.lies
            for v in face.touching.tolist()
            if allowed[v] and (v in wide or round_[v])
        )

    def _about(self, v: int, face: Face) -> str:
        s, up = self.surface, face.up
        point, kind = s.points[v], s.kind[v]
        if kind == EGG:
            return "no"
        a = np.cross(up, np.eye(3)[np.abs(up).argmin()])
        a /= np.linalg.norm(a)
        b = np.cross(up, a)
        turn = 2.0 * np.pi * np.arange(180) / 180
        ways = np.cos(turn)[:, None] * a + np.sin(turn)[:, None] * b
        aims = [self.com - point, s.points[face.touching].mean(axis=0) - point]
        if kind == RIM:  # it stays on that point only if it is turned about the tangent there
            aims = [s.points[s.piece == s.piece[v]].mean(axis=0) - point]
            ways = np.zeros((0, 3))
        flat = [aim - (aim @ up) * up for aim in aims]
        ways = np.concatenate([ways, *[aim[None] / np.linalg.norm(aim) for aim in flat if np.linalg.norm(aim) > 1e-9]])
        own = (s.piece == s.piece[v]) | (np.linalg.norm(s.points - point, axis=1) <= OWN * self.size * (kind == CORNER))
        for theta in np.deg2rad([self.arc[0] + SLACK, self.arc[1] - SLACK]):  # most ways fail at once
            heights = s.heights(np.cos(theta) * up + np.sin(theta) * ways)
            ways = ways[(heights - heights[:, [v]]).min(axis=1) >= -TOLERANCE * self.size]
        return best(self._arc(up, way, v, own) for way in ways)

    def edge(self, faces: list[Face], only: NDArray[np.int64] | None = None) -> str:
        """Whether it can be tilted off one of `faces` about an edge of it (between points of `only`)."""
        pieces = self.surface.piece if only is None else self.surface.piece[only]
        return best(
            self._along(i, j, face)
            for face in faces
            if face.lies and self.spread(face.touching) == 2
            for i, j in self._around(face)
            if np.isin(self.surface.piece[[i, j]], pieces).all()
        )

    def _around(self, face: Face) -> Iterator[tuple[int, int]]:
        """Pairs of neighbours around a face that are not of one rim, nor balls."""
        s, points = self.surface, self.surface.points[face.touching]
        centred = points - points.mean(axis=0)
        plane = np.linalg.svd(centred, full_matrices=False)[2][:2]
        around = face.touching[ConvexHull(centred @ plane.T).vertices]
        for i, j in zip(around.tolist(), np.roll(around, -1).tolist(), strict=True):
            if s.piece[i] != s.piece[j] and s.kind[i] in (CORNER, RIM) and s.kind[j] in (CORNER, RIM):
                yield i, j

    def _along(self, i: int, j: int, face: Face) -> str:
        s = self.surface
        along = s.points[j] - s.points[i]
        length = float(np.linalg.norm(along))
        if length <= OWN * self.size:
            return "no"
        along = along / length
        up = face.up - (face.up @ along) * along
        up /= np.linalg.norm(up)
        way = np.cross(along, up)
        way *= np.sign((s.points[face.touching].mean(axis=0) - s.points[i]) @ way)
        lever = s.points - s.points[i]
        away = np.linalg.norm(lever - np.clip(lever @ along, 0.0, length)[:, None] * along, axis=1)
        rims = s.piece[[k for k in (i, j) if s.kind[k] == RIM]]
        found = self._arc(up, way, i, (away <= OWN * self.size) | np.isin(s.piece, rims))
        return "borderline" if found == "yes" and length < LEAST_EDGE * self.size else found

    def _arc(self, up: Array, way: Array, v: int, own: NDArray[np.bool_]) -> str:
        """Whether point or ball `v` is the lowest while the body turns off a face, `way` being lifted."""
        tolerance = TOLERANCE * self.size

        def above(slack: float) -> tuple[float, float]:
            theta = np.deg2rad(np.linspace(self.arc[0] - slack, self.arc[1] + slack, 25))[:, None]
            heights = self.surface.heights(np.cos(theta) * up + np.sin(theta) * way)
            heights -= heights[:, [v]]
            others = heights[:, ~own]
            return float(others.min()) if others.size else np.inf, float(heights[:, own].min())

        others, mine = above(SLACK)
        if others > tolerance and mine > -0.02 * tolerance:
            return "yes"
        others, mine = above(-SLACK)
        return "borderline" if min(others, mine) >= -tolerance else "no"

    def lowest(self, up: Array) -> str:
        """Whether it can be tilted about what touches the table where its normal is `up` (3,), body frame."""
        found = {self._lowest(up, tolerance) for tolerance in (0.1 * TOLERANCE, TOLERANCE, 10.0 * TOLERANCE)}
        return found.pop() if len(found) == 1 else "borderline"

    def _lowest(self, up: Array, tolerance: float) -> str:
        touching = self.touching(up, tolerance)
        if self.rolls(touching):
            return "no"
        if self.lies(touching):
            faces = [Face(up, touching, True)]
            return best(find(faces) for find in (self.edge, self.vertex))
        if self.spread(touching) == 1:
            return self.edge(self.faces, touching)
        return self.vertex(self.faces, touching)


def best(answers: Iterable[str]) -> str:
    """The most favourable of several answers; the first "yes" ends the search."""
    found = "no"
    for answer in answers:
        if answer == "yes":
            return answer
        found = "borderline" if answer == "borderline" else found
    return found


def _com(model: mujoco.MjModel, index: int) -> Array:
    """(3,) centre of mass of a body and of what hangs on it, body frame [m]."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return (data.subtree_com[index] - data.xpos[index]) @ data.xmat[index].reshape(3, 3)


def contacts(model: mujoco.MjModel, name: str, arc: tuple[float, float] = ARC) -> dict[str, str]:
    """For "vertex", "edge" and "lowest" whether the body has such a contact: "yes", "borderline" or "no".

    Args:
        model: with the body in its place.  name: of the body.
        arc: [deg] off the face.
    """
    index = model.body(name).id
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    try:
        body = Body(model, index, arc)
    except Exception as error:  # Qhull has its own
        raise ValueError(f"{name}: no hull ({error})") from error
    up = data.xmat[index].reshape(3, 3)[2]
    answers: dict[str, Callable[[], str]] = {
        "vertex": lambda: body.vertex(body.faces),
        "edge": lambda: body.edge(body.faces),
        "lowest": lambda: body.lowest(up),
    }
    return {kind: answer() for kind, answer in answers.items()}
