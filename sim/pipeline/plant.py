"""The plant: MuJoCo's batch of worlds, what is read of it, and one step of it."""

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray
from pivoting.controller.kernels.compiled_step import STATE
from pivoting.sim.pipeline.stages import States

Array = NDArray[np.float64]


class Plant:
    """W worlds that are stepped together.

    Args:
        batch: of MuJoCo; its model has the sensors of `models.sensors`, of which the first are those of the state.

    Attributes:
        sensed: (W, sensors) what they read, a view that each step changes.
    """

    def __init__(self, batch: Batch):
        self._batch, self._stage = batch, int(mujoco.mjtStage.mjSTAGE_VEL)
        self.sensed = batch.bind("sensordata")
        self._joints = batch.bind("qpos"), batch.bind("qvel")
        batch.forward(stage=self._stage)

    @property
    def worlds(self) -> int:
        """W."""
        return len(self.sensed)

    def states(self, values: Array) -> States:
        """The states as they are; their values are copied into `values` (W, 13)."""
        values[:] = self.sensed[:, :STATE]
        return States(values, *self._joints)

    def step(self) -> None:
        """One time step, with whatever has been written to the batch."""
        self._batch.step(stage=self._stage)
