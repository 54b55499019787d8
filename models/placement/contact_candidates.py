"""Where a body may be pivoted: the corners, edges and rims of it that stay put on the table while it tilts, or roll.

`convex_hull` knows what of a body touches a table, `resting_faces` what it lies on, `tilt_range` how far it can be
tilted about what; here is the order in which that is looked for.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import chain, islice

import mujoco
import numpy as np
from numpy.typing import ArrayLike
from pivoting.models.errors import ModelError
from pivoting.models.frames import Array, matrix
from pivoting.models.placement.contact_search import held_at, search, widest
from pivoting.models.placement.convex_hull import TOLERANCE, Hull, read_hull
from pivoting.models.placement.edge_grip import Grip
from pivoting.models.placement.given_contacts import Shown, as_compiled, held_by_hand, written
from pivoting.models.placement.refusals import named, no_contact, not_held, option, out_of_range, within
from pivoting.models.placement.tilt_range import Arc, Pivot, interval

TRIES = 400  # contacts among which a nearest one is looked for, or one beside which no other corner touches
Gripped = Callable[[Pivot], Grip]  # how the simulator holds it
Misfit = Callable[[Pivot], str]  # why it cannot be had where the body stands, or nothing


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


def find_pivot(
    model: mujoco.MjModel,
    body_index: int,
    contact: str | ArrayLike,
    xquat: ArrayLike | None = None,
    table: ArrayLike = (1.0, 0.0, 0.0, 0.0),
    *,
    arc: Arc | None = None,
    height: float = 0.0,
    gripped: Gripped | None = None,
    misfit: Misfit = lambda one: "",
    shown: Shown = as_compiled,
) -> Pivot:
    """How to pivot a body about a contact.

    "vertex" and "edge" are the first that allow the arc: of the face on which it lies in the orientation that it has,
    then of that on which it rests with its CoM lowest, then of the others. "lowest" is what touches the table in that
    orientation; of a face, an edge, or else a vertex.
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
        height: of the body's origin above the table in that orientation [m]; see `resting_faces.standing`.
        gripped: how the simulator holds a contact, see `edge_grip`, which prefers what is held firmly, and refuses
            edges that are not; by default everything is.
        misfit: why a contact cannot be had where the body stands, which is then passed over; by default all can.
        shown: points as the reader of a message has them, by default in the compiled body frame.

    Raises:
        ModelError: the body has no such contact, or cannot be tilted so about it alone; with one that would do.
    """
    body, now = read_hull(model, body_index), None
    if xquat is not None or (isinstance(contact, str) and contact == "lowest"):
        now = matrix(np.asarray(table)).T @ matrix(np.asarray(model.body_quat[body_index] if xquat is None else xquat))
    one = alternating = None
    reason = told = ""
    try:
        one, alternating, told = _chosen(search(body, contact, arc, now, shown, height), gripped, misfit)
    except ModelError as error:
        if not isinstance(contact, str) or contact != "lowest":
            raise
        reason = str(error)
    if one is not None:
        return replace(one, face=_down(body, one))
    if not reason and alternating is not None and not told:
        reason = not_held(body, contact, alternating, shown)
    reason = reason or told or _out_of_reach(body, contact, arc, now, shown, height)
    raise ModelError(reason + _way_out(body, contact, arc, now, gripped, misfit, shown))


def _out_of_reach(
    body: Hull, contact: str | ArrayLike, arc: Arc | None, now: Array | None, shown: Shown, height: float
) -> str:
    """Why no contact allows the arc: there is none, or it is tilted too far."""
    met = search(body, contact, None, now, shown, height)
    some = islice(met, 1) if isinstance(contact, str) else met  # of a given contact all faces
    first = max(some, key=lambda one: one.range[1], default=None)
    if first is not None and arc is not None:
        return out_of_range(body, contact, first.held, first.up, first.range[1], arc, shown)
    return no_contact(body, contact, shown)


def find_planar_pivot(
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
        arc, shown: as for `find_pivot`.

    Raises:
        ModelError: the point is none of these, what is lowest rolls and is no ball, or the arc is not allowed.
    """
    right, normal, up = np.asarray(axes, dtype=float).T
    flat, solid = np.eye(3) - np.outer(normal, normal), read_hull(model, body_index)
    body = replace(solid, centre=solid.centre @ flat, axes=flat @ solid.axes, com=solid.com @ flat)
    if isinstance(contact, str):
        points, owner = body.touching(up)
        left = [int((points @ right).argmin())]
        held = held_at(body, points[left], owner[left], up)
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


def _chosen(found: Iterable[Pivot], gripped: Gripped | None, misfit: Misfit) -> tuple[Pivot | None, Pivot | None, str]:
    """The pivot that is held best, the first of equals; the first that alternates; why the first does not fit."""
    first: dict[Grip, Pivot] = {}
    told = ""
    for tried, one in enumerate(found):
        if wrong := misfit(one):
            told = told or wrong
            if tried >= TRIES:
                break
            continue
        how = Grip.FIRM if gripped is None else gripped(one)
        first.setdefault(how, one)
        if how is Grip.FIRM or (tried >= TRIES and first.keys() - {Grip.ALTERNATING}):
            break
    alternating = first.pop(Grip.ALTERNATING, None)
    return next((first[how] for how in Grip if how in first), None), alternating, told


def _down(body: Hull, one: Pivot) -> Array:
    """(P, 3) what touches at theta = 0."""
    up = one.rotation[2]
    try:
        return body.support(up)[0]
    except ModelError:  # it rolls on some of it
        least = body.least(up)
        return body.lowest(up, np.flatnonzero(least <= least.min() + body.reach))


def _way_out(
    body: Hull,
    contact: str | ArrayLike,
    arc: Arc | None,
    now: Array | None,
    gripped: Gripped | None,
    misfit: Misfit,
    shown: Shown,
) -> str:
    """The nearest contact that would do, or else the one with the widest range, as the end of a message."""
    asked = arc or Arc(0.0, 0.0)
    kinds = [kind for kind in ("edge", "vertex") if not (isinstance(contact, str) and contact == kind)]
    some: Iterable[Pivot] = chain(*(search(body, kind, arc, now) for kind in kinds))
    if not isinstance(contact, str):
        at = np.atleast_2d(np.asarray(contact, dtype=float)).mean(axis=0)
        some = sorted(islice(some, TRIES), key=lambda one: float(np.linalg.norm(one.points.mean(axis=0) - at)))
    one = _chosen(some, gripped, misfit)[0]
    if one is not None:
        value = (
            written(one.points, shown) if not isinstance(contact, str) else "vertex" if len(one.points) == 1 else "edge"
        )
        return f"; nearest: {option(value)}, within {within(asked, one.range[1])}"
    one = _chosen(sorted(widest(body), key=lambda one: -one.range[1]), gripped, misfit)[0]
    if one is not None:
        value = option(written(one.points, shown))
        return f"; nothing of it allows that; widest: {value}, within {within(asked, one.range[1])}"
    return ""
