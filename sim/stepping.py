"""The steps of a closed loop: read the state, control, apply, step; and the log of what happened."""

from collections.abc import Callable
from time import perf_counter, perf_counter_ns
from typing import Any, NamedTuple

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray
from pivoting.controller.controller import WrenchController, world_wrench
from pivoting.controller.kernel import first_calls
from pivoting.models.contact_rows import ContactRows
from pivoting.sim.contact_readings import ContactReadings, Declared, sort_contacts
from pivoting.sim.control import Answers, Control, States
from pivoting.sim.fidelity import Held, Rows, Sums

Array = NDArray[np.float64]
POSE = ("position", "quaternion", "velocity", "angular_velocity")
BLOCK = 256  # worlds times steps whose contacts are sorted at once: what stays in the caches


class Log(NamedTuple):
    """What the loop keeps, worlds first, read-only.

    Attributes:
        states: position (W, N+1, 3), quaternion (W, N+1, 4), velocity and angular velocity (W, N+1, 3), world axes.
        answers: required and wrench (W, N, nw), force (W, N, K d), residual and status (W, N).
        wrench_world: (W, N, 6).
        contacts: `ContactReadings`, and held: `Held`, with (W, N) first.
        control_ns: (N,) for all worlds together.
        wall_s: of the loop.
    """

    states: States
    answers: Answers
    wrench_world: Array
    contacts: ContactReadings
    held: Held
    control_ns: Array
    wall_s: float


class ContactLog:
    """Sorts the contacts of every step, some steps at once: what MuJoCo lists of them all would fill the memory."""

    def __init__(
        self,
        declared: Declared,
        rows: ContactRows | None,
        axes: Array,
        where: dict[str, slice],
        steps: int,
        worlds: int,
    ):
        K = len(declared.points)
        places = [(where[key].start, where[key].stop) for key in ("contacts", "touching")]
        known = None if rows is None else tuple(Rows.of(rows, axes))
        self._with = *places, tuple(declared), known, np.empty((K, 3)), np.empty(K), tuple(Sums.of(K))
        self.readings = ContactReadings(
            *(np.empty((steps, worlds, *rest)) for rest in ((K, 3), (), (), (), ())),
        )
        self.held = Held(
            np.full((steps, worlds, K, 2), np.nan), np.zeros((steps, worlds, K)), np.zeros((steps, worlds), np.bool_)
        )

    def sort(self, first: int, poses: Array, sensed: Array) -> None:
        """Sort the contacts (B, W, sensors) of the steps from `first` on, that began at the states (B, W, sensors)."""
        now = slice(first, first + len(sensed))
        contacts, touching, declared, rows, *scratch = self._with
        readings, held = (tuple(values[now] for values in kept) for kept in (self.readings, self.held))
        sort_contacts(sensed, contacts, touching, poses, declared, rows, *scratch, readings, held)


def run_steps(
    batch: Batch,
    control: Control,
    controller: WrenchController,
    contacts: ContactLog,
    body: int,
    where: dict[str, slice],
    steps: int,
    progress: Callable[[int, int], None] | None,
) -> Log:
    """Step all worlds to the end.

    Args:
        body: id of the object.  where: each reading's place in sensordata.
        progress: called with (steps done, steps) about a hundred times.
    """
    worlds, belief = batch.nsim, controller.belief
    sensordata, xfrc = batch.bind("sensordata"), batch.bind("xfrc_applied")[:, body]
    stage = int(mujoco.mjtStage.mjSTAGE_VEL)
    batch.forward(stage=stage)
    states = States(*(sensordata[:, where[key]] for key in POSE))
    pose = slice(where[POSE[0]].start, where[POSE[-1]].stop)
    nw, n = belief.wrench_map.shape[0], belief.Q_f.shape[0]
    kept = np.empty((steps + 1, worlds, pose.stop - pose.start))
    out = Answers(
        np.empty((steps, worlds, nw)),
        np.empty((steps, worlds, nw)),
        np.empty((steps, worlds, n)),
        np.empty((steps, worlds)),
        np.empty((steps, worlds), np.int8),
    )
    wrench_world, spent = np.empty((steps, worlds, 6)), np.empty(steps)
    block = np.empty((max(1, min(steps, BLOCK // worlds)), *sensordata.shape))
    with first_calls():  # compiled before it is timed
        control.prepare(states, Answers(*(values[0] for values in out)))
        world_wrench(belief.wrench_map, states.orientation, out.wrench[0], wrench_world[0])
        contacts.sort(0, kept[:0], block[:0])
    kept[0] = sensordata[:, pose]
    report, first = max(1, steps // 100), 0
    start = perf_counter()
    before: Array | None = None
    for k, answers in enumerate(map(Answers, *out)):
        tick = perf_counter_ns()
        control(k, states, before, answers)
        spent[k] = perf_counter_ns() - tick
        before = answers.wrench
        world_wrench(belief.wrench_map, states.orientation, before, wrench_world[k])
        xfrc[:] = wrench_world[k]
        batch.step(stage=stage)
        block[k - first] = sensordata
        if k + 1 - first == len(block) or k + 1 == steps:
            sensed = block[: k + 1 - first]
            kept[first + 1 : k + 2] = sensed[..., pose]
            contacts.sort(first, kept[first : k + 1], sensed)
            first = k + 1
        if progress is not None and (k + 1) % report == 0:
            progress(k + 1, steps)
    return Log(
        states=States(*(_worlds_first(kept[..., where[key]]) for key in POSE)),
        answers=Answers(*(_worlds_first(values) for values in out)),
        wrench_world=_worlds_first(wrench_world),
        contacts=ContactReadings(*(_worlds_first(values) for values in contacts.readings)),
        held=Held(*(_worlds_first(values) for values in contacts.held)),
        control_ns=spent,
        wall_s=perf_counter() - start,
    )


def _worlds_first(values: NDArray[Any]) -> NDArray[Any]:
    """(step, world, ...) as the read-only view (world, step, ...)."""
    out = np.moveaxis(values, 1, 0)
    out.flags.writeable = False
    return out
