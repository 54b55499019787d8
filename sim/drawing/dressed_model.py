"""A run's model as it is drawn: in the colours of recordings, without what moves otherwise or is in the way."""

import copy

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray
from pivoting.models.placement.convex_hull import colliding
from pivoting.sim.drawing.colours import BLOCK, GLASS, TABLE
from pivoting.sim.drawing.drawn_world import DrawnWorld

Array = NDArray[np.float64]
SHOWN = 3  # groups of geoms that MuJoCo shows
RAYS = 1_000  # at most, from the camera to what is to be seen


def dressed(film: DrawnWorld, size: float, width: int, height: int) -> mujoco.MjModel:
    """A copy of the model, for pictures of `width` x `height` pixels of something of this size [m].

    Of the object those geoms are seen that MuJoCo shows, or, if it shows none of them, those that collide. What else
    can move is hidden, as a run does not hold where it is, and so is a table without end, of which a slab is drawn.
    """
    model = copy.copy(film.model)
    body, surface = film.run.truth.index, film.run.truth.surface
    own = np.flatnonzero(model.geom_bodyid == body)
    shown = own[(model.geom_group[own] < SHOWN) & (_opacity(model, own) > 0.0)]
    _hide(model, np.flatnonzero(model.body_weldid[model.geom_bodyid] != 0))
    _paint(model, shown if shown.size else colliding(model, body), (*BLOCK, 255 if film.dim == 2 else GLASS))
    _paint(model, [surface.geom], (*TABLE, 255))
    if np.isinf(surface.thick):
        _hide(model, [surface.geom])
    model.vis.global_.offwidth, model.vis.global_.offheight = width, height
    model.stat.extent = size
    return model


def clear_view(model: mujoco.MjModel, data: mujoco.MjData, film: DrawnWorld, eye: Array, points: Array) -> None:
    """Hide of the surroundings, but for the support, each geom that is between the eye (3,) and a point of (P, 3)."""
    hit = np.array([-1], np.int32)
    mujoco.mj_fwdPosition(model, data)
    for point in points[:: max(1, len(points) // RAYS)]:
        while 0.0 <= mujoco.mj_ray(model, data, eye, point - eye, None, True, film.run.truth.index, hit) < 1.0:
            if hit[0] in (-1, film.run.truth.support):
                break
            _hide(model, hit)


def _opacity(model: mujoco.MjModel, geoms: NDArray[np.intp]) -> Array:
    """(G,) of a geom's own colour, or that of its material."""
    materials = np.append(model.mat_rgba[:, 3], 1.0)  # the last for those that have none
    return np.minimum(materials[model.geom_matid[geoms]], model.geom_rgba[geoms, 3])


def _paint(model: mujoco.MjModel, geoms: ArrayLike, colour: tuple[int, ...]) -> None:
    model.geom_rgba[geoms] = np.array(colour) / 255.0
    model.geom_matid[geoms] = -1
    model.geom_group[geoms] = 0


def _hide(model: mujoco.MjModel, geoms: ArrayLike) -> None:
    _paint(model, geoms, (0, 0, 0, 0))  # by which rays pass
    model.geom_group[geoms] = SHOWN
