"""The scene on the page: the body on its table, with the forces of this moment, in viser's 3-D view.

Colours and arrows are those of the recordings: green the applied force, teal the applied moment, red the measured
contact force, purple the friction cone that the controller stays within, grey the weight, orange a push of the user's.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import mujoco
import numpy as np
from pivoting.controller.rotations import CONJUGATE, rotated
from pivoting.models.rigid_body import initial_data, place
from pivoting.sim.drawing.colours import BLOCK, EDGES, GREEN, GREY, ORANGE, PURPLE, RED, TABLE, TEAL, Colour
from pivoting.sim.drawing.drawn_world import BOLD, THIN, UP, Array
from pivoting.sim.drawing.shapes import body_solids
from pivoting.sim.run import Run
from pivoting.sim.viewing.live_world import LiveWorld

DOTS = 400  # points of the paths
NOW = np.array([0])  # the row of the moment that is drawn
WORDS = (
    ("applied force", GREEN),
    ("applied moment", TEAL),
    ("contact force", RED),
    ("friction cone", PURPLE),
    ("weight", GREY),
    ("your push", ORANGE),
)


class Grab(NamedTuple):
    """Where the user holds the body: a point (3,) in object axes, and where the pointer is, world axes."""

    point: Array
    pointer: Array


class LiveScene:
    """What is drawn of a run that goes on; made anew where the world changes.

    Attributes:
        world: the moment drawn last.
        body: viser's handle of the body, for clicks and drags.
    """

    def __init__(self, scene: Any, run: Run):
        """Draw what does not move.

        Args:
            scene: viser's.  run: the last step of the loop.
        """
        self._scene = scene
        self.world = LiveWorld(run, 0, body_solids(run.model, run.truth))
        self._data = initial_data(run.model)
        self._path = np.zeros((0, 2, 3))
        self._draw_table()
        self.body = self._draw_body()
        side = self.world.side
        self._arrows = {
            name: self._arrow(name, colour, radius * side)
            for name, colour, radius in (
                ("weight", GREY, THIN),
                ("force", GREEN, BOLD),
                ("contact", RED, BOLD),
                ("push", ORANGE, BOLD),
            )
        }
        none = np.zeros((1, 2, 3))
        self._moment = scene.add_line_segments("/moment", none, TEAL, thickness=2.0 * THIN * side)
        self._paths = scene.add_line_segments("/paths", none, GREY, thickness=2.0, thickness_units="screen")
        self._cones = [self._cone(k) for k in range(len(run.points))]
        self.show(run, None)

    def show(self, run: Run, grab: Grab | None) -> None:
        """The last step of a run."""
        self.world = replace(self.world, run=run)
        world, position = self.world, run.position[0, -1]
        body = self.body
        body.position, body.wxyz = position, run.quaternion[0, -1]
        at = run.position[0, 0] + world.front
        self._point("weight", [at], [world.weight * world.scale])
        self._point("force", [at], world.applied(NOW))
        corners = world.corner[0] + world.front
        self._point("contact", corners, world.measured(NOW)[0] @ run.table_axes.T)
        arc = at + world.moment_arcs(NOW)[0]
        self._moment.points = np.stack([arc[:-1], arc[1:]], axis=1).astype(np.float32)
        for cone, corner in zip(self._cones, corners, strict=True):
            cone.position = corner
        if grab is None:
            self._point("push", [at], [np.zeros(3)])
        else:
            held = self.held(grab) + world.front
            self._point("push", [held], [grab.pointer - self.held(grab)])
        last = self._path[-1, 1] if len(self._path) else at
        if np.linalg.norm(at - last) > 0.01 * world.side or not len(self._path):
            self._path = np.concatenate([self._path, [[last, at]]])[-DOTS:]
            self._paths.points = self._path.astype(np.float32)

    def held(self, grab: Grab) -> Array:
        """(3,) where the point that the user holds is now, world axes."""
        run = self.world.run
        return run.position[0, -1] + rotated(run.quaternion[0, -1], grab.point)

    def grabbed(self, at: Array, pointer: Array) -> Grab:
        """What is held by a pointer that took the body at a point (3,), both in world axes."""
        run = self.world.run
        return Grab(rotated(run.quaternion[0, -1] * CONJUGATE, at - run.position[0, -1]), pointer)

    def hit(self, origin: Array, direction: Array) -> Array | None:
        """(3,) where a ray meets what can move, world axes; None if it does not."""
        run, geom = self.world.run, np.array([-1], np.int32)
        place(run.model, self._data, run.truth, run.quaternion[0, -1], run.world.applied_at, run.position[0, -1])
        mujoco.mj_kinematics(run.model, self._data)
        far = mujoco.mj_ray(run.model, self._data, origin, direction, None, False, -1, geom)
        return origin + far * direction if far >= 0.0 else None

    def renew(self, run: Run) -> None:
        """What depends on the world and the controller: the cones; the path begins anew."""
        self.world, self._path = replace(self.world, run=run), np.zeros((0, 2, 3))
        self._cones = [self._cone(k) for k in range(len(run.points))]

    def _draw_table(self) -> None:
        """What the object stands on: the whole geom, or, as planes have no end, a slab of it."""
        world, run = self.world, self.world.run
        surface, axes = run.truth.surface, run.table_axes
        infinite = bool(np.isinf(surface.thick))
        thick = 2.0 * world.slab[2] if infinite or world.dim == 2 else surface.thick
        style = {"color": TABLE, "wxyz": run.truth.table}
        middle = -0.5 * thick * UP + (world.start if infinite or world.dim == 2 else 0.0)
        where = run.truth.origin + axes @ middle
        if surface.disc and world.dim == 3:
            self._scene.add_cylinder("/table", radius=surface.half[0], height=thick, position=where, **style)
            return
        half = world.slab[:2] if infinite or world.dim == 2 else surface.half
        self._scene.add_box("/table", dimensions=(*(2.0 * np.array(half)), thick), position=where, **style)

    def _draw_body(self) -> Any:
        """Its geoms as triangles, with their sharp edges."""
        world, run = self.world, self.world.run
        vertices = np.concatenate([solid.vertices for solid in world.solids])
        lines = np.concatenate([solid.lines for solid in world.solids])
        if world.block:  # whose depth says nothing
            thin = np.array([1.0, world.depth / max(float(np.abs(vertices[:, 1]).max()), 1e-9), 1.0])
            vertices, lines = vertices * thin, lines * thin
        faces = np.arange(len(vertices)).reshape(-1, 3)
        body = self._scene.add_mesh_simple(
            "/body", vertices, faces, color=BLOCK, opacity=None if world.dim == 2 else 0.5, flat_shading=True,
            wxyz=run.quaternion[0, -1], position=run.position[0, -1],
        )  # fmt: skip
        self._scene.add_line_segments("/body/edges", lines, EDGES, thickness=2.0, thickness_units="screen")
        return body

    def _cone(self, k: int) -> Any:
        """The friction cone that the controller stays within at a contact."""
        world, axes = self.world, self.world.run.truth.table
        vertices, triangles, lines = world.cone(k, planned=True)
        frame = self._scene.add_frame(f"/cone{k}", show_axes=False, wxyz=axes)
        self._scene.add_mesh_simple(
            f"/cone{k}/fill", vertices, triangles, color=PURPLE, opacity=0.3, side="double", cast_shadow=False
        )
        edges = np.concatenate([np.stack([line[:-1], line[1:]], axis=1) for line in lines])
        self._scene.add_line_segments(f"/cone{k}/edge", edges, PURPLE, thickness=2.0, thickness_units="screen")
        return frame

    def _arrow(self, name: str, colour: Colour, radius: float) -> Any:
        return self._scene.add_arrows(
            f"/{name}", np.zeros((1, 2, 3)), colour,
            shaft_radius=radius, head_radius=2.2 * radius, head_length=5.0 * radius,
        )  # fmt: skip

    def _point(self, name: str, starts: Any, vectors: Any) -> None:
        """Show arrows, unless they are not finite or too short."""
        starts, vectors = np.array(starts), np.array(vectors)
        drawn = np.isfinite(vectors).all(axis=1) & (np.linalg.norm(vectors, axis=1) > 0.02 * self.world.side)
        handle = self._arrows[name]
        handle.visible = bool(drawn.any())
        if drawn.any():
            handle.points = np.stack([starts, starts + vectors], axis=1)[drawn].astype(np.float32)
