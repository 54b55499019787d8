"""The safe action: an object that can no longer be pivoted is pressed on its contacts and lowered, without a solver.

The contact forces are chosen, not optimised: a given force straight along the normals, as far from the edges of the
friction cones as a force can be, so that the wrench leaves nothing to friction but its own errors. The rest follows
from the equations of motion: w = b - J f. The motion is that of a brake: the object goes down the way that gravity
turns it about its contacts, at a rate that is slow for its size, until it lies on more than its contacts.
"""

import numpy as np
from pivoting.controller.belief import Belief
from pivoting.controller.kernels.compiled_step import state_problem
from pivoting.controller.mobility import free_axes
from pivoting.controller.rotations import rotation_matrix
from pivoting.controller.validate import Array, number
from pivoting.controller.wrench_controller import WrenchController

# [rad] in a natural time at which the object is lowered: slowly, so that it lies down softly, where its state is
# measured; otherwise 45 degrees are to take some 3 of them, in which an error of the state grows 20-fold
RATE, BLIND_RATE = 0.05, 0.25
BRAKE = 5.0  # times in a natural time that the rate's error is divided by e


class Lowering:
    """Lowers the object of one controller, from any state.

    Args:
        controller: what it believes of the object and its contacts.
        press: force that presses it on all its contacts together [N].
    """

    def __init__(self, controller: WrenchController, press: float):
        belief, space = controller.belief, controller.space
        number("press", press, at_least=0.0, unit="N")
        units = controller.units
        self._time = float(np.sqrt(units.length * belief.object.mass / units.force))
        # the rate alone is fed back, and velocities count
        self._belief = Belief(belief.object, belief.contacts, belief.source, (0.0, 0.0, BRAKE / self._time, 1.0))
        held = belief.contacts
        self._axes = free_axes(held.points, held.pivot, belief.source.map)
        K = len(held.points)
        self.force = np.zeros((K, space.dim))
        self.force[:, -1] = press / K
        self._J, self._required = np.empty((len(controller.Q_w), self.force.size)), np.empty(len(controller.Q_w))
        self._R = np.empty((3, 3))

    def rate(self, orientation: Array, blind: bool) -> Array:
        """(3,) angular velocity with which the object is to go down at an orientation (4,), world axes [rad/s]."""
        held, gravity = self._belief.contacts, self._belief.object.gravity
        R = rotation_matrix(orientation)
        moment = np.cross(-R @ held.pivot - held.offset, gravity)
        axes = self._axes @ R.T
        moment = axes.T @ (axes @ moment)
        size = float(np.linalg.norm(moment))
        return moment * ((BLIND_RATE if blind else RATE) / self._time / size) if size > 0.0 else np.zeros(3)

    def wrench(self, orientation: Array, omega: Array, blind: bool = False) -> tuple[Array, Array]:
        """The wrench (nw,), object axes, at an orientation (4,) and angular velocity (3,), and what it is part of.

        Args:
            blind: whether these are predicted, not measured.

        Returns:
            The wrench, and the required wrench (nw,) that it makes together with the contact forces `force`.
        """
        q, now, still = np.array(orientation), np.array(omega), np.zeros(3)
        state_problem(self._belief[:4], q, now, q, self.rate(q, blind), still, self._R, self._J, self._required)
        return self._required - self._J @ self.force.ravel(), self._required.copy()
