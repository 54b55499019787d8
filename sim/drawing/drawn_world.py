"""One world of a run, ready to be drawn: the states before it diverges, sizes, and arrows for forces and moments."""

from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray
from pivoting.controller.solution import FAILED
from pivoting.controller.solution_space import SolutionSpace, solution_space
from pivoting.models.support_surfaces import upward
from pivoting.sim.drawing.shapes import Solid, arcs, body_solids, cone
from pivoting.sim.run import Run
from pivoting.sim.world import World

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

FAR = 1e4  # [m, m/s, rad/s]: a state beyond it has diverged
UP = np.array([0.0, 0.0, 1.0])
EYE = {2: (0.0, 2.05, 0.25), 3: (0.95, 1.25, 0.55)}  # from the centre to the right, towards us and up [sides]
DEPTH = 0.4  # of the drawn block, in sides: the plane knows none
BOLD, THIN = 0.02, 0.012  # radii of the arrows of the applied wrench, and of the weight and the moment's arc, in sides


@dataclass(frozen=True, eq=False)
class DrawnWorld:
    """One world of a run up to where it diverges, and the sizes that it is drawn with."""

    run: Run
    world: int

    @cached_property
    def states(self) -> int:
        """Number of states before the first that is not finite or is beyond `FAR`."""
        run, i = self.run, self.world
        state = np.hstack([run.position[i], run.quaternion[i], run.velocity[i], run.angular_velocity[i]])
        wrong = ~(np.abs(state) <= FAR).all(axis=1)
        return int(wrong.argmax()) if wrong.any() else wrong.size

    @property
    def answers(self) -> int:
        """Number of steps that began in one of these states."""
        return min(self.states, self.run.time.size - 1)

    @property
    def dim(self) -> int:
        """2 or 3."""
        return self.run.truth.dim

    @property
    def tags(self) -> list[str]:
        """Of the contacts, to be put after a name: nothing if there is only one."""
        return [""] if len(self.run.points) == 1 else [str(i) for i in range(len(self.run.points))]

    @property
    def model(self) -> mujoco.MjModel:
        """The world's, which may differ from what the controller believes."""
        return self.truth.model

    @cached_property
    def truth(self) -> World:
        """The world as it is alone."""
        return self.run.world.of(self.world)

    @cached_property
    def solids(self) -> list[Solid]:
        """The body's geoms, object axes."""
        return body_solids(self.model, self.run.truth)

    @cached_property
    def block(self) -> bool:
        """Whether it is the planar scenes' block: one box about its CoM, whose depth says nothing."""
        if self.dim == 3 or len(self.solids) != 1:
            return False
        far = np.abs(self.solids[0].vertices)
        return bool(np.allclose(far, far.max(axis=0)))

    @cached_property
    def side(self) -> float:
        """Side of the block, the longest of any other body, in the plane that it moves in [m]."""
        points = np.abs(np.concatenate([solid.vertices for solid in self.solids]))
        return 2.0 * float((points[:, [0, 2]] if self.dim == 2 else points).max())

    @cached_property
    def depth(self) -> float:
        """From the plane of motion to the nearest face of the block, as it is drawn [m]."""
        if self.block:
            return 0.5 * DEPTH * self.side
        return float(np.abs(np.concatenate([solid.vertices for solid in self.solids])[:, 1]).max())

    @property
    def length(self) -> float:
        """What Q_w weighs a moment with: it weighs M / length as it does a force [m]."""
        Q_w = self.run.controller_of(self.world).Q_w
        return float(np.sqrt(Q_w[0, 0] / Q_w[self.dim, self.dim]))

    @cached_property
    def scale(self) -> float:
        """Length of a drawn force [m/N]: m g is half a side, or less if the run's forces would pass 0.8 sides."""
        return 0.5 * self.side / max(float(np.linalg.norm(self.weight)), 0.625 * self.usual_force, 1e-9)

    @property
    def usual_force(self) -> float:
        """What the drawn forces, and in space the moments as forces at `length`, usually stay below [N]."""
        wrench, i = self.run.wrench[self.world], self.dim
        drawn = [wrench[:, :i], *np.moveaxis(self.force, 1, 0)]
        drawn += [wrench[:, i:] / self.length] * (i == 3)
        return max(usual(np.linalg.norm(each[: self.answers], axis=1)) for each in drawn)

    @property
    def usual_moment(self) -> float:
        """What the applied moments usually stay below [N m]."""
        return usual(self._moments)

    @property
    def _moments(self) -> Array:
        """(N,) applied moments [N m], in the plane with their sign."""
        if self.dim == 2:
            return self.run.wrench[self.world, : self.answers, 2]
        return np.linalg.norm(self.run.wrench_world[self.world, : self.answers, 3:], axis=1)

    @property
    def away(self) -> Array:
        """(3,) the unit vector into the picture, world axes."""
        return self.run.table_axes[:, 1]

    @property
    def front(self) -> Array:
        """(3,) from the plane of motion to the one before the block that arrows are drawn in; nothing in space [m]."""
        return -self.away * (self.depth + 0.02 * self.side) * (self.dim == 2)

    @property
    def along_axis(self) -> Array:
        """(3,) horizontal unit vector into the picture along the axis of rotation, world axes.

        A positive rotation then looks counter-clockwise. If the axis is vertical this is `away`.
        """
        axis, up = self.run.world.turn[0], upward(self.model)
        level = up * (axis @ up) - axis
        size = float(np.linalg.norm(level))
        return level / size if size > 0.5 else self.away

    def eye(self, into: Array) -> Array:
        """(3,) from the centre of the picture to the viewer, who looks along `into` (3,), world axes [m]."""
        up = upward(self.model)
        return self.side * np.array(EYE[self.dim]) @ np.array([np.cross(into, up), -into, up])

    @property
    def weight(self) -> Array:
        """(3,) m g, world axes [N]."""
        return self.truth.truth.mass * self.run.truth.gravity

    @property
    def planned_mu(self) -> Array:
        """(K,) friction that the controller may use, (1 - margin) mu."""
        return self.run.controller_of(self.world, -1).belief.contacts.mu

    @cached_property
    def corner(self) -> Array:
        """(states, K, 3) where the contacts touch, world axes [m]."""
        return self.run.truth.origin + self.run.corner[self.world, : self.states] @ self.run.table_axes.T

    @cached_property
    def start(self) -> Array:
        """(3,) where on the table the contacts are at the start, table axes [m]."""
        at = self.run.corner[self.world, 0].mean(axis=0) * [1.0, 1.0, 0.0]
        return at if self.states else np.zeros(3)

    @property
    def centre(self) -> Array:
        """(3,) of the picture: above the contact in the plane, in space where the CoM is on average, world axes [m]."""
        if self.dim == 3 and self.states:
            return self.run.position[self.world, : self.states].mean(axis=0)
        return self.run.truth.origin + self.run.table_axes @ self.start + 0.62 * self.side * UP

    @cached_property
    def force(self) -> Array:
        """(N, K, d) predicted contact forces; nan where there was no answer that predicts any [N]."""
        unanswered = self.run.status[self.world] == FAILED
        return np.where(unanswered[:, None, None], np.nan, self.run.force[self.world])

    @property
    def thick(self) -> float:
        """Radius of the arrows for predicted contact forces; those for measured forces are twice as thick [m]."""
        return (0.015 if self.dim == 2 else 0.012) * self.side

    @property
    def slab(self) -> Array:
        """(3,) half sizes of the slab that is drawn for an infinite table, table axes [m]."""
        return self.side * np.array([2.0, 0.5, 0.03] if self.dim == 2 else [1.3, 1.1, 0.03])

    def applied(self, rows: Rows) -> Array:
        """(R, 3) arrows of the applied force, world axes [m]."""
        return self.run.wrench_world[self.world, rows, :3] * self.scale

    def moment(self, rows: Rows) -> Array:
        """(R, 3) arrows of the applied moment, world axes [m]."""
        return self.run.wrench_world[self.world, rows, 3:] / self.length * self.scale

    def moment_arcs(self, rows: Rows) -> Array:
        """(R, 28, 3) the applied moment as an arc around the CoM, in space in the plane normal to it, world axes [m].

        270 deg stand for what the moments usually stay below, or for a tenth of m g at the corner's lever if more.
        """
        if self.dim == 2:
            plane = np.broadcast_to(self.run.table_axes[:, [0, 2]], (len(rows), 3, 2))
        else:
            plane = _planes_across(self.run.wrench_world[self.world, : self.answers, 3:])[rows]
        full = max(self.usual_moment, 0.05 * self.side / self.scale * float(np.linalg.norm(self.run.points)))
        sweep = np.deg2rad(np.clip(270.0 * self._moments[rows] / full, -330.0, 330.0))
        return arcs(sweep, 0.2 * self.side) @ np.swapaxes(plane, 1, 2)

    def measured(self, rows: Rows) -> Array:
        """(R, K, 3) arrows of the measured contact forces, table axes [m]."""
        return self.scale * self._lifted(self.run.force_measured[self.world, rows])

    def predicted(self, rows: Rows) -> Array:
        """(R, K, 3) arrows of the predicted contact forces, nan without an answer, table axes [m]."""
        return self.scale * self._lifted(self.force[rows])

    def solution_space(self, rows: Rows, reach: float) -> SolutionSpace:
        """Of steps of a planar run, from the log alone: the pose at its start, what was required, what was applied.

        Without an answer (nan) nothing was applied, and of the contact nothing is known.

        Args:
            reach: largest normal force that is drawn [N].
        """
        run, i, controller = self.run, self.world, self.run.controller_of(self.world)
        unanswered = run.status[i, rows, None] == FAILED
        return solution_space(
            np.array([controller.jacobian(q) for q in run.quaternion[i, rows]]),
            float(self.planned_mu[0]),
            controller.contacts[0].f_min,
            run.required[i, rows],
            np.where(unanswered, 0.0, run.wrench[i, rows]),
            self.force[rows, 0],
            reach,
        )

    def _lifted(self, force: Array) -> Array:
        """(R, K, 3) of forces (R, K, d)."""
        lift = self.run.attached.controller.space.lift
        return np.stack([lift(force[:, i]) for i in range(force.shape[1])], axis=1)

    def cone(self, i: int, *, planned: bool) -> tuple[Array, NDArray[np.int64], list[Array]]:
        """The friction cone of contact i, planned or the world's, in table axes [m]; see `shapes.cone`."""
        mu = float(self.planned_mu[i]) if planned else self.truth.mu
        floor = self.scale * self.run.controller_of(self.world, -1).contacts[i].f_min
        tall = 0.8 if self.dim == 2 else 0.45
        return cone(mu, floor * planned, max(tall * self.side / np.hypot(mu, 1.0), 1.3 * floor), self.dim)


def usual(values: Array) -> float:
    """What 95 % of the magnitudes that are finite stay below; 0 if none is."""
    finite = np.abs(values[np.isfinite(values)])
    return float(np.quantile(finite, 0.95)) if finite.size else 0.0


def _planes_across(vectors: Array) -> Array:
    """(N, 3, 2) two axes of the plane normal to each of `vectors` (N, 3), right-handed about it.

    The first is also normal to the world axis that the vectors stay farthest from, so that it varies smoothly.
    """
    size = np.linalg.norm(vectors, axis=1, keepdims=True)
    axis = np.divide(vectors, size, out=np.zeros_like(vectors), where=size > 0.0)
    first = np.cross(np.eye(3)[np.abs(axis).max(axis=0).argmin()], axis)
    size = np.linalg.norm(first, axis=1, keepdims=True)
    first = np.divide(first, size, out=np.zeros_like(first), where=size > 0.0)
    return np.stack([first, np.cross(axis, first)], axis=2)
