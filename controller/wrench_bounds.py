"""Bounds on the applied wrench, and on how fast it may change."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pivoting.controller.kernels.compilation import kernel, subroutine
from pivoting.controller.validate import Array, fail


class Ball(NamedTuple):
    """One bound: |rows w| <= radius or, if `rate` is set, |rows (w - w_before)| <= radius dt."""

    rows: Array
    radius: float
    rate: bool


class Stacked(NamedTuple):
    """b balls as arrays: all rows (r, nw), where each one's begin and the last end (b + 1,), radius and rate (b,)."""

    rows: Array
    first: NDArray[np.int64]
    radius: Array
    rate: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class WrenchBounds:
    """The bounds of an actuator, on the wrench about the CoM in object axes; inf stands for no bound.

    Attributes:
        force: largest |F| [N].  moment: largest |M| [N m].
        component: (3,) in the plane or (6,), largest |w_i| [N, N m]; None for no such bounds.
        force_rate, moment_rate: largest |dF/dt| [N/s] and |dM/dt| [N m/s], in object axes.
    """

    force: float
    moment: float
    component: Array | None
    force_rate: float
    moment_rate: float

    def __init__(
        self,
        force: float = np.inf,
        moment: float = np.inf,
        component: ArrayLike | None = None,
        force_rate: float = np.inf,
        moment_rate: float = np.inf,
    ):
        given = {"force": force, "moment": moment, "force_rate": force_rate, "moment_rate": moment_rate}
        for name, value in given.items():
            if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not value > 0.0:
                raise fail(name, value, "> 0, or inf for no bound")
            object.__setattr__(self, name, float(value))
        each = None
        if component is not None:
            try:
                each = np.array(component, dtype=float)
            except (TypeError, ValueError):  # text, ragged
                each = np.zeros(0)
            if each.shape not in ((3,), (6,)) or not (each > 0.0).all():
                raise fail("component", component, "3 (plane) or 6 (space) numbers > 0, or inf for no bound")
            each.flags.writeable = False
        object.__setattr__(self, "component", each)

    @property
    def without_rates(self) -> "WrenchBounds":
        """The same, with no bounds on rates of change."""
        return WrenchBounds(self.force, self.moment, self.component)

    @property
    def any(self) -> bool:
        """Whether anything is bounded."""
        given = [np.min(value) for value in vars(self).values() if value is not None]
        return bool(np.min(given) < np.inf)

    @property
    def rated(self) -> bool:
        """Whether the rate of change is bounded."""
        return min(self.force_rate, self.moment_rate) < np.inf

    def balls(self, nw: int) -> tuple[Ball, ...]:
        """The finite bounds, on a wrench of `nw` components: 3 in the plane, 6 in space."""
        dim = 2 if nw == 3 else 3
        force, moment = np.eye(nw)[:dim], np.eye(nw)[dim:]
        out = [Ball(force, self.force, False), Ball(moment, self.moment, False)]
        if self.component is not None:
            if len(self.component) != nw:
                raise fail("component", self.component, f"{nw} numbers for this object")
            out += [Ball(row[None], float(most), False) for row, most in zip(np.eye(nw), self.component, strict=True)]
        out += [Ball(force, self.force_rate, True), Ball(moment, self.moment_rate, True)]
        return tuple(ball for ball in out if np.isfinite(ball.radius))

    def stacked(self, nw: int) -> Stacked:
        """The same as arrays, for compiled functions."""
        balls = self.balls(nw)
        heights = [len(ball.rows) for ball in balls]
        return Stacked(
            np.concatenate([np.zeros((0, nw)), *(ball.rows for ball in balls)]),
            np.cumsum([0, *heights]),
            np.array([ball.radius for ball in balls]),
            np.array([ball.rate for ball in balls], dtype=bool),
        )

    def excess(self, wrench: Array, before: Array | None = None, dt: float = 1.0) -> float:
        """The greatest excess of wrenches (..., nw) over a bound, relative to that bound; <= 0 if there is none.

        `before` contains the wrenches applied `dt` [s] earlier; None leaves the bounds on rates out. A wrench that is
        not a number is within no bound, and gives nan.
        """
        nw = wrench.shape[-1]
        last = np.broadcast_to(wrench if before is None else before, wrench.shape)
        out = np.empty(wrench.size // nw)
        fill_excess(self.stacked(nw), wrench.reshape(-1, nw), last.reshape(-1, nw), dt, out)
        return float(out.max(initial=-1.0))

    def within(self, wrench: Array, before: Array | None, dt: float) -> Array:
        """Wrenches (W, nw) as an actuator makes them that stops at its bounds: the nearest, one bound after another.

        Args:
            before: (W, nw) that acted `dt` [s] earlier, within the bounds; None leaves the bounds on rates out.
        """
        acting, still = wrench.copy(), np.zeros_like(wrench)
        for ball in sorted(self.balls(wrench.shape[1]), key=lambda ball: not ball.rate):
            if not ball.rate:
                most, since = ball.radius, still
            elif before is not None:
                most, since = ball.radius * dt, before
            else:
                continue
            part = (acting - since) @ ball.rows.T
            size = np.linalg.norm(part, axis=1, keepdims=True)
            acting -= (part - part * np.minimum(1.0, most / np.maximum(size, 1e-300))) @ ball.rows
        return acting  # what is scaled back towards 0 stays near to `before`, which is within the bounds


@kernel
def fill_excess(stacked, wrench, before, dt, out):  # type: ignore[no-untyped-def]
    """Write the relative excess of each of W wrenches (W, nw) over the bounds into out (W,); -1 if there are no bounds.

    Returns the greatest excess that is a number.

    Args:
        stacked: of `WrenchBounds.stacked`.
        before: (W, nw) applied `dt` [s] earlier; if they are the wrenches themselves, bounds on rates have no effect.
    """
    most = -1.0
    for i in range(wrench.shape[0]):
        worst = -1.0
        for k in range(stacked.radius.shape[0]):
            over = size_over(stacked, k, wrench[i], before[i], dt) - 1.0
            if over > worst or np.isnan(over):
                worst = over
        out[i] = worst
        most = max(most, -1.0 if np.isnan(worst) else worst)
    return most


@subroutine
def size_over(stacked, k, wrench, before, dt):  # type: ignore[no-untyped-def]
    """|rows v| / radius of ball k, where v is a wrench (nw,) or, for a rate, its change from `before` divided by dt."""
    square = 0.0
    for row in range(stacked.first[k], stacked.first[k + 1]):
        value = 0.0
        for j in range(wrench.shape[0]):
            part = (wrench[j] - before[j]) / dt if stacked.rate[k] else wrench[j]
            value += stacked.rows[row, j] * part
        square += value * value
    return np.sqrt(square) / stacked.radius[k]


@subroutine
def farthest_exceeded(stacked, wrench):  # type: ignore[no-untyped-def]
    """The ball, among those without a rate, that a wrench (nw,) exceeds most; -1 if it is within all of them."""
    found, worst = -1, 1.0
    for k in range(stacked.radius.shape[0]):
        size = -1.0 if stacked.rate[k] else size_over(stacked, k, wrench, wrench, 1.0)
        if size > worst:
            found, worst = k, size
    return found


@subroutine
def begin_multiplier(stacked, k, Q_w, root):  # type: ignore[no-untyped-def]
    """Initialise `root` (6,) for `next_multiplier`: (multiplier, the last, its 1 / size - 1, bracket, unit)."""
    row = stacked.rows[stacked.first[k]]
    for j in range(6):
        root[j] = 0.0
    root[4] = np.inf
    for j in range(row.shape[0]):
        root[5] += row[j] * Q_w[j, j] * row[j]


@subroutine
def next_multiplier(root, size):  # type: ignore[no-untyped-def]
    """Write the next multiplier to try, after root[0] gave `size`, |rows w| over the radius.

    The size falls as the multiplier grows. The step is a secant step in 1 / size, which is nearly linear (as in trust
    regions, More and Sorensen 1983), safeguarded by a bracket.
    """
    now, last, value = root[0], root[1], 1.0 / size - 1.0
    if value < 0.0:
        root[3] = now
    else:
        root[4] = now
    if now == last:
        guess = root[5] * (size - 1.0)  # the first
    else:
        guess = now if value == root[2] else now - value * (now - last) / (value - root[2])
        if not root[3] < guess < root[4]:
            guess = 0.5 * (root[3] + root[4]) if np.isfinite(root[4]) else 2.0 * now
    root[0], root[1], root[2] = guess, now, value


@subroutine
def fill_heavier(stacked, k, multiplier, Q_w, out):  # type: ignore[no-untyped-def]
    """Write the heavier weight Q_w + multiplier rows' rows, which keeps a wrench within ball k.

    With the multiplier for which |rows w| is the radius, w is the best wrench within the ball: the term that the bound
    adds to the Lagrangian, 1/2 multiplier (|rows w|^2 - radius^2), acts like a weight.
    """
    for i in range(out.shape[0]):
        for j in range(out.shape[0]):
            out[i, j] = Q_w[i, j]
            if k >= 0:
                for row in range(stacked.first[k], stacked.first[k + 1]):
                    out[i, j] += multiplier * stacked.rows[row, i] * stacked.rows[row, j]
