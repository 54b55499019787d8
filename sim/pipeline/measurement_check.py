"""What a receiver can tell of a measurement: one that is not a number, or came before, is not a new one."""

import numpy as np
from numpy.typing import NDArray
from pivoting.sim.pipeline.stages import ORIENTATION, POSITION, Setting, States

POSE = np.r_[POSITION, ORIENTATION]


class MeasurementCheck:
    """Marks as not fresh what is not finite; and what is to the last bit the pose before, where noise makes that
    impossible: of a sensor whose values are rounded, equal ones say nothing."""

    slot = "sense"

    def __init__(self, value: float, setting: Setting):
        case = setting.case
        noisy, rounded = (case.noise, case.noise_position), (case.resolution, case.resolution_position)
        self._told_apart = any(noise > 0.0 and not step > 0.0 for noise, step in zip(noisy, rounded, strict=True))
        self._before: NDArray[np.float64] | None = None

    def __call__(self, k: int, states: States) -> States:
        """The same values, of which fewer are fresh."""
        fresh = states.fresh & np.isfinite(states.values).all(axis=1)
        if self._told_apart:
            pose = states.values[:, POSE]
            if k > 0 and self._before is not None:
                fresh &= (pose != self._before).any(axis=1)
            self._before = pose
        return states.changed(states.values, fresh)
