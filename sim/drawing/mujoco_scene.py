"""One world of a run as a MuJoCo scene: the model's geoms, and what happened to the object as additional geoms.

These are the applied force and moment at the CoM, the measured forces and planned friction cones at the contacts, and
the paths of the CoM, of the contacts and of the corner farthest from them, all taken from the arrays of the run. In
space the object is translucent and casts a shadow straight down; in the plane the arrows are in front of it, and its
weight is drawn as well.
"""

from collections.abc import Iterator
from dataclasses import replace

import mujoco
import numpy as np
from numpy.typing import NDArray
from pivoting.controller.rotations import rotated
from pivoting.models.rigid_body import initial_data, place
from pivoting.models.support_surfaces import upward
from pivoting.sim.drawing.camera import fitted
from pivoting.sim.drawing.colours import DARK, EDGES, GLASS, GREEN, GREY, PURPLE, RED, TABLE, TEAL
from pivoting.sim.drawing.drawn_world import BOLD, THIN, UP, Array, DrawnWorld, Rows
from pivoting.sim.drawing.dressed_model import clear_view, dressed
from pivoting.sim.drawing.scene_geoms import GLOW, add_arrow, add_box, add_path, add_surface
from pivoting.sim.drawing.shapes import shadow

POSES = 60  # times at which everything has to be in the camera's view
DOTS = 200  # points of a path, at most
OTHERS = 200  # geoms, at most, that are added for the wrench and for each contact
SHADE = 110  # opacity of the shadow, from 0 to 255
SUN = np.array([0.35, 0.25, -1.0])  # direction of its light: to the right, into the picture and down
WORDS = [("applied force", GREEN), ("applied moment", TEAL), ("contact force", RED), ("friction cone", PURPLE)]
LEGEND = {2: [*WORDS, ("weight", GREY)], 3: WORDS}
EVERY = mujoco.mjtCatBit.mjCAT_ALL.value
GEOM = mujoco.mjtObj.mjOBJ_GEOM.value


class MujocoScene:
    """One world of a run, seen by a camera that has the whole motion in view.

    Attributes:
        model: what is drawn, see `dressed_model`.
        scene: the one shown last.
    """

    def __init__(self, film: DrawnWorld, width: int, height: int):
        """For pictures of `width` x `height` pixels."""
        self._film = film
        self._paths = list(_paths(film))
        points = np.concatenate([*_extent(film), *self._paths])
        self._size = float(np.linalg.norm(np.ptp(points, axis=0)))
        self._camera = fitted(points, film.eye(film.along_axis), upward(film.model), width / height)
        self.model = dressed(film, self._size, width, height)
        self._data = initial_data(self.model)
        self._data.qpos[:] = film.run.start[0][film.world]
        clear_view(self.model, self._data, film, self._camera.eye, points)
        lines = sum(len(solid.lines) for solid in film.solids) + DOTS * len(self._paths)
        self.scene = mujoco.MjvScene(self.model, self.model.ngeom + lines + OTHERS * (1 + len(film.tags)))
        self._option = mujoco.MjvOption()
        self._option.sitegroup[:] = 0

    def show(self, row: int) -> mujoco.MjvScene:
        """The scene at the beginning of step `row`."""
        film, run, scene, i = self._film, self._film.run, self.scene, self._film.world
        place(self.model, self._data, run.truth, run.quaternion[i, row], run.world.applied_at, run.position[i, row])
        mujoco.mjv_updateScene(self.model, self._data, self._option, None, mujoco.MjvCamera(), EVERY, scene)
        for geom in scene.geoms[: scene.ngeom]:
            if geom.objtype == GEOM and self.model.geom_bodyid[geom.objid] == run.truth.index:
                geom.emission = GLOW
        for draw in (_draw_table, _draw_edges, _draw_wrench, _draw_contacts):
            draw(scene, film, np.array([row]))
        for path in self._paths:
            add_path(scene, path, GREY)
        self._camera.aim(scene, 0.01 * self._size, 100.0 * self._size)
        for geom in scene.geoms[: scene.ngeom]:
            geom.camdist = self._camera.depth(geom.pos)  # MuJoCo sorts translucent geoms by it
        self._light()
        return scene

    def _light(self) -> None:
        """Replace the model's lights by three directional ones: along the view, straight down and from the sun."""
        scene, up, into = self.scene, upward(self._film.model), self._film.along_axis
        scene.flags[:] = 0  # no sky, no fog
        scene.flags[mujoco.mjtRndFlag.mjRND_CULL_FACE.value] = 1
        sun = SUN @ np.array([np.cross(into, up), into, up]) / np.linalg.norm(SUN)
        lights = (self._camera.forward, 0.3), (-up, 0.3), (sun, 0.35)
        scene.nlight = len(lights)
        for light, (where, bright) in zip(scene.lights, lights, strict=False):
            light.id, light.type, light.headlight = -1, mujoco.mjtLightType.mjLIGHT_DIRECTIONAL.value, 0
            light.dir[:], light.pos[:] = where, self._camera.eye
            light.ambient[:], light.diffuse[:], light.specular[:] = 0.1, bright, 0.1
            light.castshadow, light.texid = 0, -1


def _extent(film: DrawnWorld) -> Iterator[Array]:
    """Points (..., 3) that have to be in view: the body, its shadow, arrows and cones, at times of the whole run."""
    run, i, axes = film.run, film.world, film.run.table_axes
    rows = np.unique(np.linspace(0, film.answers - 1, POSES).astype(int))
    position, quaternion = run.position[i, rows], run.quaternion[i, rows]
    body = (position[:, None] + rotated(quaternion[:, None], np.unique(_vertices(film), axis=0))).reshape(-1, 3)
    yield body
    yield body - np.outer((body - run.truth.origin) @ axes[:, 2], axes[:, 2])  # its shadow
    yield position + film.front + film.applied(rows)
    if film.dim == 2:
        yield position + film.front + film.weight * film.scale
    yield (position[:, None] + film.front + film.moment_arcs(rows)).reshape(-1, 3)
    beside = 0.4 * film.side * np.array([[x, y, 0.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)])
    for k, at in enumerate(np.moveaxis(film.corner[rows], 1, 0) + film.front):
        yield at + film.measured(rows)[:, k] @ axes.T
        yield at[0] + np.concatenate([film.cone(k, planned=True)[0], beside]) @ axes.T


def _paths(film: DrawnWorld) -> Iterator[Array]:
    """Paths (P, 3) of the CoM, of the corner of the body farthest from the contacts, and of the contacts [m]."""
    run, i = film.run, film.world
    rows = np.unique(np.linspace(0, film.answers - 1, DOTS).astype(int))
    vertices = _vertices(film)
    far = vertices[np.linalg.norm(vertices - run.points.mean(axis=0), axis=1).argmax()]
    position, quaternion = run.position[i, rows], run.quaternion[i, rows]
    for path in (position, position + rotated(quaternion, far), *np.moveaxis(film.corner[rows], 1, 0)):
        yield path + film.front


def _vertices(film: DrawnWorld) -> Array:
    """(V, 3) vertices of the body, object axes [m]."""
    return np.concatenate([solid.vertices for solid in film.solids])


def _posed(film: DrawnWorld, row: Rows, points: Array) -> Array:
    """(..., 3) where points (..., 3) of the object are at the beginning of a step, world axes [m]."""
    return film.run.position[film.world, row] + rotated(film.run.quaternion[film.world, row], points)


def _draw_table(scene: mujoco.MjvScene, film: DrawnWorld, row: Rows) -> None:
    """The slab that stands for an infinite table, and in space the shadow."""
    run, surface, half = film.run, film.run.truth.surface, film.slab
    if film.dim == 2:
        half = np.array([half[0], film.depth, half[2]])  # so that it hides no arrow
    if np.isinf(surface.thick):
        top = run.truth.origin + run.table_axes @ film.start
        add_box(scene, top - run.table_axes @ (half * UP), run.table_axes, half, TABLE)
        surface = replace(surface, axes=run.table_axes, origin=top, half=half[:2])
    if film.dim == 3:
        outline = shadow(
            run.position[film.world, row] + rotated(run.quaternion[film.world, row], _vertices(film)), surface
        )
        corners = np.column_stack([outline, np.full(len(outline), 0.002 * film.side)])
        fan = [[0, k, k + 1] for k in range(1, len(outline) - 1)]
        add_surface(scene, surface.origin + corners @ surface.axes.T, fan, DARK, SHADE)


def _draw_edges(scene: mujoco.MjvScene, film: DrawnWorld, row: Rows) -> None:
    """The body's sharp edges."""
    lines = np.concatenate([solid.lines for solid in film.solids])
    for line in _posed(film, row, lines):
        add_path(scene, line, EDGES)


def _draw_wrench(scene: mujoco.MjvScene, film: DrawnWorld, row: Rows) -> None:
    """The applied force and moment at the CoM; in the plane, where the table does not hide it, also the weight."""
    (at,) = film.run.position[film.world, row] + film.front
    if film.dim == 2:
        add_arrow(scene, at, film.weight * film.scale, GREY, THIN * film.side)
    add_path(scene, at + film.moment_arcs(row)[0], TEAL, THIN * film.side)
    add_arrow(scene, at, film.applied(row)[0], GREEN, BOLD * film.side)


def _draw_contacts(scene: mujoco.MjvScene, film: DrawnWorld, row: Rows) -> None:
    """The measured force at each contact, and the friction cone that the controller stays within."""
    axes = film.run.table_axes
    measured = film.measured(row)[0] @ axes.T
    standing = film.run.standing[film.world, row[0]]
    for k in map(int, np.flatnonzero(standing)):
        at = film.corner[row[0], k] + film.front
        vertices, triangles, lines = film.cone(k, planned=True)
        corners = vertices @ axes.T
        if film.dim == 3:
            triangles = _far_side(corners, triangles, film.eye(film.along_axis))
        add_surface(scene, at + corners, triangles, PURPLE, GLASS)
        for line in lines:
            add_path(scene, at + line @ axes.T, PURPLE)
        add_arrow(scene, at, measured[k], RED, BOLD * film.side)


def _far_side(corners: Array, triangles: NDArray[np.int64], eye: Array) -> NDArray[np.int64]:
    """Those outward triangles (M, 3) that face away from the eye, turned inward: they do not hide the force arrow."""
    first, second, third = np.moveaxis(corners[triangles], 1, 0)
    return triangles[np.cross(second - first, third - first) @ eye < 0.0][:, ::-1]
