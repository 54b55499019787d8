"""One world of a run and the rerun recording that it is sent to in columns; its wrench space over time."""

from dataclasses import dataclass
from functools import cached_property
from math import ceil
from typing import Any

import numpy as np
from pivoting.controller.solution_space import SolutionSpace
from pivoting.sim.drawing.colours import Colour
from pivoting.sim.drawing.drawn_world import Array, DrawnWorld, Rows, usual

SCENE, SPACE, PLOTS = (200.0, 2_000), (50.0, 500), (np.inf, 20_000)  # at most [Hz of simulated time], at most rows
HUGE = 1e30  # beyond it single precision, which views are kept in, ends


@dataclass(frozen=True, eq=False)
class Film(DrawnWorld):
    """One world of a run, and the recording that it is sent to."""

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

    def rows(self, count: int, budget: tuple[float, int]) -> Rows:
        """Which of `count` rows are kept within a budget (Hz of simulated time, rows)."""
        rate, most = budget
        stride = max(1, ceil(1.0 / (rate * self.run.dt) - 1e-9), ceil(count / (most - 1)))
        return np.union1d(np.arange(0, count, stride), np.arange(count)[-1:])

    @cached_property
    def space_rows(self) -> Rows:
        """The answered steps whose wrench space is drawn."""
        return self.rows(self.answers, SPACE)

    @cached_property
    def space(self) -> SolutionSpace:
        """Of these steps."""
        return self.solution_space(self.space_rows, self.reach)

    @cached_property
    def reach(self) -> float:
        """Largest normal force in the picture of the wrench space, and half the picture's size [N]."""
        run, i, rows = self.run, self.world, self.space_rows
        planar = run.required[i, rows, :2], run.wrench[i, rows, :2], self.force[rows, 0]
        return 1.25 * max(*(usual(np.linalg.norm(each, axis=-1)) for each in planar), 1e-9)


def xyzw(quaternion: Array) -> Array:
    """(..., 4) in rerun's order, from MuJoCo's (w, x, y, z)."""
    return np.roll(quaternion, -1, axis=-1)
