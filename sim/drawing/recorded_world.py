"""One world of a run as it is drawn: how much of it, in which sizes, and how it is sent to a rerun recording."""

from dataclasses import dataclass
from functools import cached_property
from math import ceil
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from pivoting.controller.solution import FAILED
from pivoting.controller.solution_space import SolutionSpace, solution_space
from pivoting.sim.drawing.shapes import Solid, body_solids
from pivoting.sim.run import Run

Array = NDArray[np.float64]
Rows = NDArray[np.intp]
Colour = tuple[int, int, int]

SCENE, SPACE, PLOTS = (200.0, 2_000), (50.0, 500), (np.inf, 20_000)  # at most [Hz of simulated time], at most rows
FAR = 1e4  # [m, m/s, rad/s]: a state beyond it has diverged
HUGE = 1e30  # beyond it single precision, which views are kept in, ends
UP = np.array([0.0, 0.0, 1.0])
DEPTH = 0.4  # of the drawn block, in sides: the plane knows none


@dataclass(frozen=True, eq=False)
class Film:
    """One world of a run up to where it diverges, the sizes it is drawn with, and the recording it is sent to."""

    run: Run
    world: int
    rr: Any  # the module
    stream: Any

    def still(self, entity: str, *archetypes: Any) -> None:
        """Send what does not change."""
        for archetype in archetypes:
            self.stream.log(entity, archetype, static=True)

    def send(self, entity: str, rows: Rows, archetype: Any, *, each: int = 1, **values: Array) -> None:
        """Send columns `values` (R each, ...) of an archetype that has `each` instances at each of the R `rows`."""
        drawn = [np.all(np.abs(value) < HUGE, axis=tuple(range(1, value.ndim))) for value in values.values()]
        there = np.all(drawn, axis=0).reshape(rows.size, each).all(axis=1)
        columns = archetype.columns(**{key: value[np.repeat(there, each)] for key, value in values.items()})
        seconds = self.rr.TimeColumn("sim_time", duration=self.run.time[rows])
        steps = self.rr.TimeColumn("step", sequence=rows)
        self.stream.send_columns(entity, [seconds, steps], columns.partition(each * there))

    def arrows(
        self,
        entity: str,
        rows: Rows,
        vectors: Array,
        colour: Colour,
        width: float,
        label: str,
        at: float = 1.0,
        origins: Array | None = None,
    ) -> None:
        """Send arrows (R, 3) with a label just past the share `at` of their length.

        They start at `origins` (R, 3), or else at the entity's.
        """
        self.still(entity, self.rr.Arrows3D.from_fields(colors=[colour], radii=[width]), self.label(label, colour))
        past = vectors * (at + 4.0 * width / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), width))
        if origins is None:
            self.send(entity, rows, self.rr.Arrows3D, vectors=vectors)
            self.send(entity, rows, self.rr.Points3D, positions=past)
        else:
            self.send(entity, rows, self.rr.Arrows3D, vectors=vectors, origins=origins)
            self.send(entity, rows, self.rr.Points3D, positions=origins + past)

    def label(self, text: str, colour: Colour, at: Array | None = None) -> Any:
        """A word at the position `at` (3,), or else at positions that are sent as a column."""
        style = {"labels": [text], "colors": [colour], "radii": [0.0], "show_labels": bool(text)}
        return self.rr.Points3D.from_fields(positions=None if at is None else [at], **style)

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

    def rows(self, count: int, budget: tuple[float, int]) -> Rows:
        """Which of `count` rows are kept within a budget (Hz of simulated time, rows)."""
        rate, most = budget
        stride = max(1, ceil(1.0 / (rate * self.run.dt) - 1e-9), ceil(count / (most - 1)))
        return np.union1d(np.arange(0, count, stride), np.arange(count)[-1:])

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
        return self.run.model

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
        Q_w = self.run.attached.controller.Q_w
        return float(np.sqrt(Q_w[0, 0] / Q_w[self.dim, self.dim]))

    @cached_property
    def scale(self) -> float:
        """Length of a drawn force [m/N]: m g is half a side, or less if the run's forces would pass 0.8 sides."""
        wrench, i = self.run.wrench[self.world], self.dim
        drawn = [wrench[:, :i], *np.moveaxis(self.force, 1, 0)]
        drawn += [wrench[:, i:] / self.length] * (i == 3)
        largest = max(usual(np.linalg.norm(each[: self.answers], axis=1)) for each in drawn)
        return 0.5 * self.side / max(float(np.linalg.norm(self.weight)), 0.625 * largest, 1e-9)

    @property
    def away(self) -> Array:
        """(3,) the unit vector into the picture, world axes."""
        return self.run.table_axes[:, 1]

    @property
    def front(self) -> Array:
        """(3,) from the plane of motion to the one before the block that arrows are drawn in; nothing in space [m]."""
        return -self.away * (self.depth + 0.02 * self.side) * (self.dim == 2)

    @property
    def weight(self) -> Array:
        """(3,) m g, world axes [N]."""
        return self.run.truth.mass * self.run.truth.gravity

    @property
    def planned_mu(self) -> Array:
        """(K,) friction that the controller may use, (1 - margin) mu."""
        return self.run.attached.controller.belief.mu

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

    @cached_property
    def space_rows(self) -> Rows:
        """The answered steps whose wrench space is drawn."""
        return self.rows(self.answers, SPACE)

    @cached_property
    def space(self) -> SolutionSpace:
        """Of these steps, from the log alone: the pose that the controller saw, what was required, what was applied.

        Without an answer (nan) nothing was applied, and of the contact nothing is known.
        """
        run, i, rows, controller = self.run, self.world, self.space_rows, self.run.attached.controller
        unanswered = run.status[i, rows, None] == FAILED
        return solution_space(
            np.array([controller.jacobian(q) for q in run.quaternion[i, rows]]),
            float(self.planned_mu[0]),
            controller.contacts[0].f_min,
            run.required[i, rows],
            np.where(unanswered, 0.0, run.wrench[i, rows]),
            self.force[rows, 0],
            self.reach,
        )

    @cached_property
    def reach(self) -> float:
        """Largest normal force in the picture of the wrench space, and half the picture's size [N]."""
        run, i, rows = self.run, self.world, self.space_rows
        planar = run.required[i, rows, :2], run.wrench[i, rows, :2], self.force[rows, 0]
        return 1.25 * max(*(usual(np.linalg.norm(each, axis=-1)) for each in planar), 1e-9)


def usual(values: Array) -> float:
    """What 95 % of the magnitudes that are finite stay below; 0 if none is."""
    finite = np.abs(values[np.isfinite(values)])
    return float(np.quantile(finite, 0.95)) if finite.size else 0.0


def xyzw(quaternion: Array) -> Array:
    """(..., 4) in rerun's order, from MuJoCo's (w, x, y, z)."""
    return np.roll(quaternion, -1, axis=-1)
