"""`simulate`: a closed-loop run, from a scenario to what is measured."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray
from pivoting.controller.orientation_references import Turn
from pivoting.controller.references import Reference
from pivoting.controller.validate import fail
from pivoting.controller.wrench_controller import WrenchController
from pivoting.models.errors import ModelError
from pivoting.models.frames import matrix
from pivoting.models.scenes import load
from pivoting.sim.belief import Believed, believe
from pivoting.sim.engine_log import engine_log
from pivoting.sim.joint_drag import drag_wrench
from pivoting.sim.pipeline.apply_wrench import FreeWrench
from pivoting.sim.pipeline.bounded_control import BoundedControl
from pivoting.sim.pipeline.contact_log import ContactLog
from pivoting.sim.pipeline.law_control import LawControl, LawSolver
from pivoting.sim.pipeline.log import Log
from pivoting.sim.pipeline.loop import Steps, run_steps
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


def simulate(
    name: str | Scenario,
    worlds: int = 1,
    seed: int = 0,
    *,
    controller: WrenchController | None = None,
    control: OwnControlFunction | None = None,
    observe: Observe | None = None,
    first_world: int = 0,
    progress: Callable[[int, int], None] | None = None,
    open_loop: bool = False,
    **overrides: Any,
) -> Run:
    """Run a scenario in closed loop in MuJoCo and measure it.

    Args:
        name: of a shipped scenario, or a `Scenario`.
        worlds: how many; they differ by what is drawn from `seed`: their initial angle errors, and noise if there is
            any. World i of one run is world i of any other with the same seed.
        seed: same seed, same arrays, bit for bit.
        controller: to be tested in place of the scenario's own, which is built from what the scenario believes.
        control: a function of your own that decides on the wrench in place of the controller, see `OwnControl`.
        observe: a function of your own that estimates the states from what is measured, see `stages.Observe`.
        first_world: number of the first world, with which one world of a larger run is run again alone.
        progress: called with (steps done, steps) about a hundred times.
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
    begun = set_up(asked, controller, worlds=worlds, seed=seed, first_world=first_world)
    stages = stages_of(begun, observe)
    decided = decide(begun, stages, law_of(begun, stages), control, open_loop)
    batch = start_batch(begun, decided)
    start = start_of(batch)
    apply = FreeWrench(batch, begun.belief.attached.controller.belief.wrench_map, begun.world.truth.index)
    with engine_log() as warned:
        log, wall_s = run_steps(steps_of(begun, decided, Plant(batch), apply), progress)
    handed = {"controller": controller, "control": control, "observe": observe}
    objects = tuple(name for name, given in handed.items() if given is not None)
    return kept(begun, decided, start, log, wall_s, (*begun.world.warned, *warned), objects)


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


class Decided(NamedTuple):
    """What decides: the control, with the law that it ends in, and the stages around it."""

    control: Control
    per_step: LawControl
    stages: Stages


def set_up(asked: Scenario, controller: WrenchController | None, *, worlds: int, seed: int, first_world: int) -> Begun:
    """The world and the belief of a scenario; arguments and errors as of `simulate`."""
    for key, value, least in (("worlds", worlds, 1), ("seed", seed, 0), ("first_world", first_world, 0)):
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
            raise fail(key, value, f"a whole number >= {least}")
    scene = load(asked.path, body=asked.body, support=asked.support, chosen=asked.chosen)
    belief = believe(asked, scene, controller)
    case = asked.absolute(belief.placement.load)
    world = build_world(case, belief.scene, scene, belief.placement)
    turning = -matrix(belief.placement.body.table)[:, 1:2].T if belief.placement.body.dim == 2 else np.eye(3)
    counts = int(seed), int(worlds), int(first_world)
    setting = Setting(*counts, world.dt, turning, belief.attached.controller.law)
    timed = _timed(case, belief, world, int(worlds))
    return Begun(asked, case, belief, world, *timed, setting)


def on_reference(begun: Begun, reference: Reference, seconds: float) -> Begun:
    """The same world and belief on another reference, for a time [s].

    Raises:
        ValueError: it does not keep the object on its contact.
    """
    case = replace(begun.case, reference=reference, seconds=seconds)
    timed = _timed(case, begun.belief, begun.world, begun.setting.worlds)
    return Begun(begun.asked, case, begun.belief, begun.world, *timed, begun.setting)


def _timed(
    case: Scenario, belief: Believed, world: World, worlds: int
) -> tuple[Array, Samples, Samples, Samples, Turn]:
    """Time, reference, desired, told and follow; see `Begun`."""
    time = _times(case, world.dt, worlds)
    reference, desired, _ = _desired(case, world.placement, time)
    told, follow = _desired(case, belief.placement, time)[1:]  # the controller knows only the table that it believes in
    for values in (time, *reference, *desired):
        values.flags.writeable = False
    return time, reference, desired, told, follow


def stages_of(begun: Begun, observe: Observe | None = None) -> Stages:
    """The stages around the control that the scenario asks for, and an observer of the user's own."""
    stages = build_stages(begun.case.stages, begun.setting)
    return stages if observe is None else stages._replace(observe=(*stages.observe, observe))


def law_of(begun: Begun, stages: Stages) -> LawSolver:
    """The scenario's law, within its bounds."""
    return LawSolver(begun.belief.attached.controller, begun.case.bounds(begun.belief.placement.unit), stages.correct)


def decide(
    begun: Begun, stages: Stages, law: LawSolver, own: OwnControlFunction | None = None, open_loop: bool = False
) -> Decided:
    """The scenario's control, which ends in the `law`, or the user's own."""
    case, (_, attached, there) = begun.case, begun.belief
    bounds, dt = case.bounds(there.unit), begun.world.dt
    per_step = LawControl(law, begun.told, drag_wrench(attached.body, attached.controller, *begun.told))
    if own is not None:
        return Decided(OwnControl(own, begun.told, dt), per_step, stages)
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
    return Decided(control, per_step, stages)


def start_batch(begun: Begun, decided: Decided) -> Batch:
    """The worlds where they start."""
    world, attached = begun.world, begun.belief.attached
    seed, worlds, first = begun.setting[:3]
    batch = Batch(world.model, worlds, nthread=1 if worlds == 1 else 0, persistent=True)
    errors = np.random.default_rng(seed).uniform(-1.0, 1.0, first + worlds)[first:]
    depth = resting_depth(world, attached, decided.per_step, begun.told) if begun.case.chosen else 0.0
    start_worlds(batch, world, begun.desired, np.deg2rad(begun.case.spread) * errors, depth)
    return batch


def start_of(batch: Batch) -> tuple[Array, Array]:
    """qpos (W, nq) and qvel (W, nv) of the worlds as they are, for `Trajectory.start`."""
    start = np.array(batch.bind("qpos")), np.array(batch.bind("qvel"))
    for values in start:
        values.flags.writeable = False
    return start


def steps_of(begun: Begun, decided: Decided, plant: Plant, apply: FreeWrench) -> Steps:
    """The steps that a run is to make, from the states that the plant has."""
    world = begun.world
    table, counts = matrix(world.truth.table), (begun.steps, plant.worlds)
    contacts = ContactLog(world.declared, world.contact_rows, table, world.sensors, *counts)
    widths = begun.belief.attached.controller.widths
    return Steps(plant, decided.stages, decided.control, apply, contacts, begun.steps, widths)


def kept(
    begun: Begun,
    decided: Decided,
    start: tuple[Array, Array],
    log: Log,
    wall_s: float,
    warnings: tuple[str, ...] = (),
    python_objects: tuple[str, ...] = (),
) -> Run:
    """The finished run."""
    planned = decided.control.inner if isinstance(decided.control, BoundedControl) else decided.control
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
        python_objects=python_objects,
    )


def _times(case: Scenario, dt: float, worlds: int) -> Array:
    """(N+1,) when each step begins, and the last ends [s]."""
    steps = round(case.duration / dt)
    if not 2 <= steps <= MAX_STEPS:
        raise fail("seconds", case.duration, f"such that a world takes 2 to {MAX_STEPS} steps, at dt = {dt:g} s")
    if steps * worlds > MAX_STEPS:
        raise fail(
            "worlds", worlds, f"at most {MAX_STEPS // steps}: of {steps} steps each, more are not kept in memory"
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
