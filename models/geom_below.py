"""What is under a body: the geom that it would meet first if it fell, found in columns along gravity by rays."""

import copy
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from pivoting.models.errors import ModelError
from pivoting.models.placement.convex_hull import ellipsoids, samples

Array = NDArray[np.float64]
MOST, GRID = 256, 15  # corners of a kind that are looked at; columns along each side of the body
SAME = 1e-6  # of the body's height: what it would meet as soon as this is met at once
PLANE, GROUP = int(mujoco.mjtGeom.mjGEOM_PLANE), np.array([1, 0, 0, 0, 0, 0], dtype=np.uint8)
AROUND = samples(12)


def first_met(
    model: mujoco.MjModel, data: mujoco.MjData, body: int, own: list[int], others: list[int], up: Array
) -> int | None:
    """Id of that of the geoms `others` on which a body with the geoms `own` would fall; None if there is none.

    Where it would meet several at once, that which is closest to being under its CoM. One that is inside the body up to
    half of its height there counts; what touches it from above does not. Columns are those of the body's corners, of a
    grid, and of the others' corners.

    Args:
        data: with the kinematics computed.  up: (3,) against gravity, world axes.
    """
    across = np.linalg.svd(up[None])[2][1:]
    mine, ground = _Rays(model, data, own, up), _Rays(model, data, others, up)
    points, corners = _outer(model, data, own)[1], _outer(model, data, others)
    flat, middle = points @ across.T, across @ data.xipos[body]
    low, high = flat.min(axis=0), flat.max(axis=0)
    ends = float((points @ up).min()), float((points @ up).max())
    reach = 2.0 * (ends[1] - ends[0] + float(np.linalg.norm(high - low)))

    def falls() -> Iterator[tuple[float, float, int]]:
        """Of each column the way that it is to fall, how far it is from the CoM, and on what."""
        columns = [(foot, float(point @ up)) for foot, point in zip(flat, points, strict=True)]
        sides = np.meshgrid(*(np.linspace(a, b, GRID) for a, b in zip(low, high, strict=True)))
        columns += [(foot, np.nan) for foot in np.stack(sides, axis=-1).reshape(-1, 2)]
        for foot, height in _some(columns):
            under, over = span(foot @ across, height)
            begin = 0.5 * (under + over)
            far, geom = ground.cast(foot @ across + begin * up, -up) if np.isfinite(under) else (0.0, -1)
            if geom >= 0:
                yield under - begin + far, float(np.linalg.norm(foot - middle)), geom
        feet = corners[1] @ across.T
        for i in _some(np.flatnonzero(((feet >= low) & (feet <= high)).all(axis=1)).tolist()):
            under, over = span(feet[i] @ across, np.nan)
            if np.isfinite(under) and corners[1][i] @ up <= 0.5 * (under + over):
                away = float(np.linalg.norm(feet[i] - middle))
                yield under - float(corners[1][i] @ up), away, int(corners[0][i])

    def span(foot: Array, height: float) -> tuple[float, float]:
        """Where the body begins and ends in a column; inf where it is not in it."""
        below, above = ends[0] - reach, ends[1] + reach
        rise, hit = mine.cast(foot + below * up, up)
        if hit < 0:
            return (np.inf, ends[1]) if np.isnan(height) else (height, height)
        sink = mine.cast(foot + above * up, -up)[0]
        return float(np.fmin(height, below + rise)), float(np.fmax(height, above - sink))

    found = list(falls())
    if not found:
        return None
    least = min(found)[0] + SAME * (ends[1] - ends[0])
    return min((away, geom) for drop, away, geom in found if drop <= least)[1]


class _Rays:
    """Rays that meet some geoms alone; planes have no end there, as they have none for contacts."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, geoms: list[int], up: Array):
        probe = copy.copy(model)
        probe.geom_group[:] = 1
        probe.geom_group[geoms] = 0
        probe.geom_size[probe.geom_type == PLANE, :2] = 0.0
        probe.geom_matid[:] = -1  # rays pass through what is drawn transparent
        probe.geom_rgba[:, 3] = 1.0
        self._probe, self._data = probe, data

    def cast(self, start: Array, along: Array) -> tuple[float, int]:
        """How far it is to the first of them, and which it is; -1 if there is none."""
        hit = np.full(1, -1, dtype=np.int32)
        far = mujoco.mj_ray(self._probe, self._data, start, along, GROUP, 1, -1, hit)
        return float(far), int(hit[0])


def _outer(model: mujoco.MjModel, data: mujoco.MjData, geoms: list[int]) -> tuple[NDArray[np.int64], Array]:
    """Of which geom each is (N,), and the corners (N, 3) of geoms, or points around them, world axes [m]."""
    whose, points = [np.zeros(0, dtype=np.int64)], [np.zeros((0, 3))]
    for geom in geoms:
        try:
            _, centre, axes = ellipsoids(model, [geom])
        except ModelError:  # of a plane, or a height field
            continue
        rank = np.count_nonzero(np.linalg.norm(axes, axis=1), axis=1).tolist()
        local = np.concatenate([c + AROUND[k] @ A.T for c, A, k in zip(centre, axes, rank, strict=True)])
        body = int(model.geom_bodyid[geom])
        points.append(data.xpos[body] + local @ data.xmat[body].reshape(3, 3).T)
        whose.append(np.full(len(local), geom))
    return np.concatenate(whose), np.concatenate(points)


def _some(values: list[Any]) -> list[Any]:
    """At most `MOST` of them, evenly."""
    return [values[i] for i in np.unique(np.linspace(0, len(values) - 1, min(len(values), MOST)).astype(int))]
