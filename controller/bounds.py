"""Bounds on the wrench that may be applied, and on how fast it may change."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pivoting.controller.validate import Array, fail


class Ball(NamedTuple):
    """|rows w| <= radius, or |rows (w - w_before)| <= radius dt where `rate`."""

    rows: Array
    radius: float
    rate: bool


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

    def excess(self, wrench: Array, before: Array | None = None, dt: float = 1.0) -> float:
        """By how much a wrench (nw,), or any of many (..., nw), exceeds a bound, relative to that bound; <= 0: none.

        `before`: likewise, the wrench applied `dt` [s] earlier; None leaves the rates out. A wrench that is not a
        number gives nan: it is within no bound.
        """
        worst = -1.0
        for ball in self.balls(wrench.shape[-1]):
            if not ball.rate:
                change = wrench
            elif before is not None:
                change = (wrench - before) / dt
            else:
                continue
            worst = np.maximum(worst, np.max(np.linalg.norm(change @ ball.rows.T, axis=-1)) / ball.radius - 1.0)
        return float(worst)
