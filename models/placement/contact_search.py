"""The order in which contacts are looked for: face by face, then about other axes, then what is of no face."""

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pivoting.models.errors import ModelError
from pivoting.models.frames import Array
from pivoting.models.placement.convex_hull import Hull, Indices
from pivoting.models.placement.given_contacts import ALLOWED, Shown, as_compiled, held_by_hand
from pivoting.models.placement.resting_faces import SAME, SLACK, Face, face, faces, middle, promising, standing
from pivoting.models.placement.tilt_range import LARGE, LEAST, Arc, Held, Pivot, cross, tilted, tilted_aside, touches

FACETS = 50  # of a hull, on which a wide range is looked for


def search(
    body: Hull,
    contact: str | ArrayLike,
    arc: Arc | None,
    now: Array | None,
    shown: Shown = as_compiled,
    height: float = 0.0,
) -> Iterator[Pivot]:
    """The contacts that are such and allow the arc, the first to be taken; see `contact_candidates.find_pivot`."""
    least = LEAST if arc is None else max(LEAST, arc.least)
    if not isinstance(contact, str):
        found = _by_hand(body, held_by_hand(body, contact, shown), least, now)
    elif contact == "lowest" and now is not None:
        found = _lowest(body, least, now)
    elif contact in ("vertex", "edge"):
        up = None if now is None else standing(body, now[2], height)
        found = _tilts(body, contact, least, faces(body, promising(body, contact, least), up), now)
    else:
        raise ModelError(f"contact = {contact!r}: must be {ALLOWED}")
    return (one for one in found if arc is None or arc.within(one.range[1]))


def _tilts(body: Hull, kind: str, least: float, found: Iterable[Face], now: Array | None) -> Iterator[Pivot]:
    """About the edges, or vertices, of the hull: face by face, then vertices about other axes, then what is of no face.

    Of those with a range of less than `least` [rad] some are left out.
    """
    met: list[tuple[Face, Array | None]] = []
    for one in found:
        as_now = now is not None and one.up @ now[2] > 1.0 - SAME  # then its yaw is kept, too
        met.append((one, now if as_now else None))
        yield from on_face(body, one, kind, least, met[-1][1])
    if kind == "vertex":
        for one, kept in met:
            yield from aside(body, spots(body, one, least), one.up, least, kept)
    for held, up in of_no_face(body, kind, least):
        yield from about(body, held, up, least)


def _lowest(body: Hull, least: float, now: Array) -> Iterator[Pivot]:
    """About what touches the table, body to table axes `now` (3, 3): its edges, then its vertices."""
    points, owner = body.support(now[2])
    lies = face(body, now[2])
    if lies is not None:
        yield from on_face(body, lies, "edge", least, now)
        yield from on_face(body, lies, "vertex", least, now)
        yield from aside(body, spots(body, lies, least), now[2], least, now)
        return
    for some in (range(len(points)), *([i] for i in range(len(points)) if len(points) > 1)):
        yield from about(body, held_at(body, points[some], owner[some], now[2]), now[2], least, now)


def _by_hand(body: Hull, held: Held, least: float, now: Array | None) -> Iterator[Pivot]:
    """About one contact: as the body stands, if it does so on a face of that, then on its faces, then otherwise."""
    ups = (one.up for one in faces(body, body.facets_of(held.owner)) if touches(body, held, one.up))
    if now is not None and touches(body, held, now[2]) and face(body, now[2]) is not None:
        yield from filter(None, [tilted(body, held, now[2], now)])
    met = []
    for up in ups:
        met.append(up)
        yield from filter(None, [tilted(body, held, up)])
    for up in met:
        yield from aside(body, [held], up, least)
    for same, up in of_no_face(body, "vertex" if len(held.points) == 1 else "edge", least, held):
        yield from about(body, same, up, least)


def widest(body: Hull) -> Iterator[Pivot]:
    """About the edges and vertices of those faces about which the ranges can be widest."""
    rounded = (body.rank[body.facets] > 0).any(axis=1)
    for kind, bound in (("edge", body.bends), ("vertex", body.cones[body.facets])):
        for one in faces(body, np.argsort(-np.where(rounded, np.pi, bound.max(axis=1)), kind="stable")[:FACETS]):
            yield from on_face(body, one, kind, LEAST)


def about(body: Hull, held: Held, up: Array, least: float, now: Array | None = None) -> Iterator[Pivot]:
    """About one contact on a table of normal `up`: as ever, then about another axis."""
    yield from filter(None, [tilted(body, held, up, now)])
    yield from aside(body, [held], up, least, now)


def aside(body: Hull, some: Iterable[Held], up: Array, least: float, now: Array | None = None) -> Iterator[Pivot]:
    """About vertices on a table of normal `up`, about other axes; about a point of a rim as ever."""
    for held in some:
        rim = len(held.points) == 1 and body.rank[held.owner[0]] == 2
        yield from filter(None, [tilted(body, held, up, now) if rim else tilted_aside(body, held, up, least, now)])


def on_face(body: Hull, on: Face, kind: str, least: float, now: Array | None = None) -> list[Pivot]:
    """About the edges or vertices of a face, that to be taken first."""
    if kind == "vertex":
        some = [held for held in spots(body, on, least) if body.rank[held.owner[0]] != 2]
        rims, near = np.flatnonzero(body.rank == 2), body.rims(body.com)
        for rim in (near, 2.0 * body.centre[rims] - near):
            some += [Held(point[None], 0.0, rims[[k]]) for k, point in enumerate(rim)]
    else:
        pairs = np.stack([on.around, np.roll(on.around, -1)], axis=1)
        some = [_edge(body, on, pair) for pair in pairs if _is_edge(body, on.owner[pair], least)]
    some = [held for held in some if not (body.rank[held.owner] == 2).any() or touches(body, held, on.up)]
    found = [one for one in (tilted(body, held, on.up, now) for held in some) if one is not None]
    return sorted(
        found,
        key=lambda one: (one.balance >= one.range[1], round(one.balance, 6), *np.round(one.points.mean(axis=0), 9)),
    )


def spots(body: Hull, on: Face, least: float) -> list[Held]:
    """The vertices of a face, round ends and points of rims included, that may have a range of `least` [rad]."""
    wide = (body.rank > 0)[on.owner[on.around]] | (body.cones[on.owner[on.around]] >= SLACK * least)
    return [held_at(body, on.points[[i]], on.owner[[i]], on.up) for i in on.around[wide]]


def of_no_face(body: Hull, kind: str, least: float, only: Held | None = None) -> Iterator[tuple[Held, Array]]:
    """Edges or vertices of the hull, each with a normal of a table on which it stands on that alone, CoM lowest first.

    They are of two corners, or of a corner, ball or rim, all of them or `only` one.
    """
    some: list[tuple[Indices, Array]] = []
    mine = np.ones(len(body.rank), dtype=bool) if only is None else np.isin(np.arange(len(body.rank)), only.owner)
    if kind == "edge":
        for f, k in np.argwhere((body.bends >= SLACK * least) & (np.arange(len(body.ups))[:, None] < body.beside)):
            pair = np.delete(body.facets[f], k)
            if pair[0] != pair[1] and not body.rank[pair].any() and mine[pair].all():
                some.append((pair, middle(body, np.array([f, body.beside[f, k]]))))
    else:
        wide = (body.rank == 0) | (body.radius > 0.0)
        for tip in np.flatnonzero(mine & wide & (body.cones >= SLACK * least))[:, None]:
            some.append((tip, middle(body, body.facets_of(tip))))
    found = [(held_at(body, body.lowest(up, which), which, up), up) for which, up in some]
    if kind == "vertex":
        found += _of_rims(body, mine, None if only is None else only.points[0])
    height = [float((body.com - held.points[0]) @ up) for held, up in found]
    yield from (found[k] for k in np.argsort(height, kind="stable"))


def _of_rims(body: Hull, mine: NDArray[np.bool_], point: Array | None) -> Iterator[tuple[Held, Array]]:
    """A point of each rim, or that closest to and that farthest from the CoM, below the rim's centre."""
    near = body.rims(body.com)
    for rim, close in zip(np.flatnonzero(body.rank == 2), near, strict=True):
        for at in (close, 2.0 * body.centre[rim] - close) if point is None else (point,):
            away = body.centre[rim] - at
            if mine[rim]:
                yield Held(at[None], 0.0, np.array([rim])), away / np.linalg.norm(away)


def held_at(body: Hull, points: Array, owner: Indices, up: Array) -> Held:
    """What stays put of `points` (K, 3) on a table of normal `up`: they, or of a ball its centre; and its radius."""
    return Held(points + body.radius[owner, None] * up, float(body.radius[owner].max()), owner)


def _is_edge(body: Hull, ends: Indices, least: float) -> bool:
    """Whether it turns about the line between two, and does not roll on a ball; of a large hull, by `least` [rad]."""
    if ends[0] == ends[1] or body.radius[ends].any():
        return False
    return len(body.centre) <= LARGE or bool(body.rank[ends].any()) or body.fold(*ends) >= SLACK * least


def _edge(body: Hull, on: Face, pair: Indices) -> Held:
    """Two of the points around a face; moved, if they are of rims, to where their line is a tangent."""
    ends, owner = on.points[pair], on.owner[pair]
    up = cross(ends[1] - ends[0], on.points.mean(axis=0) - ends[0])
    for _ in range(50 if body.rank[owner].any() else 1):
        ends = body.lowest(cross(up, ends[1] - ends[0]), owner)
    return Held(ends, 0.0, owner)
