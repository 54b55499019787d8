"""Bias: errors of the measured pose that stay the same for as long as a world is run."""

import numpy as np
from pivoting.controller.rotations import exponential, quaternion_product
from pivoting.sim.pipeline.stages import ORIENTATION, POSITION, Setting, States


class OrientationBias:
    """The measured orientation is turned by a constant angle about an axis of each world's own.

    Args:
        angle: of the turn [deg].
    """

    slot = "sense"

    def __init__(self, angle: float, setting: Setting):
        draws = setting.draws("bias of the orientation")
        self._turn = exponential(np.deg2rad(angle) * draws.direction(0, len(setting.axes)) @ setting.axes)

    def __call__(self, k: int, states: States) -> States:
        """The states with orientations as measured."""
        values = states.values.copy()
        values[:, ORIENTATION] = quaternion_product(self._turn, states.orientation)
        return states.changed(values)


class PositionBias:
    """The measured position is off by a constant distance in a direction of each world's own.

    Args:
        distance: [m].
    """

    slot = "sense"

    def __init__(self, distance: float, setting: Setting):
        draws = setting.draws("bias of the position")
        directions = setting.directions
        self._off = distance / setting.unit * draws.direction(0, len(directions)) @ directions

    def __call__(self, k: int, states: States) -> States:
        """The states with positions as measured."""
        values = states.values.copy()
        values[:, POSITION] += self._off
        return states.changed(values)
