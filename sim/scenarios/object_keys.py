"""The keys of the object and its support, which the controller may take to be other than they are."""

from dataclasses import dataclass

from pivoting.controller.uncertainty.uncertainty import Interval
from pivoting.models.mujoco_constants import LEAST_FRICTION
from pivoting.sim.scenarios.key_declaration import key

OBJECT = "the object and its support; as world.KEY of the world alone, which the controller does not know of"
SCENE = "as the scene has it"
COM_KEYS = ("com_x", "com_y", "com_z")  # for which "com" stands
SET_KEYS = ("mass", "inertia", "mu", *COM_KEYS)  # that may be intervals, in the order of `Uncertainty`


@dataclass(frozen=True, kw_only=True)
class ObjectKeys:
    """What an object has, as the controller believes; where several may be, an interval."""

    mu: float | Interval | None = key(
        None,
        f"friction coefficient between the object and its support (MuJoCo needs more than {LEAST_FRICTION:g})",
        group=OBJECT,
        above=0.0,
        at_most=10.0,
        none=SCENE,
    )
    mass: float | Interval | None = key(None, "mass of the object", group=OBJECT, unit="kg", above=0.0, none=SCENE)
    inertia: float | Interval | None = key(
        None,
        "factor on the inertia about the centre of mass that the object has with the mass that is believed",
        group=OBJECT,
        above=0.0,
        at_most=1e6,
        none="in proportion to the mass",
    )
    com: float | Interval | None = key(
        None,
        "com_x, com_y and com_z at once, as far as the object moves along them",
        group=OBJECT,
        unit="m",
        at_least=-1e3,
        at_most=1e3,
        none="0",
    )
    com_x: float | Interval | None = key(
        None,
        "centre of mass, from where the scene has it along the object's x axis",
        group=OBJECT,
        unit="m",
        at_least=-1e3,
        at_most=1e3,
        none="com",
    )
    com_y: float | Interval | None = key(
        None,
        "centre of mass, from where the scene has it along the object's y axis",
        group=OBJECT,
        unit="m",
        at_least=-1e3,
        at_most=1e3,
        none="com",
    )
    com_z: float | Interval | None = key(
        None,
        "centre of mass, from where the scene has it along the object's z axis",
        group=OBJECT,
        unit="m",
        at_least=-1e3,
        at_most=1e3,
        none="com",
    )
    size: float | None = key(
        None,
        "longest side of the object, which has to be a single box",
        group=OBJECT,
        unit="m",
        above=0.0,
        at_most=1e3,
        none=SCENE,
    )
    incline: float | None = key(
        None,
        "angle by which the support rises to the right",
        group=OBJECT,
        unit="deg",
        above=-90.0,
        below=90.0,
        none=SCENE,
    )
    gravity: float | None = key(
        None,
        "magnitude of gravity, whose direction stays that of the scene",
        group=OBJECT,
        unit="m/s^2",
        at_least=0.0,
        at_most=1e3,
        none=SCENE,
    )
