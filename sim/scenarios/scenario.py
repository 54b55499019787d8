"""Scenarios: what a closed-loop run is made of, and the keys that change it."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pivoting.controller.control_laws import Law
from pivoting.controller.references import Constant, MinimumJerk, Reference, Sine
from pivoting.controller.validate import Array, fail, number, one_of
from pivoting.controller.wrench_bounds import WrenchBounds
from pivoting.controller.wrench_problem import wrench_weight
from pivoting.models.length_unit import POWERS
from pivoting.models.scenes import BODY, TABLE, WORLD_KEYS, scene_path
from pivoting.sim.judging.verdict import Limits
from pivoting.sim.scenarios.relative_values import Load, absolute
from pivoting.sim.scenarios.scenario_keys import BOUND_KEYS, HIDDEN_KEYS, KEYS, LOWEST, RELATIVE_KEYS, check, parsed

PACE = 2001  # times at which a motion is looked at, to see how far and how fast it goes


@dataclass(frozen=True)
class Scenario:
    """A closed-loop run. Angles are in degrees here and in radians everywhere else.

    Keys of the world and of what the controller believes (None: as the scene's MJCF has it): mu, mass [kg], size [m],
    incline [deg], gravity [m/s^2], and of the simulator alone: dt, timeconst [s], impedance, impratio (see
    `models.scenes.load`). `world` holds what the simulated world really has where the controller believes otherwise.

    Attributes:
        name, summary: shown by `pivoting list`.
        scene: name of an MJCF file in models/, or the path of one of your own.
        body, support: names of the object and of the geom that it stands on (None: what is under it).
        contact: what stays put: "corner" (planar scenes), "vertex", "edge", "lowest", or points (K, 3), body frame,
            see `contact_candidates.stance`.
        chosen: whether the object's own contact and solver parameters give way to those of the shipped scenes.
        about: "tilt" (theta lifts the object off its face) or "yaw" (with the CoM straight above the contact, theta
            turns it about the table's normal).
        reference: "constant" (stay at theta for seconds), "arc" (theta to theta_end in seconds, at rest for hold before
            and after), "return" (an arc and back), "sine" (theta + amplitude sin, for seconds); from Python also any
            `Reference`, for seconds.
        law: of `control_laws.FORMULATIONS`.  bandwidth [rad/s] (1/h of a quasi-dynamic law), damping: of the law.
        margin: share of mu kept unused.  f_min: floor of each contact's normal force [N]; None: what keeps the contact
            closed as it turns, see `pace`.
        length: characteristic length of Q_w [m]; None: the lever of the contact.
        force_max [N], moment_max [N m], force_rate [N/s], moment_rate [N m/s]: bounds on the wrench, in object axes;
            None: none.
        plan_hz: how often a horizon is planned, which the per-step law then follows; None: the law follows the
            reference itself.  plan_steps, plan_step [s], integrator: of the horizon, see `controller.Horizon`.
        track: what a pose error of one radian, or one lever, costs in a plan's step, in squares of the weight.
        spread: each world starts off the reference by up to this angle [deg], drawn from the seed.
        limits: the thresholds of the verdict.
        given: what was set with `change`, as the command line spells it.

    Bounds and f_min may be relative to the weight of the object as it is believed, "0.8w", of a moment with the lever
    from contact to CoM, of a rate per second; and seconds, hold, period and plan_step to its natural time, "3T"; see
    `relative`. `absolute` resolves them.
    """

    name: str
    summary: str
    scene: str | os.PathLike[str]
    body: str = BODY
    support: str | None = TABLE
    contact: str | ArrayLike = "corner"
    chosen: bool = False
    about: str = "tilt"
    reference: str | Reference = "constant"
    theta: float = 30.0
    theta_end: float = 80.0
    seconds: float | str = 10.0
    hold: float | str = 0.25
    amplitude: float = 5.0
    period: float | str = 2.0
    law: str = "dynamic"
    bandwidth: float = 40.0
    damping: float = 1.0
    margin: float = 1.0 / 6.0
    f_min: float | str | None = 0.0
    length: float | None = None
    force_max: float | str | None = None
    moment_max: float | str | None = None
    force_rate: float | str | None = None
    moment_rate: float | str | None = None
    plan_hz: float | None = None
    plan_steps: int = 20
    plan_step: float | str = 0.02
    integrator: str = "semi-implicit"
    track: float = 1e4
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
    given: frozenset[str] = field(default=frozenset(), compare=False)

    def __post_init__(self) -> None:
        if isinstance(self.reference, np.ndarray | list | tuple):
            raise fail("reference", type(self.reference).__name__, "Sampled(samples, dt), which knows their times")
        if not isinstance(self.limits, Limits):
            raise fail("limits", self.limits, "Limits")
        one_of("about", self.about, ("tilt", "yaw"))
        corner = isinstance(self.contact, str) and self.contact == "corner"
        for key in KEYS:
            value = getattr(self, key)
            if key in ("theta", "theta_end") and not corner:  # what an object allows, its plan knows
                check(key, value, at_least=-360.0, at_most=360.0)
            elif key != "reference" or isinstance(value, str) or not callable(value):
                check(key, value)
        object.__setattr__(self, "world", MappingProxyType(dict(self.world)))
        for key, value in self.world.items():
            if key not in HIDDEN_KEYS:
                raise fail(f"world.{key}", value, "one of " + ", ".join(f"world.{k}" for k in HIDDEN_KEYS))
            check(key, value, "world.")
        if not isinstance(self.scene, str):
            object.__setattr__(self, "scene", Path(self.scene))
        swing = self.amplitude if self.reference == "sine" else 0.0
        if corner and not LOWEST <= self.theta - swing <= self.theta + swing <= 90.0 - LOWEST:
            raise fail("amplitude", swing, f"such that the block stays on its corner about theta = {self.theta:g} deg")

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickle, which takes no read-only mapping."""
        return partial(Scenario, **{**vars(self), "world": dict(self.world)}), ()

    @property
    def path(self) -> Path:
        """The MJCF file."""
        return scene_path(self.scene) if isinstance(self.scene, str) else Path(self.scene)

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
        """The reference of a scenario that is `absolute`, in radians."""
        if not isinstance(self.reference, str):
            return self.reference
        start, end = np.deg2rad(self.theta), np.deg2rad(self.theta_end)
        if self.reference == "constant":
            return Constant(start)
        if self.reference == "sine":
            return Sine(start, np.deg2rad(self.amplitude), self._number("period"))
        points = (start, end, start) if self.reference == "return" else (start, end)
        return MinimumJerk(points, self._number("seconds"), self._number("hold"))

    @property
    def duration(self) -> float:
        """Simulated time [s]."""
        ends = isinstance(self.reference, str) and np.isfinite(self.motion.duration)
        return self.motion.duration if ends else self._number("seconds")

    @property
    def changes(self) -> dict[str, Any]:
        """What was set, and what else differs from the shipped scenario of this name, or else from the defaults."""
        from pivoting.sim.scenarios.shipped_scenarios import shipped  # which are made of this

        then = (shipped(self) or Scenario(self.name, self.summary, self.scene))._values
        return {k: value for k, value in self._values.items() if k in self.given or k not in then or then[k] != value}

    @property
    def _values(self) -> dict[str, Any]:
        """By key of the command line; limits of the verdict as limit.KEY."""
        plain = {key: getattr(self, key) for key in KEYS}
        if not isinstance(self.reference, str):
            plain["reference"] = type(self.reference).__name__
        hidden = {f"world.{key}": value for key, value in self.world.items()}
        return {**plain, **hidden, **{f"limit.{key}": value for key, value in vars(self.limits).items()}}

    @property
    def label(self) -> str:
        """Name and changes, in the words of the command line."""
        return " ".join([self.name, *(f"{key}={value}" for key, value in self.changes.items())])

    @property
    def stages(self) -> dict[str, float]:
        """The values of the keys that ask for a stage, by the place of its class."""
        return {}

    def control_law(self) -> Law:
        """The law; the quasi-dynamic ones take the time constant of `bandwidth` as their step h."""
        if self.law == "static":
            return Law.static()
        if self.law.startswith("quasi-dynamic"):
            return Law.quasi_dynamic(1.0 / self.bandwidth, velocity=self.law == "quasi-dynamic-velocity")
        return Law.dynamic(self.bandwidth, self.damping)

    def absolute(self, of: Load) -> "Scenario":
        """This scenario with all that is relative resolved: it says how it moves a load, and within which bounds.

        Raises:
            ValueError: there is nothing to be relative to, or what comes out is out of range.
        """
        return replace(self, **self.resolved(of))

    def resolved(self, of: Load) -> dict[str, Any]:
        """What is relative, by key, in the key's own unit."""
        given = {key: getattr(self, key) for key in RELATIVE_KEYS if isinstance(getattr(self, key), str)}
        return {
            key: absolute(key, value, KEYS[key].relative, of, KEYS[key].unit, KEYS[key].limits)
            for key, value in given.items()
        }

    @property
    def pace(self) -> tuple[Array, Array]:
        """Times and the rates of turn at them, (N,) [s] and [rad/s], of a scenario whose motion is `absolute`."""
        times = np.linspace(0.0, self.duration, PACE)
        return times, self.samples(times)[1]

    def samples(self, times: Array) -> tuple[Array, Array, Array]:
        """Angles [rad], rates and accelerations (N,) at times (N,) [s], of a scenario whose motion is `absolute`.

        Raises:
            ValueError: a reference of a user's own gives others than these.
        """
        angle, rate, acceleration = (np.array(values, dtype=float) for values in self.motion(times))
        for name, values in (("angle", angle), ("rate", rate), ("acceleration", acceleration)):
            if values.shape != times.shape or not np.isfinite(values).all():
                allowed = f"finite and of the shape of the times, {times.shape}"
                raise fail("reference", f"{name} of shape {values.shape}", allowed)
        return angle, rate, acceleration

    def bounds(self, unit: float = 1.0) -> WrenchBounds:
        """On the wrench, of a scenario that is `absolute`; without any, one that bounds nothing.

        Args:
            unit: of the model's lengths [m], in which the bounds are then.
        """
        given = {
            key: self._number(key) / unit ** POWERS[KEYS[key].unit]
            for key in BOUND_KEYS
            if getattr(self, key) is not None
        }
        return WrenchBounds(**{key.removesuffix("_max"): value for key, value in given.items()})

    def _number(self, key: str) -> float:
        """A value that is no longer relative."""
        return number(key, getattr(self, key), unit=KEYS[key].unit)

    def wrench_weight(self, dim: int, unit: float = 1.0) -> Array | None:
        """Q_w of the characteristic length, in a model's `unit` of length [m], or None for the controller's own."""
        return None if self.length is None else wrench_weight(dim, self.length / unit)

    def change(self, **overrides: Any) -> "Scenario":
        """This scenario with other values; `world.KEY` (or a mapping `world`) changes the world alone.

        A plain key that the world had a value of its own for sets both again. `limits` (`Limits`, or a mapping of
        some) sets the verdict's.

        Raises:
            ValueError: an unknown key or a value out of range; it is named.
        """
        limits = overrides.pop("limits", {})
        plain = {key: value for key, value in overrides.items() if not key.startswith("world.") and key != "world"}
        given = overrides.get("world", {})
        if not isinstance(given, Mapping):
            raise fail("world", given, 'a mapping, such as {"mu": 0.2}')
        hidden = dict(given)
        hidden.update({key[6:]: value for key, value in overrides.items() if key.startswith("world.")})
        for key, value in plain.items():
            if key not in KEYS:
                raise fail(key, value, "a known key: " + ", ".join(KEYS) + ", world." + ", world.".join(HIDDEN_KEYS))
            plain[key] = parsed(key, value)
        kept = {key: value for key, value in self.world.items() if key not in plain}
        world = {**kept, **{key: parsed(key, value, "world.") for key, value in hidden.items()}}
        names = {
            *plain,
            *(f"world.{key}" for key in hidden),
            *(f"limit.{key}" for key in (limits if isinstance(limits, Mapping) else ())),
        }
        return replace(self, **plain, world=world, limits=self.limits.change(limits), given=self.given | names)
