"""The observer of a scenario: pose and rates are estimated from delayed poses, the wrenches that were asked for and the
model; measured rates are not used."""

from collections import deque

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.pose_observer import PoseObserver
from pivoting.controller.validate import fail
from pivoting.sim.pipeline.stages import Setting, States

Array = NDArray[np.float64]


class ModelObserver:
    """A `PoseObserver` of what was measured a delay ago, and from there a prediction for now.

    Args:
        bandwidth: of the observer [rad/s].

    Raises:
        ValueError: there are two stances, or measurements are too far apart.
    """

    slot = "observe"

    def __init__(self, bandwidth: float, setting: Setting):
        case, dt = setting.case, setting.dt
        if case.landing == "held":
            raise fail("observer", bandwidth, "0 with landing=held: it knows one stance")
        self._late = setting.step("delay", case.delay)
        apart = 1 if case.measure_hz is None else setting.every("measure_hz", case.measure_hz)
        if bandwidth * apart * dt > 1.0:
            raise fail("observer", bandwidth, f"at most {1.0 / (apart * dt):g} rad/s, one for each measurement")
        self._observer = PoseObserver(setting.controllers, bandwidth, dt, apart * dt)
        self._wrenches: deque[Array] = deque(maxlen=self._late)
        self.prepare = self._observer.model.prepare

    def __call__(self, k: int, measured: States, applied: Array | None) -> States:
        """The states as they are estimated for the start of step k."""
        observer = self._observer
        if k == 0:
            observer.begin(measured.values)
            self._wrenches.clear()
        elif applied is not None:
            now = np.array(applied)
            if self._late == 0:
                observer.advance(now)
            else:
                if len(self._wrenches) == self._late:
                    observer.advance(self._wrenches[0])
                self._wrenches.append(now)
        if k >= self._late:
            observer.correct(measured.values, measured.fresh)
        return measured.changed(observer.ahead(tuple(self._wrenches)))
