"""Shapes as triangles and lines, to be drawn: a body's geoms, a friction cone, an arc with a head, a shadow."""

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray
from pivoting.models.frames import matrix
from pivoting.models.placement.convex_hull import circle, colliding, ellipsoids, sampled, samples
from pivoting.models.rigid_body import RigidBody
from pivoting.models.support_surfaces import Surface
from scipy.spatial import ConvexHull

Array = NDArray[np.float64]
SIDES = 32  # of what is round
SHARP = np.cos(np.deg2rad(30.0))  # edges whose faces turn by more are drawn


class Solid(NamedTuple):
    """A surface.

    Attributes:
        vertices: (3 M, 3) [m]; each three of them make a triangle, counter-clockwise seen from outside.
        normals: (3 M, 3) outward, of these triangles.
        lines: (L, 2, 3) ends of its sharp edges [m].
    """

    vertices: Array
    normals: Array
    lines: Array


def body_solids(model: mujoco.MjModel, body: RigidBody) -> list[Solid]:
    """The colliding geoms of a body in object axes, as convex as MuJoCo takes them."""
    geoms = colliding(model, body.index)
    owner, centres, axes = ellipsoids(model, geoms)
    points, which = sampled(centres, axes, samples(SIDES))
    points, whose = (points - body.com) @ matrix(body.axes), owner[which]
    return [_hull(points[whose == geom]) for geom in geoms]


def _hull(points: Array) -> Solid:
    """The convex hull of (P, 3) points."""
    hull = ConvexHull(points)
    corners, normals = hull.points[hull.simplices], hull.equations[:, :3]
    outward = np.linalg.det(corners - hull.points.mean(axis=0)) > 0.0
    corners = np.where(outward[:, None, None], corners, corners[:, ::-1])
    bends = np.einsum("fi,fki->fk", normals, normals[hull.neighbors]) < SHARP
    face, corner = np.nonzero(bends & (np.arange(len(normals))[:, None] < hull.neighbors))
    ends = np.stack([hull.simplices[face, (corner + k) % 3] for k in (1, 2)], axis=1)  # across from that corner
    lines = hull.points[np.sort(ends, axis=1)]
    return Solid(corners.reshape(-1, 3), np.repeat(normals, 3, axis=0), lines)


def cone(mu: float, low: float, high: float, dim: int) -> tuple[Array, NDArray[np.int64], list[Array]]:
    """A friction cone about z with its apex at the origin, in the plane (x, z) a wedge; `low` and `high` in z [m].

    Returns:
        Vertices (V, 3) of the cone from `low` to `high`, triangles (M, 3) of it, and lines (P, 3) from the apex to
        `high` and around `low`; in space around `high` as well.
    """
    sides = 2 if dim == 2 else SIDES
    edges = mu * circle(sides) + [0.0, 0.0, 1.0]
    i = np.arange(sides if dim == 3 else 1)
    j = (i + 1) % sides
    triangles = np.concatenate([np.stack([i, j, sides + i], axis=1), np.stack([j, sides + j, sides + i], axis=1)])
    half = sides // 2
    beams = [np.array([high * edges[k], np.zeros(3), high * edges[k + half]]) for k in range(0, half, 4)]
    rims = [height * np.vstack([edges, edges[:1]]) for height in (low, high)[: dim - 1]]
    return np.vstack([low * edges, high * edges]), triangles, beams + rims


def arcs(sweep: Array, radius: float) -> Array:
    """(R, 28, 2) arcs about the origin from 45 deg on, with an arrow head, counter-clockwise for a positive sweep.

    Args:
        sweep: (R,) [rad].
        radius: [m].
    """
    turn = sweep[:, None]
    shaft = 0.25 * np.pi + turn * np.linspace(0.0, 1.0, 25)
    tip = shaft[:, -1:]
    barb = tip - np.sign(turn) * np.minimum(0.35, np.abs(turn))
    angle, away = np.hstack([shaft, barb, tip, barb]), radius * np.array([1.0] * 25 + [1.25, 1.0, 0.75])
    return np.stack([away * np.cos(angle), away * np.sin(angle)], axis=-1)


def shadow(points: Array, surface: Surface) -> Array:
    """(P, 2) outline, counter-clockwise, of the shadow that a convex body casts straight down on a face; may be empty.

    Args:
        points: (N, 3) whose convex hull is the body, world axes [m].
        surface: the face; the outline is in its axes (t, o), from its middle [m].
    """
    flat = (points - surface.origin) @ surface.axes[:, :2]
    outline = flat[ConvexHull(flat).vertices]
    if surface.disc:
        edges = [(normal, surface.half[0]) for normal in circle(SIDES)[:, :2]]
    else:
        edges = list(zip(np.vstack([np.eye(2), -np.eye(2)]), np.tile(surface.half, 2), strict=True))
    for normal, limit in edges:
        if len(outline):
            outline = _cut(outline, outline @ normal - limit)
    return outline


def _cut(outline: Array, beyond: Array) -> Array:
    """A convex outline (P, 2) cut off along a line, of which its points are `beyond` (P,) by a signed distance."""
    kept = []
    for k, (point, over) in enumerate(zip(outline, beyond, strict=True)):
        before = beyond[k - 1]
        if (over <= 0.0) != (before <= 0.0):
            kept.append(point + over / (over - before) * (outline[k - 1] - point))
        if over <= 0.0:
            kept.append(point)
    return np.array(kept).reshape(-1, 2)
