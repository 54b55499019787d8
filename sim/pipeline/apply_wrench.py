"""The wrench as MuJoCo takes it: turned into world axes and written to `xfrc_applied` of the object; and a push."""

import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray
from pivoting.controller.kernels.compiled_step import apply_wrenches
from pivoting.sim.pipeline.stages import States

Array = NDArray[np.float64]


class FreeWrench:
    """A wrench that acts on the object from nowhere, fixed to its axes, at its centre of mass.

    Args:
        wrench_map: (nw, 6), see `Space`.
        body: id of the object.
    """

    def __init__(self, batch: Batch, wrench_map: Array, body: int):
        self._map, self._xfrc, self._body = wrench_map, batch.bind("xfrc_applied"), body

    def __call__(self, states: States, wrenches: Array, first: int, out: Array) -> None:
        """Apply wrenches, object axes; zero where there is no answer.

        Args:
            wrenches: (W, at least nw), in the nw columns from `first` on.
            out: (W, 6), written: what is applied, force and torque at the centre of mass, world axes.
        """
        apply_wrenches(self._map, states.values, wrenches, first, out, self._xfrc, self._body)

    def add(self, wrenches: Array) -> None:
        """Add forces and torques (W, 6) at the centre of mass, world axes, to what was applied in this step."""
        self._xfrc[:, self._body] += wrenches


class PushedWrench(FreeWrench):
    """The same, and for some steps a push that the control neither makes nor knows of, and that no log shows.

    Attributes:
        push: (6,) force and torque at the centre of mass, world axes, of every world.
        steps: for how many more steps it acts.
    """

    def __init__(self, batch: Batch, wrench_map: Array, body: int):
        super().__init__(batch, wrench_map, body)
        self.push, self.steps = np.zeros(6), 0

    def __call__(self, states: States, wrenches: Array, first: int, out: Array) -> None:
        """As of `FreeWrench`; `out` is without the push."""
        super().__call__(states, wrenches, first, out)
        if self.steps > 0:
            self.steps -= 1
            self._xfrc[:, self._body] += self.push
