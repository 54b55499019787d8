"""Why a contact will not do, in one sentence that says what it allows."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike
from pivoting.models.frames import Array
from pivoting.models.placement.convex_hull import Hull
from pivoting.models.placement.given_contacts import ALLOWED, Shown, as_compiled, written
from pivoting.models.placement.tilt_range import Arc, Held, Pivot, next_touch


def bounds(arc: Arc, most: float) -> tuple[float, float]:
    """What a range from 0 to `most` [rad] leaves to an arc, in degrees, rounded inwards."""
    low, high = np.rad2deg(arc.limits(most))
    return float(np.ceil(1e3 * low - 1e-6) / 1e3 + 0.0), float(np.floor(1e3 * high + 1e-6) / 1e3)


def within(arc: Arc, most: float) -> str:
    """The same in words."""
    low, high = bounds(arc, most)
    return f"[{low:g}, {high:g}] deg" if low < high else f"nothing, as its range ends at {np.rad2deg(most):.3g} deg"


def option(contact: str) -> str:
    """A contact as the command line takes it."""
    return f'--contact "{contact}"' if "," in contact else f"--contact {contact}"


def named(contact: str | ArrayLike, shown: Shown = as_compiled) -> str:
    """A contact at the head of a message."""
    return f"contact = {contact!r}" if isinstance(contact, str) else f"contact = {written(np.asarray(contact), shown)}"


def out_of_range(
    body: Hull,
    contact: str | ArrayLike,
    held: Held,
    up: Callable[[float], Array],
    most: float,
    arc: Arc,
    shown: Shown = as_compiled,
) -> str:
    """That what is held does not allow the arc; what it allows, and what would touch the table.

    Args:
        contact: as it was asked for.
        held: what it would turn about.
        up: the table's normal (3,) at an angle [rad], body frame.
        most: the end of the range, which begins at 0 [rad].
    """
    low, high = arc.limits(most)
    wanted = sorted((arc.theta, arc.theta_end))
    point, which = next_touch(body, held, up(0.0 if wanted[0] < low <= wanted[1] <= high else most))
    kind = "corner" if body.rank[which] == 0 else "point"
    end = f" and theta_end = {np.rad2deg(arc.theta_end):g}" * bool(arc.theta_end != arc.theta)
    asked = f"theta = {np.rad2deg(arc.theta):g}{end} deg"
    about = f"about {written(held.points, shown)} " * isinstance(contact, str)
    touches = f"then the {kind} {written(point, shown)} of geom {body.label[int(body.geom[which])]} touches the table"
    return f"{named(contact, shown)}: {asked}: {about}it can be turned within {within(arc, most)}, {touches}"


def no_contact(body: Hull, contact: str | ArrayLike, shown: Shown = as_compiled) -> str:
    """That the body cannot be tilted about any such contact."""
    tilted = f"body {body.name!r} lies on no face from which it can be tilted so, with nothing else touching"
    rolls = ", and about a line that ends on a round end it would only roll" * bool((body.radius > 0.0).any())
    return f"{named(contact, shown)}: {tilted}{rolls}; must be {ALLOWED}"


def not_held(body: Hull, contact: str | ArrayLike, edge: Pivot, shown: Shown = as_compiled) -> str:
    """That the simulator does not hold an edge."""
    length = float(np.linalg.norm(edge.points[1] - edge.points[0]))
    whose = body.label[int(body.geom[edge.owner[0]])]
    what = (
        f"the edge {written(edge.points, shown)} of geom {whose}, {length:.3g} m long, is held by one contact at a time"
    )
    return f"{named(contact, shown)}: {what}, as MuJoCo makes few contacts of such geoms, and none close to another"
