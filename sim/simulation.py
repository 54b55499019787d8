"""`simulate`: a closed-loop run, from a scenario to what is measured."""

import os
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from itertools import pairwise
from typing import Any, Literal, overload

import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray
from pivoting.controller.validate import fail, frozen, one_of
from pivoting.models.frames import matrix
from pivoting.sim.belief import Controllers
from pivoting.sim.engine_log import engine_log
from pivoting.sim.fleet import Fleet, Handed
from pivoting.sim.keep import KEEP
from pivoting.sim.pipeline.apply_wrench import FreeWrench
from pivoting.sim.pipeline.bounded_control import BoundedControl
from pivoting.sim.pipeline.contact_log import ContactLog
from pivoting.sim.pipeline.law_control import LawControl
from pivoting.sim.pipeline.log import Log, empty_log, some_worlds, worlds_first
from pivoting.sim.pipeline.loop import Steps, run_steps
from pivoting.sim.pipeline.own_control import OwnControlFunction
from pivoting.sim.pipeline.plan_log import Event
from pivoting.sim.pipeline.plan_playback import PlanPlayback
from pivoting.sim.pipeline.plant import Plant
from pivoting.sim.pipeline.receding_horizon_control import RecedingHorizonControl
from pivoting.sim.pipeline.stages import Observe
from pivoting.sim.pipeline.stance_control import StanceControl
from pivoting.sim.run import Run
from pivoting.sim.run_setup import Begun, refuse_too_many, set_up
from pivoting.sim.scenario_control import Decided, decide, laws_of, stages_of
from pivoting.sim.scenarios.scenario import Scenario
from pivoting.sim.scenarios.shipped_scenarios import scenario
from pivoting.sim.start_states import resting_depths, start_worlds
from pivoting.sim.world import World

Array = NDArray[np.float64]
LANE = 64  # worlds that are worth a thread
MOST_IN_LANE = 128  # worlds that are stepped together: what MuJoCo keeps of them stays in the caches


@overload
def simulate(
    name: str | Scenario,
    worlds: int = ...,
    seed: int = ...,
    *,
    keep: Literal["all"] = ...,
    controller: Controllers = ...,
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
    controller: Controllers = None,
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
        controller: to be tested in place of the scenario's own, which is built from what the scenario believes; or
            one for each world, of the same law and as many contacts, that believe different things.
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
    if asked.landing == "held" and (controller is not None or control is not None):
        if "landing" in asked.given:
            raise fail("landing", "held", "left out: a controller or control of your own holds one set of contacts")
        asked = replace(asked, landing="ignored")
    one_of("keep", keep, tuple(KEEP))
    if open_loop and keep != "all":
        raise fail("keep", keep, "'all' in open loop, where one plan is played in all worlds together")
    begun = set_up(asked, controller, worlds=worlds, seed=seed, first_world=first_world)
    handed = Handed(controller, control, observe)
    if keep == "all":
        refuse_too_many(begun)
        return run_worlds(begun, handed, progress, engine_log(), open_loop)
    from pivoting.sim.chunks import run_in_chunks  # which runs worlds

    return run_in_chunks(begun, handed, keep, progress)


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
    decided = _decided(begun, handed, open_loop)
    bounds = _lanes(begun.setting.worlds) if _plain(decided, handed) else [(0, begun.setting.worlds)]
    log, lanes, starts, parts = new_log(begun, decided), [], [], []
    begun.world.read()
    for first, last in bounds:
        part = begun.part(first, last - first)
        own = decided if len(bounds) == 1 else _decided(part, handed, open_loop)
        batch = start_batch(part, own, threads=1 if len(bounds) > 1 else 0)
        starts.append(start_of(batch))
        apply = free_wrench(part, batch)
        plant = Plant(batch, begun.world.sensors)
        for disturb in own.stages.disturb:
            disturb.begin(batch, begun.world)
        lanes.append(steps_of(part, own, plant, apply, some_worlds(log, first, last)))
        parts.append((first, own))
    with hearing as warned:
        wall_s = run_steps(lanes, progress)
    log.control_ns[:] = sum(lane.log.control_ns for lane in lanes)
    qpos, qvel = (frozen(np.concatenate(values)) for values in zip(*starts, strict=True))
    made = (qpos, qvel), worlds_first(log), wall_s
    events = [event._replace(world=first + event.world) for first, own in parts for event in own.events]
    return kept(begun, decided, made, events, (*begun.world.warned, *warned), handed.names)


def _decided(begun: Begun, handed: Handed, open_loop: bool) -> Decided:
    """What decides in these worlds."""
    stages = stages_of(begun, handed.observe)
    return decide(begun, stages, laws_of(begun, stages), handed.control, open_loop)


def _plain(decided: Decided, handed: Handed) -> bool:
    """Whether Python has little to do at a step: no plan is made, and no function of the user's own is called."""
    return isinstance(decided.asked, LawControl) and handed.observe is None


def _lanes(worlds: int) -> list[tuple[int, int]]:
    """The first and one past the last world of each part: at least one for each processor, and not too many in one."""
    parts = max(1, min(os.cpu_count() or 1, worlds // LANE), -(-worlds // MOST_IN_LANE))
    return list(pairwise(worlds * part // parts for part in range(parts + 1)))


def new_batch(world: World, worlds: int, threads: int = 1) -> Batch:
    """So many worlds, each with what it has of its own; `threads` as of `start_batch`."""
    differing = world.differing
    model = world.model if differing is None else differing.bare
    batch = Batch(model, worlds, nthread=1 if worlds == 1 else threads, persistent=True)
    if differing is not None:
        differing.fill(batch)
    return batch


def free_wrench(begun: Begun, batch: Batch) -> FreeWrench:
    """What applies the wrench to these worlds."""
    source, world = begun.belief.attached.controller.belief.source, begun.world
    return FreeWrench(batch, source.map, world.truth.index, world.offsets)


def start_batch(begun: Begun, decided: Decided, threads: int = 1) -> Batch:
    """The worlds where they start; `threads`: that MuJoCo steps them with, 0 for as many as there are processors."""
    world, controllers = begun.world, begun.belief.controllers
    seed, worlds, first = begun.setting[:3]
    batch = new_batch(world, worlds, threads)
    draws = np.random.Generator(np.random.PCG64(seed).advance(first))  # a number for each world
    errors = draws.uniform(-1.0, 1.0, worlds)
    depths = resting_depths(world, controllers, decided.per_step, begun.told) if begun.case.chosen else np.zeros(1)
    start_worlds(batch, world, begun.desired, np.deg2rad(begun.case.spread) * errors, depths)
    return batch


def start_of(batch: Batch) -> tuple[Array, Array]:
    """qpos (W, nq) and qvel (W, nv) of the worlds as they are, for `Trajectory.start`."""
    return frozen(np.array(batch.bind("qpos"))), frozen(np.array(batch.bind("qvel")))


def new_log(begun: Begun, decided: Decided) -> Log:
    """The log of all worlds and steps, yet to be written."""
    nw, _ = begun.belief.attached.controller.widths
    declared = len(begun.world.declared.points)
    widths = nw, declared * begun.world.truth.dim
    return empty_log(begun.steps, begun.setting.worlds, widths, declared, decided.stages)


def steps_of(begun: Begun, decided: Decided, plant: Plant, apply: FreeWrench, log: Log) -> Steps:
    """The steps that a run is to make, from the states that the plant has, written to the log of its worlds."""
    world = begun.world
    table = matrix(world.truth.table)
    rows = [each.rows for each in world.truths]
    contacts = ContactLog(world.declared, rows, table, world.sensors, plant.worlds, log.contacts, log.held)
    return Steps(plant, decided.stages, decided.asked, apply, contacts, log)


def kept(
    begun: Begun,
    decided: Decided,
    made: tuple[tuple[Array, Array], Log, float],
    events: Sequence[Event],
    warnings: tuple[str, ...] = (),
    python_objects: tuple[str, ...] = (),
) -> Run:
    """The finished run; `made`: where it started, its log, and the time that it took [s]; `events`: of all worlds."""
    start, log, wall_s = made
    control = decided.control
    planned = control.inner if isinstance(control, BoundedControl) else control
    horizons = planned if isinstance(planned, RecedingHorizonControl) else None
    return Run(
        **begun.experiment,
        start=start,
        desired=begun.desired,
        log=log,
        wall_s=wall_s,
        plan=planned.plan if isinstance(planned, PlanPlayback) else None,
        stance=control.by_world() if isinstance(control, StanceControl) else None,
        plans=None if horizons is None else horizons.log,
        events=tuple(sorted(events, key=lambda event: event.time)),
        engine_warnings=warnings,
        python_objects=python_objects,
    )
