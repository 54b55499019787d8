"""The numbers in which the balances of moments and forces are linear, and the prior knowledge of them as a polytope.

    x = (m, h, J, s)    mass, first moment h = m c, inertia J about the contact, factor s on the believed inertia

in object axes, c from the contact to the centre of mass. They hang together, J = s I + m (|c|^2 1 - c c'), where I is
the inertia about the centre of mass that is believed. What follows from intervals of m, c and s is bounded from outside
by linear inequalities: a product m c_i c_j lies between its McCormick envelopes, which are linear in (m, h).
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import ArrayLike
from pivoting.controller.learning.polytope import Polytope
from pivoting.controller.plane_and_space import Space
from pivoting.controller.uncertainty.uncertainty import Interval, Uncertainty
from pivoting.controller.validate import Array, fail

ENTRIES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # of an inertia tensor, in their order in x
MASS, MOMENT, INERTIA, FACTOR = 0, slice(1, 4), slice(4, 10), 10  # places in all eleven numbers
COUNT = 11
NARROW = 0.5  # cosine of the widest cone about the believed direction that is used
TANGENTS = 3  # to m c_i^2 over the interval of c_i, from below


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Which numbers are unknown, and what is known of them beforehand.

    Attributes:
        space: the plane, with the unknowns m, h_u, h_v, I_P and s, or space, with all eleven.
        lever: (3,) from the contact to the believed CoM, object axes [m].
        inertia: (3, 3) believed, about the CoM, object axes [kg m^2].
        prior: of mass, centre of mass and inertia.
    """

    space: Space
    lever: Array
    inertia: Array
    prior: Uncertainty

    @property
    def used(self) -> list[int]:
        """The places of the unknowns among all eleven numbers."""
        return [0, 1, 3, 5, 10] if self.space.dim == 2 else list(range(COUNT))

    @property
    def names(self) -> list[str]:
        """Of the unknowns."""
        if self.space.dim == 2:
            return ["m", "m c_u", "m c_v", "I_P", "s"]
        inertias = [f"I_P {'xyz'[i]}{'xyz'[j]}" for i, j in ENTRIES]
        return ["m", *(f"m c_{axis}" for axis in "xyz"), *inertias, "s"]

    @property
    def moments(self) -> list[str]:
        """The names of the first moment's components."""
        return self.names[1 : 1 + self.space.dim]

    @property
    def com(self) -> Array:
        """(3, 2) the interval of the centre of mass from the contact, object axes [m]."""
        offsets = np.zeros((3, 2))
        offsets[self.axes] = self.prior.com
        return self.lever[:, None] + offsets

    @property
    def mass(self) -> Interval:
        """The interval of the mass [kg]."""
        if self.prior.mass is None:
            raise fail("uncertainty.mass", None, "an interval (low, high), which the mass is in")
        return self.prior.mass

    @property
    def axes(self) -> list[int]:
        """The object axes that the plane or space has."""
        return [0, 2] if self.space.dim == 2 else [0, 1, 2]

    @cached_property
    def farthest(self) -> Array:
        """(11,) a row whose product with any member x is at least |h|, the size of the first moment.

        Within a cone about a direction d, of half-angle a, it is at most h d / cos a; and anywhere m max |c|.
        """
        corners = np.array(list(product(*self.com)))
        distances = np.linalg.norm(corners, axis=1)
        row, length = np.zeros(COUNT), float(np.linalg.norm(self.lever))
        cosine = (corners @ self.lever / np.maximum(length * distances, 1e-300)).min() if length > 0.0 else 0.0
        if cosine > NARROW:
            row[MOMENT] = self.lever / (length * cosine)
        else:
            row[MASS] = distances.max()
        return row

    def select(self, rows: Array) -> Array:
        """(..., n) the columns of the unknowns of rows (..., 11)."""
        return rows[..., self.used]

    def of(self, mass: float, com: ArrayLike, inertia: float) -> Array:
        """(n,) the unknowns of one world: mass [kg], offset of the CoM (d,) [m], factor on the inertia."""
        c = self.lever + self.space.lift(np.asarray(com, dtype=float))
        tensor = inertia * self.inertia + mass * (c @ c * np.eye(3) - np.outer(c, c))
        x = np.concatenate([[mass], mass * c, [tensor[i, j] for i, j in ENTRIES], [inertia]])
        return self.select(x)

    @cached_property
    def polytope(self) -> Polytope:
        """What the prior says, from outside."""
        low, high = self._box()
        found = Polytope.box(self.select(low), self.select(high))
        every = np.array([*self._moment_rows(), *self._inertia_rows()])
        rows = self.select(every[~np.delete(every, self.used, axis=1).any(axis=1)])  # those of the unknowns alone
        cut = found.cut(rows, np.zeros(len(rows)))
        if cut is None:
            raise fail("uncertainty", self.prior, "a set with a member")
        return cut

    def _box(self) -> tuple[Array, Array]:
        mass, factor = self.mass, self.prior.inertia
        c = [Interval(*row) for row in self.com.tolist()]
        ends = [mass, *(_product(mass, each) for each in c)]
        for i, j in ENTRIES:
            parts = [_product(factor, Interval(self.inertia[i, j], self.inertia[i, j]))]
            if i == j:
                parts += [_product(mass, _square(c[k])) for k in range(3) if k != i]
            else:
                low, high = _product(mass, _product(c[i], c[j]))
                parts.append(Interval(-high, -low))
            ends.append(Interval(sum(part.low for part in parts), sum(part.high for part in parts)))
        return tuple(np.array([*ends, factor]).T)

    def _moment_rows(self) -> list[Array]:
        """Of m low_i <= h_i <= m high_i, each row (11,) with row x <= 0."""
        rows = []
        for i, (low, high) in enumerate(self.com):
            for sign, end in ((-1.0, low), (1.0, high)):
                row = np.zeros(COUNT)
                row[1 + i], row[MASS] = sign, -sign * end
                rows.append(row)
        return rows

    def _inertia_rows(self) -> list[Array]:
        """Of the inertia about the contact between its envelopes, likewise."""
        rows = []
        for place, (i, j) in enumerate(ENTRIES):
            about = np.zeros(COUNT)
            about[4 + place], about[FACTOR] = 1.0, -self.inertia[i, j]  # J_ij - s I_ij
            if i != j:
                below, above = self._products(i, j)
                rows += [about + each for each in below] + [-about - each for each in above]
                continue
            k, n = (axis for axis in range(3) if axis != i)
            (below, above), (below_n, above_n) = self._squares(k), self._squares(n)
            rows += [about - a - b for a in above for b in above_n]
            rows += [a + b - about for a in below for b in below_n]
        return rows

    def _squares(self, i: int) -> tuple[list[Array], list[Array]]:
        """Linear forms (11,) below and above m c_i^2: tangents, and the secant."""
        low, high = self.com[i]
        below, above = [], np.zeros(COUNT)
        for at in np.unique(np.linspace(low, high, TANGENTS)):
            tangent = np.zeros(COUNT)
            tangent[1 + i], tangent[MASS] = 2.0 * at, -at * at
            below.append(tangent)
        above[1 + i], above[MASS] = low + high, -low * high
        return below, [above]

    def _products(self, i: int, j: int) -> tuple[list[Array], list[Array]]:
        """Linear forms (11,) below and above m c_i c_j."""

        def form(a: float, b: float) -> Array:
            row = np.zeros(COUNT)
            row[1 + j], row[1 + i], row[MASS] = a, b, -a * b
            return row

        (li, hi), (lj, hj) = self.com[i], self.com[j]
        return [form(li, lj), form(hi, hj)], [form(hi, lj), form(li, hj)]


def _product(a: Interval, b: Interval) -> Interval:
    ends = [x * y for x in a for y in b]
    return Interval(min(ends), max(ends))


def _square(a: Interval) -> Interval:
    ends = a.low**2, a.high**2
    return Interval(0.0 if a.low < 0.0 < a.high else min(ends), max(ends))
