"""Scenarios: what a closed-loop run is made of, the keys that change it, and the shipped ones."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from pivoting.controller.laws import FORMULATIONS, Law
from pivoting.controller.problem import wrench_weight
from pivoting.controller.references import Constant, MinimumJerk, Reference, Sine
from pivoting.controller.validate import Array, fail, number, one_of
from pivoting.models.scenes import WORLD_KEYS, scene_path
from pivoting.sim.verdict import Limits

HIDDEN_KEYS = ("mu", "mass", "size", "incline", "gravity")  # what the world may have and the controller not know
CONTROL_KEYS = ("law", "bandwidth", "damping", "margin", "f_min", "length")  # of the controller alone
LOWEST = 0.1  # [deg] from a face: closer, the next corner touches the table too
_OPTIONAL = ("length", *WORLD_KEYS)  # None: as the scene or the contact has it
_POSITIVE = {"above": 0.0}
_RANGES: dict[str, dict[str, Any]] = {
    "mu": {**_POSITIVE, "at_most": 10.0},
    "mass": {**_POSITIVE, "at_most": 1e6, "unit": "kg"},
    "size": {**_POSITIVE, "at_most": 1e3, "unit": "m"},
    "incline": {"above": -90.0, "below": 90.0, "unit": "deg"},
    "gravity": {"at_least": 0.0, "at_most": 1e3, "unit": "m/s^2"},
    "dt": {**_POSITIVE, "at_most": 0.1, "unit": "s"},
    "timeconst": {**_POSITIVE, "at_most": 1.0, "unit": "s"},
    "impedance": {**_POSITIVE, "below": 1.0},
    "impratio": {**_POSITIVE, "at_most": 1e9},
    "theta": {"at_least": LOWEST, "at_most": 90.0 - LOWEST, "unit": "deg"},
    "theta_end": {"at_least": LOWEST, "at_most": 90.0 - LOWEST, "unit": "deg"},
    "seconds": {**_POSITIVE, "at_most": 3600.0, "unit": "s"},
    "hold": {"at_least": 0.0, "at_most": 3600.0, "unit": "s"},
    "amplitude": {"at_least": 0.0, "below": 45.0, "unit": "deg"},
    "period": {**_POSITIVE, "at_most": 3600.0, "unit": "s"},
    "bandwidth": {**_POSITIVE, "at_most": 1e5, "unit": "rad/s"},
    "damping": {**_POSITIVE, "at_most": 100.0},
    "margin": {"at_least": 0.0, "below": 1.0},
    "f_min": {"at_least": 0.0, "at_most": 1e9, "unit": "N"},
    "length": {**_POSITIVE, "at_most": 1e6, "unit": "m"},
    "spread": {"at_least": 0.0, "at_most": 10.0, "unit": "deg"},
}


@dataclass(frozen=True)
class Scenario:
    """A closed-loop run. Angles are in degrees here and in radians everywhere else.

    Keys of the world and of what the controller believes (None: as the scene's MJCF has it): mu, mass [kg], size [m],
    incline [deg], gravity [m/s^2], and of the simulator alone: dt, timeconst [s], impedance, impratio (see
    `models.scenes.load`). `world` holds what the simulated world really has where the controller believes otherwise.

    Attributes:
        name, summary: shown by `pivoting list`.
        scene: name of an MJCF file in models/.
        reference: "constant" (stay at theta for seconds), "arc" (theta to theta_end in seconds, at rest for hold before
            and after), "return" (an arc and back), "sine" (theta + amplitude sin, for seconds); from Python also any
            `Reference`, for seconds.
        law: "static", "quasi-dynamic", "dynamic".  bandwidth [rad/s], damping: of the dynamic law.
        margin: share of mu kept unused.  f_min: normal-force floor [N].
        length: characteristic length of Q_w [m]; None: the lever of the contact.
        spread: each world starts off the reference by up to this angle [deg], drawn from the seed.
        limits: the thresholds of the verdict.
    """

    name: str
    summary: str
    scene: str
    reference: str | Reference = "constant"
    theta: float = 30.0
    theta_end: float = 80.0
    seconds: float = 10.0
    hold: float = 0.25
    amplitude: float = 5.0
    period: float = 2.0
    law: str = "dynamic"
    bandwidth: float = 40.0
    damping: float = 1.0
    margin: float = 1.0 / 6.0
    f_min: float = 0.0
    length: float | None = None
    spread: float = 0.01
    mu: float | None = None
    mass: float | None = None
    size: float | None = None
    incline: float | None = None
    gravity: float | None = None
    dt: float | None = None
    timeconst: float | None = None
    impedance: float | None = None
    impratio: float | None = None
    world: Mapping[str, float] = field(default_factory=dict)
    limits: Limits = field(default_factory=Limits)

    def __post_init__(self) -> None:
        if isinstance(self.reference, np.ndarray | list | tuple):
            raise fail("reference", type(self.reference).__name__, "Sampled(samples, dt), which knows their times")
        if isinstance(self.reference, str) or not callable(self.reference):
            one_of("reference", self.reference, ("constant", "arc", "return", "sine"))
        one_of("law", self.law, FORMULATIONS)
        if not isinstance(self.limits, Limits):
            raise fail("limits", self.limits, "Limits")
        for key in _RANGES:
            if getattr(self, key) is not None or key not in _OPTIONAL:
                number(key, getattr(self, key), **_RANGES[key])
        object.__setattr__(self, "world", MappingProxyType(dict(self.world)))
        for key, value in self.world.items():
            if key not in HIDDEN_KEYS:
                raise fail(f"world.{key}", value, "one of " + ", ".join(f"world.{k}" for k in HIDDEN_KEYS))
            number(f"world.{key}", value, **_RANGES[key])
        swing = self.amplitude if self.reference == "sine" else 0.0
        if not LOWEST <= self.theta - swing <= self.theta + swing <= 90.0 - LOWEST:
            raise fail("amplitude", swing, f"such that the block stays on its corner about theta = {self.theta:g} deg")

    @property
    def path(self) -> Path:
        """The MJCF file."""
        return scene_path(self.scene)

    @property
    def believed(self) -> dict[str, float]:
        """Changes to the scene that the controller knows of."""
        return {key: getattr(self, key) for key in WORLD_KEYS if getattr(self, key) is not None}

    @property
    def actual(self) -> dict[str, float]:
        """Changes to the scene that is simulated."""
        return {**self.believed, **self.world}

    @property
    def motion(self) -> Reference:
        """The reference, in radians."""
        if not isinstance(self.reference, str):
            return self.reference
        start, end = np.deg2rad(self.theta), np.deg2rad(self.theta_end)
        if self.reference == "constant":
            return Constant(start)
        if self.reference == "sine":
            return Sine(start, np.deg2rad(self.amplitude), self.period)
        return MinimumJerk((start, end, start) if self.reference == "return" else (start, end), self.seconds, self.hold)

    @property
    def duration(self) -> float:
        """Simulated time [s]."""
        motion = self.motion
        return motion.duration if isinstance(motion, MinimumJerk) and self.reference is not motion else self.seconds

    @property
    def changes(self) -> dict[str, Any]:
        """What differs from the shipped scenario of this name, by key; everything, if there is none."""
        shipped = SCENARIOS.get(self.name)
        own = {
            key: getattr(self, key) for key in KEYS if shipped is None or getattr(self, key) != getattr(shipped, key)
        }
        if "reference" in own and not isinstance(self.reference, str):
            own["reference"] = type(self.reference).__name__
        theirs = {} if shipped is None else shipped.world
        hidden = {f"world.{key}": value for key, value in self.world.items() if theirs.get(key) != value}
        return {**own, **hidden}

    @property
    def label(self) -> str:
        """Name and changes, in the words of the command line."""
        return " ".join([self.name, *(f"{key}={value}" for key, value in self.changes.items())])

    def control_law(self) -> Law:
        """The law; the quasi-dynamic one takes the time constant of `bandwidth` as its step h."""
        if self.law == "static":
            return Law.static()
        if self.law == "quasi-dynamic":
            return Law.quasi_dynamic(1.0 / self.bandwidth)
        return Law.dynamic(self.bandwidth, self.damping)

    def wrench_weight(self) -> Array | None:
        """Q_w of the characteristic length, or None for the controller's own."""
        return None if self.length is None else wrench_weight(2, self.length)

    def change(self, **overrides: Any) -> "Scenario":
        """This scenario with other values; `world.KEY` (or a mapping `world`) changes the world alone.

        A plain key that the world had a value of its own for sets both again.

        Raises:
            ValueError: an unknown key or a value out of range; it is named.
        """
        plain = {key: value for key, value in overrides.items() if not key.startswith("world.") and key != "world"}
        given = overrides.get("world", {})
        if not isinstance(given, Mapping):
            raise fail("world", given, 'a mapping, such as {"mu": 0.2}')
        hidden = dict(given)
        hidden.update({key[6:]: value for key, value in overrides.items() if key.startswith("world.")})
        for key, value in plain.items():
            if key not in KEYS:
                raise fail(key, value, "a known key: " + ", ".join(KEYS) + ", world." + ", world.".join(HIDDEN_KEYS))
            plain[key] = _parsed(key, value)
        kept = {key: value for key, value in self.world.items() if key not in plain}
        world = {**kept, **{key: _parsed(key, value, "world.") for key, value in hidden.items()}}
        return replace(self, **plain, world=world)


_WORDS = ("reference", "law")
KEYS = (*_WORDS, *_RANGES)


def _parsed(key: str, value: Any, prefix: str = "") -> Any:
    """The value of a key, from the command line's text if need be."""
    if key in _WORDS:
        return value
    if isinstance(value, str):
        try:
            return float(value)
        except ValueError:
            raise fail(prefix + key, value, "a number") from None
    return value


def scenario(name: str) -> Scenario:
    """The shipped scenario of that name."""
    if name not in SCENARIOS:
        raise fail("scenario", name, "one of " + ", ".join(SCENARIOS))
    return SCENARIOS[name]


SCENARIOS = {
    case.name: case
    for case in (
        Scenario(
            "balance-2d",
            "hold a 1 m, 1 kg block on its corner at 30 deg for 10 s",
            scene="balance-2d",
            limits=Limits(slip_m=2e-5, angle_rms_deg=0.005, angle_max_deg=0.005, force_mismatch_rel=0.01, settle_s=0.5),
        ),
        Scenario(
            "incline-2d",
            "the notes' printed example: 30 deg on a table inclined by 30 deg, on the cone's edge",
            scene="incline-2d",
            mu=0.3,
            world={"mu": 0.4},
            margin=0.0,
            length=1.0,
            seconds=5.0,
            limits=Limits(slip_m=2e-5, angle_rms_deg=0.005, angle_max_deg=0.005, force_mismatch_rel=0.01, settle_s=0.5),
        ),
        Scenario(
            "pivot-2d",
            "turn the block about its corner from 10 to 80 deg in 2 s, and back",
            scene="pivot-2d",
            reference="return",
            theta=10.0,
            seconds=2.0,
            limits=Limits(slip_m=2e-5, angle_rms_deg=0.02, angle_max_deg=0.05, force_mismatch_rel=0.01, settle_s=0.1),
        ),
        Scenario(
            "snap-2d",
            "10 to 80 deg in 0.3 s, with a floor under the normal force",
            scene="snap-2d",
            reference="arc",
            theta=10.0,
            seconds=0.3,
            f_min=50.0,
            limits=Limits(slip_m=1e-4, angle_rms_deg=0.1, angle_max_deg=0.2, force_mismatch_rel=0.05, settle_s=0.1),
        ),
    )
}
