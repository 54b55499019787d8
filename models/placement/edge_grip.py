"""Whether the simulator holds a contact: an edge by contacts along it, and with nothing else touching.

Of a mesh on a plane MuJoCo makes few contacts, by rules that change with its version: 3.12 keeps three that are not
close to the deepest, 4.0 keeps four of that face of the mesh which is turned down most. An edge that it holds at one
end at a time alternates between the two. And as its contacts are soft, corners that are close by touch before the
body's shape has them do so. Therefore it is asked, with the body pressed in as far as the load does.
"""

import copy
from collections.abc import Callable
from enum import Enum

import mujoco
import numpy as np
from pivoting.models.body_contacts import contacts_of
from pivoting.models.contact_softness import read_rows
from pivoting.models.frames import Array, matrix, quaternion
from pivoting.models.placement.convex_hull import body_size
from pivoting.models.placement.given_contacts import NEAR
from pivoting.models.placement.tilt_range import Arc, Pivot, cross
from pivoting.models.rigid_body import RigidBody, initial_data, place

PROBE = 1e-5  # of the body's size, how deep it is to make any contact
LOAD = 0.5  # of the weight, which the smallest wrench leaves to the contact
LEANING = 0.3  # share of the depth by which one end of an edge is deeper and the other less deep
APART = 0.3  # of an edge's length: closer contacts do not hold it
STEP = np.deg2rad(1.0)  # of an arc, or a range, at which it is asked: between two faces MuJoCo changes its rule


class Grip(Enum):
    """How the simulator holds a contact, the best first.

    FIRM: an edge has two contacts, whichever end is deeper. ONE_SIDED: two only while a particular end is the deeper
    one. CROWDED: other corners touch too, because the contact is soft. ALTERNATING: one contact at a time.
    """

    FIRM = "firm"
    ONE_SIDED = "one-sided"
    CROWDED = "crowded"
    ALTERNATING = "alternating"


def grip(model: mujoco.MjModel, body: RigidBody, arc: Arc | None = None) -> Callable[[Pivot], Grip]:
    """What says of a pivot how it is held.

    Args:
        model: of the body; it is not changed.
        body: that moves freely.
        arc: over which they have to; by default over all of a pivot's range.
    """
    model, data, table = copy.copy(model), initial_data(model), matrix(body.table)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE  # it misses contacts of less than 1e-6 m
    turned, origin = data.xmat[body.index].reshape(3, 3).copy(), data.xpos[body.index].copy() - body.origin
    size, load = body_size(model, body.index), LOAD * body.mass * float(np.linalg.norm(body.gravity))

    def touching(pivot: Pivot, theta: float, depth: float, leaning: float = 0.0) -> tuple[Array, Array]:
        """(C,) where along the edge, of its length, contacts are, and (C,) how far from it [m]."""
        first, along = pivot.points[0], pivot.points[-1] - pivot.points[0]
        level = _rotation(pivot.axis, theta) @ pivot.rotation
        away = origin + turned @ first  # where the file has it, as far as the table goes
        at = body.origin + away + table @ level @ (0.5 * along)
        at = at + (pivot.radius[0] - depth - (at - body.origin) @ table[:, 2]) * table[:, 2]
        length = float(np.linalg.norm(along))
        if leaning:
            across = cross(np.array([0.0, 0.0, 1.0]), level @ along / length)
            level = _rotation(across, np.arctan(2.0 * leaning * depth / length)) @ level
        place(model, data, body, quaternion(table @ level), first + 0.5 * along, at)
        mujoco.mj_collision(model, data)
        ours = [one.contact for one in contacts_of(model, data, body.index) if one.other == body.support]
        found = np.array([contact.pos for contact in ours if contact.dist < 0.0]).reshape(-1, 3)
        points = (found - data.xpos[body.index]) @ data.xmat[body.index].reshape(3, 3)
        points = points + pivot.radius[0] * pivot.up(theta) - first
        share = np.clip(points @ along / max(length**2, 1e-300), 0.0, 1.0)
        return share, np.linalg.norm(points - share[:, None] * along, axis=1)

    def held(pivot: Pivot) -> Grip:
        ends = (0.02 * pivot.range[1], 0.98 * pivot.range[1])
        if arc is not None:
            ends = (max(min(arc.theta, arc.theta_end), ends[0]), max(arc.theta, arc.theta_end))
        touching(pivot, ends[1], PROBE * size)
        rows = read_rows(model, body.index, body.support, [data.qpos])
        depth = max(PROBE * size, 0.0 if rows is None else float(rows.depth(load)))
        edge, crowded, one_sided = len(pivot.points) == 2, False, False
        for theta in np.linspace(*ends, 2 + int((ends[1] - ends[0]) / STEP)):
            found = [touching(pivot, theta, depth, leaning) for leaning in ((-LEANING, LEANING) if edge else (0.0,))]
            apart = [share.max(initial=0.0) - share.min(initial=1.0) >= APART for share, _ in found]
            if edge and not any(apart):
                return Grip.ALTERNATING
            one_sided |= edge and not all(apart)
            crowded |= max(off.max(initial=0.0) for _, off in found) > NEAR * size
        return Grip.CROWDED if crowded else Grip.ONE_SIDED if one_sided else Grip.FIRM

    return held


def _rotation(axis: Array, angle: float) -> Array:
    """(3, 3) by an angle [rad] about a unit vector (3,)."""
    out = np.empty(4)
    mujoco.mju_axisAngle2Quat(out, axis, angle)
    return matrix(out)
