"""`simulate`: a closed-loop run, from a scenario to what is measured."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray
from pivoting.controller.orientation_references import Turn
from pivoting.controller.validate import fail
from pivoting.controller.wrench_bounds import WrenchBounds
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
from pivoting.sim.pipeline.loop import run_steps
from pivoting.sim.pipeline.own_control import OwnControl, OwnControlFunction
from pivoting.sim.pipeline.plan_playback import PlanPlayback
from pivoting.sim.pipeline.plant import Plant
from pivoting.sim.pipeline.receding_horizon_control import RecedingHorizonControl
from pivoting.sim.pipeline.stages import Control, Observe, Setting, Stages, build_stages
from pivoting.sim.pipeline.stance_control import StanceControl
from pivoting.sim.placement import Placement
from pivoting.sim.run import Run
from pivoting.sim.scenario_horizon import plan_playback, receding_horizon_control
from pivoting.sim.scenarios.scenario import Scenario
from pivoting.sim.scenarios.shipped_scenarios import scenario
from pivoting.sim.stances import Stance
from pivoting.sim.start_states import Samples, resting_depth, start_worlds
from pivoting.sim.world import World, build_world

Array = NDArray[np.float64]
MAX_STEPS = 10_000_000  # worlds times steps that are kept in memory, about 0.5 kB each


def simulate(
    name: str | Scenario,
    worlds: int = 1,
    seed: int = 0,
    *,
    controller: WrenchController | Sequence[WrenchController] | None = None,
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
        controller: to be tested in place of the scenario's own, which is built from what the scenario believes; or
            one for each world, of the same law and as many contacts, that believe different things.
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
    if asked.landing == "held" and (controller is not None or control is not None):
        if "landing" in overrides:
            raise fail("landing", "held", "left out: a controller or control of your own holds one set of contacts")
        asked = replace(asked, landing="ignored")
    begun = set_up(asked, controller, worlds=worlds, seed=seed, first_world=first_world)
    decided = _control(begun, control, observe, open_loop)
    return _run(begun, decided, progress)


class Begun(NamedTuple):
    """A run that is about to begin: the scenario as it was asked for and `absolute`, and all that follows from it.

    reference: angles, rates, accelerations (N+1,).  desired, told: orientations and their rates, as the world has the
    table and as the controller knows it.  follow: the latter at any time.  setting: of the stages.
    given: whether the controller was handed in.
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
    given: bool

    @property
    def bounds(self) -> WrenchBounds:
        """On the wrench, in the model's units."""
        return self.case.bounds(self.belief.placement.unit)

    @property
    def steps(self) -> int:
        """N."""
        return len(self.time) - 1


class _Decided(NamedTuple):
    """What decides: the control, with the law that it ends in, and the stages around it; what of it was handed in."""

    control: Control
    per_step: LawControl
    stages: Stages
    python_objects: tuple[str, ...]


def set_up(
    asked: Scenario,
    controller: WrenchController | Sequence[WrenchController] | None,
    *,
    worlds: int,
    seed: int,
    first_world: int,
) -> Begun:
    """The world and the belief of a scenario; arguments and errors as of `simulate`."""
    for key, value, least in (("worlds", worlds, 1), ("seed", seed, 0), ("first_world", first_world, 0)):
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
            raise fail(key, value, f"a whole number >= {least}")
    scene = load(asked.path, body=asked.body, support=asked.support, chosen=asked.chosen)
    belief = believe(asked, scene, int(worlds), controller)
    case = asked.absolute(belief.placement.load)
    world = build_world(case, belief.scene, scene, belief.placement)
    time = _times(case, world.dt, int(worlds))
    reference, desired, _ = _desired(case, world.placement, time)
    told, follow = _desired(case, belief.placement, time)[1:]  # the controller knows only the table that it believes in
    for values in (time, *reference, *desired):
        values.flags.writeable = False
    turning = -matrix(belief.placement.body.table)[:, 1:2].T if belief.placement.body.dim == 2 else np.eye(3)
    counts = int(seed), int(worlds), int(first_world)
    setting = Setting(*counts, world.dt, turning, belief.attached.controller.law)
    return Begun(
        asked, case, belief, world, time, reference, desired, told, follow, setting, given=controller is not None
    )


def _control(begun: Begun, own: OwnControlFunction | None, observe: Observe | None, open_loop: bool) -> _Decided:
    """The scenario's control, or the user's own, and the stages around it."""
    case, stances = begun.case, begun.belief.stances
    stages = build_stages(case.stages, begun.setting)
    if observe is not None:
        stages = stages._replace(observe=(*stages.observe, observe))
    solvers = [LawSolver(stance.controllers, begun.bounds, stages.correct) for stance in stances]
    laws = [_law_control(begun, *each) for each in zip(solvers, stances, strict=True)]
    handed = {"controller": begun.given, "control": own is not None, "observe": observe is not None}
    objects = tuple(name for name, there_is in handed.items() if there_is)
    planned = open_loop or case.plan_hz is not None
    if len(stances) > 1 and (planned or stages.correct):
        raise fail("landing", "held", "ignored with a plan or integral action, which know one stance")
    if own is not None:
        return _Decided(OwnControl(own, begun.told, begun.world.dt), laws[0], stages, objects)
    if len(stances) == 1:
        control = _planned(begun, solvers[0], open_loop) if planned else laws[0]
        bounded = control if open_loop else _bounded(begun, control, stances[0])  # a plan is within them
        return _Decided(bounded, laws[0], stages, objects)
    controls = [_bounded(begun, law, stance) for law, stance in zip(laws, stances, strict=True)]
    inner = StanceControl(stances, controls, begun.world.dt, begun.setting.worlds, begun.steps)
    return _Decided(inner, laws[0], stages, objects)


def _law_control(begun: Begun, solver: LawSolver, stance: Stance) -> LawControl:
    """The law of a stance on the scenario's own reference."""
    body = begun.belief.attached.body
    drag = np.stack([drag_wrench(body, controller, *begun.told) for controller in stance.controllers], axis=1)
    return LawControl(solver, begun.told, drag)


def _bounded(begun: Begun, control: Control, stance: Stance) -> Control:
    """A control within the scenario's bounds, where it has any."""
    return BoundedControl(control, stance.controllers, begun.bounds, begun.world.dt) if begun.bounds.any else control


def _planned(begun: Begun, law: LawSolver, open_loop: bool) -> Control:
    """The control that makes plans, or plays one."""
    belief, dt = begun.belief, begun.world.dt
    if belief.attached.body.drag is not None:
        name = belief.attached.body.name
        raise ModelError(f"body = {name!r}: a plan knows no joint damping or friction; must have none")
    if not open_loop:
        worlds = begun.setting.worlds
        return receding_horizon_control(begun.case, belief, law, begun.follow, worlds, dt, begun.steps)
    if len(belief.controllers) > 1:
        raise fail("controller", f"{len(belief.controllers)} of them", "one in open loop, where one plan is played")
    return plan_playback(begun.case, belief, begun.follow, dt, begun.steps)


def _run(begun: Begun, decided: _Decided, progress: Callable[[int, int], None] | None) -> Run:
    """Start the worlds, make the steps, and keep what came of them."""
    world, attached = begun.world, begun.belief.attached
    seed, worlds, first = begun.setting[:3]
    batch = Batch(world.model, worlds, nthread=1 if worlds == 1 else 0, persistent=True)
    errors = np.random.default_rng(seed).uniform(-1.0, 1.0, first + worlds)[first:]
    depth = resting_depth(world, attached, decided.per_step, begun.told) if begun.case.chosen else 0.0
    start_worlds(batch, world, begun.desired, np.deg2rad(begun.case.spread) * errors, depth)
    start = np.array(batch.bind("qpos")), np.array(batch.bind("qvel"))
    for values in start:
        values.flags.writeable = False
    table, wrench_map = matrix(world.truth.table), attached.controller.belief.source.map
    contacts = ContactLog(world.declared, world.contact_rows, table, world.sensors, begun.steps, worlds)
    apply, K = FreeWrench(batch, wrench_map, world.truth.index), len(world.declared.points)
    widths = len(wrench_map), K * world.truth.dim
    with engine_log() as warned:
        log, wall_s = run_steps(
            Plant(batch, world.sensors), decided.stages, decided.control, apply, contacts, begun.steps, widths, progress
        )
    return _kept(begun, decided, start, log, wall_s, (*world.warned, *warned))


def _kept(
    begun: Begun,
    decided: _Decided,
    start: tuple[Array, Array],
    log: Log,
    wall_s: float,
    warnings: tuple[str, ...],
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
        stances=begun.belief.stances,
        stance=decided.control.by_world() if isinstance(decided.control, StanceControl) else None,
        plans=None if horizons is None else horizons.log,
        events=() if horizons is None else tuple(horizons.events),
        engine_warnings=warnings,
        python_objects=decided.python_objects,
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
