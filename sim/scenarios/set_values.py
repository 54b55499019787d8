"""What a scenario says of its object, to the controller and of the world: numbers, and intervals that make a set."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from pivoting.controller.uncertainty.uncertainty import Interval
from pivoting.sim.scenarios.object_keys import COM_KEYS, SET_KEYS
from pivoting.sim.scenarios.scenario_keys import SCENE_KEYS

if TYPE_CHECKING:
    from pivoting.sim.scenarios.scenario import Scenario

Values = dict[str, float | Interval]


def believed_values(case: "Scenario") -> Values:
    """What the controller is told, by key of a scene."""
    return _spelled_out({key: getattr(case, key) for key in ("com", *SCENE_KEYS) if getattr(case, key) is not None})


def actual_values(case: "Scenario") -> Values:
    """What is so in the worlds, by key of a scene.

    Where the controller is told of a set, a world has the inertia that is believed, unless another is given; without a
    set the inertia is in proportion to the world's mass.
    """
    believed = believed_values(case)
    actual = {**believed, **_spelled_out(dict(case.world))}
    if any(isinstance(value, Interval) for value in believed.values()):
        actual.setdefault("inertia", 1.0)
    return actual


def differing_values(case: "Scenario") -> dict[str, Interval]:
    """The intervals from which each world has its own value, in the order of `SET_KEYS`; empty if the worlds are alike.

    Where the masses differ the inertia is among them if it does not follow the mass, as an interval of no width.
    """
    actual = actual_values(case)
    found = {key: value for key in SET_KEYS if isinstance(value := actual.get(key), Interval)}
    inertia = actual.get("inertia")
    if "mass" in found and isinstance(inertia, float | int):
        found["inertia"] = Interval(inertia, inertia)
    return {key: found[key] for key in SET_KEYS if key in found}


def _spelled_out(values: Mapping[str, float | Interval]) -> Values:
    """With each coordinate of the centre of mass in place of `com`."""
    given = dict(values)
    com = given.pop("com", None)
    return given if com is None else {**dict.fromkeys(COM_KEYS, com), **given}
