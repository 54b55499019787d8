"""All that a body may be pivoted about, for a user to pick from."""

from collections.abc import Iterable
from typing import NamedTuple

import mujoco
import numpy as np
from pivoting.models.frames import matrix
from pivoting.models.placement.contact_candidates import find_planar_pivot
from pivoting.models.placement.contact_search import about, aside, of_no_face, on_face, spots
from pivoting.models.placement.convex_hull import Hull, read_hull
from pivoting.models.placement.edge_grip import Grip, grip
from pivoting.models.placement.given_contacts import Shown, as_compiled, written
from pivoting.models.placement.resting_faces import faces, promising, standing
from pivoting.models.placement.tilt_range import LEAST, Pivot
from pivoting.models.rigid_body import RigidBody, initial_data


class Candidate(NamedTuple):
    """A contact that a body may be pivoted about.

    Attributes:
        kind: "vertex", "rim", "round end" or "edge".
        contact: as `--contact` takes it; an arc as long as `most` is accepted.
        face: number of the face that the body lies on at theta = 0, from 1 in the order of the search, or None.
        most: theta_max, where something else touches [rad].
        balance: theta at which the CoM is above the contact, or highest [rad].
        radius: of a round end, else 0 [m].
    """

    kind: str
    contact: str
    face: int | None
    most: float
    balance: float
    radius: float


def contacts(
    model: mujoco.MjModel, body: RigidBody, least: float = LEAST, shown: Shown = as_compiled
) -> list[Candidate]:
    """The contacts of a body with a range of at least `least` [rad], face by face as they are looked for.

    A contact is listed again if on a later face its range is longer. Edges that the simulator does not hold are none.

    Args:
        model: of the body.
        body: as it was read of that.
        shown: points of the compiled body frame as the user has them.

    Raises:
        ModelError: the body's shape cannot be served.
    """
    if body.dim == 2:
        return [one for one in [_planar(model, body, shown)] if one.most >= least]
    hull, gripped = read_hull(model, body.index), grip(model, body)
    data, up = initial_data(model), matrix(body.table)[:, 2]
    height = float(up @ (data.xpos[body.index] - body.origin))
    stands = standing(hull, up @ data.xmat[body.index].reshape(3, 3), height)
    met = list(faces(hull, promising(hull, "vertex", least) | promising(hull, "edge", least), stands))
    longest: dict[str, float] = {}
    found: list[Candidate] = []

    def listed(some: Iterable[Pivot], face: int | None) -> None:
        for one in some:
            contact, most = written(one.points, shown), one.range[1]
            if most < max(least, longest.get(contact, 0.0) + LEAST):
                continue
            longest[contact] = most
            if len(one.points) == 1 or gripped(one) is not Grip.ALTERNATING:
                found.append(Candidate(_kind(hull, one), contact, face, most, one.balance, float(one.radius[0])))

    for number, on in enumerate(met, start=1):
        for kind in ("edge", "vertex"):
            listed(on_face(hull, on, kind, least), number)
    for number, on in enumerate(met, start=1):  # about other axes, if about that towards the CoM it is no candidate
        new = (held for held in spots(hull, on, least) if written(held.points, shown) not in longest)
        listed(aside(hull, new, on.up, least), number)
    for kind in ("edge", "vertex"):
        for held, up in of_no_face(hull, kind, least):
            if written(held.points, shown) not in longest:
                listed(about(hull, held, up, least), None)
    return found


def _planar(model: mujoco.MjModel, body: RigidBody, shown: Shown) -> Candidate:
    """The one contact of a body that moves in a plane."""
    axes = matrix(body.axes)
    point, radius, most = find_planar_pivot(model, body.index, "lowest", axes)
    lever = (body.com - point) @ axes
    kind = "round end" if radius > 0.0 else "vertex"
    return Candidate(kind, written(point, shown), 1, most, float(np.arctan2(lever[0], lever[2])), radius)


def _kind(hull: Hull, one: Pivot) -> str:
    """What a contact is called."""
    if len(one.points) == 2:
        return "edge"
    return "round end" if one.radius[0] > 0.0 else "rim" if hull.rank[one.owner[0]] == 2 else "vertex"
