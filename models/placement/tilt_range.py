"""How far a body can be tilted about what of it stays put on the table: from lying on more of itself to the next touch.

What rolls is a round end: of a capsule, or a sphere that is part of a body. Its centre and radius are given in place of
a point that stays put.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pivoting.models.frames import Array
from pivoting.models.placement.convex_hull import Hull, Indices, circle

LEAST = 1e-3  # [rad]: a range of less is none
LARGE = 1000  # ellipsoids: of larger hulls first only the neighbours are asked, and whether nothing else is lower
RING = circle(360)[:, :2] / np.cos(np.pi / 360.0)  # around the unit circle, not inside it: no contact is missed
TURNS = np.deg2rad(5.0) * np.arange(72)  # directions that are tried about a vertex
SHARES = np.array([0.02, 0.1, 0.25, 0.5, 0.75, 0.9, 0.98])  # and between any two of the faces around it


class Held(NamedTuple):
    """What stays put: the points (K, 3), or the centre (1, 3) of a ball and its radius, or 0; of which ellipsoids."""

    points: Array
    radius: float
    owner: Indices


class Arc(NamedTuple):
    """The angles that are asked for, in any order.

    Attributes:
        theta, theta_end: [rad].
        gap: what has to be left to the ends of a range [rad].  lands: whether the arc may end on the face, at 0.
    """

    theta: float
    theta_end: float
    gap: float = 0.0
    lands: bool = False

    def limits(self, most: float) -> tuple[float, float]:
        """What a range from 0 to `most` leaves to an arc [rad]."""
        return (0.0 if self.lands else self.gap), most - self.gap

    def within(self, most: float) -> bool:
        """Whether a range from 0 to `most` allows it."""
        low, high = self.limits(most)
        return low - 1e-11 <= min(self.theta, self.theta_end) and max(self.theta, self.theta_end) <= high + 1e-11

    @property
    def least(self) -> float:
        """The range that it needs [rad]."""
        return max(self.theta, self.theta_end) + self.gap


@dataclass(frozen=True, eq=False)
class Pivot:
    """Points of a body to pivot about. At theta = 0 it lies on more of itself, and theta > 0 lifts it off that.

    Attributes:
        points: (K, 3) one point or the two ends of an edge, of a round end its centre, body frame [m].
        radius: (K,) of a round end, 0 of all else [m].
        rotation: (3, 3) body to table frame (t, o, n) at theta = 0, n the table's normal.
        axis: (3,) about which theta turns, in the table frame, horizontal.
        range: (0, theta_max), open: in it nothing but `points`, and the edge between them, touches the table [rad].
        balance: theta at which the CoM is straight above them, or, about an axis past which it leans, highest [rad].
        start: theta of the orientation that "lowest" is about, else 0 [rad].
        owner: of which ellipsoids of the hull the points are.
        face: (P, 3) what touches at theta = 0, body frame [m]; in what `contact_candidates.find_pivot` gives.
    """

    points: Array
    radius: Array
    rotation: Array
    axis: Array
    range: tuple[float, float]
    balance: float
    start: float
    owner: Indices
    face: Array = field(default_factory=lambda: np.zeros((0, 3)))

    @property
    def held(self) -> Held:
        """What stays put, or rolls."""
        return Held(self.points, float(self.radius[0]), self.owner)

    def up(self, theta: float) -> Array:
        """(3,) the table's normal at an angle [rad], body frame."""
        up = np.array([0.0, 0.0, 1.0])
        return (np.cos(theta) * up - np.sin(theta) * cross(self.axis, up)) @ self.rotation


def cross(a: Array, b: Array) -> Array:
    """(3,) the cross product of two vectors, which NumPy is slow at."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def touches(body: Hull, held: Held, up: Array) -> bool:
    """Whether all that is held is on a table of normal `up` (3,), points of rims as what is lowest of these."""
    if (held.points @ up).max() - held.radius > body.least(up).min() + body.reach:
        return False
    tilted = np.linalg.norm(up @ body.axes[held.owner], axis=1) > body.reach
    off = np.linalg.norm(body.lowest(up, held.owner) - held.points, axis=1) > body.reach
    return not bool(((body.rank[held.owner] == 2) & tilted & off).any())


def tilted(body: Hull, held: Held, up: Array, now: Array | None = None, inward: Array | None = None) -> Pivot | None:
    """The pivot about what is `held` on a table of normal `up`, or None if it cannot be tilted about that alone.

    Args:
        held: one point, two corners or points of rims, or a ball, which touch there.
        now: (3, 3) body to table frame, to keep the yaw of.
        inward: (3,) what is lifted, of one point; by default towards the CoM, and of a rim towards its centre.
    """
    points, radius, owner = held
    if radius > 0.0 and len(points) > 1:
        return None
    points = points[np.lexsort(np.round(points, 9).T[::-1])]
    lever = body.com - points[0]
    if len(points) == 2:
        along = points[1] - points[0]
        along = along / np.linalg.norm(along)
        up = (up - (up @ along) * along) / np.linalg.norm(cross(up, along))
        inward = cross(along, up) if cross(along, up) @ lever >= -body.reach else cross(up, along)
    else:
        inward = _inward(body, held, up) if inward is None else inward
    near = _near(body, held)
    low, high = interval(body, held, up, inward, near)
    if near is not None and high - low > LEAST and not all(_lowest(body, held, up, inward, end) for end in (low, high)):
        low, high = interval(body, held, up, inward)
    if not LEAST < high - low < np.inf:  # inf: nothing else ever touches, so it lies on nothing
        return None
    t, n = np.cos(low) * inward - np.sin(low) * up, np.sin(low) * inward + np.cos(low) * up
    x, y = (1.0, 0.0) if now is None else (now @ inward)[:2] / np.linalg.norm((now @ inward)[:2])
    yaw = np.array([[x, -y, 0.0], [y, x, 0.0], [0.0, 0.0, 1.0]])
    balance, start = float(np.arctan2(lever @ t, lever @ n)), 0.0 if now is None else max(0.0, -low)
    turned = yaw @ np.stack([t, cross(n, t), n])
    return Pivot(points, np.full(len(points), radius), turned, -yaw[:, 1], (0.0, high - low), balance, start, owner)


def tilted_aside(body: Hull, held: Held, up: Array, least: float, now: Array | None = None) -> Pivot | None:
    """The pivot about one point with a range of at least `least` [rad] about another axis than that towards the CoM.

    Of the directions that allow it, the one that is farthest from those that do not; of equal ones that closest to the
    CoM. None for a point of a rim, which stays put about its tangent alone.
    """
    if _rim(body, held).size or len(held.points) > 1:
        return None
    first = _inward(body, held, up)
    second = cross(up, first)
    around = body.ups[body.facets_of(held.owner)] if held.radius == 0.0 else np.zeros((0, 3))
    way = np.stack([around @ first, around @ second], axis=1)
    ways = np.unique(np.round(np.arctan2(way[:, 1], way[:, 0])[np.linalg.norm(way, axis=1) > LEAST], 9))
    between = ways[:, None] + np.diff(ways, append=ways[:1] + 2.0 * np.pi)[:, None] * SHARES
    turns = np.concatenate([TURNS, ways, between.ravel()])
    some = np.cos(turns)[:, None] * first + np.sin(turns)[:, None] * second
    low, high = _interval(body, held, up, some, _near(body, held))
    good = (high - low >= least) & (high - low < np.inf) & (low <= LEAST)
    if not good.any():
        return None
    apart = (turns[good][:, None] - turns[~good] + np.pi) % (2.0 * np.pi) - np.pi
    room = np.abs(apart).min(axis=1, initial=np.pi)
    aside = np.abs((turns[good] + np.pi) % (2.0 * np.pi) - np.pi)
    one = tilted(body, held, up, now, some[good][np.lexsort((aside, -np.round(room, 6)))[0]])
    return one if one is not None and one.range[1] >= least else None


def next_touch(body: Hull, held: Held, up: Array) -> tuple[Array, int]:
    """Of what is not the contact itself, the point (3,) closest to a table of normal `up`; of which ellipsoid it is."""
    clear = body.least(up)
    clear[held.owner] = np.inf
    clear[(body.rank == 0) & _between(held, body.centre, body.reach)] = np.inf
    nearest = int(clear.argmin())
    return body.lowest(up, np.array([nearest]))[0], nearest


def interval(body: Hull, held: Held, up: Array, inward: Array, some: Indices | None = None) -> tuple[float, float]:
    """Between which angles [rad] from here nothing but `held` is on the table, when `inward` is lifted about it.

    `some`: of which ellipsoids it is asked, by default all.
    """
    low, high = _interval(body, held, up, inward[None], some)
    return float(low[0]), float(high[0])


def _lowest(body: Hull, held: Held, up: Array, inward: Array, theta: float) -> bool:
    """Whether nothing is below what is held, at an angle. If so at both ends of an interval, it is so in between."""
    normal = np.cos(theta) * up + np.sin(theta) * inward
    return bool(held.points[0] @ normal - held.radius <= body.least(normal).min() + 1e-3 * body.reach)


def _inward(body: Hull, held: Held, up: Array) -> Array:
    """(3,) horizontally to the CoM from one point; of a rim to its centre, or if that is above it, along its axis."""
    lever, rims = body.com - held.points[0], _rim(body, held)
    inward = body.centre[rims[0]] - held.points[0] if rims.size else lever
    inward = inward - (inward @ up) * up
    if np.linalg.norm(inward) <= body.reach and rims.size:
        inward = np.linalg.svd(body.axes[rims[0]])[0][:, 2]
        inward = inward if inward @ lever >= 0.0 else -inward
    elif np.linalg.norm(inward) <= body.reach:  # balanced
        inward = cross(np.eye(3)[np.abs(up).argmin()], up)
    return inward / np.linalg.norm(inward)


def _rim(body: Hull, held: Held) -> Indices:
    """The rims that any of the points is on."""
    which = np.flatnonzero(body.rank == 2)
    if not which.size or held.radius > 0.0:
        return which[:0]
    off = np.stack([np.linalg.norm(body.rims(point) - point, axis=1) for point in held.points])
    return which[(off <= body.reach).any(axis=0)]


def _near(body: Hull, held: Held) -> Indices | None:
    """What may touch first: of a large hull's corners the neighbours and all that is round; None for all there is."""
    if len(body.centre) <= LARGE or (body.rank[held.owner] > 0).any():
        return None
    return np.union1d(body.facets[body.facets_of(held.owner)], body.wide)


def _between(held: Held, points: Array, reach: float) -> NDArray[np.bool_]:
    """(...,) which of some points (..., 3) are within `reach` of the contact's point, or of the edge."""
    away, along = points - held.points[0], held.points[-1] - held.points[0]
    share = np.clip(away @ along / max(float(along @ along), 1e-300), 0.0, 1.0)
    return np.linalg.norm(away - share[..., None] * along, axis=-1) <= reach


def _interval(body: Hull, held: Held, up: Array, inward: Array, some: Indices | None = None) -> tuple[Array, Array]:
    """(D,) and (D,): the same for each of `inward` (D, 3), of all ellipsoids or `some`.

    At theta the table's normal is n = cos(theta) up + sin(theta) inward. A corner, c from the axis, is above it for
    half a turn; an ellipsoid while n.c > |A'n|: a cone of n in the plane of both, about an eigenvector of c c' - A A'.
    """
    if held.radius > 0.0:
        return _rolling(body, held, up, inward)
    some = np.arange(len(body.centre)) if some is None else some
    corners, wide = some[body.rank[some] == 0], some[body.rank[some] > 0]
    corners = corners[~_between(held, body.centre[corners], body.reach)]
    c = _across(body.centre[corners] - held.points[0], up, inward)
    angle = np.arctan2(c[..., 1], c[..., 0])
    half = np.where(np.linalg.norm(c, axis=-1) <= body.reach, -np.inf, 0.5 * np.pi)  # on the axis: it stays there
    low, high = (angle - half).max(axis=1, initial=-np.inf), (angle + half).min(axis=1, initial=np.inf)
    if not wide.size:
        return low, high
    c = _across(body.centre[wide] - held.points[0], up, inward)
    A = np.stack([np.broadcast_to(up, inward.shape), inward], axis=1)[:, None] @ body.axes[wide]
    values, vectors = np.linalg.eigh(c[..., :, None] * c[..., None, :] - A @ A.swapaxes(-1, -2))
    v = vectors[..., 1] * np.sign((vectors[..., 1] * c).sum(axis=-1, keepdims=True))
    half = np.arctan2(np.sqrt(np.maximum(values[..., 1], 0.0)), np.sqrt(np.maximum(-values[..., 0], 0.0)))
    lowest = np.stack([body.lowest(way, wide) for way in inward])
    own = _between(held, lowest, body.reach)  # about a line a rim stays put only if that is its tangent
    if len(held.points) == 1:
        own = own | np.isin(wide, _rim(body, held))
    half[own], v[own] = 0.5 * np.pi, c[own]  # a half-plane: of a rim that the points are on
    angle = np.arctan2(v[..., 1], v[..., 0])
    return np.maximum(low, (angle - half).max(axis=1)), np.minimum(high, (angle + half).min(axis=1))


def _across(points: Array, up: Array, inward: Array) -> Array:
    """(D, M, 2) along `up` (3,) and each of `inward` (D, 3)."""
    y = inward @ points.T
    return np.stack([np.broadcast_to(points @ up, y.shape), y], axis=-1)


def _rolling(body: Hull, held: Held, up: Array, inward: Array) -> tuple[Array, Array]:
    """The same about a ball, c from its centre: another is above the table while n.c + radius > |A'n|.

    For a ball or a corner at the angle phi that is |c| cos(theta - phi) > (its radius) - radius. Rims and ellipsoids
    are taken as the corners of polygons around them.
    """
    away = body.centre - held.points[0]
    others = (np.linalg.norm(away, axis=1) > body.reach) | (np.abs(body.radius - held.radius) > body.reach)
    wide = (body.rank > 0) & (body.radius == 0.0)
    points, larger = _across(away[~wide & others], up, inward), body.radius[~wide & others] - held.radius
    if wide.any():
        plane = np.stack([np.broadcast_to(up, inward.shape), inward], axis=1)[:, None]
        U, half_axes, _ = np.linalg.svd(plane @ body.axes[wide], full_matrices=False)
        around = RING @ (U * half_axes[..., None, :]).swapaxes(-1, -2) + _across(away[wide], up, inward)[:, :, None]
        around = around.reshape(len(inward), -1, 2)
        points = np.concatenate([points, around], axis=1)
        larger = np.concatenate([larger, np.full(around.shape[1], -held.radius)])
    far = np.linalg.norm(points, axis=-1)
    half = np.where(larger <= -far, np.inf, np.arccos(np.clip(larger / np.maximum(far, 1e-300), -1.0, 1.0)))
    half[(far <= body.reach) & (np.abs(larger) <= body.reach)] = -np.inf  # on the axis: it stays there
    angle = np.arctan2(points[..., 1], points[..., 0])
    return (angle - half).max(axis=1, initial=-np.inf), (angle + half).min(axis=1, initial=np.inf)
