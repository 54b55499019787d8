"""The proof that a wrench problem has no answer within bounds: numbers that arithmetic alone checks."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Self

import numpy as np
from pivoting.controller.solvers.conic_program import Cones
from pivoting.controller.validate import Array, frozen


@dataclass(frozen=True, eq=False)
class FarkasCertificate:
    """A proof that no x with |x| <= radius satisfies A x + s = b with s in the cones.

    If there were such an x, then for every y in the dual of the cones

        y'b = y'A x + y's >= -|A'y| |x| + 0,   so that   y'b + radius |A'y| >= 0.

    A y with which this is violated proves that there is none. The cones are {0}, half-lines and second-order cones, in
    this order; of the first the dual is everything, and the other two are their own duals.

    x = (f, w) are the contact forces and the wrench, and the rows of A say, in this order: J f + w = required, floors
    and sides of friction cones, limits and bounds. Every x that does what they say has |x| <= radius, which is derived
    in `feasibility.greatest_size`; `limit` tells whether a limit on the normal forces had to be stated for it.

    Attributes:
        y: (m,) multipliers of the rows.  A: (m, n) and b: (m,), the rows themselves, in units of force and length.
        cones: how many rows are equalities and half-lines, and how many each second-order cone has.
        radius: of a ball that contains every x that is sought.
        limit: the greatest normal force that was considered [N]; inf: all, because the bounds limit them.
        force, length: the units of x [N, m]; wrenches are (forces, moments).
    """

    y: Array
    A: Array
    b: Array
    cones: Cones
    radius: float
    limit: float
    force: float
    length: float

    def __post_init__(self) -> None:
        for values in (self.y, self.A, self.b):
            frozen(values)

    @property
    def gap(self) -> float:
        """By how much the inequality is violated, in units of force; positive in a proof."""
        return -float(self.y @ self.b + self.radius * np.linalg.norm(self.y @ self.A))

    @property
    def rounding(self) -> float:
        """What rounding may contribute to `gap` at most."""
        terms = np.abs(self.y) @ np.abs(self.b) + self.radius * np.linalg.norm(np.abs(self.y) @ np.abs(self.A))
        return 4.0 * len(self.y) * float(np.finfo(float).eps * terms)

    @property
    def in_dual_cone(self) -> bool:
        """Whether y is in the dual of the cones."""
        halves = self.y[self.cones.zero : self.cones.zero + self.cones.linear]
        return bool((halves >= 0.0).all()) and all(part[0] >= np.linalg.norm(part[1:]) for part in self._round(self.y))

    def holds(self) -> bool:
        """Whether it proves what it is to prove, by its own numbers alone; rounding counts against it."""
        return self.in_dual_cone and self.gap > self.rounding

    def as_dict(self) -> dict[str, Any]:
        """The same in numbers and lists, as JSON can say them."""
        return {
            "y": self.y.tolist(),
            "A": self.A.tolist(),
            "b": self.b.tolist(),
            "equalities": self.cones.zero,
            "half_lines": self.cones.linear,
            "second_order_cones": list(self.cones.orders),
            "radius": self.radius,
            "normal_force_limit_N": None if np.isinf(self.limit) else self.limit,
            "unit_of_force_N": self.force,
            "unit_of_length_m": self.length,
        }

    @classmethod
    def from_dict(cls, said: Mapping[str, Any]) -> Self:
        """What `as_dict` gave."""
        y, A, b = (np.array(said[name], dtype=float) for name in ("y", "A", "b"))
        cones = Cones(said["equalities"], said["half_lines"], tuple(said["second_order_cones"]))
        limit = np.inf if said["normal_force_limit_N"] is None else float(said["normal_force_limit_N"])
        units = float(said["unit_of_force_N"]), float(said["unit_of_length_m"])
        return cls(y, A, b, cones, float(said["radius"]), limit, *units)

    def _round(self, values: Array) -> Iterator[Array]:
        """The parts (order,) of values (m,) that belong to the second-order cones."""
        ends = np.cumsum([self.cones.zero + self.cones.linear, *self.cones.orders])
        return (values[first:last] for first, last in pairwise(ends.tolist()))
