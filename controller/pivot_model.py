"""The model of an object that turns about its believed contacts: how it moves on under the wrench that acts on it."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.belief import for_worlds
from pivoting.controller.kernels.pivot_prediction import correct_worlds, fill_contacts, predict_worlds
from pivoting.controller.mobility import free_axes
from pivoting.controller.rotations import rotated
from pivoting.controller.validate import Array
from pivoting.controller.wrench_controller import WrenchController


class PivotModel:
    """Rigid bodies, each on contacts that stick or roll, in as many worlds.

    Args:
        controllers: one for each world, or one that they share: what is believed.
        dt: time step [s].

    Attributes:
        axes: (W or 1, A, 3) object axes about which the contacts let the object turn.
    """

    def __init__(self, controllers: Sequence[WrenchController], dt: float):
        beliefs = [controller.belief for controller in controllers]
        self._pivot = np.array([belief.contacts.pivot for belief in beliefs])
        self._offset = np.array([belief.contacts.offset for belief in beliefs])
        nw = self._nw = len(controllers[0].Q_w)
        (self._beliefs, _), self._dt = for_worlds(beliefs), dt
        self.axes = np.array(
            [free_axes(belief.contacts.points, belief.contacts.pivot, belief.source.map) for belief in beliefs]
        )
        sizes = (3, 3), (nw,), (3, nw), (3, nw), (3, 3), (3,), (3,), (3,), (4,)
        self._spin = np.zeros(6)
        self._scratch = tuple(np.zeros(size) for size in sizes)

    def prepare(self) -> None:
        """Compile, on one world that comes to nothing."""
        states, still, fresh = np.zeros((1, 13)), np.zeros((1, 3)), np.zeros(1, np.bool_)
        states[0, 3] = 1.0
        self.advance(states, np.zeros((1, self._nw)), still)
        self.correct(0.0, states.copy(), fresh, states, still, np.zeros((1, 3, 3)))
        self.contacts(states)

    def advance(self, states: Array, wrenches: Array, added: Array) -> None:
        """Move states (W, 13) one time step on, in place.

        Args:
            wrenches: (W, nw) that act, object axes; what is not a number counts as 0.
            added: (W, 3) angular accelerations besides, world axes [rad/s^2].
        """
        predict_worlds(self._beliefs, self.axes, wrenches, added, self._dt, self._scratch, states)

    def free(self, orientation: Array, vectors: Array) -> Array:
        """The part of vectors (W, 3), world axes, along the axes about which objects at (W, 4) can turn."""
        axes = rotated(orientation[:, None], np.broadcast_to(self.axes, (len(vectors), *self.axes.shape[1:])))
        return np.einsum("waj,wak,wk->wj", axes, axes, vectors)

    def correct(
        self, slow: float, measured: Array, fresh: NDArray[np.bool_], states: Array, unknown: Array, covariance: Array
    ) -> None:
        """Correct states in place by measured poses, see `correct_worlds`."""
        correct_worlds(
            self.axes, self._pivot, self._offset, slow, measured, fresh, self._spin, states, unknown, covariance
        )

    def contacts(self, states: Array) -> Array:
        """(W, 3) where the mean of the contacts is by the poses of states (W, 13), world axes [m]."""
        out = np.empty((len(states), 3))
        fill_contacts(self._pivot, self._offset, states, out)
        return out
