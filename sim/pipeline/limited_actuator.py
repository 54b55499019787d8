"""An actuator that does not make every wrench that it is asked for, of which the controller does not know."""

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.wrench_bounds import WrenchBounds
from pivoting.models.length_unit import POWERS
from pivoting.sim.pipeline.stages import Setting
from pivoting.sim.scenarios.scenario_keys import KEYS

Array = NDArray[np.float64]
BOUND_OF = {
    "actuator_force": "force",
    "actuator_moment": "moment",
    "actuator_force_rate": "force_rate",
    "actuator_moment_rate": "moment_rate",
}


class LimitedActuator:
    """Force and moment are scaled back to their bounds, and change no faster than they can; see the keys.

    At first it makes the wrench that it is asked for, within the bounds: it has had time to reach it.
    """

    slot = "actuate"

    def __init__(self, value: float, setting: Setting):
        given = {
            bound: float(getattr(setting.case, name)) / setting.unit ** POWERS[KEYS[name].unit]
            for name, bound in BOUND_OF.items()
            if getattr(setting.case, name) is not None
        }
        self._bounds, self._dt = WrenchBounds(**given), setting.dt
        self._acting: Array | None = None

    def __call__(self, k: int, wrench: Array) -> Array:
        """The wrenches that act; without an answer it makes none as soon as it can."""
        asked = np.where(np.isfinite(wrench), wrench, 0.0)
        self._acting = self._bounds.within(asked, None if k == 0 else self._acting, self._dt)
        return self._acting
