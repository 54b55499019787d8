"""A copy of a run's model to draw: coloured like a recording, without other moving bodies and obstructions."""

import copy

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray
from pivoting.models.placement.convex_hull import colliding
from pivoting.sim.drawing.colours import BLOCK, GLASS, TABLE
from pivoting.sim.drawing.drawn_world import DrawnWorld

Array = NDArray[np.float64]
SHOWN = 3  # MuJoCo shows the geom groups below this one
RAYS = 1_000  # at most, from the camera to the points that have to be visible


def dressed(film: DrawnWorld, size: float, width: int, height: int) -> mujoco.MjModel:
    """A copy of the model for pictures of `width` x `height` pixels in which everything together has this size [m].

    The object shows its visible geoms, or its colliding ones if none is visible. Other movable bodies are hidden,
    because a run does not record where they are, and so is an infinite table, in place of which a slab is drawn.
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
    model.vis.quality.offsamples, model.vis.quality.shadowsize = 4, 0
    model.stat.extent = size
    return model


def clear_view(model: mujoco.MjModel, data: mujoco.MjData, film: DrawnWorld, eye: Array, points: Array) -> None:
    """Hide the geoms, other than the support and the object, between the eye (3,) and any of the points (P, 3)."""
    hit = np.array([-1], np.int32)
    mujoco.mj_fwdPosition(model, data)
    for point in points[:: max(1, len(points) // RAYS)]:
        while 0.0 <= mujoco.mj_ray(model, data, eye, point - eye, None, True, film.run.truth.index, hit) < 1.0:
            if hit[0] in (-1, film.run.truth.support):
                break
            _hide(model, hit)


def _opacity(model: mujoco.MjModel, geoms: NDArray[np.intp]) -> Array:
    """(G,) the opacity of each geom, or of its material if that is less."""
    materials = np.append(model.mat_rgba[:, 3], 1.0)  # the last one is for geoms without a material
    return np.minimum(materials[model.geom_matid[geoms]], model.geom_rgba[geoms, 3])


def _paint(model: mujoco.MjModel, geoms: ArrayLike, colour: tuple[int, ...]) -> None:
    model.geom_rgba[geoms] = np.array(colour) / 255.0
    model.geom_matid[geoms] = -1
    model.geom_group[geoms] = 0


def _hide(model: mujoco.MjModel, geoms: ArrayLike) -> None:
    _paint(model, geoms, (0, 0, 0, 0))  # rays pass through what is transparent
    model.geom_group[geoms] = SHOWN
