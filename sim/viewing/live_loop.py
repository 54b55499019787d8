"""The closed loop of a scenario that goes on for as long as one likes, while it is shoved and changed.

It goes on in laps. Each is a run like one of `simulate`, of the same stages, logged and measured in the same way, and
begins with the state in which the one before ended.
"""

from dataclasses import replace
from math import ceil, inf, isfinite
from time import perf_counter
from typing import Any

import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray
from pivoting.controller.references import Reference
from pivoting.controller.rotations import rotated
from pivoting.controller.validate import fail
from pivoting.models.frames import matrix
from pivoting.sim.drawing.drawn_world import FAR
from pivoting.sim.pipeline.apply_wrench import PushedWrench
from pivoting.sim.pipeline.log import some_steps, worlds_first
from pivoting.sim.pipeline.plant import Plant
from pivoting.sim.pipeline.stages import States
from pivoting.sim.run import Run
from pivoting.sim.run_setup import on_reference, set_up
from pivoting.sim.scenario_control import decide, laws_of, stages_of
from pivoting.sim.scenarios.scenario import Scenario
from pivoting.sim.simulation import kept, new_log, start_batch, start_of, steps_of
from pivoting.sim.start_states import Samples
from pivoting.sim.viewing.later_references import Redirected, from_now
from pivoting.sim.world import World

Array = NDArray[np.float64]
LONGEST = 20.0  # [s] that a lap may take
SHORTEST = 0.5  # [s] beyond what the verdict lets settle
SHOVED = 0.02  # [s] that a shove takes
STILL = 1e-9  # [rad, rad/s]: a motion that ends as close to how it begins is repeated without a jump
MOVE = 8.0  # natural times that it takes to another angle


class LiveLoop:
    """One world of a scenario in closed loop.

    Attributes:
        asked: the scenario as it is now.
        lap: number of this lap.  passed, failed: how many that were brought to their end did so.
        notes: what the loop did of itself, in words, the last one last.
    """

    def __init__(self, asked: Scenario, seed: int = 0):
        """At the start of the scenario; compiles what a step calls.

        Raises:
            ValueError, ModelError: as of `simulate`.
        """
        self._seed = seed
        self.lap = self.passed = self.failed = 0
        self.notes: list[str] = []
        self._set(asked)
        self.restart()

    def _set(self, asked: Scenario) -> None:
        """The world, the belief and the law of a scenario; an error leaves all as it was."""
        asked.refuse_without_effect(asked.given, open_loop=False)
        if asked.landing == "held":  # a lap that goes on for as long as one likes is of one stance
            asked = asked.change(landing="ignored")
            self.notes.append("The page runs laps of one stance: landing=ignored.")
        whole = set_up(asked, None, worlds=1, seed=self._seed, first_world=0)
        stages = stages_of(whole)
        laws = laws_of(whole, stages)
        decide(whole, stages, laws)  # which refuses what it cannot control
        self.asked, self._whole, self._stages, self._laws = asked, whole, stages, laws

    def restart(self) -> None:
        """Put the object back to the start of the scenario's own motion."""
        stages = stages_of(self._whole)
        self._stages, self._laws = stages, laws_of(self._whole, stages)
        self._on(start_batch(self._whole, decide(self._whole, stages, self._laws)))
        self._begin_cycle()

    def _on(self, batch: Batch) -> None:
        """Go on with these worlds."""
        self._batch, self._plant = batch, Plant(batch, self._whole.world.sensors)
        wrench_map = self._whole.belief.attached.controller.belief.source.map
        self._apply = PushedWrench(batch, wrench_map, self._whole.world.truth.index, self._whole.world.offsets)
        for disturb in self._stages.disturb:
            disturb.begin(batch, self._whole.world)

    def _begin_cycle(self) -> None:
        """The scenario's own motion from its beginning, in as many laps as it takes."""
        case = self._whole.case
        ends = isfinite(getattr(case.motion, "duration", inf))
        self.laps_left: float = ceil(case.duration / LONGEST) if ends else inf
        self._ends = self.laps_left == 1
        self._begin(case.motion, case.duration / self.laps_left if ends else min(case.duration, LONGEST))

    def _begin(self, reference: Reference, seconds: float) -> None:
        """A lap on a reference, for a time [s]."""
        seconds = max(seconds, self.asked.limits.settle_s + SHORTEST)
        self._reference, self.lap = reference, self.lap + 1
        self._begun = on_reference(self._whole, reference, seconds)
        self._decided = decide(self._begun, self._stages, self._laws)
        self._start = start_of(self._batch)
        log = new_log(self._begun, self._decided)
        self._steps = steps_of(self._begun, self._decided, self._plant, self._apply, log)
        self._steps.prepare()
        self._wall_s = 0.0

    @property
    def made(self) -> int:
        """Steps of this lap so far."""
        return self._steps.made

    @property
    def time(self) -> float:
        """Of this lap [s]."""
        return self.made * self.dt

    @property
    def seconds(self) -> float:
        """That this lap takes [s]."""
        return float(self._begun.time[-1])

    @property
    def dt(self) -> float:
        """Time step [s]."""
        return self._whole.world.dt

    @property
    def states(self) -> States:
        """Of the one world, as they are now; a view."""
        return self._plant.states

    @property
    def range(self) -> tuple[float, float]:
        """Angles [deg] at which the object stands on nothing but its contacts, in the world and as it is believed."""
        ranges = np.rad2deg([self._whole.world.placement.range, self._whole.belief.placement.range])
        return float(ranges[:, 0].max()), float(ranges[:, 1].min())

    @property
    def world(self) -> World:
        """That is simulated."""
        return self._whole.world

    @property
    def angle(self) -> float:
        """At which the scenario's own motion begins [rad]."""
        return float(self._whole.reference[0][0])

    @property
    def length(self) -> float:
        """That Q_w weighs a moment with: it weighs M / length as it does a force [m]."""
        controller = self._whole.belief.attached.controller
        d = controller.space.dim
        return self.world.unit * float(np.sqrt(controller.Q_w[0, 0] / controller.Q_w[d, d]))

    @property
    def momentum(self) -> float:
        """That the object has after a tenth of its natural time of falling, or at a tenth of its lever a second [N s]:
        a shove of a size that one can see."""
        load = self._whole.belief.placement.load
        return 0.1 * (load.force * load.time if isfinite(load.time) else self.world.truth.mass * load.lever)

    @property
    def sideways(self) -> Array:
        """(3,) to the right along the support, or in space across the axis that the object turns about; world axes."""
        table, axis = matrix(self.world.truth.table), self.world.turn[0]
        level = np.cross(table[:, 2], axis)
        size = float(np.linalg.norm(level))
        return level / size if size > 0.5 else table[:, 0]

    @property
    def diverged(self) -> bool:
        """Whether the state is not finite, or beyond all bounds."""
        return not bool((np.abs(self.states.values) <= FAR).all())

    def advance(self, steps: int) -> None:
        """Make some steps, and begin the next lap where one ends."""
        while steps > 0:
            now, start = min(steps, self._begun.steps - self.made), perf_counter()
            self._steps.make(self.made + now)
            self._wall_s += perf_counter() - start
            steps -= now
            if self.diverged:
                self.notes.append(f"Lap {self.lap}: the simulation diverged. Started again.")
                self.restart()
            elif self.made == self._begun.steps:
                self._end_lap()

    def _end_lap(self) -> None:
        """Judge the lap, and go on."""
        verdict = self.run().verdict
        self.passed, self.failed = self.passed + (verdict == "pass"), self.failed + (verdict == "fail")
        angle, rate, _ = self._whole.reference
        closed = max(abs(angle[-1] - angle[0]), abs(rate[0]), abs(rate[-1])) < STILL
        self.laps_left -= 1
        self._ends = self.laps_left == 1
        again = "" if closed or self.laps_left > 0 else " The object was put back to its start."
        self.notes.append(f"Lap {self.lap} of {self.seconds:g} s: {verdict}.{again}")
        if self.laps_left > 0:
            self._begin(from_now(self._reference, self.seconds), self.seconds)
        elif closed:
            self._begin_cycle()
        else:
            self.restart()

    def run(self, first: int = 0) -> Run:
        """This lap from step `first` up to now, of which at least one step was made; nothing is computed again.

        Slip counts from its first step on.
        """
        states, last = slice(first, self.made + 1), self.made
        asked = self._begun.asked
        if not self._ends:  # only the last lap of the scenario's own motion ends on what is to be landed on
            asked = replace(asked, limits=replace(asked.limits, contacts_end=0))
        begun = self._begun._replace(
            asked=asked,
            time=self._begun.time[states],
            reference=_cut(self._begun.reference, states),
            desired=_cut(self._begun.desired, states),
        )
        log = worlds_first(some_steps(self._steps.log, first, last))
        made = self._start, log, self._wall_s
        return kept(begun, self._decided, made, self._decided.events, self._whole.world.warned)

    def go_to(self, theta: float) -> None:
        """Move smoothly to an angle [deg], whatever the motion is now, and stay there.

        Raises:
            ValueError: the object would stand on something else there.
        """
        low, high = self.range
        if not low <= theta <= high:
            raise fail("theta", theta, f"in [{low:.4g}, {high:.4g}] deg")
        natural = self._whole.belief.placement.load.time
        seconds = MOVE * natural if isfinite(natural) else 0.1 * LONGEST
        self.laps_left, self._ends = inf, False
        now = from_now(self._reference, self.time)
        self._begin(Redirected(now, float(np.deg2rad(theta)), seconds), max(0.5 * LONGEST, 2.0 * seconds))

    def change(self, **keys: Any) -> None:
        """Change keys of the scenario, as `Scenario.change`, and go on from the present state if that is possible.

        Raises:
            ValueError, ModelError: all is as it was before.
        """
        time = self.time
        self._set(self.asked.change(**keys))
        angle = np.rad2deg(self.run(self.made - 1).theta[0, -1]) if self.made else None
        batch = Batch(self._whole.world.model, 1, nthread=1, persistent=True)
        if angle is None or not self.range[0] <= angle <= self.range[1] or batch.state.shape != self._batch.state.shape:
            self.notes.append("The object could not go on from where it was: started again.")
            self.restart()
            return
        batch.state[:] = self._batch.state
        self._on(batch)
        self._begin(from_now(self._reference, time), max(self.seconds - time, 0.0))

    def shove(self, impulse: Array, at: Array | None = None) -> None:
        """Push the object for an instant, in the world alone: the controller sees only what comes of it.

        Args:
            impulse: (3,) world axes [N s].
            at: (3,) where, world axes, in the model's unit of length; None: at the centre of mass.
        """
        steps = max(1, round(SHOVED / self.dt))
        self._push(np.asarray(impulse, dtype=float) / (self._whole.world.unit * steps * self.dt), at, steps)

    def pull(self, force: Array, at: Array) -> None:
        """Pull with a force (3,) [the model's unit of force] at a point (3,), until the next call of this or of
        `let_go`."""
        self._push(force, at, np.iinfo(np.int64).max)

    def let_go(self) -> None:
        """End a push."""
        self._apply.steps = 0

    @property
    def _com(self) -> Array:
        """(3,) the true centre of mass, world axes."""
        position, offsets = self.states.position[0], self._whole.world.offsets
        return position if offsets is None else position - rotated(self.states.orientation[0], offsets[0])

    def _push(self, force: Array, at: Array | None, steps: int) -> None:
        away = np.zeros(3) if at is None else at - self._com
        self._apply.push[:] = *force, *np.cross(away, force)
        self._apply.steps = steps


def _cut(samples: Samples, states: slice) -> Samples:
    first, second, third = samples
    return first[states], second[states], third[states]
