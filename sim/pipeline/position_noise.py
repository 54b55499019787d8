"""Noise of the measured position, drawn anew for each world and step."""

from pivoting.sim.pipeline.stages import POSITION, Setting, States


class PositionNoise:
    """White noise of the position.

    Args:
        amplitude: greatest error along each axis that the object can move along, or its standard deviation where the
            noise is normal [m].
    """

    slot = "sense"

    def __init__(self, amplitude: float, setting: Setting):
        self._amplitude = amplitude / setting.unit
        draws = setting.draws("measured position")
        self._draw = draws.of(setting.case.noise_distribution)
        self._directions = setting.directions

    def __call__(self, k: int, states: States) -> States:
        """The states with positions as measured at step k."""
        values = states.values.copy()
        values[:, POSITION] += self._amplitude * self._draw(k, len(self._directions)) @ self._directions
        return states.changed(values)
