"""What a run needs before it begins: the world, the belief, the reference; from a scenario."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.orientation_references import Turn
from pivoting.controller.references import Reference
from pivoting.controller.validate import fail, frozen
from pivoting.controller.wrench_bounds import WrenchBounds
from pivoting.models.frames import matrix
from pivoting.models.scenes import load
from pivoting.sim.belief import Believed, Controllers, believe
from pivoting.sim.pipeline.stages import Setting
from pivoting.sim.placement import Placement
from pivoting.sim.scenarios.scenario import Scenario
from pivoting.sim.start_states import Samples
from pivoting.sim.world import World, build_world

Array = NDArray[np.float64]
MOST = 10**15  # worlds, and their numbers: more than can be run
MAX_STEPS = 10_000_000  # worlds times steps that are kept in memory, about 0.5 kB each


class Begun(NamedTuple):
    """A run that is about to begin: the scenario as it was asked for and `absolute`, and all that follows from it.

    reference: angles, rates, accelerations (N+1,).  desired, told: orientations and their rates, as the world has the
    table and as the controller knows it.  follow: the latter at any time.  setting: of the stages.
    """

    asked: Scenario
    case: Scenario
    belief: Believed
    world: World
    time: Array
    reference: Samples
    desired: Samples
    told: Samples
    follow: Turn
    setting: Setting

    @property
    def bounds(self) -> WrenchBounds:
        """On the wrench, in the model's units."""
        return self.case.bounds(self.belief.placement.unit)

    @property
    def steps(self) -> int:
        """N."""
        return len(self.time) - 1

    @property
    def experiment(self) -> dict[str, Any]:
        """What is known before it runs, by field of `Experiment`."""
        return {
            "scenario": self.asked,
            "seed": self.setting.seed,
            "first_world": self.setting.first_world,
            "attached": self.belief.attached,
            "load": self.belief.placement.load,
            "world": self.world,
            "stances": self.belief.stances,
            "time": self.time,
            "reference": self.reference,
        }

    def part(self, first: int, worlds: int) -> "Begun":
        """The same for some of the worlds, from that with the index `first` on."""
        setting = self.setting
        belief = self.belief.part(first, worlds)
        some = setting._replace(worlds=worlds, first_world=setting.first_world + first, controllers=belief.controllers)
        return self._replace(setting=some, belief=belief)


def set_up(
    asked: Scenario,
    controller: Controllers,
    *,
    worlds: int,
    seed: int,
    first_world: int,
) -> Begun:
    """The world and the belief of a scenario; arguments and errors as of `simulate`."""
    for key, value, least in (("worlds", worlds, 1), ("seed", seed, 0), ("first_world", first_world, 0)):
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
            raise fail(key, value, f"a whole number >= {least}")
        if key != "seed" and value >= MOST:
            raise fail(key, value, f"a whole number < {MOST:g}")
    scene = load(asked.path, body=asked.body, support=asked.support, chosen=asked.chosen)
    belief = believe(asked, scene, int(worlds), controller)
    case = asked.absolute(belief.placement.load)
    world = build_world(case, belief.scene, scene, belief.placement)
    turning = -matrix(belief.placement.body.table)[:, 1:2].T if belief.placement.body.dim == 2 else np.eye(3)
    counts = int(seed), int(worlds), int(first_world)
    setting = Setting(*counts, world.dt, turning, belief.attached.controller.law, belief.controllers)
    timed = _timed(case, belief, world)
    return Begun(asked, case, belief, world, *timed, setting)


def on_reference(begun: Begun, reference: Reference, seconds: float) -> Begun:
    """The same world and belief on another reference, for a time [s].

    Raises:
        ValueError: it does not keep the object on its contact.
    """
    case = replace(begun.case, reference=reference, seconds=seconds)
    timed = _timed(case, begun.belief, begun.world)
    return Begun(begun.asked, case, begun.belief, begun.world, *timed, begun.setting)


def refuse_too_many(begun: Begun) -> None:
    """Raise if all steps of all worlds are more than are kept in memory.

    Raises:
        ValueError: they are; it says how many there may be.
    """
    worlds, steps = begun.setting.worlds, begun.steps
    if steps * worlds > MAX_STEPS:
        told = f"at most {MAX_STEPS // steps}: of {steps} steps each, more are not kept in memory"
        raise fail("worlds", worlds, f"{told}; or any number with keep = 'measures'")


def _timed(case: Scenario, belief: Believed, world: World) -> tuple[Array, Samples, Samples, Samples, Turn]:
    """Time, reference, desired, told and follow; see `Begun`."""
    time = _times(case, world.dt)
    reference, desired, _ = _desired(case, world.placement, time)
    told, follow = _desired(case, belief.placement, time)[1:]  # the controller knows only the table that it believes in
    for values in (time, *reference, *desired):
        frozen(values)
    return time, reference, desired, told, follow


def _times(case: Scenario, dt: float) -> Array:
    """(N+1,) when each step begins, and the last ends [s]."""
    steps = round(case.duration / dt)
    if not 2 <= steps <= MAX_STEPS:
        raise fail("seconds", case.duration, f"such that a world takes 2 to {MAX_STEPS} steps, at dt = {dt:g} s")
    if steps * dt <= case.limits.settle_s:
        raise fail("seconds", case.duration, f"more than the {case.limits.settle_s:g} s that the verdict lets settle")
    time: Array = dt * np.arange(steps + 1, dtype=float)
    return time


def _desired(case: Scenario, there: Placement, time: Array) -> tuple[Samples, Samples, Turn]:
    """The reference at every step, as angles and as orientations, and as what gives the latter at any time.

    Checked: whatever it says of itself, it has to keep the object on its contact.
    """
    angle, rate, acceleration = case.samples(time)
    low, high = np.rad2deg([angle.min(), angle.max()])
    least, most = np.rad2deg(there.range)
    if not least - 1e-9 <= low <= high <= most + 1e-9:
        raise fail("reference", f"angles from {low:g} to {high:g} deg", f"in [{least:.4g}, {most:.4g}] deg")
    turn = Turn(case.motion, there.axis, there.start)
    q, omega, alpha = (np.array(values, dtype=float) for values in turn(time))
    return (angle, rate, acceleration), (q, omega, alpha), turn
