"""`simulate`: a closed-loop run, from a scenario to what is measured."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any, Literal, NamedTuple, overload

import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray
from pivoting.controller.orientation_references import Turn
from pivoting.controller.validate import fail, one_of
from pivoting.controller.wrench_controller import WrenchController
from pivoting.models.errors import ModelError
from pivoting.models.frames import matrix
from pivoting.models.scenes import load
from pivoting.sim.belief import Believed, believe
from pivoting.sim.engine_log import engine_log
from pivoting.sim.fleet import Fleet, Handed
from pivoting.sim.joint_drag import drag_wrench
from pivoting.sim.keep import KEEP
from pivoting.sim.pipeline.apply_wrench import FreeWrench
from pivoting.sim.pipeline.bounded_control import BoundedControl
from pivoting.sim.pipeline.contact_log import ContactLog
from pivoting.sim.pipeline.law_control import LawControl, LawSolver
from pivoting.sim.pipeline.log import Log
from pivoting.sim.pipeline.loop import run_steps
from pivoting.sim.pipeline.own_control import OwnControl, OwnControlFunction
from pivoting.sim.pipeline.plan_playback import PlanPlayback
from pivoting.sim.pipeline.plant import Plant
from pivoting.sim.pipeline.receding_horizon_control import RecedingHorizonControl
from pivoting.sim.pipeline.stages import Control, Observe, Setting, Stages, build_stages
from pivoting.sim.placement import Placement
from pivoting.sim.run import Run
from pivoting.sim.scenario_horizon import plan_playback, receding_horizon_control
from pivoting.sim.scenarios.scenario import Scenario
from pivoting.sim.scenarios.shipped_scenarios import scenario
from pivoting.sim.start_states import Samples, resting_depth, start_worlds
from pivoting.sim.world import World, build_world

Array = NDArray[np.float64]
MAX_STEPS = 10_000_000  # worlds times steps that are kept in memory, about 0.5 kB each


@overload
def simulate(
    name: str | Scenario,
    worlds: int = ...,
    seed: int = ...,
    *,
    keep: Literal["all"] = ...,
    controller: WrenchController | None = ...,
    control: OwnControlFunction | None = ...,
    observe: Observe | None = ...,
    first_world: int = ...,
    progress: Callable[[int, int], None] | None = ...,
    open_loop: bool = ...,
    **overrides: Any,
) -> Run: ...
@overload
def simulate(
    name: str | Scenario, worlds: int = ..., seed: int = ..., *, keep: Literal["reduced", "measures"], **others: Any
) -> Fleet: ...
@overload
def simulate(name: str | Scenario, worlds: int = ..., seed: int = ..., *, keep: str, **others: Any) -> Run | Fleet: ...
def simulate(
    name: str | Scenario,
    worlds: int = 1,
    seed: int = 0,
    *,
    keep: str = "all",
    controller: WrenchController | None = None,
    control: OwnControlFunction | None = None,
    observe: Observe | None = None,
    first_world: int = 0,
    progress: Callable[[int, int], None] | None = None,
    open_loop: bool = False,
    **overrides: Any,
) -> Run | Fleet:
    """Run a scenario in closed loop in MuJoCo and measure it.

    Args:
        name: of a shipped scenario, or a `Scenario`.
        worlds: how many; they differ by what is drawn from `seed`: their initial angle errors, and noise if there is
            any. World i of one run is world i of any other with the same seed.
        seed: same seed, same arrays, bit for bit.
        keep: "all" gives a `Run`, with every array of every step. "measures" and "reduced" give a `Fleet`, with the
            measures of each world, and some 200 samples of each: its worlds are run in chunks, so that there may be any
            number, and functions of your own are asked for the worlds of a chunk, chunk after chunk.
        controller: to be tested in place of the scenario's own, which is built from what the scenario believes.
        control: a function of your own that decides on the wrench in place of the controller, see `OwnControl`.
        observe: a function of your own that estimates the states from what is measured, see `stages.Observe`.
        first_world: number of the first world, with which one world of a larger run is run again alone.
        progress: called with (steps done, steps) about a hundred times; of a fleet for each chunk, steps times worlds.
        open_loop: plan the whole motion once, in steps of `plan_step`, and apply those wrenches whatever happens; the
            run's `plan` is then to be compared with what MuJoCo makes of it.
        overrides: keys of the scenario; `world={"mu": 0.2}` or `**{"world.mu": 0.2}` changes the world alone.

    Raises:
        ValueError: an unknown scenario or key, or a value out of range; it is named.
        PlanError: open loop, and there is no plan.
    """
    if not isinstance(name, str | Scenario):
        raise fail("scenario", name, "a name or a Scenario")
    asked = (scenario(name) if isinstance(name, str) else name).change(**overrides)
    asked.refuse_without_effect(overrides, open_loop)
    one_of("keep", keep, tuple(KEEP))
    if open_loop and keep != "all":
        raise fail("keep", keep, "'all' in open loop, where one plan is played in all worlds together")
    begun = set_up(asked, controller, worlds=worlds, seed=seed, first_world=first_world, keep=keep)
    handed = Handed(controller, control, observe)
    if keep == "all":
        return run_worlds(begun, handed, progress, engine_log(), open_loop)
    from pivoting.sim.chunks import run_in_chunks  # which runs worlds

    return run_in_chunks(begun, handed, keep, progress)


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
    def steps(self) -> int:
        """N."""
        return len(self.time) - 1

    def part(self, first: int, worlds: int) -> "Begun":
        """The same for some of the worlds, from that with the index `first` on."""
        setting = self.setting
        return self._replace(setting=setting._replace(worlds=worlds, first_world=setting.first_world + first))


class _Decided(NamedTuple):
    """What decides: the control, with the law that it ends in, and the stages around it."""

    control: Control
    per_step: LawControl
    stages: Stages


def set_up(
    asked: Scenario,
    controller: WrenchController | None,
    *,
    worlds: int,
    seed: int,
    first_world: int,
    keep: str = "all",
) -> Begun:
    """The world and the belief of a scenario; arguments and errors as of `simulate`."""
    for key, value, least in (("worlds", worlds, 1), ("seed", seed, 0), ("first_world", first_world, 0)):
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
            raise fail(key, value, f"a whole number >= {least}")
    scene = load(asked.path, body=asked.body, support=asked.support, chosen=asked.chosen)
    belief = believe(asked, scene, controller)
    case = asked.absolute(belief.placement.load)
    world = build_world(case, belief.scene, scene, belief.placement)
    time = _times(case, world.dt, int(worlds) if keep == "all" else 1)
    reference, desired, _ = _desired(case, world.placement, time)
    told, follow = _desired(case, belief.placement, time)[1:]  # the controller knows only the table that it believes in
    for values in (time, *reference, *desired):
        values.flags.writeable = False
    turning = -matrix(belief.placement.body.table)[:, 1:2].T if belief.placement.body.dim == 2 else np.eye(3)
    counts = int(seed), int(worlds), int(first_world)
    setting = Setting(*counts, world.dt, turning, belief.attached.controller.law)
    return Begun(asked, case, belief, world, time, reference, desired, told, follow, setting)


def _control(begun: Begun, handed: Handed, open_loop: bool) -> _Decided:
    """The scenario's control, or the user's own, and the stages around it."""
    _, own, observe = handed
    case, (_, attached, there) = begun.case, begun.belief
    stages = build_stages(case.stages, begun.setting)
    if observe is not None:
        stages = stages._replace(observe=(*stages.observe, observe))
    bounds, dt = case.bounds(there.unit), begun.world.dt
    law = LawSolver(attached.controller, bounds, stages.correct)
    per_step = LawControl(law, begun.told, drag_wrench(attached.body, attached.controller, *begun.told))
    if own is not None:
        return _Decided(OwnControl(own, begun.told, dt, begun.setting.first_world), per_step, stages)
    if attached.body.drag is not None and (open_loop or case.plan_hz is not None):
        raise ModelError(f"body = {attached.body.name!r}: a plan knows no joint damping or friction; must have none")
    control: Control = per_step
    if open_loop:
        control = plan_playback(case, begun.belief, begun.follow, dt, begun.steps)
    elif case.plan_hz is not None:
        worlds = begun.setting.worlds
        control = receding_horizon_control(case, begun.belief, law, begun.follow, worlds, dt, begun.steps)
    if bounds.any and not open_loop:  # a plan is within them
        control = BoundedControl(control, attached.controller, bounds, dt)
    return _Decided(control, per_step, stages)


def run_worlds(
    begun: Begun,
    handed: Handed,
    progress: Callable[[int, int], None] | None,
    hearing: AbstractContextManager[list[str]],
    open_loop: bool = False,
) -> Run:
    """Start the worlds with a control that knows of none before, make the steps, and keep what came of them.

    Args:
        hearing: what gives MuJoCo's warnings, an `engine_log`.
    """
    decided = _control(begun, handed, open_loop)
    world, attached = begun.world, begun.belief.attached
    seed, worlds, first = begun.setting[:3]
    batch = Batch(world.model, worlds, nthread=1 if worlds == 1 else 0, persistent=True)
    errors = np.random.default_rng(seed).uniform(-1.0, 1.0, first + worlds)[first:]
    depth = resting_depth(world, attached, decided.per_step, begun.told) if begun.case.chosen else 0.0
    start_worlds(batch, world, begun.desired, np.deg2rad(begun.case.spread) * errors, depth)
    start = np.array(batch.bind("qpos")), np.array(batch.bind("qvel"))
    for values in start:
        values.flags.writeable = False
    table, wrench_map = matrix(world.truth.table), attached.controller.belief.wrench_map
    contacts = ContactLog(world.declared, world.contact_rows, table, world.sensors, begun.steps, worlds)
    apply, widths = FreeWrench(batch, wrench_map, world.truth.index), attached.controller.widths
    with hearing as warned:
        log, wall_s = run_steps(
            Plant(batch), decided.stages, decided.control, apply, contacts, begun.steps, widths, progress
        )
    return _kept(begun, handed, decided.control, (start, log, wall_s), (*world.warned, *warned))


def _kept(
    begun: Begun,
    handed: Handed,
    control: Control,
    made: tuple[tuple[Array, Array], Log, float],
    warnings: tuple[str, ...],
) -> Run:
    """The finished run; `made`: where it started, its log, and the time that it took [s]."""
    start, log, wall_s = made
    planned = control.inner if isinstance(control, BoundedControl) else control
    horizons = planned if isinstance(planned, RecedingHorizonControl) else None
    return Run(
        scenario=begun.asked,
        seed=begun.setting.seed,
        first_world=begun.setting.first_world,
        attached=begun.belief.attached,
        load=begun.belief.placement.load,
        world=begun.world,
        start=start,
        time=begun.time,
        reference=begun.reference,
        desired=begun.desired,
        log=log,
        wall_s=wall_s,
        plan=planned.plan if isinstance(planned, PlanPlayback) else None,
        plans=None if horizons is None else horizons.log,
        events=() if horizons is None else tuple(horizons.events),
        engine_warnings=warnings,
        python_objects=handed.names,
    )


def _times(case: Scenario, dt: float, worlds: int) -> Array:
    """(N+1,) when each step begins, and the last ends [s]."""
    steps = round(case.duration / dt)
    if not 2 <= steps <= MAX_STEPS:
        raise fail("seconds", case.duration, f"such that a world takes 2 to {MAX_STEPS} steps, at dt = {dt:g} s")
    if steps * worlds > MAX_STEPS:
        raise fail(
            "worlds",
            worlds,
            f"at most {MAX_STEPS // steps}: of {steps} steps each, more are not kept in memory; or any number with"
            " keep = 'measures'",
        )
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
