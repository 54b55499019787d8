"""Scenarios: what a closed-loop run is made of, the keys that change it, and the shipped ones."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pivoting.controller.bounds import WrenchBounds
from pivoting.controller.laws import FORMULATIONS, Law
from pivoting.controller.problem import wrench_weight
from pivoting.controller.references import Constant, MinimumJerk, Reference, Sine
from pivoting.controller.transcription import INTEGRATORS
from pivoting.controller.validate import Array, fail, number, one_of
from pivoting.models.scenes import BODY, TABLE, WORLD_KEYS, scene_path
from pivoting.sim.keys import BOUND_KEYS, HIDDEN_KEYS, KEYS, LOWEST, OPTIONAL, RANGES, parsed
from pivoting.sim.verdict import Limits


@dataclass(frozen=True)
class Scenario:
    """A closed-loop run. Angles are in degrees here and in radians everywhere else.

    Keys of the world and of what the controller believes (None: as the scene's MJCF has it): mu, mass [kg], size [m],
    incline [deg], gravity [m/s^2], and of the simulator alone: dt, timeconst [s], impedance, impratio (see
    `models.scenes.load`). `world` holds what the simulated world really has where the controller believes otherwise.

    Attributes:
        name, summary: shown by `pivoting list`.
        scene: name of an MJCF file in models/, or the path of one of your own.
        body, support: names of the object and of the geom that it stands on (None: the only plane).
        contact: what stays put: "corner" (planar scenes), "vertex", "edge", "lowest", or points (K, 3), body frame,
            see `models.candidates.stance`.
        chosen: whether the object's own contact and solver parameters give way to those of the shipped scenes.
        about: "tilt" (theta lifts the object off its face) or "yaw" (with the CoM straight above the contact, theta
            turns it about the table's normal).
        reference: "constant" (stay at theta for seconds), "arc" (theta to theta_end in seconds, at rest for hold before
            and after), "return" (an arc and back), "sine" (theta + amplitude sin, for seconds); from Python also any
            `Reference`, for seconds.
        law: of `controller.laws.FORMULATIONS`.  bandwidth [rad/s] (1/h of a quasi-dynamic law), damping: of the law.
        margin: share of mu kept unused.  f_min: normal-force floor [N].
        length: characteristic length of Q_w [m]; None: the lever of the contact.
        force_max [N], moment_max [N m], force_rate [N/s], moment_rate [N m/s]: bounds on the wrench, in object axes;
            None: none.
        plan_hz: how often a horizon is planned, which the per-step law then follows; None: the law follows the
            reference itself.  plan_steps, plan_step [s], integrator: of the horizon, see `controller.Horizon`.
        track: what a pose error of one radian, or one lever, costs in a plan's step, in squares of the weight.
        spread: each world starts off the reference by up to this angle [deg], drawn from the seed.
        limits: the thresholds of the verdict.
    """

    name: str
    summary: str
    scene: str | Path
    body: str = BODY
    support: str | None = TABLE
    contact: str | ArrayLike = "corner"
    chosen: bool = False
    about: str = "tilt"
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
    force_max: float | None = None
    moment_max: float | None = None
    force_rate: float | None = None
    moment_rate: float | None = None
    plan_hz: float | None = None
    plan_steps: int = 20
    plan_step: float = 0.02
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

    def __post_init__(self) -> None:
        if isinstance(self.reference, np.ndarray | list | tuple):
            raise fail("reference", type(self.reference).__name__, "Sampled(samples, dt), which knows their times")
        if isinstance(self.reference, str) or not callable(self.reference):
            one_of("reference", self.reference, ("constant", "arc", "return", "sine"))
        one_of("law", self.law, FORMULATIONS)
        one_of("integrator", self.integrator, tuple(INTEGRATORS))
        if not float(self.plan_steps).is_integer():
            raise fail("plan_steps", self.plan_steps, "a whole number")
        if not isinstance(self.limits, Limits):
            raise fail("limits", self.limits, "Limits")
        one_of("about", self.about, ("tilt", "yaw"))
        corner = isinstance(self.contact, str) and self.contact == "corner"
        for key in RANGES:
            if key in ("theta", "theta_end") and not corner:  # what an object allows, its plan knows
                number(key, getattr(self, key), at_least=-360.0, at_most=360.0, unit="deg")
            elif getattr(self, key) is not None or key not in OPTIONAL:
                number(key, getattr(self, key), **RANGES[key])
        object.__setattr__(self, "world", MappingProxyType(dict(self.world)))
        for key, value in self.world.items():
            if key not in HIDDEN_KEYS:
                raise fail(f"world.{key}", value, "one of " + ", ".join(f"world.{k}" for k in HIDDEN_KEYS))
            number(f"world.{key}", value, **RANGES[key])
        swing = self.amplitude if self.reference == "sine" else 0.0
        if corner and not LOWEST <= self.theta - swing <= self.theta + swing <= 90.0 - LOWEST:
            raise fail("amplitude", swing, f"such that the block stays on its corner about theta = {self.theta:g} deg")

    @property
    def path(self) -> Path:
        """The MJCF file."""
        return self.scene if isinstance(self.scene, Path) else scene_path(self.scene)

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
        own_one = isinstance(self.scene, Path) and self.name == "pivot"
        shipped = own_object(self.scene, self.body) if own_one else SCENARIOS.get(self.name)  # type: ignore[arg-type]
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
        """The law; the quasi-dynamic ones take the time constant of `bandwidth` as their step h."""
        if self.law == "static":
            return Law.static()
        if self.law.startswith("quasi-dynamic"):
            return Law.quasi_dynamic(1.0 / self.bandwidth, velocity=self.law == "quasi-dynamic-velocity")
        return Law.dynamic(self.bandwidth, self.damping)

    def bounds(self) -> WrenchBounds:
        """On the wrench; without any, one that bounds nothing."""
        names = {"force_max": "force", "moment_max": "moment"}
        given = {names.get(key, key): getattr(self, key) for key in BOUND_KEYS if getattr(self, key) is not None}
        return WrenchBounds(**given)

    def wrench_weight(self, dim: int) -> Array | None:
        """Q_w of the characteristic length, or None for the controller's own."""
        return None if self.length is None else wrench_weight(dim, self.length)

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
            plain[key] = parsed(key, value)
        kept = {key: value for key, value in self.world.items() if key not in plain}
        world = {**kept, **{key: parsed(key, value, "world.") for key, value in hidden.items()}}
        return replace(self, **plain, world=world)


def own_object(
    model: Path, body: str, contact: str | ArrayLike = "lowest", *, support: str | None = None, chosen: bool = True
) -> Scenario:
    """A scenario of an object of your own: turned by 20 degrees about a contact, in 2 s.

    Args:
        model: MJCF file.
        body: name of a body that moves freely, or by two slides and a hinge.
        contact: "vertex", "edge", "lowest", or points (K, 3) in the body frame [m]; see `models.candidates.stance`.
        support: name of the plane or box geom that it stands on; None: the only plane.
        chosen: simulate it with the contact and solver parameters of the shipped scenes (`models/settings.xml`).
    """
    return Scenario(
        "pivot",
        f"{body} of {model.name} about its {contact if isinstance(contact, str) else 'given contact'}",
        scene=Path(model),
        body=body,
        support=support,
        contact=contact,
        chosen=chosen,
        reference="arc",
        theta=5.0,
        theta_end=25.0,
        seconds=2.0,
        limits=Limits(slip_m=None, angle_rms_deg=0.1, angle_max_deg=0.2, force_mismatch_rel=0.05, settle_s=0.1),
    )


def scenario(name: str) -> Scenario:
    """The shipped scenario of that name."""
    if name not in SCENARIOS:
        raise fail("scenario", name, "one of " + ", ".join(SCENARIOS) + ", or pivot with a model")
    return SCENARIOS[name]


_PLANNED = Limits(slip_m=1e-4, angle_rms_deg=0.2, angle_max_deg=0.5, force_mismatch_rel=0.05, settle_s=0.1)
_SPATIAL = Limits(slip_m=1e-4, angle_rms_deg=0.05, angle_max_deg=0.1, force_mismatch_rel=0.03, settle_s=0.1)
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
        Scenario(
            "mpc-2d",
            "10 to 80 deg in 1 s by a receding horizon, with a force of at most 0.8 of the weight",
            scene="pivot-2d",
            reference="arc",
            theta=10.0,
            seconds=1.0,
            plan_hz=100.0,
            force_max=8.0,
            limits=_PLANNED,
        ),
        Scenario(
            "balance-3d",
            "a 1 x 0.7 x 1.4 m block on one vertex, its body diagonal vertical, for 10 s",
            scene="balance-3d",
            contact="vertex",
            about="yaw",
            theta=0.0,
            limits=_SPATIAL,
        ),
        Scenario(
            "spin-3d",
            "the block on that vertex, 90 deg of yaw in 2 s",
            scene="spin-3d",
            contact="vertex",
            about="yaw",
            reference="arc",
            theta=0.0,
            theta_end=90.0,
            seconds=2.0,
            limits=_SPATIAL,
        ),
        Scenario(
            "pivot-3d",
            "the block about an edge, two contacts, from 10 to 80 deg in 2 s",
            scene="pivot-3d",
            contact="edge",
            reference="arc",
            theta=10.0,
            seconds=2.0,
            limits=_SPATIAL,
        ),
        Scenario(
            "mpc-3d",
            "the block about an edge by a receding horizon, from 10 to 80 deg in 2 s",
            scene="pivot-3d",
            contact="edge",
            reference="arc",
            theta=10.0,
            seconds=2.0,
            plan_hz=100.0,
            force_max=8.0,
            limits=_PLANNED,
        ),
        Scenario(
            "settle-3d",
            "the block lowered about an edge until it lies on its face, without bouncing, in 2 s",
            scene="settle-3d",
            contact="edge",
            reference="arc",
            theta=20.0,
            theta_end=0.0,
            seconds=2.0,
            limits=replace(_SPATIAL, contacts_end=4),
        ),
    )
}
