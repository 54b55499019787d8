"""References in space: the desired orientation as a function of time, with angular velocity and acceleration.

Each is a `references.Reference`: at times (N,) [s] it returns a `Motion` of quaternions (N, 4) object to world, and
angular velocities and accelerations (N, 3) in world axes [rad/s, rad/s^2].
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from pivoting.controller.motion import Motion
from pivoting.controller.references import MinimumJerk, Reference
from pivoting.controller.rotations import exponential, quaternion_product, rotation_error, rotation_matrix
from pivoting.controller.validate import Array, array, fail, frozen, number, unit_quaternions


@dataclass(frozen=True, eq=False)
class Turn:
    """A turn about one axis that is fixed in the world, by the angle that a planar reference gives.

    The orientation is q = exp(angle axis) start. The axis may be the edge of a contact or the table's normal.

    Attributes:
        angle: planar reference of the angle [rad].
        axis: (3,) direction in world axes; its length does not matter.
        start: (4,) orientation at angle 0.
    """

    angle: Reference
    axis: Array
    start: Array

    def __init__(self, angle: Reference, axis: ArrayLike, start: ArrayLike = (1.0, 0.0, 0.0, 0.0)):
        direction = array("axis", axis, (3,))
        length = float(np.linalg.norm(direction))
        if length == 0.0:
            raise fail("axis", direction, "not zero")
        object.__setattr__(self, "angle", angle)
        object.__setattr__(self, "axis", direction / length)
        object.__setattr__(self, "start", unit_quaternion("start", start))

    @property
    def duration(self) -> float:
        """Duration of the angle's reference [s]; inf for a plain function of time, which has none."""
        return float(getattr(self.angle, "duration", math.inf))

    def __call__(self, times: ArrayLike) -> Motion:
        angle, rate, acceleration = (np.asarray(values, dtype=float)[..., None] for values in self.angle(times))
        turned = quaternion_product(exponential(angle * self.axis), self.start)
        return Motion(turned, rate * self.axis, acceleration * self.axis)


@dataclass(frozen=True, eq=False)
class Waypoints:
    """Rest-to-rest turns through orientations, each the shortest and in `seconds`, with rests of `hold` seconds.

    Attributes:
        orientations: (P, 4) quaternions, P >= 2.
    """

    orientations: Array
    seconds: float
    hold: float = 0.0

    def __init__(self, orientations: ArrayLike, seconds: float, hold: float = 0.0):
        points = array("orientations", orientations, (None, 4))
        if len(points) < 2:
            raise fail("orientations", points, "at least two quaternions")
        points = np.array([unit_quaternion("orientations", point) for point in points])
        object.__setattr__(self, "orientations", frozen(points))
        object.__setattr__(self, "seconds", number("seconds", seconds, above=0.0, unit="s"))
        object.__setattr__(self, "hold", number("hold", hold, at_least=0.0, unit="s"))

    @property
    def duration(self) -> float:
        """Time from the first rest to the end of the last [s]."""
        return MinimumJerk((0.0,) * len(self.orientations), self.seconds, self.hold).duration

    @cached_property
    def _turns(self) -> list[Turn]:
        turns = []
        for start, end in zip(self.orientations[:-1], self.orientations[1:], strict=True):
            vector = rotation_matrix(start) @ np.array(rotation_error(start, end))  # world axes
            angle = float(np.linalg.norm(vector))
            axis = vector if angle > 0.0 else np.array([0.0, 0.0, 1.0])
            turns.append(Turn(MinimumJerk((0.0, angle), self.seconds), axis, start))
        return turns

    def __call__(self, times: ArrayLike) -> Motion:
        times = np.asarray(times, dtype=float)
        since = times - self.hold
        leg = np.clip(since // (self.seconds + self.hold), 0, len(self._turns) - 1).astype(int)
        parts = [turn(since - i * (self.seconds + self.hold)) for i, turn in enumerate(self._turns)]
        chosen = [np.stack([np.asarray(part[k]) for part in parts]) for k in range(3)]
        index = np.broadcast_to(leg[None, ..., None], (1, *times.shape, 1))
        return Motion(*(np.take_along_axis(values, index, axis=0)[0] for values in chosen))


class SampledRotation:
    """Orientations sampled every `dt` [s], interpolated with continuous acceleration; it rests at the last one."""

    def __init__(self, orientations: ArrayLike, dt: float):
        from scipy.spatial.transform import Rotation, RotationSpline

        points = array("orientations", orientations, (None, 4))
        if len(points) < 2:
            raise fail("orientations", points, "at least two quaternions")
        self.orientations = np.array([unit_quaternion("orientations", point) for point in points])
        self.dt = number("dt", dt, above=0.0, unit="s")
        rotations = Rotation.from_quat(np.roll(self.orientations, -1, axis=-1))
        self._curve = RotationSpline(self.dt * np.arange(len(points)), rotations)

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return self.dt * (len(self.orientations) - 1)

    def __call__(self, times: ArrayLike) -> Motion:
        times = np.asarray(times, dtype=float)
        inside = np.clip(times, 0.0, self.duration)
        moving = ((times >= 0.0) & (times <= self.duration))[..., None]
        at = self._curve(inside)
        # the spline's rates are in the object's axes, and the frame's own turning adds nothing: omega x omega = 0
        rate, acceleration = (at.apply(self._curve(inside, order)) for order in (1, 2))
        return Motion(
            np.roll(at.as_quat(), 1, axis=-1), np.where(moving, rate, 0.0), np.where(moving, acceleration, 0.0)
        )


def unit_quaternion(name: str, value: ArrayLike) -> Array:
    """(4,) of unit length to the last bit; raises unless it was nearly so."""
    given = unit_quaternions(name, value, (4,))
    return given / np.linalg.norm(given)
