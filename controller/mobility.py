"""How an object can still move when all of its contacts stay where they are."""

import numpy as np
from pivoting.controller.validate import Array

_COLINEAR = 1e-9  # of the farthest of them from their mean


def free_axes(points: Array, pivot: Array, wrench_map: Array) -> Array:
    """The axes about which the object can still turn: (A, 3) unit vectors, object axes; A is 3, 1 or 0.

    Args:
        points: (K, 3) contacts from the CoM, object axes [m].  pivot: (3,) their mean.
        wrench_map: (nw, 6), see `Space`.
    """
    axes, rank = _spread(points, pivot)
    allowed = [np.eye(3), axes[:1], axes[:0]][rank]
    turning = np.abs(allowed @ wrench_map[:, 3:].T)
    if len(wrench_map) == 3:  # the one axis of the plane, unless a second contact keeps it
        normal = np.abs(wrench_map[:, 3:]).sum(axis=0)
        return normal[None] if rank == 0 or (len(allowed) and turning.max() > 0.5) else np.zeros((0, 3))
    return allowed


def fixed_pairs(points: Array, pivot: Array, wrench_map: Array) -> Array:
    """The turns that the contacts prevent, as (D, 2, 3) pairs (u, e) of object axes: e must not turn towards u.

    Contacts stay where they are if their mean does and if the line on which they lie does not turn; if they are not on
    one line, the object must not turn at all. A condition for every point would be redundant.
    """
    (along, across, normal), rank = _spread(points, pivot)
    pairs = [[], [(across, along), (normal, along)], [(across, along), (normal, along), (normal, across)]][rank]
    kept = np.array(pairs, dtype=float).reshape(-1, 2, 3)
    moves = np.abs(np.cross(kept[:, 0], kept[:, 1]) @ wrench_map[:, 3:].T).max(axis=1, initial=0.0)
    return kept[moves > 1e-9]


def _spread(points: Array, pivot: Array) -> tuple[Array, int]:
    """Principal axes (3, 3) as rows, the widest first, and 0 for one point, 1 for a line, 2 for more."""
    _, spread, axes = np.linalg.svd(points - pivot)
    reach = max(float(np.linalg.norm(points, axis=1).max()), 1e-300)
    return axes, min(2, int(np.count_nonzero(spread > _COLINEAR * reach)))
