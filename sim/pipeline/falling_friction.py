"""Friction that falls while the object is held: the world's alone, which the controller does not know of."""

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray
from pivoting.controller.validate import fail
from pivoting.sim.pipeline.stages import Setting
from pivoting.sim.scenarios.scenario import Scenario
from pivoting.sim.world import World

Array = NDArray[np.float64]


class FallingFriction:
    """From some time on the sliding friction of the object and its support is another.

    Args:
        mu: the friction coefficient from then on.
    """

    slot = "disturb"

    def __init__(self, mu: float, setting: Setting):
        self._mu, self._at = mu, falls_at(setting.case, setting.dt)
        self._friction: Array = np.zeros(0)
        self._geoms: NDArray[np.intp] = np.zeros(0, np.intp)
        self._before: Array | None = None

    def begin(self, batch: Batch, world: World) -> None:
        """The geoms whose friction it is, with that which they have before.

        Raises:
            ValueError: the friction is not that of the geoms.
        """
        model = world.model
        if model.npair or model.opt.enableflags & int(mujoco.mjtEnableBit.mjENBL_OVERRIDE):
            raise fail("mu_falls_to", self._mu, "left out: the friction of this model is not that of its geoms")
        self._friction = batch.expand("geom_friction")
        own = np.flatnonzero(model.geom_bodyid == world.truth.index)
        self._geoms = np.array([*own, world.truth.support])
        if self._before is None:
            self._before = np.array(self._friction[:, self._geoms, 0])
        self._friction[:, self._geoms, 0] = self._before

    def __call__(self, k: int) -> None:
        """Let it fall, if it is time."""
        if k == self._at:
            self._friction[:, self._geoms, 0] = self._mu


def falls_at(case: Scenario, dt: float) -> int:
    """The step at which the friction falls."""
    return round((0.5 * case.duration if case.mu_falls_at is None else case.mu_falls_at) / dt)


def friction_at(case: Scenario, mu: float, times: Array, dt: float) -> Array:
    """(N,) the world's friction coefficient in the steps that begin at `times` (N,) [s], which is `mu` at first.

    Args:
        case: `absolute`.
    """
    if case.mu_falls_to is None:
        return np.full(len(times), mu)
    return np.where(times > (falls_at(case, dt) - 0.5) * dt, case.mu_falls_to, mu)
