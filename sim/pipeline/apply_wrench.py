"""The wrench as MuJoCo takes it: turned into world axes and written to `xfrc_applied` of the object; and a push."""

import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray
from pivoting.controller.kernels.compilation import kernel
from pivoting.controller.kernels.compiled_step import apply_wrenches
from pivoting.controller.rotations import cross, turned
from pivoting.sim.pipeline.stages import States

Array = NDArray[np.float64]


class FreeWrench:
    """A wrench that acts on the object from nowhere, fixed to its axes, at what the controller takes for its CoM.

    MuJoCo counts the moment of `xfrc_applied` about the true centre of mass.

    Args:
        wrench_map: (nw, 6), see `Space`.
        body: id of the object.
        offsets: (W or 1, 3) from the true centre of mass of each world to the point where the wrench acts, object axes
            [m]; None where that is the centre of mass.
    """

    def __init__(self, batch: Batch, wrench_map: Array, body: int, offsets: Array | None = None):
        self._map, self._xfrc, self._body = wrench_map, batch.bind("xfrc_applied"), body
        self._offsets = offsets

    def __call__(self, states: States, wrenches: Array, first: int, out: Array) -> None:
        """Apply wrenches, object axes; zero where there is no answer.

        Args:
            wrenches: (W, at least nw), in the nw columns from `first` on.
            out: (W, 6), written: what is applied, force and torque at the true centre of mass, world axes.
        """
        apply_wrenches(self._map, states.values, wrenches, first, out, self._xfrc, self._body)
        if self._offsets is not None:
            count_at_com(states.values, self._offsets, out, self._xfrc, self._body)

    def add(self, wrenches: Array) -> None:
        """Add forces and torques (W, 6) at the centre of mass, world axes, to what was applied in this step."""
        self._xfrc[:, self._body] += wrenches


class PushedWrench(FreeWrench):
    """The same, and for some steps a push that the control neither makes nor knows of, and that no log shows.

    Attributes:
        push: (6,) force and torque at the true centre of mass, world axes, of every world.
        steps: for how many more steps it acts.
    """

    def __init__(self, batch: Batch, wrench_map: Array, body: int, offsets: Array | None = None):
        super().__init__(batch, wrench_map, body, offsets)
        self.push, self.steps = np.zeros(6), 0

    def __call__(self, states: States, wrenches: Array, first: int, out: Array) -> None:
        """As of `FreeWrench`; `out` is without the push."""
        super().__call__(states, wrenches, first, out)
        if self.steps > 0:
            self.steps -= 1
            self._xfrc[:, self._body] += self.push


@kernel
def count_at_com(states, offsets, out, xfrc, body):  # type: ignore[no-untyped-def]
    """Count wrenches that act at a point of the object about its centre of mass: the moment grows by offset x force.

    Args:
        states: (W, 13 or more), see `STATE`.
        offsets: (W or 1, 3) from the centre of mass to that point, object axes [m].
        out: (W, 6) and xfrc: (W, bodies, 6), in the row `body`: force and torque, world axes; changed.
    """
    for i in range(out.shape[0]):
        q, away = states[i, 3:7], offsets[i % offsets.shape[0]]
        x, y, z = turned(q[0], q[1], q[2], q[3], away[0], away[1], away[2])
        a, b, c = cross(x, y, z, out[i, 0], out[i, 1], out[i, 2])
        out[i, 3] += a
        out[i, 4] += b
        out[i, 5] += c
        for j in range(3, 6):
            xfrc[i, body, j] = out[i, j]
