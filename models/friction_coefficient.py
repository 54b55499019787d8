"""The friction of a contact as MuJoCo combines it: by pair, by priority, or the larger of both geoms, or overridden."""

from collections.abc import Iterable

import mujoco
import numpy as np
from numpy.typing import ArrayLike
from pivoting.models.errors import ModelError
from pivoting.models.mujoco_constants import LEAST_FRICTION
from pivoting.models.names import label
from pivoting.models.placement.convex_hull import body_size, ellipsoids
from pivoting.models.support_surfaces import can_collide

EDGE = 65  # points along an edge at which rims and round ends are looked for
NEAR = 1e-3  # of the body's size: a geom whose surface is closer to a contact point carries it


def contact_friction(model: mujoco.MjModel, one: int, other: int) -> tuple[int, tuple[float, float]]:
    """condim and the sliding friction along both tangents of a contact between two geoms, as MuJoCo combines them."""
    tangents: tuple[float, float]
    ends = zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True)
    pair = next((i for i, (a, b) in enumerate(ends) if {a, b} == {one, other}), None)
    order = int(model.geom_priority[one]) - int(model.geom_priority[other])
    if pair is not None:
        condim, (first, second) = int(model.pair_dim[pair]), model.pair_friction[pair, :2]
        tangents = float(first), float(second)
    elif order == 0:
        condim = max(int(model.geom_condim[one]), int(model.geom_condim[other]))
        tangents = (float(max(model.geom_friction[one, 0], model.geom_friction[other, 0])),) * 2
    else:
        first = one if order > 0 else other
        condim, tangents = int(model.geom_condim[first]), (float(model.geom_friction[first, 0]),) * 2
    if model.opt.enableflags & int(mujoco.mjtEnableBit.mjENBL_OVERRIDE):
        tangents = float(model.opt.o_friction[0]), float(model.opt.o_friction[1])
    return condim, (max(tangents[0], LEAST_FRICTION), max(tangents[1], LEAST_FRICTION))


def read_friction(model: mujoco.MjModel, body: int, support: int, points: ArrayLike | None = None) -> float:
    """Sliding friction between a body and its support: the least of both tangents and of all geoms that touch there.

    Args:
        body: id.  support: id of the geom that it stands on.
        points: (K, 3) of the contacts, body frame [m]: only geoms that are there count. None, or points that no geom is
            near: all geoms of the body, which then have to agree.

    Raises:
        ModelError: they never touch, or without friction; or the geoms differ in it, and mu is to be given.
    """
    first = int(model.body_geomadr[body])
    own = range(first, first + int(model.body_geomnum[body]))
    meeting = [geom for geom in own if can_collide(model, geom, support)]
    if not meeting:
        raise ModelError(
            f"support = {label(model, support)}: it and the body never touch (contype, conaffinity or exclude)"
        )
    there = [] if points is None else _near(model, meeting, np.atleast_2d(np.asarray(points, dtype=float)))
    found = {geom: contact_friction(model, geom, support) for geom in there or meeting}
    for geom, (condim, tangents) in found.items():
        if condim == 1 or max(tangents) <= LEAST_FRICTION:
            why = "condim 1" if condim == 1 else "friction 0"
            touches = f"{label(model, geom)} touches {label(model, support)} without friction ({why})"
            raise ModelError(f"{touches}, and nothing sticks; give both geoms condim 3 and friction")
    least = {min(tangents) for _, tangents in found.values()}
    if not there and len(least) > 1:
        raise ModelError(f"mu = None: the body's geoms give {sorted(least)}; give mu")
    return min(least)


def _near(model: mujoco.MjModel, geoms: Iterable[int], points: np.ndarray) -> list[int]:
    """Those of the geoms that come to one of the points (K, 3), or to the edge between two of them."""
    owner, centre, axes = ellipsoids(model, list(geoms))
    half = np.linalg.norm(axes, axis=1)
    reach = NEAR * body_size(model, int(model.geom_bodyid[owner[0]]))
    along = np.linspace(0.0, 1.0, EDGE if len(points) == 2 else 1)[:, None]
    spots = points[0] + along * (points[-1] - points[0]) if len(points) <= 2 else points
    direction = points[-1] - points[0]
    share = np.clip((centre - points[0]) @ direction / max(float(direction @ direction), 1e-300), 0.0, 1.0)
    there = np.linalg.norm(centre - points[0] - share[:, None] * direction, axis=1) <= reach
    if len(points) > 2:
        there = (np.linalg.norm(centre[:, None] - points, axis=2) <= reach).any(axis=1)
    for i in np.flatnonzero(half.any(axis=1)):
        used = half[i] > 0.0
        unit = axes[i][:, used] / half[i][used]
        off = (spots - centre[i]) @ unit
        away = np.linalg.norm(spots - centre[i] - off @ unit.T, axis=1)
        rim = np.abs(np.linalg.norm(off / half[i][used], axis=1) - 1.0) * float(half[i][used].min())
        there[i] |= bool((np.hypot(away, rim) <= reach).any())
    return sorted({int(geom) for geom in owner[there]})
