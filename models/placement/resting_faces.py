"""The faces that a body can lie on, out of its hull: that on which it lies, then those on which it rests."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pivoting.models.errors import ModelError
from pivoting.models.frames import Array
from pivoting.models.placement.convex_hull import Hull, Indices, outline

HOVERS = 1.0  # of its size: a body that is farther above a table stands on nothing there
SAME = 1e-9  # 1 - cos of the angle between the normals of one face
SLACK = 0.9  # of a range asked for: a bound is of facets that were merged within a tolerance


class Face(NamedTuple):
    """What of a body is on a table that it lies on.

    Attributes:
        up: (3,) the table's normal, body frame.
        points: (M, 3) what touches [m].  owner: (M,) of which ellipsoid each is.
        around: the corners of its convex outline, in order.
    """

    up: Array
    points: Array
    owner: Indices
    around: Indices


def face(body: Hull, up: Array) -> Face | None:
    """What is on a table of normal `up` (3,), or None if the body does not lie on it, or rolls there."""
    try:
        points, owner = body.touching(up)
    except ModelError:
        return None
    around = outline(points, body.reach)
    return Face(up, points, owner, around) if body.lies(owner[around]) else None


def standing(body: Hull, up: Array, height: float) -> Array | None:
    """The normal `up` (3,) of a table, body frame, on which the body stands, or None where it hovers too far above it.

    Args:
        height: of the body frame's origin above the table [m].
    """
    return up if height + body.least(up).min() <= HOVERS * body.size else None


def faces(body: Hull, some: Indices | NDArray[np.bool_], now: Array | None = None) -> Iterator[Face]:
    """The faces that `some` of the hull's facets are of, as they are asked for.

    First that on which it lies now, on a table of normal `now` (3,), if it lies on any; then those on which it rests;
    of these, and of the others, by the CoM's height, then the most up.
    """
    lies = None if now is None else face(body, now)
    if lies is not None:
        yield lies
    ups, height = _planes(body, np.arange(len(body.ups))[some])
    tipping = []
    for k in np.lexsort((*-np.round(ups, 6).T, height)):
        one = face(body, ups[k])
        if one is None or (lies is not None and one.up @ lies.up > 1.0 - SAME):
            continue
        if height[k] > 0.0 and _above(one.points[one.around], one.up, body):
            yield one
        else:
            tipping.append(one)
    yield from tipping


def promising(body: Hull, kind: str, least: float) -> NDArray[np.bool_]:
    """(F,) which facets may have a "vertex" or an "edge" with a range of at least `least` [rad]; no other has.

    The table's normals about a vertex of the hull are a cone that ends at the normals of its facets, and about an edge
    an arc between two; a hull of samples has the wider ones. Facets of what is round are promising.
    """
    if kind == "vertex":
        return np.any((body.rank[body.facets] > 0) | (body.cones[body.facets] >= SLACK * least), axis=1)
    one, other = body.facets[:, [1, 2, 0]], body.facets[:, [2, 0, 1]]  # the ends of the edge across from each
    turns = (one != other) & (body.radius[one] == 0.0) & (body.radius[other] == 0.0)
    rims = (body.rank[one] > 0) | (body.rank[other] > 0)
    return np.any(turns & (rims | (body.bends >= SLACK * least)), axis=1)


def middle(body: Hull, facets: Indices) -> Array:
    """(3,) the normal in the middle of some facets' normals."""
    total = body.ups[facets].sum(axis=0)
    return total / max(float(np.linalg.norm(total)), 1e-300)


def _planes(body: Hull, some: Indices) -> tuple[Array, Array]:
    """(P, 3) inward normals of planes to lie on, and (P,) the CoM's height above each, of the body's size.

    They are of the facets, and of lines that end on a ball. Facets of what is round were of samples and are made exact.
    On a line the body may lie as a facet there does, or with its CoM lowest.
    """
    owner = np.sort(body.facets[some], axis=1)
    rank, ball = body.rank[owner], (body.radius[owner] > 0.0).any(axis=1)
    several = 1 + (np.diff(owner, axis=1) > 0).sum(axis=1)
    tilt = np.linalg.norm(np.einsum("fi,fkij->fkj", body.ups[some], body.axes[owner]), axis=2)
    flat = ((rank == 2) & (tilt <= body.reach)).any(axis=1) & ~ball
    exact = (rank == 0).all(axis=1) | flat
    near = ~exact & ((several == 3) | ((several == 2) & ball))
    lines = np.unique(owner[near & (several == 2)][:, [0, 2]], axis=0)[:, [0, 1, 1]]
    touching = np.concatenate([owner[exact], owner[near], lines])
    guess = np.concatenate([body.ups[some][near], body.centre[lines[:, 0]] - body.com])
    ups = np.concatenate([body.ups[some][exact], _tangents(body, guess, touching[exact.sum() :])])
    found = np.linalg.norm(ups, axis=1) > 0.5
    found[found] = np.isin(np.arange(found.sum()), np.unique(np.round(ups[found], 6), axis=0, return_index=True)[1])
    ups, touching = ups[found], touching[found]
    lowest = body.lowest(np.repeat(ups, 3, axis=0), touching.ravel()).reshape(-1, 3, 3)
    height = body.com @ ups.T - np.einsum("pki,pi->pk", lowest, ups).min(axis=1)
    return ups, np.round(height / body.size, 6)


def _tangents(body: Hull, ups: Array, touching: Indices) -> Array:
    """(P, 3) inward normals of the planes nearest to normals `ups` that touch each of `touching` (P, 3); 0 if none."""
    for _ in range(8):  # converges quadratically, as Newton's method does
        points = body.lowest(np.repeat(ups, 3, axis=0), touching.ravel()).reshape(-1, 3, 3)
        across = points[:, 1:] - points[:, :1]
        ups = ups - np.einsum("pij,pj->pi", np.linalg.pinv(across, rcond=1e-9) @ across, ups)
        length = np.linalg.norm(ups, axis=1, keepdims=True)
        ups = np.where(length > body.reach, ups / np.maximum(length, 1e-300), 0.0)
    return ups


def _above(around: Array, up: Array, body: Hull) -> bool:
    """Whether the CoM is above a line (2, 3), or a face of which these (P, 3) are the corners."""
    lever, along = body.com - around, np.roll(around, -1, axis=0) - around
    side = np.cross(along, lever) @ up
    if len(around) > 2:
        return bool((side >= 0.0).all() or (side <= 0.0).all())
    between = (along * lever).sum(axis=1).min() >= 0.0
    return bool(between and abs(side[0]) <= body.reach * np.linalg.norm(along[0]))
