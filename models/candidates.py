"""Where a body may be pivoted: the corners, edges and rims of it that stay put on the table while it tilts, or roll.

`models.hull` knows what of a body touches a table, `models.faces` what it lies on, `models.tilt` how far it can be
tilted about what; here is the order in which that is looked for.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import chain
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike
from pivoting.models.faces import SLACK, Face, bends, cones, face, faces, middle, promising
from pivoting.models.frames import Array, matrix
from pivoting.models.given import ALLOWED, Shown, as_compiled, held_by_hand, written
from pivoting.models.hull import TOLERANCE, Hull, Indices, read_hull
from pivoting.models.naming import ModelError
from pivoting.models.refusal import named, no_contact, not_held, option, out_of_range, within
from pivoting.models.tilt import LEAST, Arc, Held, Stance, interval, tilted, tilted_aside

NEARLY = 1e-3  # [rad]: closer normals are of one face
Holds = Callable[[Stance], bool]  # whether the simulator holds an edge by contacts of its own


class Candidate(NamedTuple):
    """A contact that a body may be pivoted about.

    Attributes:
        kind: "vertex", "rim", "round end" or "edge".
        contact: as `--contact` and `stance` take it.
        stance: that giving it yields, for an arc as long as its range.
        face: number of the face that it lies on at theta = 0, in the order of the search, or None.
    """

    kind: str
    contact: str
    stance: Stance
    face: int | None


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
    *,
    arc: Arc | None = None,
    holds: Holds | None = None,
    shown: Shown = as_compiled,
) -> Stance:
    """How to pivot a body about a contact.

    "vertex" and "edge" are the first that allow the arc: of the face on which it rests with its CoM lowest, then of the
    others. "lowest" is what touches the table in the orientation that it has; of a face, an edge, or else a vertex.
    Given corners, or a point of a rim: at theta = 0 it lies on that face of theirs on which its CoM is lowest, one on
    which it rests if there is one, of those on which they allow the arc. Of several edges or vertices of a face, the
    CoM is closest to the one chosen, among those above which it can be brought.
    A round end is a vertex, and what lies on two of them, as a capsule on its side, lies on a face of two vertices.
    About a vertex the axis is perpendicular to the lever from it to the CoM, or, if about that none allows the arc,
    another; about a point of a rim, tangent to that. The table's t points into the body, but with "lowest" the body's
    yaw is kept.

    Args:
        contact: "vertex", "edge", "lowest", or corners (3,), (1, 3) or (2, 3) in the body frame [m]; of a round end the
            centre or any point of its surface.
        xquat: (4,) body to world, what "lowest" is about, by default that of a child of the world at qpos0; given
            corners lie on the face that the body has down in it, if they are of that.
        table: (4,) table frame (t, o, n) to world, that goes with it.
        arc: the angles that it has to allow; by default any range will do.
        holds: whether the simulator holds an edge, see `models.grip`; by default it does.
        shown: points as the reader of a message has them, by default in the compiled body frame.

    Raises:
        ModelError: the body has no such contact, or cannot be tilted so about it alone; with one that would do.
    """
    body, now = read_hull(model, body_index), None
    if xquat is not None or (isinstance(contact, str) and contact == "lowest"):
        now = matrix(np.asarray(table)).T @ matrix(np.asarray(model.body_quat[body_index] if xquat is None else xquat))
    loose, reason = None, ""  # an edge that allows the arc and is not held
    try:
        for one in _search(body, contact, arc, now, shown):
            if holds is None or holds(one):
                return replace(one, face=_down(body, one))
            loose = loose or one
    except ModelError as error:
        if not isinstance(contact, str) or contact != "lowest":
            raise
        reason = str(error)
    if not reason:
        first = next(_search(body, contact, None, now, shown), None)
        if loose is not None:
            reason = not_held(body, contact, loose, shown)
        elif first is not None and arc is not None:
            reason = out_of_range(body, contact, first.held, first.up, first.range[1], arc, shown)
        else:
            reason = no_contact(body, contact, shown)
    raise ModelError(reason + _way_out(body, contact, arc, now, holds, shown))


def contacts(
    model: mujoco.MjModel,
    body_index: int,
    least: float = LEAST,
    *,
    holds: Holds | None = None,
    shown: Shown = as_compiled,
) -> list[Candidate]:
    """All that a body may be pivoted about with a range of at least `least` [rad], face by face as `stance` looks.

    A contact is listed again if on a later face, or about another axis, its range is longer.

    Raises:
        ModelError: the body's shape cannot be served.
    """
    body = read_hull(model, body_index)
    met = list(faces(body, promising(body, "vertex", least) | promising(body, "edge", least)))
    ups = np.array([one.up for one in met]).reshape(-1, 3)
    longest: dict[str, float] = {}
    found = []
    for kind in ("edge", "vertex"):
        for one in _tilts(body, kind, least, met):
            contact = written(one.points, shown)
            if not max(least, longest.get(contact, 0.0) + 1e-6) <= one.range[1] or not (holds is None or holds(one)):
                continue
            longest[contact] = one.range[1]
            away = np.linalg.norm(ups - one.rotation[2], axis=1)
            lies = int(away.argmin()) if away.min(initial=np.inf) <= NEARLY else None
            rank = int(body.rank[one.owner[0]])
            name = "edge" if kind == "edge" else "round end" if one.radius[0] else "rim" if rank == 2 else "vertex"
            found.append(Candidate(name, contact, one, lies))
    return sorted(found, key=lambda one: len(met) if one.face is None else one.face)


def planar_stance(
    model: mujoco.MjModel,
    body_index: int,
    contact: str | ArrayLike,
    axes: ArrayLike,
    *,
    arc: Arc | None = None,
    shown: Shown = as_compiled,
) -> tuple[Array, float, float]:
    """How to pivot a body in a plane: the point, or centre of a ball, (3,) body frame, its radius [m], theta_max [rad].

    Args:
        contact: a corner or ball (3,), lowest at theta = 0, body frame [m]; any word is the left end of what is down.
        axes: (3, 3) object axes (u, o, v) as columns, body frame; theta = 0 has u along the table and v up.
        arc, shown: as for `stance`.

    Raises:
        ModelError: the point is none of these, what is lowest rolls and is no ball, or the arc is not allowed.
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
        projected = given @ flat if given.dtype.kind in "iuf" and given.shape[-1:] == (3,) else given
        held = held_by_hand(body, projected, shown)
    point, radius = held.points[0], held.radius
    if len(held.points) > 1 or point @ up - radius > body.least(up).min() + body.reach:
        raise ModelError(f"{named(contact, shown)}: must be one lowest corner of the body at theta = 0")
    high = interval(body, held, up, right)[1]
    if np.isinf(high):
        raise ModelError(f"body = {body.name!r}: it is round in the plane, and rolls: no tilt lifts it off one point")
    if arc is not None and not arc.within(high):
        normals = lambda theta: np.cos(theta) * up + np.sin(theta) * right  # noqa: E731
        raise ModelError(out_of_range(body, contact, held, normals, high, arc, shown))
    return point, radius, high


def _search(
    body: Hull, contact: str | ArrayLike, arc: Arc | None, now: Array | None, shown: Shown = as_compiled
) -> Iterator[Stance]:
    """The contacts that are such and allow the arc, the first to be taken."""
    least = LEAST if arc is None else max(LEAST, arc.least)
    if not isinstance(contact, str):
        found = _by_hand(body, held_by_hand(body, contact, shown), least, now)
    elif contact == "lowest" and now is not None:
        found = _lowest(body, least, now)
    elif contact in ("vertex", "edge"):
        found = _tilts(body, contact, least, faces(body, promising(body, contact, least)))
    else:
        raise ModelError(f"contact = {contact!r}: must be {ALLOWED}")
    return (one for one in found if arc is None or arc.within(one.range[1]))


def _tilts(body: Hull, kind: str, least: float, found: Iterable[Face]) -> Iterator[Stance]:
    """About all edges, or vertices, of the hull: face by face, then vertices about other axes, then what is of no face.

    Of those with a range of less than `least` [rad] some are left out.
    """
    met = []
    for one in found:
        met.append(one)
        yield from _on_face(body, one, kind)
    if kind == "vertex":
        for one in met:
            yield from _aside(body, one, least)
    for held, up in _of_no_face(body, kind, least):
        yield from _about(body, held, up, least)


def _lowest(body: Hull, least: float, now: Array) -> Iterator[Stance]:
    """About what touches the table, body to table axes `now` (3, 3): its edges, then its vertices."""
    points, owner = body.support(now[2])
    lies = face(body, now[2])
    if lies is not None:
        yield from chain(_on_face(body, lies, "edge", now), _on_face(body, lies, "vertex", now))
        yield from _aside(body, lies, least, now)
        return
    for some in (range(len(points)), *([i] for i in range(len(points)) if len(points) > 1)):
        yield from _about(body, _held(body, points[some], owner[some], now[2]), now[2], least, now)


def _by_hand(body: Hull, held: Held, least: float, now: Array | None) -> Iterator[Stance]:
    """About one contact: as the body stands, if it does so on a face of that, then on its faces, then otherwise."""
    if now is not None and face(body, now[2]) is not None:
        yield from filter(None, [tilted(body, held, now[2], now)])
    met = []
    for one in faces(body, body.facets_of(held.owner)):
        met.append(one)
        yield from filter(None, [tilted(body, held, one.up)])
    for one in met:
        yield from filter(None, [tilted_aside(body, held, one.up, least)])
    for same, up in _of_no_face(body, "vertex" if len(held.points) == 1 else "edge", least, held.owner):
        if np.linalg.norm(same.points - held.points) <= body.reach:
            yield from _about(body, held, up, least)


def _about(body: Hull, held: Held, up: Array, least: float, now: Array | None = None) -> Iterator[Stance]:
    """About one contact on a table of normal `up`: as ever, then about another axis."""
    yield from filter(None, [tilted(body, held, up, now), tilted_aside(body, held, up, least, now)])


def _on_face(body: Hull, on: Face, kind: str, now: Array | None = None) -> list[Stance]:
    """About the edges or vertices of a face, that to be taken first."""
    if kind == "vertex":
        some = [_held(body, on.points[[i]], on.owner[[i]], on.up) for i in on.around if body.rank[on.owner[i]] != 2]
        rims, near = np.flatnonzero(body.rank == 2), body.rims(body.com)
        for rim in (near, 2.0 * body.centre[rims] - near):
            some += [Held(point[None], 0.0, rims[[k]]) for k, point in enumerate(rim)]
    else:
        pairs = np.stack([on.around, np.roll(on.around, -1)], axis=1)
        some = [_edge(body, on, pair) for pair in pairs if _is_edge(body, on.owner[pair])]
    found = [one for one in (tilted(body, held, on.up, now) for held in some) if one is not None]
    return sorted(
        found,
        key=lambda one: (one.balance >= one.range[1], round(one.balance, 6), *np.round(one.points.mean(axis=0), 9)),
    )


def _aside(body: Hull, on: Face, least: float, now: Array | None = None) -> Iterator[Stance]:
    """About the vertices of a face about other axes, and about any point of its rims."""
    for i in on.around:
        held = _held(body, on.points[[i]], on.owner[[i]], on.up)
        rim = body.rank[on.owner[i]] == 2
        one = tilted(body, held, on.up, now) if rim else tilted_aside(body, held, on.up, least, now)
        if one is not None:
            yield one


def _of_no_face(body: Hull, kind: str, least: float, of: Indices | None = None) -> Iterator[tuple[Held, Array]]:
    """Edges or vertices of the hull, each with a normal of a table on which it stands on that alone, CoM lowest first.

    They are of two corners, or of a corner, ball or rim, all of them or those `of` some ellipsoids.
    """
    some: list[tuple[Indices, Array]] = []
    if kind == "edge":
        for f, k in np.argwhere((bends(body) >= SLACK * least) & (np.arange(len(body.ups))[:, None] < body.beside)):
            pair = np.delete(body.facets[f], k)
            if pair[0] != pair[1] and not body.rank[pair].any() and (of is None or set(of) == set(pair)):
                some.append((pair, middle(body, np.array([f, body.beside[f, k]]))))
    else:
        tips = np.flatnonzero(((body.rank == 0) & (cones(body) >= SLACK * least)) | (body.radius > 0.0))
        tips = tips if of is None else np.intersect1d(tips, of)
        some = [(tip, middle(body, body.facets_of(tip))) for tip in tips[:, None]]
    found = [(_held(body, body.lowest(up, which), which, up), up) for which, up in some]
    rims = np.flatnonzero(body.rank == 2) if kind == "vertex" else np.array([], dtype=int)
    for rim, near in zip(rims, body.rims(body.com), strict=False):
        for point in (near, 2.0 * body.centre[rim] - near):
            up = (body.centre[rim] - point) / np.linalg.norm(body.centre[rim] - point)
            found.append((Held(point[None], 0.0, np.array([rim])), up))
    height = [float((body.com - held.points[0]) @ up) for held, up in found]
    yield from (found[k] for k in np.argsort(height, kind="stable"))


def _held(body: Hull, points: Array, owner: Indices, up: Array) -> Held:
    """What stays put of `points` (K, 3) on a table of normal `up`: they, or of a ball its centre; and its radius."""
    return Held(points + body.radius[owner, None] * up, float(body.radius[owner].max()), owner)


def _is_edge(body: Hull, ends: Indices) -> bool:
    """Whether it turns about the line between two, and does not roll on a ball."""
    return bool(ends[0] != ends[1] and not body.radius[ends].any())


def _edge(body: Hull, on: Face, pair: Indices) -> Held:
    """Two of the points around a face; moved, if they are of rims, to where their line is a tangent."""
    ends, owner = on.points[pair], on.owner[pair]
    up = np.cross(ends[1] - ends[0], on.points.mean(axis=0) - ends[0])
    for _ in range(50 if body.rank[owner].any() else 1):
        ends = body.lowest(np.cross(up, ends[1] - ends[0]), owner)
    return Held(ends, 0.0, owner)


def _down(body: Hull, one: Stance) -> Array:
    """(P, 3) what touches at theta = 0."""
    up = one.rotation[2]
    try:
        return body.support(up)[0]
    except ModelError:  # it rolls on some of it
        least = body.least(up)
        return body.lowest(up, np.flatnonzero(least <= least.min() + body.reach))


def _way_out(
    body: Hull, contact: str | ArrayLike, arc: Arc | None, now: Array | None, holds: Holds | None, shown: Shown
) -> str:
    """The nearest contact that would do, or else the first with half the range or more, as the end of a message."""
    asked = arc or Arc(0.0, 0.0)
    for part in 0.5 ** np.arange(8):
        less = (
            None if arc is None else arc if part == 1.0 else Arc(0.0, part * arc.least - arc.gap, arc.gap, lands=True)
        )
        kinds = [kind for kind in ("edge", "vertex") if part < 1.0 or contact is not kind]
        some = (one for kind in kinds for one in _search(body, kind, less, now) if holds is None or holds(one))
        if isinstance(contact, str):
            one = next(some, None)
        else:
            at = np.atleast_2d(np.asarray(contact, dtype=float)).mean(axis=0)
            one = min(some, key=lambda one: float(np.linalg.norm(one.points.mean(axis=0) - at)), default=None)
        if one is not None:
            word = "vertex" if len(one.points) == 1 else "edge"
            value = word if part == 1.0 and isinstance(contact, str) else written(one.points, shown)
            return f"; nearest: {option(value)}, within {within(asked, one.range[1])}"
        if less is None or less.least < LEAST:
            break
    return ""
