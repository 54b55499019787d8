"""The steps of a closed loop: sense, observe, control, actuate, apply, step; and what each of them gives is logged."""

from collections.abc import Callable
from time import perf_counter, perf_counter_ns

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.kernels.compilation import first_calls
from pivoting.controller.kernels.compiled_step import STATE
from pivoting.sim.pipeline.apply_wrench import FreeWrench
from pivoting.sim.pipeline.contact_log import BLOCK, ContactLog
from pivoting.sim.pipeline.log import Log, empty_log, worlds_first
from pivoting.sim.pipeline.plant import Plant
from pivoting.sim.pipeline.stages import Answers, Control, Stages, States

Array = NDArray[np.float64]


def run_steps(
    plant: Plant,
    stages: Stages,
    control: Control,
    apply: FreeWrench,
    contacts: ContactLog,
    steps: int,
    widths: tuple[int, int],
    progress: Callable[[int, int], None] | None,
) -> tuple[Log, float]:
    """Step all worlds to the end.

    Args:
        widths: nw and K d.
        progress: called with (steps done, steps) about a hundred times.

    Returns:
        The log, and the time that it took [s].
    """
    log = empty_log(steps, plant.worlds, widths, (contacts.readings, contacts.held), stages)
    block = np.empty((max(1, min(steps, BLOCK // plant.worlds)), *plant.sensed.shape))
    states, nw = plant.states, log.answers.nw
    log.states[0] = plant.sensed[:, :STATE]
    with first_calls():  # compiled before it is timed
        first_answers = Answers(log.answers.values[0], log.answers.status[0], nw)
        control.prepare(states, first_answers)
        apply(states, first_answers.values, nw, log.wrench_world[0])
        contacts.sort(0, log.states[:0], block[:0])
    report, first = max(1, steps // 100), 0
    start = perf_counter()
    before: Array | None = None
    for k, (values, status) in enumerate(zip(*log.answers[:2], strict=True)):
        tick = perf_counter_ns()
        seen = states if not stages.sense and not stages.observe else _seen(k, states, before, stages, log)
        control(k, seen, before, answers := Answers(values, status, nw))
        log.control_ns[k] = perf_counter_ns() - tick
        before = answers.wrench
        acting, column = (values, nw) if not stages.actuate else (_acting(k, before, stages, log), 0)
        apply(states, acting, column, log.wrench_world[k])
        plant.step()
        block[k - first] = plant.sensed
        if k + 1 - first == len(block) or k + 1 == steps:
            sensed = block[: k + 1 - first]
            log.states[first + 1 : k + 2] = sensed[..., :STATE]
            contacts.sort(first, log.states[first : k + 1], sensed)
            first = k + 1
        if progress is not None and (k + 1) % report == 0:
            progress(k + 1, steps)
    return worlds_first(log), perf_counter() - start


def _seen(k: int, states: States, before: Array | None, stages: Stages, log: Log) -> States:
    """What the control is told of the states: as they are measured and estimated."""
    states = states.copy()
    for sense in stages.sense:
        states = sense(k, states)
    if log.measured is not None:
        log.measured[k] = states.values
    for observe in stages.observe:
        states = observe(k, states, before)
    if log.estimated is not None:
        log.estimated[k] = states.values
    return states


def _acting(k: int, wrench: Array, stages: Stages, log: Log) -> Array:
    """What the actuators make of the wrenches that are asked for."""
    for actuate in stages.actuate:
        wrench = actuate(k, wrench)
    assert log.acting is not None
    log.acting[k] = wrench
    return wrench
