"""What a fast turn of a large object asks for: a floor under its contact's force, and time steps that are fine enough.

MuJoCo steps the velocity of one point of a body, and does not know that another, at an arm r from it, is accelerated by
c = omega^2 r as it turns. With the contact parameters of models/settings.xml, b h = 4 / 2.1, the contact holds that but
for the share 1 - b h / 2 = 1 / 21: it opens unless it is pressed with as much, and its point drifts along the table at
(1 / b - h / 2) c = h c / 40. docs/fidelity.md derives both.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
NOT_HELD, DRIFT = 1.0 / 21.0, 1.0 / 40.0
SPARE = 3.0  # times the least force; a light body's softer contact (see contact_settings.py) needs up to 2.8 times
SHARE = 0.5  # of the limit on the slip that may go into the drift


def closing_force(mass: float, arm: float, rate: Array) -> float:
    """The normal force [N] that keeps a contact closed while an object of `mass` [kg] turns at `rate` (N,) [rad/s].

    Args:
        arm: [m] to the contact from the point whose velocity is stepped.
    """
    return SPARE * NOT_HELD * mass * arm * float(np.square(rate).max(initial=0.0))


def fine_step(dt: float, arm: float, times: Array, rate: Array, slip: float) -> float:
    """The time step [s], a whole part of `dt`, with which the drift of a turn stays well below a limit on the slip.

    Args:
        arm: as above [m].
        times: (N,) [s] at which it turns at rates (N,) [rad/s].
        slip: the limit [m], > 0.
    """
    drift = DRIFT * dt * arm * float(np.trapezoid(rate**2, times))
    return float(dt / max(1.0, np.ceil(drift / (SHARE * slip))))
