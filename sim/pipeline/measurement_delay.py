"""Measurements that arrive late, in their order."""

from collections import deque

from pivoting.sim.pipeline.stages import Setting, States


class MeasurementDelay:
    """Each measurement arrives some steps after it was taken; until the first one does, the first is there already.

    Args:
        seconds: age of a measurement when it arrives, a whole number of time steps [s].
    """

    slot = "sense"

    def __init__(self, seconds: float, setting: Setting):
        self._steps = setting.step("delay", seconds)
        self._under_way: deque[States] = deque()

    def __call__(self, k: int, states: States) -> States:
        """What arrives at step k."""
        if k == 0:
            self._under_way = deque([states] * self._steps)
        self._under_way.append(states)
        late = self._under_way.popleft()
        return states.changed(late.values, late.fresh)
