"""Scenarios: what a closed-loop run is made of, its keys with the values that they have there, and how they change."""

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from pivoting.controller.control_laws import Law
from pivoting.controller.references import REFERENCES, Reference
from pivoting.controller.uncertainty.uncertainty import Interval
from pivoting.controller.validate import Array, fail, number, one_of
from pivoting.models.length_unit import POWERS
from pivoting.models.shipped_files import BODY, TABLE, scene_path
from pivoting.sim.judging.verdict import Limits
from pivoting.sim.scenarios.intervals import middle, read_interval, spelled
from pivoting.sim.scenarios.key_declaration import Key, declared_keys, documented
from pivoting.sim.scenarios.relative_values import Load, absolute
from pivoting.sim.scenarios.scenario_keys import (
    ANY_ANGLE,
    BOUND_KEYS,
    HIDDEN_KEYS,
    LOWEST,
    ScenarioKeys,
)
from pivoting.sim.scenarios.set_values import actual_values, believed_values, differing_values

if TYPE_CHECKING:  # what is compiled is imported when it is needed: a list of scenarios needs none of it
    from pivoting.controller.wrench_bounds import WrenchBounds

_HIDDEN = tuple(f"world.{key}" for key in HIDDEN_KEYS)
PACE = 2001  # times at which a motion is looked at, to see how far and how fast it goes


@documented
@dataclass(frozen=True)
class Scenario(ScenarioKeys):
    """A closed-loop run. Angles are in degrees here and in radians everywhere else.

    The keys, which are listed last and given by name, belong to the world and to what the controller believes of it,
    to the reference and to the controller; `world` holds what the simulated world really has where the controller
    believes otherwise. Bounds and f_min may be relative to the weight of the object as it is believed, "0.8w", of a
    moment with the lever from contact to CoM, of a rate per second; durations to its natural time, "3T"; see
    `relative_values`. `absolute` resolves them.

    mass, inertia, mu and the coordinates of the centre of mass may be intervals, (0.8, 1.2) or "0.8:1.2": the
    controller is told that they are somewhere in there and takes the middle for nominal, and each world has its own,
    see `worlds_at`, unless `world` says which. Intervals in `world` are of the worlds alone.

    Attributes:
        name, summary: shown by `pivoting list`.
        scene: name of an MJCF file in models/, or the path of one of your own.
        body, support: names of the object and of the geom that it stands on (None: what is under it).
        contact: what stays put: "corner" (planar scenes), "vertex", "edge", "lowest", or points (K, 3), body frame,
            see `contact_candidates.find_pivot`.
        chosen: whether the object's own contact and solver parameters give way to those of the shipped scenes.
        about: "tilt" (theta lifts the object off its face) or "yaw" (with the CoM straight above the contact, theta
            turns it about the table's normal).
        world: values by key of the object that the simulated world alone has, or intervals.
        limits: the thresholds of the verdict.
        given: what was set with `change`, as the command line spells it.
    """

    name: str
    summary: str
    scene: str | os.PathLike[str]
    body: str = BODY
    support: str | None = TABLE
    contact: str | ArrayLike = "corner"
    chosen: bool = False
    about: str = "tilt"
    world: Mapping[str, float | Interval] = field(default_factory=dict)
    limits: Limits = field(default_factory=Limits)
    given: frozenset[str] = field(default=frozenset(), compare=False)

    def __post_init__(self) -> None:
        if isinstance(self.reference, np.ndarray | list | tuple):
            raise fail("reference", type(self.reference).__name__, "Sampled(samples, dt), which knows their times")
        if not isinstance(self.limits, Limits):
            raise fail("limits", self.limits, "Limits")
        one_of("about", self.about, ("tilt", "yaw"))
        corner = isinstance(self.contact, str) and self.contact == "corner"
        for name, key in self._keys.items():
            if key.ranged:
                object.__setattr__(self, name, read_interval(name, getattr(self, name)))
            turned = name in ("theta", "theta_end") and not corner  # what an object allows, its plan knows
            key.check(name, getattr(self, name), **(ANY_ANGLE if turned else {}))
        hidden = {name: self._hidden(name, value).read(f"world.{name}", value) for name, value in self.world.items()}
        object.__setattr__(self, "world", MappingProxyType(hidden))
        for name, value in hidden.items():
            self._hidden(name, value).check(f"world.{name}", value)
        if not isinstance(self.scene, str):
            object.__setattr__(self, "scene", Path(self.scene))
        swing = self.amplitude if "amplitude" in self.reference_keys else 0.0
        if corner and not LOWEST <= self.theta - swing <= self.theta + swing <= 90.0 - LOWEST:
            raise fail("amplitude", swing, f"such that the block stays on its corner about theta = {self.theta:g} deg")

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickle, which takes no read-only mapping."""
        return partial(type(self), **{**vars(self), "world": dict(self.world)}), ()

    @property
    def _keys(self) -> Mapping[str, Key]:
        """As they are declared, those of a subclass among them."""
        return declared_keys(type(self))

    def _hidden(self, name: str, value: Any) -> Key:
        """The key world.NAME, which has this value."""
        if name not in HIDDEN_KEYS:
            raise fail(f"world.{name}", value, "one of " + ", ".join(_HIDDEN))
        return self._keys[name]

    @property
    def own(self) -> bool:
        """Whether the object is of a user's own file, and not of a scene of this package."""
        return not isinstance(self.scene, str)

    @property
    def path(self) -> Path:
        """The MJCF file."""
        return scene_path(self.scene) if isinstance(self.scene, str) else Path(self.scene)

    @property
    def believed(self) -> dict[str, float]:
        """Changes to the scene that the controller knows of; of intervals it takes the middle."""
        return {key: middle(value) for key, value in believed_values(self).items()}

    @property
    def actual(self) -> dict[str, float]:
        """Changes to the scene that is simulated; in the middle of what is `differing`."""
        return {key: middle(value) for key, value in actual_values(self).items()}

    @property
    def differing(self) -> Mapping[str, Interval] | None:
        """The intervals, by key of the object, from which each world has a value of its own; None: they are alike."""
        return differing_values(self) or None

    @property
    def uncertain(self) -> bool:
        """Whether the controller is told that something of the object is in an interval, and knows no number."""
        return any(isinstance(value, Interval) for value in believed_values(self).values())

    @property
    def reference_keys(self) -> tuple[str, ...]:
        """The keys that the reference is made of; none, if it is not asked for by name."""
        return REFERENCES[self.reference].keys if isinstance(self.reference, str) else ()

    @property
    def motion(self) -> Reference:
        """The reference of a scenario that is `absolute`, in radians."""
        if not isinstance(self.reference, str):
            return self.reference
        values = {key: self._number(key) for key in self.reference_keys}
        in_radians = {key: np.deg2rad(value) for key, value in values.items() if self._keys[key].unit == "deg"}
        return REFERENCES[self.reference].make(**{**values, **in_radians})

    @property
    def duration(self) -> float:
        """Simulated time [s]."""
        ends = isinstance(self.reference, str) and np.isfinite(self.motion.duration)
        return self.motion.duration if ends else self._number("seconds")

    @property
    def changes(self) -> dict[str, Any]:
        """What was set, and what else with an effect is not as in the shipped scenario of this name, or by default."""
        from pivoting.sim.scenarios.shipped_scenarios import shipped  # which are made of this

        then = (shipped(self) or type(self)(self.name, self.summary, self.scene))._values
        return {
            key: value
            for key, value in self._values.items()
            if key in self.given or key not in then or (then[key] != value and self._effective(key))
        }

    def _effective(self, name: str, open_loop: bool = True) -> bool:
        """Whether a key has an effect beside the values of the others; see `refuse_without_effect`."""
        needs = self._keys[name].needs if name in self._keys else None
        return needs is None or needs.met(name, self, open_loop)

    @property
    def _values(self) -> dict[str, Any]:
        """By key of the command line; limits of the verdict as limit.KEY."""
        plain = {key: getattr(self, key) for key in self._keys}
        if not isinstance(self.reference, str):
            plain["reference"] = type(self.reference).__name__
        hidden = {f"world.{key}": value for key, value in self.world.items()}
        return {**plain, **hidden, **{f"limit.{key}": value for key, value in vars(self.limits).items()}}

    @property
    def label(self) -> str:
        """Name and changes, in the words of the command line."""
        return " ".join([self.name, *(f"{key}={spelled(value)}" for key, value in self.changes.items())])

    @property
    def stages(self) -> dict[str, float]:
        """The values of the keys that ask for a stage of the pipeline, by the place of its class."""
        asked: dict[str, float] = {}
        for name, key in self._keys.items():
            if value := getattr(self, name):
                for stage in key.stages:
                    asked.setdefault(stage, value)
        return asked

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
        given = {name: getattr(self, name) for name, key in self._keys.items() if key.relative}
        return {
            name: absolute(name, value, self._keys[name].relative, of, self._keys[name].unit, self._keys[name].limits)
            for name, value in given.items()
            if isinstance(value, str)
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

    def bounds(self, unit: float = 1.0) -> "WrenchBounds":
        """On the wrench, of a scenario that is `absolute`; without any, one that bounds nothing.

        Args:
            unit: of the model's lengths [m], in which the bounds are then.
        """
        given = {
            key: self._number(key) / unit ** POWERS[self._keys[key].unit]
            for key in BOUND_KEYS
            if getattr(self, key) is not None
        }
        from pivoting.controller.wrench_bounds import WrenchBounds

        return WrenchBounds(**{key.removesuffix("_max"): value for key, value in given.items()})

    def _number(self, key: str) -> float:
        """A value that is no longer relative."""
        return number(key, getattr(self, key), unit=self._keys[key].unit)

    def wrench_weight(self, dim: int, unit: float = 1.0) -> Array | None:
        """Q_w of the characteristic length, in a model's `unit` of length [m], or None for the controller's own."""
        from pivoting.controller.wrench_problem import wrench_weight

        return None if self.length is None else wrench_weight(dim, self.length / unit)

    def change(self, **overrides: Any) -> "Scenario":
        """This scenario with other values; `world.KEY` (or a mapping `world`) changes the world alone.

        A plain key that the world had a value of its own for sets both again. `limits` (`Limits`, or a mapping of
        some) sets the verdict's.

        Raises:
            ValueError: an unknown key, a value out of range, or a key that has no effect; it is named.
        """
        limits = overrides.pop("limits", {})
        plain = {key: value for key, value in overrides.items() if not key.startswith("world.") and key != "world"}
        given = overrides.get("world", {})
        if not isinstance(given, Mapping):
            raise fail("world", given, 'a mapping, such as {"mu": 0.2}')
        hidden = dict(given)
        hidden.update({key[6:]: value for key, value in overrides.items() if key.startswith("world.")})
        for key, value in plain.items():
            if key not in self._keys:
                raise fail(key, value, "a known key: " + ", ".join((*self._keys, *_HIDDEN)))
            plain[key] = self._keys[key].read(key, value)
        kept = {key: value for key, value in self.world.items() if key not in plain}
        hidden = {key: self._hidden(key, value).read(f"world.{key}", value) for key, value in hidden.items()}
        names = {
            *plain,
            *(f"world.{key}" for key in hidden),
            *(f"limit.{key}" for key in (limits if isinstance(limits, Mapping) else ())),
        }
        new = replace(
            self, **plain, world={**kept, **hidden}, limits=self.limits.change(limits), given=self.given | names
        )
        new.refuse_without_effect(plain)
        return new

    def refuse_without_effect(self, keys: Iterable[str], open_loop: bool = True) -> None:
        """Raise if one of some `keys` that were set has no effect beside the others.

        Args:
            open_loop: whether the run is in open loop, where a plan is made without plan_hz; True also where that is
                not known.

        Raises:
            ValueError: the reference, the law or the planning that there is takes no notice of a key; it is named.
        """
        asked = set(keys)
        for name, key in self._keys.items():
            if name in asked and key.needs is not None and not self._effective(name, open_loop):
                raise fail(name, getattr(self, name), f"left out: it has no effect unless {key.needs.condition(name)}")
