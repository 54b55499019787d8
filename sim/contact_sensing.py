"""What MuJoCo's contacts say of an object: the force at each declared contact, and whatever else it touches.

A contact is declared if it is at one of the points that are to stick, or anywhere along the edge between two of them.
MuJoCo may put its contact points along an edge anywhere, so that a force on an edge is counted at its two ends by the
law of the lever, which keeps the net force and its moment: what statics determines of the two forces.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.kernels.compilation import kernel, subroutine
from pivoting.controller.rotations import cross, turned
from pivoting.sim.judging.predicted_slip import TINY, add_row, begin_rows, end_rows

Array = NDArray[np.float64]
NOTHING = 1e-9  # of the forces at work: less is what rounding leaves of them
FIELDS = 14  # of each listed contact: found, force (3), distance, position (3), normal (3), tangent (3)


class ContactReadings(NamedTuple):
    """Of N steps and W worlds; world axes.

    Attributes:
        force: (N, W, K, 3) on the object at each declared contact [N].
        found: (N, W) contacts between the object and its support, of whatever kind.
        stray: (N, W) force of contacts that are not declared, with the support or anything else [N].
        strays: (N, W) how many there are.
        depth: (N, W) how deep the deepest contact with the support is [m].
    """

    force: Array
    found: Array
    stray: Array
    strays: Array
    depth: Array


class Declared(NamedTuple):
    """The contacts that are declared to stick, on an object that moves.

    Attributes:
        points: (K, 3) from the CoM, object axes; of what rolls, which is one, the centre [m].
        up: (K, 3) from where they touch to these points, world axes [m].
        across: (m, 3) the directions along the table in which it counts how far from them a contact is, world axes.
        near: how far a contact of theirs may be [m].
        landing: whether the object is to land, so that other contacts with the support are no strays.
    """

    points: Array
    up: Array
    across: Array
    near: float
    landing: bool

    def touch(self, position: Array, quaternion: Array) -> Array:
        """(K, 3) where they touch, world axes [m], of an object whose CoM is at position (3,), turned by (4,)."""
        at = np.empty(self.points.shape)
        fill_touching(self.points, self.up, (*position, *quaternion), at)
        return at

    def share(self, point: Array, at: Array) -> tuple[Array, float]:
        """(K,) share of a force at a point (3,) that each contact carries; distance of the point from them [m].

        Args:
            at: (K, 3) where the contacts touch, world axes [m].
        """
        out = np.empty(len(at))
        return out, float(fill_share(self.across, at, *point, out))


@subroutine
def fill_touching(points, up, pose, at):  # type: ignore[no-untyped-def]
    """Write where the declared contacts touch, (K, 3) in world axes [m]; see `Declared.touch`."""
    for k in range(points.shape[0]):
        x, y, z = turned(pose[3], pose[4], pose[5], pose[6], points[k, 0], points[k, 1], points[k, 2])
        at[k, 0] = pose[0] + x - up[k, 0]
        at[k, 1] = pose[1] + y - up[k, 1]
        at[k, 2] = pose[2] + z - up[k, 2]


@subroutine
def fill_share(across, at, a, b, c, share):  # type: ignore[no-untyped-def]
    """Write the share (K,) that each contact carries of a force at (a, b, c); returns how far that is from them [m]."""
    K, nearest, least = at.shape[0], 0, np.inf
    if K == 2:
        along = length = 0.0
        x, y, z = at[1, 0] - at[0, 0], at[1, 1] - at[0, 1], at[1, 2] - at[0, 2]
        for row in range(across.shape[0]):
            edge = across[row, 0] * x + across[row, 1] * y + across[row, 2] * z
            away = _along(across, row, a, b, c, at, 0)
            along, length = along + edge * away, length + edge * edge
        s = min(max(along / max(length, TINY), 0.0), 1.0)
        share[0], share[1] = 1.0 - s, s
        a, b, c = a - s * x, b - s * y, c - s * z
    for k in range(1 if K == 2 else K):
        square = 0.0
        for row in range(across.shape[0]):
            away = _along(across, row, a, b, c, at, k)
            square += away * away
        if square < least:
            nearest, least = k, square
    if K != 2:
        for k in range(K):
            share[k] = 1.0 if k == nearest else 0.0
    return np.sqrt(least)


@subroutine
def _along(across, row, a, b, c, at, k):  # type: ignore[no-untyped-def]
    """How far (a, b, c) is from a contact in one direction."""
    return across[row, 0] * (a - at[k, 0]) + across[row, 1] * (b - at[k, 1]) + across[row, 2] * (c - at[k, 2])


@kernel
def sort_contacts(sensed, contacts, touching, pose, declared, rows, at, share, sums, readings, held):  # type: ignore[no-untyped-def]
    """Sort the contacts of N steps of W worlds.

    Args:
        sensed: (N, W, sensors) at the end of each step, of the contacts that it made.
        contacts, touching: first and last of their places in it; see `models.sensors.instrument`.
        pose: (N, W, 7 or more) CoM and quaternion at the start of each step.
        declared: the values of `Declared`.
        rows: those of `predicted_slip.RowNumbers`, None if nothing is known of them.
        at: (K, 3) and share: (K,), scratch; sums: of `predicted_slip.Sums`, scratch.
        readings, held: of `ContactReadings` and `RowEffects`, which are written.
    """
    points, up, across, near, landing = declared
    force, found, stray, strays, depth = readings
    K, net = points.shape[0], touching[0]
    for n in range(sensed.shape[0]):
        for w in range(sensed.shape[1]):
            values = sensed[n, w]
            fill_touching(points, up, pose[n, w], at)
            for k in range(K):
                force[n, w, k, 0] = force[n, w, k, 1] = force[n, w, k, 2] = 0.0
            if rows is not None:
                begin_rows(sums)
                for k in range(K):
                    held[2][n, w, k] = False
            x = y = z = deepest = strange = strangers = listed = 0.0
            for first in range(contacts[0], contacts[1], FIELDS):
                if not values[first] > 0.0:  # slots in use come first
                    break
                listed += 1.0
                push, pull, side, apart = values[first + 1], values[first + 2], values[first + 3], values[first + 4]
                where = values[first + 5], values[first + 6], values[first + 7]
                normal = values[first + 8], values[first + 9], values[first + 10]
                tangent = values[first + 11], values[first + 12], values[first + 13]
                other = cross(*normal, *tangent)
                a = push * normal[0] + pull * tangent[0] + side * other[0]
                b = push * normal[1] + pull * tangent[1] + side * other[1]
                c = push * normal[2] + pull * tangent[2] + side * other[2]
                x, y, z = x + a, y + b, z + c
                if -apart > deepest or apart != apart:  # one that is not a number stays
                    deepest = -apart
                if fill_share(across, at, where[0], where[1], where[2], share) <= near:
                    for k in range(K):
                        force[n, w, k, 0] += share[k] * a
                        force[n, w, k, 1] += share[k] * b
                        force[n, w, k, 2] += share[k] * c
                    if rows is not None and push > 0.0:
                        pulls = pull, side
                        if add_row(rows, w, push, pulls, -apart, where, tangent, other, at, share, sums):
                            for k in range(K):
                                held[2][n, w, k] |= share[k] > 0.0
                elif not landing:
                    size = np.sqrt(a * a + b * b + c * c)
                    strange += size
                    strangers += 1.0 if size > 0.0 else 0.0
            of_support = values[contacts[0]]
            beyond = values[net] - listed  # with other geoms than the support, or more than there are slots
            if beyond > 0.0:
                p, q, r = values[net + 1], values[net + 2], values[net + 3]
                rest = np.sqrt((p - x) ** 2 + (q - y) ** 2 + (r - z) ** 2)
                most = np.sqrt(x * x + y * y + z * z) + np.sqrt(p * p + q * q + r * r)
                if rest > NOTHING * most:  # a contact within a gap makes no force
                    strange, strangers = strange + rest, strangers + beyond
            found[n, w], stray[n, w], strays[n, w], depth[n, w] = of_support, strange, strangers, deepest
            if rows is not None:
                end_rows(sums, held[0][n, w], held[1][n, w])
