"""A sensor that is slower than the loop: it measures at some steps, and in between its last measurement stays."""

import numpy as np
from numpy.typing import NDArray
from pivoting.sim.pipeline.stages import Setting, States


class SlowerMeasurement:
    """Measures at the first step and from then on at a rate.

    Args:
        rate: [Hz]; the time from one measurement to the next is a whole number of time steps.
    """

    slot = "sense"

    def __init__(self, rate: float, setting: Setting):
        self._every = setting.every("measure_hz", rate)
        self._none = np.zeros(setting.worlds, np.bool_)
        self._last: NDArray[np.float64] = np.zeros(0)

    def __call__(self, k: int, states: States) -> States:
        """What was last measured; fresh only at the steps at which it is measured."""
        if k % self._every == 0:
            self._last = states.values.copy()
            return states
        return states.changed(self._last, self._none)
