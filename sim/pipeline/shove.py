"""A shove: at some time something pushes the object at its true centre of mass, which nobody is told of."""

import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray
from pivoting.controller.validate import fail
from pivoting.sim.pipeline.plan_log import Event
from pivoting.sim.pipeline.stages import Setting
from pivoting.sim.world import World

Array = NDArray[np.float64]


class Shove:
    """One shove in each world, a constant force for some time, at a time and in a direction of its own.

    It begins after the time that the verdict lets settle, and ends before the run does.

    Args:
        impulse: of the shove, for each kg of the true mass [N s/kg].

    Attributes:
        events: what happened when.
    """

    slot = "disturb"

    def __init__(self, impulse: float, setting: Setting):
        case = setting.case
        self._steps = setting.step("shove_seconds", case.shove_seconds)
        first = int(np.ceil(case.limits.settle_s / setting.dt))
        room = round(case.duration / setting.dt) - self._steps - first
        if room < 0:
            raise fail("shove_seconds", case.shove_seconds, f"less than {case.duration - case.limits.settle_s:g} s")
        draws = setting.draws("shove")
        self._start = first + np.floor((room + 1) * draws.shares(0)).astype(int)
        self._towards = draws.direction(1, len(setting.directions)) @ setting.directions
        self._per_kg = impulse / setting.unit / (self._steps * setting.dt)
        self._dt, self._told = setting.dt, f"shoved by {impulse:g} N s/kg within {self._steps * setting.dt:g} s"
        self._force: Array = np.zeros(0)
        self.events: list[Event] = []

    def begin(self, batch: Batch, world: World) -> None:
        """The forces, of the masses that the worlds have."""
        each = batch.expanded("body_mass")
        mass = world.truth.mass if each is None else each[:, world.truth.index][:, None]
        self._force = np.zeros((len(self._start), 6))
        self._force[:, :3] = self._per_kg * mass * self._towards

    def __call__(self, k: int) -> Array | None:
        """The forces of step k."""
        if k == 0:
            self.events = []
        pushed = (self._start <= k) & (k < self._start + self._steps)
        if not pushed.any():
            return None
        for world in np.flatnonzero(self._start == k):
            self.events.append(Event(int(world), k * self._dt, self._told))
        return np.where(pushed[:, None], self._force, 0.0)
