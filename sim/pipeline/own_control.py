"""A control of the user's own: a function of the estimated states and the reference that gives the wrench."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pivoting.controller.solution import FAILED, UNCERTIFIED
from pivoting.controller.validate import fail
from pivoting.sim.pipeline.stages import Answers, Desired, States, desired_values

Array = NDArray[np.float64]


class Moment(NamedTuple):
    """What a control of one's own is told at a step.

    Attributes:
        time: [s].
        states: of W worlds, as measured and estimated.
        desired: where the object is to be now; the same for all worlds, (1, ...).
        before: (W, nw) the wrenches that it gave at the step before, None at first. With None a function that has a
            state begins anew: a fleet's worlds are run in chunks, one after the other.
        first_world: number of the first of the W worlds.
    """

    time: float
    states: States
    desired: Desired
    before: Array | None
    first_world: int = 0


OwnControlFunction = Callable[[Moment], ArrayLike]  # gives (W, nw) or (nw,) wrenches, object axes [N, N m]


class OwnControl:
    """Asks the function at every step. Its wrenches are applied as they are, and carry no certificate.

    Args:
        desired: (N+1, 4), (N+1, 3), (N+1, 3), the reference at every step.
        dt: time step [s].
        first_world: number of the first world.
    """

    def __init__(
        self, function: OwnControlFunction, desired: tuple[Array, Array, Array], dt: float, first_world: int = 0
    ):
        if not callable(function):
            raise fail("control", function, "a function of a Moment that gives the wrench")
        self._function, self._dt, self._first = function, dt, first_world
        self._desired = desired_values(*desired)[:, None]

    def prepare(self, states: States, out: Answers) -> None:
        """Nothing has to be done; the function is not asked before its time."""
        out.wrench[:] = 0.0

    def __call__(self, k: int, states: States, before: Array | None, out: Answers) -> None:
        now = Moment(k * self._dt, states.copy(), Desired(self._desired[k]), before, self._first)
        given = np.asarray(self._function(now))
        W, nw = out.wrench.shape
        if given.dtype.kind not in "iuf" or given.shape not in ((W, nw), (nw,)):
            what = f"{given.dtype} of shape {given.shape}"
            raise fail("control", what, f"a function that gives numbers of shape {(W, nw)} or {(nw,)}: wrenches")
        out.wrench[:] = given
        for values in (out.required, out.force, out.residual):
            values[:] = np.nan
        out.status[:] = np.where(np.isfinite(out.wrench).all(axis=1), UNCERTIFIED, FAILED)
