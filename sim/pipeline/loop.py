"""The steps of a closed loop: sense, observe, control, actuate, apply, disturb, step; all of it is logged."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from itertools import chain
from threading import Event
from time import perf_counter, perf_counter_ns

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.kernels.compilation import first_calls
from pivoting.controller.kernels.compiled_step import STATE
from pivoting.controller.kernels.second_compiler import compiled_beside
from pivoting.controller.validate import fail, frozen
from pivoting.sim.contact_sensing import sort_contacts
from pivoting.sim.pipeline.apply_wrench import FreeWrench
from pivoting.sim.pipeline.contact_log import ContactLog
from pivoting.sim.pipeline.log import Log
from pivoting.sim.pipeline.plant import Plant
from pivoting.sim.pipeline.stages import Answers, Control, Stages, States

Array = NDArray[np.float64]


class Steps:
    """The steps of some worlds, some at a time: what each of the stages gives is logged.

    Args:
        log: of all N steps of these worlds, with (step, world) first, in which they are written.

    Attributes:
        log: as given; steps beyond `made` are yet to be written.
        made: how many steps were made.
    """

    def __init__(
        self,
        plant: Plant,
        stages: Stages,
        control: Control,
        apply: FreeWrench,
        contacts: ContactLog,
        log: Log,
    ):
        self._plant, self._stages, self._control, self._apply, self._contacts = plant, stages, control, apply, contacts
        self.log, self.made = log, 0
        # of the readings of one step alone the batch has the array; of several this one, shown likewise: read-only
        self._block = np.empty((min(len(log.control_ns), contacts.most), *plant.sensed.shape))
        self._readings = plant.sensed[None] if len(self._block) == 1 else frozen(self._block.view())
        self._before: Array | None = None
        self.log.states[0] = plant.sensed[:, :STATE]

    def prepare(self) -> None:
        """Compile all that a step calls, so that no step waits for it."""
        log, states = self.log, self._plant.states
        nw, nothing = log.answers.nw, (log.states[:0], self._readings[:0])
        with first_calls():
            with compiled_beside(sort_contacts, *self._contacts.arguments(*nothing)):
                first_answers = Answers(log.answers.values[0], log.answers.status[0], nw)
                self._control.prepare(states, first_answers)
                for prepare in (getattr(stage, "prepare", None) for stage in chain(*self._stages)):
                    if prepare is not None:
                        prepare()
                self._apply(states, first_answers.values, nw, log.wrench_world[0])
            self._contacts.sort(0, *nothing)

    def make(self, last: int, progress: Callable[[int, int], None] | None = None) -> None:
        """Make the steps up to number `last`.

        Args:
            progress: called with (steps done, steps) about a hundred times in N steps.
        """
        plant, stages, control, apply, contacts = self._plant, self._stages, self._control, self._apply, self._contacts
        log, block, before, states = self.log, self._block, self._before, plant.states
        readings = self._readings
        nw, steps, first = log.answers.nw, len(log.control_ns), self.made
        report = max(1, steps // 100)
        answers = zip(log.answers.values[first:last], log.answers.status[first:last], strict=True)
        for k, (values, status) in enumerate(answers, first):
            tick = perf_counter_ns()
            seen = states if not stages.sense and not stages.observe else _seen(k, states, before, stages, log)
            control(k, seen, before, answer := Answers(values, status, nw))
            log.control_ns[k] = perf_counter_ns() - tick
            before = answer.wrench
            acting, column = (values, nw) if not stages.actuate else (_acting(k, before, stages, log), 0)
            apply(states, acting, column, log.wrench_world[k])
            if stages.disturb:
                _disturb(k, stages, apply, log)
            plant.step()
            if len(block) > 1:
                block[k - first] = plant.sensed
            if k + 1 - first == len(block) or k + 1 == last:
                sensed = readings[: k + 1 - first]
                log.states[first + 1 : k + 2] = sensed[..., :STATE]
                contacts.sort(first, log.states[first : k + 1], sensed)
                first = k + 1
            if progress is not None and (k + 1) % report == 0:
                progress(k + 1, steps)
        self.made, self._before = last, before


def run_steps(lanes: Sequence[Steps], progress: Callable[[int, int], None] | None) -> float:
    """Make all steps of all worlds, whose parts are stepped at the same time, as many as there are processors.

    Args:
        lanes: of the parts, each of which one thread for each processor steps to its end before it takes another; what
            they call, MuJoCo and the kernels, runs without the interpreter's lock.
        progress: see `Steps.make`; it is called from this thread.

    Returns:
        The time that it took [s].
    """
    for steps in lanes:
        steps.prepare()  # compiled before it is timed
    start = perf_counter()
    every, stop, others = len(lanes[0].log.control_ns), Event(), list[Future[None]]()
    made = [0] * len(lanes)

    def make(i: int) -> None:
        def unless_stopped(done: int, of: int) -> None:
            if stop.is_set():
                raise CancelledError  # another lane has failed, whose error is raised
            made[i] = done

        lanes[i].make(every, unless_stopped)

    def make_here(i: int) -> None:
        def unless_failed(done: int, of: int) -> None:
            for other in others:
                if other.done() and not other.cancelled():
                    other.result()
            made[i] = done
            if progress is not None:
                progress(sum(made) // len(made), of)

        lanes[i].make(every, unless_failed)

    with ThreadPoolExecutor(max(1, min(len(lanes), os.cpu_count() or 1) - 1)) as pool:
        try:
            others += [pool.submit(make, i) for i in range(1, len(lanes))]
            make_here(0)
            for i in range(len(lanes) - 1, 0, -1):  # the last are those that no other thread has begun
                if others[i - 1].cancel():
                    make_here(i)
            for other in others:
                if not other.cancelled():
                    other.result()
            if progress is not None and len(lanes) > 1:
                progress(every, every)
        finally:  # after an error, or an interrupt, which only this thread gets
            stop.set()
            pool.shutdown(cancel_futures=True)
    return perf_counter() - start


def _seen(k: int, states: States, before: Array | None, stages: Stages, log: Log) -> States:
    """What the control is told of the states: as they are measured and estimated."""
    states = states.copy()
    for sense in stages.sense:
        states = sense(k, states)
    if log.measured is not None:
        log.measured[k] = states.values
    for observe in stages.observe:
        states = observe(k, states, before)
        if not isinstance(states, States):
            raise fail("observe", type(states).__name__, "a function that returns States, as states.changed(...) makes")
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


def _disturb(k: int, stages: Stages, apply: FreeWrench, log: Log) -> None:
    """Whatever else happens in a step."""
    assert log.disturbance is not None
    for disturb in stages.disturb:
        added = disturb(k)
        if added is not None:
            apply.add(added)
            log.disturbance[k] += added
