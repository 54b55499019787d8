"""Values relative to the object on its contact: "0.8w", of its weight; "3T", of the time in which gravity turns it."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.units import lever
from pivoting.controller.validate import fail, number

Array = NDArray[np.float64]
MEANING = {"w": "weights of the object, such as 0.8w", "T": "natural times sqrt(lever / gravity), such as 3T"}


class Load(NamedTuple):
    """What values may be relative to.

    force: [N] the object's weight.
    lever: [m] from the CoM to the contacts' mean, and the radius of what rolls. A moment of "1w" is weight times lever.
    time: [s] sqrt(lever / gravity), "1T": a pendulum of that length swings in 2 pi of them. inf without gravity.
    """

    force: float
    lever: float
    time: float


def load(mass: float, gravity: Array, points: Array, radius: Array) -> Load:
    """Of an object [kg] in `gravity` (3,) [m/s^2] on contacts (K, d) from its CoM [m], which roll at `radius` (K,)."""
    g, reach = float(np.linalg.norm(gravity)), lever(points) + float(np.mean(radius))
    return Load(mass * g, reach, float(np.sqrt(reach / g)) if g > 0.0 else np.inf)


def multiple(value: Any, sign: str) -> float | None:
    """How many of what `sign` stands for are in a text such as "0.8w"; None if it is no such text."""
    if not sign or not isinstance(value, str) or not value.strip().endswith(sign):
        return None
    try:
        return float(value.strip()[:-1])
    except ValueError:
        return None


def absolute(name: str, value: float | str, sign: str, of: Load, unit: str, limits: Mapping[str, float]) -> float:
    """A value in its `unit`, N or N m, per second or not, or s, of one that may be relative; to ten digits.

    Args:
        name: of the argument.  value: a number, or text such as "0.8w".  sign: "w" or "T".  of: the load.
        unit: of the result.  limits: that it has to be within, see `validate.number`.

    Raises:
        ValueError: there is nothing to be relative to, or the result is out of range.
    """
    times = multiple(value, sign)
    if times is None:
        return number(name, value, unit=unit, **limits)  # type: ignore[arg-type]
    one = of.time if sign == "T" else of.force * (of.lever if unit.startswith("N m") else 1.0)
    if times and not 0.0 < one < np.inf:
        missing = "gravity" if of.force == 0.0 else "a lever from the contacts to the centre of mass"
        raise fail(name, value, f"a number [{unit}]: without {missing} it says nothing")
    return number(f"{name} = {value}, that is {name}", float(f"{times * one:.10g}"), unit=unit, **limits)
