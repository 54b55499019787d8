"""Where a body may be pivoted: the corners, edges and rims of it that stay put on the table while it tilts, or roll.

What rolls is a round end: of a capsule, or a sphere that is part of a body. Its centre and radius are given in place of
a point that stays put. `models.hull` knows what of a body touches a table.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import chain

import mujoco
import numpy as np
from numpy.typing import ArrayLike
from pivoting.models.frames import Array, matrix
from pivoting.models.hull import TOLERANCE, Hull, Indices, circle, outline, read_hull
from pivoting.models.naming import ModelError

NEAR = 1e-3  # of the body's size: a contact given by hand is a corner if it is closer to it
LEAST = 1e-3  # [rad]: a range of less is none
ALLOWED = "vertex, edge, lowest, or one or two corners, or a round end (x, y, z) in the body frame [m]"
Held = tuple[Array, float]  # the points (K, 3) that stay put, or the centre (1, 3) of a ball; its radius, or 0
RING = circle(360)[:, :2] / np.cos(np.pi / 360.0)  # around the unit circle, not inside it: no contact is missed


@dataclass(frozen=True, eq=False)
class Stance:
    """Points of a body to pivot about. At theta = 0 it lies on more of itself, and theta > 0 lifts it off that.

    Attributes:
        points: (K, 3) one point or the two ends of an edge, of a round end its centre, body frame [m].
        radius: (K,) of a round end, 0 of all else [m].
        rotation: (3, 3) body to table frame (t, o, n) at theta = 0, n the table's normal.
        axis: (3,) about which theta turns, in the table frame, horizontal.
        range: (0, theta_max), open: in it nothing but `points`, and the edge between them, touches the table [rad].
        balance: theta at which the CoM is straight above them [rad].
        start: theta of the orientation that "lowest" is about, else 0 [rad].
    """

    points: Array
    radius: Array
    rotation: Array
    axis: Array
    range: tuple[float, float]
    balance: float
    start: float


def contact_points(model: mujoco.MjModel, body_index: int) -> Array:
    """(P, 3) corners of a body's colliding geoms that are on its hull, body frame [m]; (0, 3) for a cylinder's rims."""
    body = read_hull(model, body_index)
    return body.centre[body.rank == 0]


def support_points(model: mujoco.MjModel, body_index: int, down: ArrayLike, tolerance: float = TOLERANCE) -> Array:
    """(K, 3) what of a body touches a table below it, body frame [m]: a vertex, the ends of an edge, or a face.

    A face is the corners of its convex polygon, in order around it; a rim that lies flat counts as four.

    Args:
        down: (3,) towards the table, body frame.
        tolerance: of the body's size, within which a point touches.

    Raises:
        ModelError: what touches is an ellipsoid or the side of a cylinder, which roll.
    """
    up = -np.asarray(down, dtype=float) / np.linalg.norm(down)
    return read_hull(model, body_index, tolerance).support(up)[0]


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
    A round end is a vertex, and what lies on two of them, as a capsule on its side, lies on a face of two vertices.
    About a vertex the axis is perpendicular to the lever from it to the CoM; about a point of a rim, tangent to that.
    The table's t points into the body, but with "lowest" the body's yaw is kept.

    Args:
        contact: "vertex", "edge", "lowest", or corners (3,), (1, 3) or (2, 3) in the body frame [m]; of a round end the
            centre or any point of its surface.
        xquat: (4,) body to world, what "lowest" is about, by default that of a child of the world at qpos0; given
            corners lie on the face that the body has down in it, if they are of that.
        table: (4,) table frame (t, o, n) to world, that goes with it.

    Raises:
        ModelError: the body has no such contact, or cannot be tilted about it alone.
    """
    body = read_hull(model, body_index)
    found: Iterable[Stance | None]
    if not isinstance(contact, str):
        held = _given(body, contact)
        # as it stands already, if it stands on a face of theirs
        down = [] if xquat is None else [matrix(np.asarray(table)).T @ matrix(np.asarray(xquat))]
        first = (_turn(body, held, now[2], now) for now in down if body.lies(body.support(now[2])[1]))
        found = chain(first, (_turn(body, held, up) for up in _faces(body)))
    elif contact == "lowest":
        now = matrix(np.asarray(table)).T @ matrix(np.asarray(model.body_quat[body_index] if xquat is None else xquat))
        points, owner = body.support(now[2])
        flat = (_best(body, now[2], kind, now) for kind in ("edge", "vertex"))
        found = flat if body.lies(owner) else [_turn(body, _held(body, points, owner, now[2]), now[2], now)]
    elif contact in ("vertex", "edge"):
        found = (_best(body, up, contact) for up in _faces(body))
    else:
        raise ModelError(f"contact = {contact!r}: must be {ALLOWED}")
    one = next(filter(None, found), None)
    if one is None:
        tilted = "lies on no face from which it can be tilted so, towards its CoM and with nothing else touching"
        rolls = ", and about a line that ends on a round end it would only roll" * bool((body.radius > 0.0).any())
        raise ModelError(f"contact = {contact!r}: body {body.name!r} {tilted}{rolls}; must be {ALLOWED}")
    return one


def planar_stance(
    model: mujoco.MjModel, body_index: int, contact: str | ArrayLike, axes: ArrayLike
) -> tuple[Array, float, float]:
    """How to pivot a body in a plane: the point, or centre of a ball, (3,) body frame, its radius [m], theta_max [rad].

    Args:
        contact: a corner or ball (3,), lowest at theta = 0, body frame [m]; any word is the left end of what is down.
        axes: (3, 3) object axes (u, o, v) as columns, body frame; theta = 0 has u along the table and v up.

    Raises:
        ModelError: the point is none of these, or what is lowest rolls and is no ball.
    """
    right, normal, up = np.asarray(axes, dtype=float).T
    flat, solid = np.eye(3) - np.outer(normal, normal), read_hull(model, body_index)
    body = replace(solid, centre=solid.centre @ flat, axes=flat @ solid.axes, com=solid.com @ flat)
    if isinstance(contact, str):
        points, owner = body.touching(up)
        left = [int((points @ right).argmin())]
        held = _held(body, points[left], owner[left], up)
    else:
        given = np.asarray(contact)
        held = _given(body, given @ flat if given.dtype.kind in "iuf" and given.shape[-1:] == (3,) else given)
    (point, *_), radius = held
    if len(held[0]) > 1 or point @ up - radius > body.least(up).min() + body.reach:
        raise ModelError(
            f"contact = {np.asarray(contact).tolist()}: must be one lowest corner of the body at theta = 0"
        )
    high = (_rolling(body, point, radius, up, right) if radius else _interval(body, held[0], up, right))[1]
    if np.isinf(high):
        raise ModelError(f"body = {body.name!r}: it is round in the plane, and rolls: no tilt lifts it off one point")
    return point, radius, high


def _faces(body: Hull) -> list[Array]:
    """Inward normals of the faces: first those on which the body rests, then by the CoM's height, then the most up."""
    found = []
    for up in body.planes():
        try:
            points, owner = body.touching(up)
        except ModelError:  # it rolls there
            continue
        around = outline(points, body.reach)
        if body.lies(owner[around]):
            height = float(body.com @ up - body.least(up).min()) / body.size
            tips = not _above(points[around], up, body) or height <= 0.0
            found.append((tips, round(height, 6), *-np.round(up[::-1], 6), up))
    return [up for *_, up in sorted(found, key=lambda item: item[:-1])]


def _above(around: Array, up: Array, body: Hull) -> bool:
    """Whether the CoM is above a line (2, 3), or a face of which these (P, 3) are the corners."""
    lever, along = body.com - around, np.roll(around, -1, axis=0) - around
    side = np.cross(along, lever) @ up
    if len(around) > 2:
        return bool((side >= 0.0).all() or (side <= 0.0).all())
    between = (along * lever).sum(axis=1).min() >= 0.0
    return bool(between and abs(side[0]) <= body.reach * np.linalg.norm(along[0]))


def _held(body: Hull, points: Array, owner: Indices, up: Array) -> Held:
    """What stays put of `points` (K, 3) on a table of normal `up`: they, or of a ball its centre; and its radius."""
    radius = float(body.radius[owner].max())
    return points + body.radius[owner, None] * up, radius


def _best(body: Hull, up: Array, kind: str, now: Array | None = None) -> Stance | None:
    """Of the edges or vertices of the face with inward normal `up` the one to pivot about, if there is one."""
    points, owner = body.touching(up)
    around = outline(points, body.reach)
    if kind == "vertex":
        near = body.rims(body.com)
        far = 2.0 * body.centre[body.rank == 2] - near
        some = [_held(body, points[[i]], owner[[i]], up) for i in around if body.rank[owner[i]] != 2]
        some += [(rim[None], 0.0) for rim in (*near, *far)]
    else:
        pairs = np.stack([around, np.roll(around, -1)], axis=1)
        some = [(_edge(body, points, owner, pair), 0.0) for pair in pairs if _is_edge(body, owner[pair])]
    found = [one for one in (_turn(body, held, up, now) for held in some) if one is not None]
    return min(
        found,
        key=lambda one: (one.balance >= one.range[1], round(one.balance, 6), *np.round(one.points.mean(axis=0), 9)),
        default=None,
    )


def _is_edge(body: Hull, ends: Indices) -> bool:
    """Whether it turns about the line between two, and does not roll on a ball."""
    return bool(ends[0] != ends[1] and not body.radius[ends].any())


def _edge(body: Hull, points: Array, owner: Indices, pair: Indices) -> Array:
    """(2, 3) of two of the `points` around a face; moved, if they are of rims, to where their line is a tangent."""
    ends, middle = points[pair], points.mean(axis=0)
    up = np.cross(ends[1] - ends[0], middle - ends[0])
    for _ in range(50):
        ends = body.lowest(np.cross(up, ends[1] - ends[0]), owner[pair])
    return ends


def _turn(body: Hull, held: Held, up: Array, now: Array | None = None) -> Stance | None:
    """The stance about what is `held` on a table of normal `up`, or None if it cannot be tilted about that alone.

    `now`: (3, 3) body to table frame, to keep the yaw of.
    """
    points, radius = held
    if (points @ up).max() - radius > body.least(up).min() + body.reach or (radius > 0.0 and len(points) > 1):
        return None
    points = points[np.lexsort(np.round(points, 9).T[::-1])]
    lever, along = body.com - points[0], points[-1] - points[0]
    if len(points) == 2:
        along = along / np.linalg.norm(along)
        up = (up - (up @ along) * along) / np.linalg.norm(np.cross(up, along))
        inward = np.cross(along, up) if np.cross(along, up) @ lever >= -body.reach else np.cross(up, along)
    else:
        on = np.linalg.norm(body.rims(points[0]) - points[0], axis=1) <= body.reach * (radius == 0.0)
        inward = [*(body.centre[body.rank == 2][on] - points[0]), lever][0]
        inward = inward - (inward @ up) * up
        if np.linalg.norm(inward) <= body.reach:  # balanced
            inward = np.cross(np.eye(3)[np.abs(up).argmin()], up)
        inward = inward / np.linalg.norm(inward)
    low, high = _interval(body, points, up, inward) if radius == 0.0 else _rolling(body, points[0], radius, up, inward)
    if not LEAST < high - low < np.inf:  # inf: nothing else ever touches, so it lies on nothing
        return None
    t, n = np.cos(low) * inward - np.sin(low) * up, np.sin(low) * inward + np.cos(low) * up
    x, y = (1.0, 0.0) if now is None else (now @ inward)[:2] / np.linalg.norm((now @ inward)[:2])
    yaw = np.array([[x, -y, 0.0], [y, x, 0.0], [0.0, 0.0, 1.0]])
    balance, start = float(np.arctan2(lever @ t, lever @ n)), 0.0 if now is None else max(0.0, -low)
    radii = np.full(len(points), radius)
    return Stance(points, radii, yaw @ np.stack([t, np.cross(n, t), n]), -yaw[:, 1], (0.0, high - low), balance, start)


def _interval(body: Hull, points: Array, up: Array, inward: Array) -> tuple[float, float]:
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


def _rolling(body: Hull, centre: Array, radius: float, up: Array, inward: Array) -> tuple[float, float]:
    """The same about a ball, c from its centre: another is above the table while n.c + radius > |A'n|.

    For a ball or a corner at the angle phi that is |c| cos(theta - phi) > (its radius) - radius. Rims and ellipsoids
    are taken as the corners of polygons around them.
    """
    plane = np.stack([up, inward])
    c, own = (body.centre - centre) @ plane.T, np.linalg.norm(body.centre - centre, axis=1) <= body.reach
    own &= np.abs(body.radius - radius) <= body.reach
    wide = (body.rank > 0) & (body.radius == 0.0)
    U, half_axes, _ = np.linalg.svd(plane @ body.axes[wide], full_matrices=False)
    around = c[wide, None] + RING @ (U * half_axes[:, None, :]).transpose(0, 2, 1)
    points = np.concatenate([c[~wide & ~own], around.reshape(-1, 2)])
    larger = np.concatenate([body.radius[~wide & ~own], np.zeros(around.size // 2)]) - radius
    far = np.linalg.norm(points, axis=1)
    half = np.where(larger <= -far, np.inf, np.arccos(np.clip(larger / np.maximum(far, 1e-300), -1.0, 1.0)))
    half[(far <= body.reach) & (np.abs(larger) <= body.reach)] = -np.inf  # on the axis: it stays there
    middle = np.arctan2(points[:, 1], points[:, 0])
    return float((middle - half).max(initial=-np.inf)), float((middle + half).min(initial=np.inf))


def _given(body: Hull, contact: ArrayLike) -> Held:
    """The corners, points of rims, or the ball, that a user's points are."""
    given = np.atleast_2d(np.asarray(contact))
    if given.dtype.kind not in "iuf" or given.shape not in ((1, 3), (2, 3)) or not np.isfinite(given).all():
        raise ModelError(f"contact = {given.tolist()}: must be {ALLOWED}")
    tips = (body.rank == 0) | (body.radius > 0.0)
    nearest, radii = [], []
    for point in given:
        some = np.concatenate([body.centre[tips], body.rims(point)])
        radius = np.concatenate([body.radius[tips], np.zeros(len(some) - np.count_nonzero(tips))])
        away = np.linalg.norm(some - point, axis=1)
        off = np.minimum(away, np.abs(away - radius))
        i = int(off.argmin())
        if off[i] > NEAR * body.size:
            shown = ", ".join(f"{x:.6g}" for x in some[i])
            end = f", the centre of a round end of radius {radius[i]:.6g}" * bool(radius[i])
            what = f"no corner of body {body.name!r}; the nearest is {shown}{end}"
            raise ModelError(f"contact = {point.tolist()}: {what}")
        nearest.append(some[i])
        radii.append(float(radius[i]))
    if len(given) == 2 and np.linalg.norm(nearest[0] - nearest[1]) <= NEAR * body.size:
        raise ModelError(f"contact = {given.tolist()}: twice the same corner; must be {ALLOWED}")
    if len(given) == 2 and any(radii):
        raise ModelError(f"contact = {given.tolist()}: a line that ends on a round end rolls; must be {ALLOWED}")
    return np.array(nearest), radii[0]
