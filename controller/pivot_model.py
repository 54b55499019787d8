"""The model of an object that turns about its believed contacts: how it moves on under the wrench that acts on it."""

from collections.abc import Sequence

import numpy as np
from pivoting.controller.belief import for_worlds
from pivoting.controller.kernels.pivot_prediction import predict_worlds
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
        nw = len(controllers[0].Q_w)
        self._beliefs, self._dt = for_worlds(beliefs), dt
        self.axes = np.array(
            [free_axes(belief.contacts.points, belief.contacts.pivot, belief.source.map) for belief in beliefs]
        )
        sizes = (3, 3), (nw,), (3, nw), (3, nw), (3, 4), (3,), (3,), (4,)
        self._scratch = tuple(np.zeros(size) for size in sizes)

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

    def arm(self, orientation: Array) -> Array:
        """(W, 3) from the contacts' mean to the centre of mass at orientations (W, 4), world axes [m]."""
        pivot = np.broadcast_to(self._pivot, (len(orientation), 3))
        return -rotated(orientation, pivot) - self._offset
