"""A bounded polytope that only shrinks: linear inequalities without redundant ones, and the box around them."""

from dataclasses import dataclass

import numpy as np
from pivoting.controller.validate import Array, frozen
from scipy.optimize import linprog

MOST = 400  # inequalities that are kept without looking for redundant ones
ROUNDING = 1e-10  # of the size of a row: a bound is loosened by so much, which is more than rounding can take away


@dataclass(frozen=True, eq=False)
class Polytope:
    """All x with A x <= b and low <= x <= high.

    Every bound that is taken from a linear program is the value of a dual point, whatever the solver says of it
    (Neumaier and Shcherbina 2004): y >= 0 proves c x <= y b + max (c - A'y) x over the box. So the box is outer even
    where the solver is inaccurate.

    Attributes:
        A: (M, n).  b: (M,).  low, high: (n,).
    """

    A: Array
    b: Array
    low: Array
    high: Array

    @classmethod
    def box(cls, low: Array, high: Array) -> "Polytope":
        """A box, loosened by more than rounding can take away."""
        loose = ROUNDING * np.maximum(np.abs(low), np.abs(high))
        return cls(np.zeros((0, len(low))), np.zeros(0), frozen(low - loose), frozen(high + loose))

    def cut(self, A: Array, b: Array) -> "Polytope | None":
        """What of it satisfies A x <= b, with (M, n) and (M,), too; None: nothing does, which is certified."""
        size = np.abs(A) @ np.maximum(np.abs(self.low), np.abs(self.high)) + np.abs(b)
        b = b + ROUNDING * size
        cutting = self._most_in_box(A) > b
        if not cutting.any():
            return self
        both = Polytope(np.vstack([self.A, A[cutting]]), np.concatenate([self.b, b[cutting]]), self.low, self.high)
        if both._empty():
            return None
        return both._tightened()._slim()

    def interval(self, c: Array) -> tuple[float, float]:
        """Bounds, from outside, of the linear form c (n,)."""
        return -self._most(-c), self._most(c)

    def ratio(self, i: int, j: int) -> tuple[float, float]:
        """Bounds, from outside, of x_i / x_j, where x_j > 0: a linear program by Charnes and Cooper (1962)."""
        n = len(self.low)
        rows = [np.column_stack([self.A, -self.b])]  # y = x / x_j and t = 1 / x_j: A y <= b t, low t <= y <= high t
        rows += [np.column_stack([np.eye(n), -self.high]), np.column_stack([-np.eye(n), self.low])]
        t = np.array([1.0 / self.high[j], 1.0 / self.low[j]])
        ends = np.array([self.low[:, None] * t, self.high[:, None] * t])
        low, high = ends.min(axis=(0, 2)), ends.max(axis=(0, 2))
        low[j] = high[j] = 1.0
        scaled = np.vstack(rows)
        lifted = Polytope(scaled, np.zeros(len(scaled)), np.append(low, t[0]), np.append(high, t[1]))
        return lifted.interval(np.eye(n + 1)[i])

    def holds(self, x: Array) -> bool:
        """Whether x (n,) is in it."""
        inside = (self.low <= x).all() and (x <= self.high).all()
        return bool(inside and (self.A @ x <= self.b).all())

    def _most_in_box(self, rows: Array) -> Array:
        return np.where(rows > 0.0, rows * self.high, rows * self.low).sum(axis=-1)

    def _most(self, c: Array) -> float:
        """The greatest value of c x, or a little more."""
        simple = float(self._most_in_box(c))
        if not len(self.A):
            return simple
        scale, rows, b = self._units()
        found = linprog(-c * scale, rows, b, bounds=self._bounds(scale))
        if found.x is None:
            return simple
        y = np.maximum(0.0, -found.ineqlin.marginals) / self._size()
        return min(simple, float(y @ self.b + self._most_in_box(c - y @ self.A)))

    def _empty(self) -> bool:
        """Whether multipliers y >= 0 prove that no x in the box satisfies all rows: y b < min (y A) x."""
        scale, rows, b = self._units()
        ones = np.ones((len(b), 1))
        cost = np.zeros(len(scale) + 1)
        cost[-1] = 1.0
        found = linprog(cost, np.hstack([rows, -ones]), b, bounds=[*self._bounds(scale), (0.0, None)])
        if found.x is None or found.x[-1] <= 0.0:
            return False
        y = np.maximum(0.0, -found.ineqlin.marginals) / self._size()
        return bool(y @ self.b + self._most_in_box(-y @ self.A) < 0.0)

    def _tightened(self) -> "Polytope":
        """With the box around it."""
        unit = np.eye(len(self.low))
        high = np.array([self._most(each) for each in unit])
        low = np.array([-self._most(-each) for each in unit])
        low, high = np.maximum(low, self.low), np.minimum(high, self.high)
        crossed = low > high  # by rounding, where nothing but one value is left
        low, high = np.where(crossed, high, low), np.where(crossed, low, high)
        return Polytope(self.A, self.b, frozen(low), frozen(high))

    def _slim(self) -> "Polytope":
        """Without rows that the box implies, and, where many are left, without those that the others imply."""
        keep = self._most_in_box(self.A) > self.b
        A, b = self.A[keep], self.b[keep]
        if len(b) > MOST:
            used = np.ones(len(b), bool)
            for i in range(len(b)):
                used[i] = False
                used[i] = Polytope(A[used], b[used], self.low, self.high)._most(A[i]) > b[i]
            A, b = A[used], b[used]
        return Polytope(frozen(A), frozen(b), self.low, self.high)

    def _size(self) -> Array:
        """(M,) of each row, in units of its own."""
        return np.abs(self.A) @ np.maximum(self.high - self.low, 1e-300) + 1e-300

    def _units(self) -> tuple[Array, Array, Array]:
        """The widths of the box, and the rows with x in these widths from the box's middle, each of size 1."""
        scale = np.where(self.high > self.low, self.high - self.low, 1.0)
        size = self._size()
        middle = 0.5 * (self.low + self.high)
        return scale, self.A * scale / size[:, None], (self.b - self.A @ middle) / size

    def _bounds(self, scale: Array) -> list[tuple[float, float]]:
        half = 0.5 * (self.high - self.low) / scale
        return list(zip(-half, half, strict=True))
