"""A control that is asked less often than the simulation steps; in between its last wrench is held."""

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.solution import REPEATED
from pivoting.controller.validate import fail
from pivoting.sim.pipeline.stages import Answers, Control, Setting, States

Array = NDArray[np.float64]


class SlowerControl:
    """Zero-order hold: the wrench, fixed to the object, is that of the last answer until there is another.

    Args:
        rate: at which the control is asked [Hz]; the time from one answer to the next is a whole number of time steps.

    Raises:
        ValueError: the rate is above that of the steps, or plans are to be made at others.
    """

    slot = "wrap"

    def __init__(self, rate: float, setting: Setting):
        self._every = setting.every("control_hz", rate)
        if setting.case.plan_hz is not None:
            raise fail("control_hz", rate, "left out with plan_hz, at which plans are made")

    def __call__(self, control: Control, desired: Array) -> Control:
        """The control that holds its answers."""
        return _Held(control, self._every)


class _Held:
    def __init__(self, inner: Control, every: int):
        self._inner, self._every = inner, every
        self._values: Array = np.zeros(0)
        self._answered: NDArray[np.bool_] = np.zeros(0, np.bool_)
        self.prepare = inner.prepare

    def __call__(self, k: int, states: States, before: Array | None, out: Answers) -> None:
        if k % self._every == 0:
            self._inner(k, states, before, out)
            self._values, self._status = out.values.copy(), out.status.copy()
            self._answered = np.asarray(np.isfinite(out.wrench).all(axis=1))
            return
        out.values[:] = self._values
        out.residual[:] = np.nan
        out.status[:] = np.where(self._answered, REPEATED, self._status)
