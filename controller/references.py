"""References: the desired angle of the object as a function of time, and the references that scenarios know by name."""

import inspect
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from pivoting.controller.motion import Motion
from pivoting.controller.validate import array, fail, number


class Reference(Protocol):
    """The desired motion as a function of time: at times (N,) [s] the angle, rate and acceleration, each (N,) [rad, s].

    In space (see `orientation_references`) these are orientations (N, 4), angular velocities and accelerations (N, 3).
    For a single time they are single values. A reference rests after its `duration`.
    """

    @property
    def duration(self) -> float:
        """The time at which the motion ends [s]; inf if it never does."""
        ...

    def __call__(self, times: ArrayLike) -> Motion:
        """The desired motion at each of `times`."""
        ...


@dataclass(frozen=True)
class NamedReference:
    """A reference that a scenario selects by its name.

    Attributes:
        meaning: what the motion is, in a few words.
        make: returns the reference; its parameters are named like keys of the scenario and take their values [rad, s].
    """

    meaning: str
    make: Callable[..., Reference]

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys of a scenario on which the reference depends."""
        return tuple(inspect.signature(self.make).parameters)

    def __str__(self) -> str:
        return self.meaning


REFERENCES: dict[str, NamedReference] = {}  # by name; filled, where the functions are defined, by `reference`

Make = TypeVar("Make", bound=Callable[..., Reference])


def reference(name: str, meaning: str) -> Callable[[Make], Make]:
    """Register what the decorated function or class returns under a `name` for scenarios; see `NamedReference`.

    Raises:
        ValueError: the name is taken.
    """
    if name in REFERENCES:
        raise fail("name", name, "a name that no other reference has")

    def register(make: Make) -> Make:
        REFERENCES[name] = NamedReference(meaning, make)
        return make

    return register


@reference("constant", "stay at theta")
@dataclass(frozen=True)
class Constant:
    """Stay at `theta` [rad]."""

    theta: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "theta", number("theta", self.theta, unit="rad"))

    @property
    def duration(self) -> float:
        """It goes on for ever."""
        return math.inf

    def __call__(self, times: ArrayLike) -> Motion:
        zero = np.zeros(np.shape(times))
        return Motion(zero + self.theta, zero, zero.copy())


@dataclass(frozen=True)
class MinimumJerk:
    """Rest-to-rest arcs through `waypoints` [rad], each in `seconds`; rests of `hold` seconds before, between, after.

    theta = theta_0 + (theta_1 - theta_0) (10 s^3 - 15 s^4 + 6 s^5), s = t / seconds (Flash and Hogan 1985).
    """

    waypoints: tuple[float, ...]
    seconds: float
    hold: float = 0.0

    def __post_init__(self) -> None:
        if len(self.waypoints) < 2:
            raise fail("waypoints", self.waypoints, "at least two angles")
        put = object.__setattr__  # whole numbers are as good as any, and what is made of them is of their type
        put(self, "waypoints", tuple(number("waypoints", angle, unit="rad") for angle in self.waypoints))
        put(self, "seconds", number("seconds", self.seconds, above=0.0, unit="s"))
        put(self, "hold", number("hold", self.hold, at_least=0.0, unit="s"))

    @property
    def duration(self) -> float:
        """Time from the first rest to the end of the last [s]."""
        arcs = len(self.waypoints) - 1
        return self.hold + arcs * (self.seconds + self.hold)

    def __call__(self, times: ArrayLike) -> Motion:
        times = np.asarray(times, dtype=float)
        angle = np.full(times.shape, self.waypoints[0])
        rate, acceleration = np.zeros(times.shape), np.zeros(times.shape)
        T = self.seconds
        for i, (start, end) in enumerate(zip(self.waypoints[:-1], self.waypoints[1:], strict=True)):
            s = np.clip((times - self.hold - i * (T + self.hold)) / T, 0.0, 1.0)
            angle += (end - start) * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
            rate += (end - start) / T * 30.0 * s**2 * (1.0 - s) ** 2
            acceleration += (end - start) / T**2 * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s)
        return Motion(angle, rate, acceleration)


@reference("arc", "go from theta to theta_end")
def _arc(theta: float, theta_end: float, seconds: float, hold: float) -> MinimumJerk:
    return MinimumJerk((theta, theta_end), seconds, hold)


@reference("return", "go from theta to theta_end and back")
def _return(theta: float, theta_end: float, seconds: float, hold: float) -> MinimumJerk:
    return MinimumJerk((theta, theta_end, theta), seconds, hold)


@dataclass(frozen=True)
class Sine:
    """theta = mean + amplitude sin(2 pi t / period) [rad, s]; it starts at full speed, so keep it slow or small."""

    mean: float
    amplitude: float
    period: float

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "mean", number("mean", self.mean, unit="rad"))
        put(self, "amplitude", number("amplitude", self.amplitude, unit="rad"))
        put(self, "period", number("period", self.period, above=0.0, unit="s"))

    @property
    def duration(self) -> float:
        """It goes on for ever."""
        return math.inf

    def __call__(self, times: ArrayLike) -> Motion:
        w = 2.0 * np.pi / self.period
        s, c = np.sin(w * np.asarray(times)), np.cos(w * np.asarray(times))
        return Motion(self.mean + self.amplitude * s, self.amplitude * w * c, -self.amplitude * w * w * s)


@reference("sine", "swing about theta")
def _sine(theta: float, amplitude: float, period: float) -> Sine:
    return Sine(theta, amplitude, period)


class Sampled:
    """Angles sampled every `dt` [s], interpolated by a quintic spline.

    After its end it rests at the last angle. Let the samples end at rest, or the rate jumps there.
    """

    def __init__(self, samples: ArrayLike, dt: float):
        from scipy.interpolate import make_interp_spline

        self.samples = array("samples", samples, (None,))
        if self.samples.size < 6:
            raise fail("samples", self.samples, "at least six angles [rad], as a quintic spline needs")
        self.dt = number("dt", dt, above=0.0, unit="s")
        knots = self.dt * np.arange(self.samples.size)
        self._curve = make_interp_spline(knots, self.samples, k=5)

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return self.dt * (self.samples.size - 1)

    def __call__(self, times: ArrayLike) -> Motion:
        times = np.asarray(times, dtype=float)
        inside = np.clip(times, 0.0, self.duration)
        moving = (times >= 0.0) & (times <= self.duration)
        return Motion(self._curve(inside), *(np.where(moving, self._curve(inside, k), 0.0) for k in (1, 2)))
