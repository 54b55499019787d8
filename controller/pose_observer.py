"""An observer of pose and rates, from poses that are measured with noise, the applied wrench and the pivot's model.

A Kalman filter of three states about each axis that the contacts leave free: angle, rate, and an angular acceleration
that the model does not know of, which is a random walk. Between measurements `PivotModel` moves the estimate on. For a
triple integrator driven by white noise the closed filter is a Butterworth filter of third order, whose bandwidth
(q / r)^(1/6) is all that has to be chosen: its noise grows with it, its delay falls with it. The contacts are taken to
stay where they are, so that the position follows the angle; what is measured of it corrects it slowly.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.kernels.compiled_step import STATE
from pivoting.controller.pivot_model import PivotModel
from pivoting.controller.validate import Array, fail, number
from pivoting.controller.wrench_controller import WrenchController
from scipy.linalg import solve_discrete_are

SLOWER = 0.1  # of the bandwidth: at which what the contacts do not let move is corrected


class PoseObserver:
    """Estimates of W worlds, as many filters as that.

    Args:
        controllers: one for each world, or one that they share: what is believed.
        bandwidth: of the filter [rad/s].
        dt: time step [s].
        interval: time from one measurement to the next, where none is missing [s].

    Attributes:
        states: (W, 13) estimated, with the columns of `compiled_step.STATE`.
        unknown: (W, 3) the angular acceleration that the model does not know of, world axes [rad/s^2].

    Raises:
        ValueError: the bandwidth is beyond what measurements so far apart can tell.
    """

    def __init__(self, controllers: Sequence[WrenchController], bandwidth: float, dt: float, interval: float):
        number("bandwidth", bandwidth, above=0.0, unit="rad/s")
        if bandwidth * interval > 1.0:
            raise fail("bandwidth", bandwidth, f"at most one for each interval between measurements, {1 / interval:g}")
        self.model = PivotModel(controllers, dt)
        self._step = np.array([[1.0, dt, dt * dt], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
        # in units of the variance of one measurement, r = interval
        self._walk = np.diag([0.0, 0.0, dt * interval * bandwidth**6])
        self._slow = SLOWER * bandwidth * interval
        steady = solve_discrete_are(self._step.T, np.eye(3)[:, :1], self._walk, np.array([[interval / dt]]))
        steady[0], steady[:, 0] = 0.0, 0.0
        steady[0, 0] = 1.0  # the first pose is measured
        self._begun = steady
        self.states, self.unknown = np.zeros((0, STATE)), np.zeros((0, 3))
        self._covariance = np.zeros((0, 3, 3))

    def begin(self, values: Array) -> None:
        """Begin at rest at measured poses, in the first columns of values (W, 7 or more)."""
        self.states = np.zeros((len(values), STATE))
        self.states[:, :7] = values[:, :7]
        self.unknown = np.zeros((len(values), 3))
        self._covariance = np.repeat(self._begun[None], len(values), axis=0)

    def advance(self, wrenches: Array) -> None:
        """Go one time step on, in which wrenches (W, nw) act, object axes."""
        self.model.advance(self.states, wrenches, self.unknown)
        self._covariance = self._step @ self._covariance @ self._step.T + self._walk

    def correct(self, values: Array, fresh: NDArray[np.bool_]) -> None:
        """Take up measured poses, in the first columns of values (W, 7 or more), where they are `fresh` (W,)."""
        seen, new = (
            np.array(values),
            np.array(fresh),
        )  # copies that may be written: else numba compiles a second variant
        self.model.correct(self._slow, seen, new, self.states, self.unknown, self._covariance)

    def ahead(self, wrenches: Sequence[Array]) -> Array:
        """(W, 13) the estimate as it will be after some steps in which these wrenches act, one after another."""
        states = self.states.copy()
        for acting in wrenches:
            self.model.advance(states, acting, self.unknown)
        return states
