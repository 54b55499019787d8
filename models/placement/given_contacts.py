"""Contacts as people write them: what points of a body's frame are of it, and how a contact is written down."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike
from pivoting.models.errors import ModelError
from pivoting.models.frames import Array
from pivoting.models.placement.convex_hull import Hull
from pivoting.models.placement.tilt_range import Held

NEAR = 1e-3  # of the body's size: a contact given by hand is a corner if it is closer to it
ALLOWED = "vertex, edge, lowest, or one or two corners, or a round end (x, y, z) in the body frame [m]"
Shown = Callable[[Array], Array]  # points (K, 3) of the compiled body frame as a reader has them


def as_compiled(points: Array) -> Array:
    """Points (K, 3) as they are: for a reader who has the compiled body frame."""
    return points


def written(points: Array, shown: Shown = as_compiled) -> str:
    """Points (K, 3) as a `--contact` value; of a round end the centre."""
    return "; ".join(",".join(f"{x + 0.0:.6g}" for x in np.round(point, 7)) for point in shown(np.atleast_2d(points)))


def held_by_hand(body: Hull, contact: ArrayLike, shown: Shown = as_compiled) -> Held:
    """The corners, points of rims, or the ball, that a user's points are.

    Args:
        contact: (3,), (1, 3) or (2, 3) in the body frame [m]; of a ball the centre or any point of its surface.
        shown: for messages.

    Raises:
        ModelError: there are no such points, or the body has nothing there.
    """
    given = np.atleast_2d(np.asarray(contact))
    if given.dtype.kind not in "iuf" or given.shape not in ((1, 3), (2, 3)) or not np.isfinite(given).all():
        raise ModelError(f"contact = {given.tolist()}: must be {ALLOWED}")
    tips = np.flatnonzero((body.rank == 0) | (body.radius > 0.0))
    which = np.concatenate([tips, np.flatnonzero(body.rank == 2)])
    radius, nearest = body.radius[which], []
    for point in given:
        some = np.concatenate([body.centre[tips], body.rims(point)])
        away = np.linalg.norm(some - point, axis=1)
        off = np.minimum(away, np.abs(away - radius))
        i = int(np.lexsort((away, np.round(off / body.size, 6)))[0])  # a centre on the surface of another is itself
        if off[i] > NEAR * body.size:
            there = written(some[i], shown).replace(",", ", ")
            end = f", the centre of a round end of radius {radius[i]:.6g}" * bool(radius[i])
            what = f"no corner of body {body.name!r}; the nearest is {there}{end}"
            raise ModelError(f"contact = {shown(point[None])[0].tolist()}: {what}")
        nearest.append((some[i], which[i], float(radius[i])))
    points, owner, radii = (np.array(column) for column in zip(*nearest, strict=True))
    if len(given) == 2 and np.linalg.norm(points[0] - points[1]) <= NEAR * body.size:
        raise ModelError(f"contact = {given.tolist()}: twice the same corner; must be {ALLOWED}")
    if len(given) == 2 and radii.any():
        raise ModelError(f"contact = {given.tolist()}: a line that ends on a round end rolls; must be {ALLOWED}")
    return Held(points, float(radii[0]), owner)
