"""Faults of the measurement: in some steps it is repeated, does not arrive, or is not a number."""

import numpy as np
from numpy.typing import NDArray
from pivoting.sim.pipeline.random_draws import Chance
from pivoting.sim.pipeline.stages import Setting, States

Array = NDArray[np.float64]


class _LastAgain:
    """In a share of the steps the last measurement is there again in place of a new one.

    Args:
        share: of the steps.  stream: what is drawn.
    """

    slot = "sense"
    _told = False  # whether the receiver knows

    def __init__(self, share: float, setting: Setting):
        self._happens = Chance(share, type(self).__name__, setting)
        self._last: Array = np.zeros(0)

    def __call__(self, k: int, states: States) -> States:
        """What the receiver has at step k; the first measurement always arrives."""
        if k == 0:
            self._last = states.values.copy()
            return states
        again = self._happens(k)
        values = np.where(again[:, None], self._last, states.values)
        self._last = values
        return states.changed(values, states.fresh & ~again if self._told else None)


class RepeatedMeasurement(_LastAgain):
    """The last measurement comes again, and nobody says that it is not a new one."""


class DroppedMeasurement(_LastAgain):
    """No measurement arrives, and the receiver knows."""

    _told = True


class BrokenMeasurement:
    """The measurement is not a number.

    Args:
        share: of the steps.
    """

    slot = "sense"

    def __init__(self, share: float, setting: Setting):
        self._happens = Chance(share, "BrokenMeasurement", setting)

    def __call__(self, k: int, states: States) -> States:
        """What arrives at step k; the first measurement always does."""
        return states if k == 0 else states.changed(np.where(self._happens(k)[:, None], np.nan, states.values))
