"""Adding geoms to a MuJoCo scene: arrows, lines, boxes and surfaces."""

from collections.abc import Iterable
from itertools import pairwise

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray
from pivoting.sim.drawing.colours import Colour

Array = NDArray[np.float64]
BOX, CAPSULE, LINE, ARROW, TRIANGLE = (
    getattr(mujoco.mjtGeom, f"mjGEOM_{kind}").value for kind in ("BOX", "CAPSULE", "LINE", "ARROW", "TRIANGLE")
)
GLOW = 0.35  # emission, so that colours can be told apart in shade as well
LENGTH = 2.0  # MuJoCo's renderer draws an arrow half as long as the connector that it is made from


def add_arrow(scene: mujoco.MjvScene, at: Array, vector: Array, colour: Colour, radius: float) -> None:
    """Add an arrow from `at` (3,) to `at + vector`, unless it is not finite or shorter than its radius [m]."""
    if np.isfinite(vector).all() and np.linalg.norm(vector) > radius:
        _connect(scene, ARROW, at, at + LENGTH * vector, colour, radius)


def add_path(scene: mujoco.MjvScene, points: Array, colour: Colour, radius: float = 0.0) -> None:
    """Add a line through points (P, 3), as a tube of this radius [m] or else as a thin line."""
    for start, end in pairwise(points):
        _connect(scene, CAPSULE if radius else LINE, start, end, colour, radius or 1.5)


def add_box(scene: mujoco.MjvScene, middle: Array, axes: Array, half: Array, colour: Colour) -> None:
    """Add a box with half sizes `half` (3,) along the columns of `axes` (3, 3)."""
    _add(scene, BOX, colour, half, middle, axes)


def add_surface(
    scene: mujoco.MjvScene, vertices: Array, triangles: Iterable[ArrayLike], colour: Colour, opacity: int
) -> None:
    """Add triangles, each given by three rows of `vertices` (V, 3); both of their sides are visible."""
    for triangle in triangles:
        corner, *others = vertices[np.asarray(triangle)]
        first, second = (other - corner for other in others)
        normal = np.cross(first, second)
        if np.linalg.norm(normal) > 0.0:
            axes = np.column_stack([first, second, normal / np.linalg.norm(normal)])
            geom = _add(scene, TRIANGLE, colour, np.ones(3), corner, axes, opacity)
            geom.emission = GLOW
            geom.specular = 0.0


def _connect(scene: mujoco.MjvScene, kind: int, start: Array, end: Array, colour: Colour, width: float) -> None:
    geom = _add(scene, kind, colour, np.zeros(3), np.zeros(3), np.eye(3))
    geom.emission = GLOW
    mujoco.mjv_connector(geom, kind, width, start, end)


def _add(
    scene: mujoco.MjvScene, kind: int, colour: Colour, size: Array, at: Array, axes: Array, opacity: int = 255
) -> mujoco.MjvGeom:
    if scene.ngeom == scene.maxgeom:
        raise RuntimeError(f"the scene holds {scene.maxgeom} geoms, and there are more to draw")
    geom = scene.geoms[scene.ngeom]
    scene.ngeom += 1
    mujoco.mjv_initGeom(geom, kind, size, at, axes.ravel(), np.array([*colour, opacity], np.float32) / 255.0)
    geom.castshadow = 0
    return geom
