"""What MuJoCo's contacts say of an object: the force at each declared contact, and whatever else it touches.

A contact is declared if it is at one of the points that are to stick, or anywhere along the edge between two of them.
MuJoCo may put its contact points along an edge anywhere, so that a force on an edge is counted at its two ends by the
law of the lever, which keeps the net force and its moment: what statics determines of the two forces.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.so3 import rotated

Array = NDArray[np.float64]
NOTHING = 1e-9  # of the forces at work: less is what rounding leaves of them
FIELDS = 14  # of each listed contact: found, force (3), distance, position (3), normal (3), tangent (3)


class ContactReadings(NamedTuple):
    """Of N steps and W worlds; world axes.

    Attributes:
        force: (N, W, K, 3) on the object at each declared contact [N].
        points: (N, W, K) MuJoCo's contacts that are at it, one along an edge at both of its ends.
        found: (N, W) contacts between the object and its support, of whatever kind.
        stray: (N, W) force of contacts that are not declared, with the support or anything else [N].
        strays: (N, W) how many there are.
        depth: (N, W) how deep the deepest contact with the support is [m].
    """

    force: Array
    points: Array
    found: Array
    stray: Array
    strays: Array
    depth: Array


class Listed(NamedTuple):
    """What MuJoCo lists of the S contacts with the support; world axes, leading axes of steps and worlds.

    Attributes:
        there: (..., S) whether there is one.
        share: (..., S, K) of a force on it that each declared contact carries; 0 of one that is not declared.
        local: (..., S, 3) force on the object along its normal and both tangents [N].
        normal, tangent, other: (..., S, 3) its normal and both tangents.
        position: (..., S, 3) [m].  depth: (..., S) [m].
    """

    there: NDArray[np.bool_]
    share: Array
    local: Array
    normal: Array
    tangent: Array
    other: Array
    position: Array
    depth: Array


@dataclass(frozen=True, eq=False)
class Declared:
    """The contacts that are declared to stick, on an object that moves.

    Attributes:
        points: (K, 3) from the CoM, object axes; of what rolls, which is one, the centre [m].
        up: (K, 3) from where they touch to these points, world axes [m].
        across: (3, m) the directions along the table in which it counts how far from them a contact is, as columns.
        near: how far a contact of theirs may be [m].
        landing: whether the object is to land, so that other contacts with the support are no strays.
    """

    points: Array
    up: Array
    across: Array
    near: float
    landing: bool

    def touch(self, position: Array, quaternion: Array) -> Array:
        """(..., K, 3) where they touch, world axes [m], of an object at poses (..., 3) and (..., 4)."""
        turned: Array = rotated(quaternion[..., None, :], self.points)
        return position[..., None, :] + turned - self.up

    def shares(self, points: Array, at: Array) -> tuple[Array, Array]:
        """(..., S, K) share that each contact carries of a force at each of S points; (..., S) distance from them [m].

        Args:
            points: (..., S, 3).  at: (..., K, 3) where the contacts touch; both in world axes [m].
        """
        flat, ends = points @ self.across, at @ self.across
        if at.shape[-2] == 2:
            first, along = ends[..., None, 0, :], ends[..., None, 1, :] - ends[..., None, 0, :]
            s = ((flat - first) * along).sum(axis=-1) / np.maximum((along**2).sum(axis=-1), 1e-300)
            s = np.clip(s, 0.0, 1.0)
            return np.stack([1.0 - s, s], axis=-1), np.linalg.norm(flat - first - s[..., None] * along, axis=-1)
        away = np.linalg.norm(flat[..., :, None, :] - ends[..., None, :, :], axis=-1)
        return np.eye(at.shape[-2])[away.argmin(axis=-1)], away.min(axis=-1)


def list_contacts(sensed: Array, at: Array, declared: Declared) -> Listed:
    """The contacts of the object with its support.

    Args:
        sensed: (N, W, S 14).
        at: (N, W, K, 3) where the declared contacts are [world axes, m].
    """
    slots = sensed.reshape(*sensed.shape[:2], -1, FIELDS)
    most = int(sensed[..., 0].max(initial=1.0))  # each slot in use says how many there are; the first ones are used
    contacts = np.ascontiguousarray(slots[:, :, :most])
    there = contacts[..., 0] > 0.0
    normal, tangent = contacts[..., 8:11], contacts[..., 11:14]
    share, away = declared.shares(contacts[..., 5:8], at)
    return Listed(
        there=there,
        share=np.where((there & (away <= declared.near))[..., None], share, 0.0),
        local=contacts[..., 1:4],
        normal=normal,
        tangent=tangent,
        other=np.cross(normal, tangent),
        position=contacts[..., 5:8],
        depth=-contacts[..., 4],
    )


def read_contacts(listed: Listed, found: Array, touching: Array, declared: Declared) -> ContactReadings:
    """Sort the contacts of the object.

    Args:
        listed: those with the support.  found: (N, W) how many there are.
        touching: (N, W, 4) number and net force of all contacts.
    """
    there, share, local, normal, tangent, other = listed[:6]
    force = local[..., :1] * normal + local[..., 1:2] * tangent + local[..., 2:3] * other
    others = there & ~share.any(axis=-1)
    unlisted = found - there.sum(axis=-1)  # more contacts than slots
    elsewhere = touching[..., 0] - found  # with other geoms than the support
    stray, strays = np.zeros(found.shape), np.zeros(found.shape)
    if (beyond := elsewhere + unlisted > 0.0).any():
        listed_force = np.where(there[..., None], force, 0.0).sum(axis=-2)
        rest = np.linalg.norm(touching[..., 1:4] - listed_force, axis=-1)
        most = np.linalg.norm(listed_force, axis=-1) + np.linalg.norm(touching[..., 1:4], axis=-1)
        pushes = rest > NOTHING * most  # a contact within a gap makes no force
        stray = np.where(beyond & pushes, rest, 0.0)
        strays = np.where(pushes, elsewhere + unlisted, 0.0)
    if not declared.landing and others.any():
        size = np.linalg.norm(force, axis=-1)
        stray = stray + np.where(others, size, 0.0).sum(axis=-1)
        strays = strays + (others & (size > 0.0)).sum(axis=-1)
    return ContactReadings(
        force=np.einsum("nwsk,nwsi->nwki", share, force),
        points=(share > 0.0).sum(axis=2).astype(float),
        found=found,
        stray=stray,
        strays=strays.astype(float),
        depth=np.where(there, listed.depth, 0.0).max(axis=-1, initial=0.0),
    )
