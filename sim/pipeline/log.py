"""What is kept of a run: the output of every stage at every step."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.kernels.compiled_step import STATE
from pivoting.controller.validate import frozen
from pivoting.sim.contact_sensing import ContactReadings
from pivoting.sim.judging.predicted_slip import RowEffects
from pivoting.sim.pipeline.stages import Answers

Array = NDArray[np.float64]


class Log(NamedTuple):
    """The output of every stage, W worlds and N steps; read-only once the run is over.

    While the steps are made, and as `empty_log` makes them, the arrays have (step, world) first; `worlds_first` turns
    that round.

    Attributes:
        states: (W, N+1, 13) true states, with the columns of `stages.States`.
        measured, estimated: (W, N, 13) likewise, by sensing and by the observer; None where they change nothing.
        answers: `Answers`, (W, N, ...).
        acting: (W, N, nw) wrenches that act, object axes; None where the actuators change nothing.
        disturbance: (W, N, 6) force and torque on the object besides, at the centre of mass, world axes; None where
            nothing disturbs it.
        wrench_world: (W, N, 6) the same as force and torque at the centre of mass, world axes.
        contacts, held: `ContactReadings` and `RowEffects`, (W, N, ...).
        control_ns: (N,) for all worlds together.
    """

    states: Array
    measured: Array | None
    estimated: Array | None
    answers: Answers
    acting: Array | None
    disturbance: Array | None
    wrench_world: Array
    contacts: ContactReadings
    held: RowEffects
    control_ns: Array


def empty_log(steps: int, worlds: int, widths: tuple[int, int], contacts: int, stages: Any) -> Log:
    """The log of a run that begins.

    Args:
        widths: nw and K d.  contacts: K, that are declared.  stages: `Stages`, for what they change is kept.
    """
    nw, n = widths
    both, K = (steps, worlds), contacts
    return Log(
        states=np.empty((steps + 1, worlds, STATE)),
        measured=np.empty((*both, STATE)) if stages.sense else None,
        estimated=np.empty((*both, STATE)) if stages.observe else None,
        answers=Answers.empty(both, nw, n),
        acting=np.empty((*both, nw)) if stages.actuate else None,
        disturbance=np.zeros((*both, 6)) if stages.disturb else None,
        wrench_world=np.empty((*both, 6)),
        contacts=ContactReadings(*(np.empty((*both, *rest)) for rest in ((K, 3), (), (), (), ()))),
        held=RowEffects(np.full((*both, K, 2), np.nan), np.zeros((*both, K)), np.zeros((*both, K), np.bool_)),
        control_ns=np.empty(steps),
    )


def some_worlds(log: Log, first: int, last: int) -> Log:
    """Worlds `first` to `last` - 1 of a log that has (step, world) first, as views; their times are their own."""
    return _cut(log, (slice(None), slice(first, last)))._replace(control_ns=np.empty(len(log.control_ns)))


def some_steps(log: Log, first: int, last: int) -> Log:
    """Steps `first` to `last` - 1 of a log that has (step, world) first, with the states around them."""
    return _cut(log, (slice(first, last),))._replace(states=log.states[first : last + 1])


def _cut(values: Any, where: tuple[slice, ...]) -> Any:
    """These places of an array, or of all arrays of a named tuple."""
    if values is None or isinstance(values, int):
        return values
    if isinstance(values, tuple):
        return type(values)(*(_cut(value, where) for value in values))
    return values[where[: values.ndim]]


def worlds_first(log: Log) -> Log:
    """With (world, step) first, read-only."""
    frozen(log.control_ns)
    turned = {name: _turned(values) for name, values in log._asdict().items() if name != "control_ns"}
    return log._replace(**turned)


def _turned(values: Any) -> Any:
    """(step, world, ...) as the read-only view (world, step, ...), also of all arrays of a named tuple."""
    if values is None or isinstance(values, int):
        return values
    if isinstance(values, tuple):
        return type(values)(*map(_turned, values))
    return frozen(np.moveaxis(values, 1, 0))
