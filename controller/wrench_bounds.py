"""Bounds on the wrench that may be applied, and on how fast it may change."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pivoting.controller.kernels.compilation import kernel, subroutine
from pivoting.controller.validate import Array, fail


class Ball(NamedTuple):
    """|rows w| <= radius, or |rows (w - w_before)| <= radius dt where `rate`."""

    rows: Array
    radius: float
    rate: bool


class Stacked(NamedTuple):
    """b balls: rows (r, nw) of all, where each one's begin and the last one's end (b + 1,), radius (b,), rate (b,)."""

    rows: Array
    first: NDArray[np.int64]
    radius: Array
    rate: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class WrenchBounds:
    """What an actuator can give. Everything is of the wrench in object axes, about the CoM; inf is no bound.

    Attributes:
        force: largest |F| [N].  moment: largest |M| [N m].
        component: (3,) in the plane or (6,), largest |w_i| [N, N m]; None: no such bounds.
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
    def any(self) -> bool:
        """Whether anything is bounded."""
        given = [np.min(value) for value in vars(self).values() if value is not None]
        return bool(np.min(given) < np.inf)

    @property
    def rated(self) -> bool:
        """Whether a rate is bounded."""
        return min(self.force_rate, self.moment_rate) < np.inf

    def balls(self, nw: int) -> tuple[Ball, ...]:
        """The bounds on a wrench of `nw` = 3 (plane) or 6 components, those that bound something."""
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
        """By how much a wrench (nw,), or any of many (..., nw), exceeds a bound, relative to that bound; <= 0: none.

        `before`: likewise, the wrench applied `dt` [s] earlier; None leaves the rates out. A wrench that is not a
        number gives nan: it is within no bound.
        """
        nw = wrench.shape[-1]
        last = np.broadcast_to(wrench if before is None else before, wrench.shape)
        out = np.empty(wrench.size // nw)
        fill_excess(self.stacked(nw), wrench.reshape(-1, nw), last.reshape(-1, nw), dt, out)
        return float(out.max(initial=-1.0))


@kernel
def fill_excess(stacked, wrench, before, dt, out):  # type: ignore[no-untyped-def]
    """Write by how much each of wrenches (W, nw) exceeds a bound, relative to it, into out (W,); -1 without any bound.

    Returns the greatest of those that are numbers.

    Args:
        stacked: of `WrenchBounds.stacked`.
        before: (W, nw) applied `dt` [s] earlier; the wrenches themselves leave rates out.
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
    """|rows v| over the radius of ball k; v is a wrench (nw,), or its change from `before` over dt for a rate."""
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
    """The ball, not of a rate, that a wrench (nw,) exceeds the farthest; -1 if it is within all."""
    found, worst = -1, 1.0
    for k in range(stacked.radius.shape[0]):
        size = -1.0 if stacked.rate[k] else size_over(stacked, k, wrench, wrench, 1.0)
        if size > worst:
            found, worst = k, size
    return found


@subroutine
def begin_multiplier(stacked, k, Q_w, root):  # type: ignore[no-untyped-def]
    """Make `root` (6,) ready for `next_multiplier`: (multiplier, the last, its 1 / size - 1, bracket, unit)."""
    row = stacked.rows[stacked.first[k]]
    for j in range(6):
        root[j] = 0.0
    root[4] = np.inf
    for j in range(row.shape[0]):
        root[5] += row[j] * Q_w[j, j] * row[j]


@subroutine
def next_multiplier(root, size):  # type: ignore[no-untyped-def]
    """Write the multiplier to try after root[0] gave `size` over the radius, which falls as the multiplier grows.

    A secant in 1 / size, which is nearly a line (as in trust regions, More and Sorensen 1983), within a bracket.
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
    """Write Q_w + multiplier rows' rows of ball k: where that makes |rows w| the radius, w is the best within it.

    The Lagrangian of the bound, 1/2 multiplier (|rows w|^2 - radius^2), is a weight.
    """
    for i in range(out.shape[0]):
        for j in range(out.shape[0]):
            out[i, j] = Q_w[i, j]
            if k >= 0:
                for row in range(stacked.first[k], stacked.first[k + 1]):
                    out[i, j] += multiplier * stacked.rows[row, i] * stacked.rows[row, j]
