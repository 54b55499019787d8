"""The set in which the world is: honest bounds on what the controller does not know."""

from copy import copy
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike
from pivoting.controller.validate import Array, array, dimensions, fail, frozen, number, one_of

SHOVE_SECONDS = 0.05  # over which a shove is spread, unless it is said otherwise [s]
DISTURBANCES = ("shove", "theta", "omega")  # intervals about 0


class Interval(NamedTuple):
    """All numbers from `low` to `high`, both among them."""

    low: float
    high: float

    @property
    def middle(self) -> float:
        """Halfway between the two."""
        return 0.5 * (self.low + self.high)

    @property
    def half(self) -> float:
        """Half the width."""
        return 0.5 * (self.high - self.low)

    def at(self, share: float) -> float:
        """The number at this share of the way from `low` to `high`, to the last bit at both ends."""
        return self.high if share == 1.0 else self.low + share * (self.high - self.low)

    def scaled(self, scale: float) -> "Interval":
        """The interval about the same middle, `scale` times as wide."""
        return Interval(self.middle - scale * self.half, self.middle + scale * self.half)


class Member(NamedTuple):
    """One world of the set.

    Attributes:
        mass: [kg]; None: as believed.  com: (d,) from where the controller takes the CoM to be, object axes [m].
        inertia: factor on the believed inertia.  mu: friction coefficient; None: as believed.
    """

    mass: float | None
    com: Array
    inertia: float
    mu: float | None


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """The set of worlds in which a guarantee has to hold: independent intervals of what is not known exactly.

    A number stands for the interval of that number alone; for `com`, `theta` and `omega`, where the controller believes
    in 0, and for `shove`, it stands for the greatest deviation either way.

    Attributes:
        mass: of the object [kg]; None: as believed.
        com: (d, 2) the true centre of mass, from the point of the body that the controller takes for it, at which its
            wrench acts; object axes [m].
        inertia: factor on the believed inertia `about` the centre of mass or the contact.
        about: "com" or "contact"; in the plane the latter means the square of the radius of gyration about the contact,
            in space the tensor about it, both with the believed mass and centre of mass. What a pivot's motion tells is
            about the contact, and a guarantee for such a set is exact; one about the centre of mass is bounded.
        mu: friction coefficient of every contact; None: as believed. Only the lower bound matters to a grip.
        shove: impulse of a shove at the true centre of mass, per true kg, in any direction [N s/kg].
        shove_seconds: over which a shove is spread at least [s].
        theta: error of the measured orientation about any axis [rad].
        omega: error of the measured angular velocity about any axis [rad/s].

    Raises:
        ValueError: an interval that is empty, not finite, or of values that no world has; it is named.
    """

    mass: Interval | None
    com: Array
    inertia: Interval
    about: str
    mu: Interval | None
    shove: Interval
    shove_seconds: float
    theta: Interval
    omega: Interval

    def __init__(
        self,
        *,
        mass: ArrayLike | None = None,
        com: ArrayLike = 0.0,
        inertia: ArrayLike = 1.0,
        about: str = "com",
        mu: ArrayLike | None = None,
        shove: ArrayLike = 0.0,
        shove_seconds: float = SHOVE_SECONDS,
        theta: ArrayLike = 0.0,
        omega: ArrayLike = 0.0,
        dim: int | None = None,
    ):
        """The set; `dim`: 2 in the plane or 3 in space, needed where `com` is one interval for all axes."""
        put = object.__setattr__
        put(self, "mass", None if mass is None else _positive("mass", mass, "kg"))
        put(self, "com", _box(com, dim))
        put(self, "inertia", _positive("inertia", inertia, ""))
        one_of("about", about, ("com", "contact"))
        put(self, "about", about)
        put(self, "mu", None if mu is None else _positive("mu", mu, ""))
        put(self, "shove", _about_zero("shove", shove))
        put(self, "shove_seconds", number("shove_seconds", shove_seconds, above=0.0, unit="s"))
        put(self, "theta", _about_zero("theta", theta))
        put(self, "omega", _about_zero("omega", omega))

    @property
    def dim(self) -> int:
        """2 in the plane, 3 in space."""
        return len(self.com)

    @property
    def nominal(self) -> Member:
        """The member in the middle of all intervals, with the inertia that is believed."""
        return self.at([0.5] * self.unknowns)._replace(inertia=1.0)

    @property
    def unknowns(self) -> int:
        """How many numbers tell one member: mass, inertia, mu and d coordinates of the centre of mass."""
        return 3 + self.dim

    def at(self, shares: ArrayLike) -> Member:
        """The member at these shares (unknowns,) of the way through the intervals, of mass, inertia, mu and com."""
        mass, inertia, mu, *com = array("shares", shares, (self.unknowns,)).tolist()
        return Member(
            None if self.mass is None else self.mass.at(mass),
            frozen(np.array([Interval(*row).at(share) for row, share in zip(self.com, com, strict=True)])),
            self.inertia.at(inertia),
            None if self.mu is None else self.mu.at(mu),
        )

    def vertices(self) -> list[Member]:
        """All members at the ends of their intervals; what is known exactly has one end."""
        known = [0.0 if each is None else each.half for each in (self.mass, self.inertia, self.mu)]
        widths = [*known, *np.ptp(self.com, axis=1)]
        return [self.at(ends) for ends in product(*((0.0, 1.0) if width > 0.0 else (0.0,) for width in widths))]

    def scaled(self, scale: float) -> Self:
        """The set about the same nominal member, `scale` times as wide in every direction.

        What is believed may be outside of it where it is not in the middle: the nominal member is.

        Args:
            scale: >= 0, and < `widest`; 0 leaves the nominal member alone, which no disturbance meets.

        Raises:
            ValueError: the scale is not in this range.
        """
        factor = number("scale", scale, at_least=0.0, below=self.widest)
        middle, half = self.com.mean(axis=1), 0.5 * np.ptp(self.com, axis=1)
        changed: dict[str, object] = {
            "com": frozen(np.column_stack([middle - factor * half, middle + factor * half])),
            "mass": None if self.mass is None else self.mass.scaled(factor),
            "mu": None if self.mu is None else self.mu.scaled(factor),
            "inertia": Interval(*(1.0 + factor * (end - 1.0) for end in self.inertia)),
        }
        changed |= {name: Interval(*(factor * end for end in getattr(self, name))) for name in DISTURBANCES}
        out = copy(self)
        for name, value in changed.items():
            object.__setattr__(out, name, value)
        return out

    @property
    def widest(self) -> float:
        """The scale at which the set would reach a mass, an inertia or a friction of 0; inf if at none."""
        least = [1.0 - self.inertia.low]  # over the nominal value, what the set takes away of it
        least += [each.half / each.middle for each in (self.mass, self.mu) if each is not None]
        return float(1.0 / max(least)) if max(least) > 0.0 else float(np.inf)


def _positive(name: str, value: ArrayLike, unit: str) -> Interval:
    """An interval of numbers > 0."""
    interval = _interval(name, value)
    if interval.low <= 0.0:
        raise fail(name, value, "an interval (low, high) of numbers > 0" + f" [{unit}]" * bool(unit))
    return interval


def _about_zero(name: str, value: ArrayLike) -> Interval:
    """An interval with 0 in it; a number stands for the greatest deviation either way."""
    if dimensions(value) == 0:
        most = number(name, value, at_least=0.0)  # type: ignore[arg-type]
        return Interval(-most, most)
    interval = _interval(name, value)
    if not interval.low <= 0.0 <= interval.high:
        raise fail(name, value, "a number >= 0, or an interval (low, high) with 0 in it")
    return interval


def _box(value: ArrayLike, dim: int | None) -> Array:
    """(d, 2) of one interval for all axes, or one for each."""
    box = dimensions(value) == 2
    if not (isinstance(dim, int | np.integer) and dim in (2, 3)) and not (box and dim is None):
        raise fail("dim", dim, "2 or 3, where com is one interval for all axes")
    if box:
        return frozen(np.array([_about_zero("com", row) for row in array("com", value, (dim, 2))]))
    assert dim is not None
    return frozen(np.array([_about_zero("com", value)] * dim))


def _interval(name: str, value: ArrayLike) -> Interval:
    """An interval, or a number as one of no width."""
    if dimensions(value) == 0:
        only = number(name, value)  # type: ignore[arg-type]
        return Interval(only, only)
    low, high = array(name, value, (2,)).tolist()
    if low > high:
        raise fail(name, value, "(low, high) with low <= high")
    return Interval(low, high)
