"""The plant: MuJoCo's batch of worlds, what is read of it, and one step of it."""

from collections.abc import Mapping

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray
from pivoting.sim.pipeline.stages import States

Array = NDArray[np.float64]


class Plant:
    """W worlds that are stepped together.

    Args:
        batch: of MuJoCo; its model has the sensors of `models.sensors`, of which the first are those of the state, see
            `compiled_step.STATE`.
        sensors: where the readings of each are, see `models.sensors.instrument`.

    Attributes:
        sensed: (W, sensors) what they read.  states: of the worlds.  Both are views, which each step changes.
    """

    def __init__(self, batch: Batch, sensors: Mapping[str, slice]):
        self._batch, self._stage = batch, int(mujoco.mjtStage.mjSTAGE_VEL)
        self.sensed = batch.bind("sensordata")
        batch.forward(stage=self._stage)
        self.states = States(
            self.sensed, batch.bind("qpos"), batch.bind("qvel"), self.sensed[:, sensors["contacts"].start]
        )

    @property
    def worlds(self) -> int:
        """W."""
        return len(self.sensed)

    def step(self) -> None:
        """One time step, with whatever has been written to the batch."""
        self._batch.step(stage=self._stage)
