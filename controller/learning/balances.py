"""Cuts: what the balances of moments and of forces, integrated over windows, say of the unknowns under bounded errors.

About a contact that stays where it is the angular momentum L changes by the moments of the known wrench and of gravity.
With the second moment of the mass S = tr(J) / 2 - J, and w the weight of a window,

    -int w' L dt - int w (R h) x g dt = int w M dt + (what is unknown),    L dt = int (R xi) x (dR xi) dm,

in which L needs no rates: along straight lines between measured rotations it is a sum of (R_k xi) x (R_k+1 xi). Both
sides are linear in J and h. The forces are linear in m and h: m times the acceleration of R c is the second derivative
of R h. docs/notes/learning.md derives the errors that are bounded here.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from pivoting.controller.learning.motion_log import MeasurementErrors, MotionLog, world_force, world_moment
from pivoting.controller.learning.unknowns import COUNT, ENTRIES, MASS, MOMENT, Unknowns
from pivoting.controller.learning.windows import Weights, Window, weights
from pivoting.controller.rotations import rotation_matrix
from pivoting.controller.validate import Array


@dataclass(frozen=True, eq=False)
class Cuts:
    """Pairs of parallel half-spaces: |row x - value| <= spread x + error for the true unknowns x, all eleven of them.

    Attributes:
        rows: (M, 11).  values: (M,).  spreads: (M, 11), of which the product with any true x is >= 0.
        errors: (M,) >= 0.
    """

    rows: Array
    values: Array
    spreads: Array
    errors: Array

    @property
    def half_spaces(self) -> tuple[Array, Array]:
        """(2 M, 11) and (2 M,): A x <= b."""
        A = np.vstack([self.rows - self.spreads, -self.rows - self.spreads])
        return A, np.concatenate([self.values + self.errors, self.errors - self.values])

    @classmethod
    def together(cls, cuts: "Sequence[Cuts]") -> Self:
        """All of several cuts, or of none."""
        none = cls(np.zeros((0, COUNT)), np.zeros(0), np.zeros((0, COUNT)), np.zeros(0))
        return cls(*(np.concatenate([getattr(each, name) for each in (none, *cuts)]) for name in vars(none)))


class Balances:
    """The balances of one log, from which windows make cuts.

    Args:
        unknowns: of the object.

    Attributes:
        unknowns: as given.  time: (N+1,) of the log [s].
    """

    def __init__(self, log: MotionLog, errors: MeasurementErrors, unknowns: Unknowns):
        self._log, self._errors, self._farthest = log, errors, unknowns.farthest
        self.unknowns, self.time = unknowns, log.time
        self._turn = errors.theta * np.sqrt(1.0 if log.space.dim == 2 else 3.0)  # angle of an error of orientation
        self._R = np.array([rotation_matrix(q) for q in log.orientation])
        self._moment, self._force = world_moment(log), world_force(log)
        self._arm = np.linalg.norm(log.force, axis=1) * float(np.linalg.norm(log.lever))  # (N,) of moments [N m]
        self._load = np.linalg.norm(log.moment, axis=1) + self._arm
        self._tensors = np.array([_momentum_rows(self._R, axis) for axis in log.axes])  # (A, N, 6)
        self._across = np.linalg.norm(np.cross(log.gravity, log.axes), axis=1)  # (A,) gravity across the axes
        self._second = 1.0 if log.space.dim == 2 else 0.5  # times the unknowns `_size`: the second moment of the mass
        self._arms = np.array([np.cross(log.gravity, axis) @ self._R for axis in log.axes])  # (A, N+1, 3)

    def moments(self, window: Window) -> Cuts:
        """Of the balance of moments about each axis."""
        log, errors, w = self._log, self._errors, weights(window, self._log.time)
        steps, states = slice(window.first, window.last), slice(window.first, window.last + 1)
        axes = len(log.axes)
        rows, spreads = np.zeros((axes, COUNT)), np.zeros((axes, COUNT))
        rows[:, 4:10] = -np.einsum("k,akj->aj", w.slope, self._tensors[:, steps])
        rows[:, MOMENT] = -np.einsum("k,akj->aj", w.around, self._arms[:, states])
        along = log.axes @ self._moment[steps].T  # (A, n)
        spreads[:, self._size] = self._momentum_error(w)
        turned = self._turn * w.size.sum() + self._between(w)
        heavy = self._across * turned + errors.shove
        spreads += heavy[:, None] * self._farthest
        late = np.abs(along) @ (0.5 * w.duration**2 * np.abs(w.slope))
        return Cuts(rows, along @ w.step, spreads, late + self._moment_error(w, steps, along))

    def sizes_of_errors(self, axis: int, x: Array) -> tuple[float, float]:
        """Errors of the balance of moments about one axis, for unknowns x (n,): of a weight of height 1 all the time,
        and of a change of its slope by 1/s. They say which windows are good; no bound is made of them."""
        every = np.zeros(COUNT)
        every[self.unknowns.used] = x
        turned = self._turn * float(self.time[-1] - self.time[0])
        heavy = self._errors.shove + float(self._across[axis]) * turned
        return heavy * float(self._farthest @ every), self._turn * self._second * float(every[self._size].sum())

    def forces(self, window: Window) -> Cuts:
        """Of the balance of forces along each world axis that the plane or space has; contact forces are measured."""
        log, errors, w = self._log, self._errors, weights(window, self._log.time)
        steps, corners = slice(window.first, window.last), list(window.corners)
        slopes = np.diff(window.heights) / np.diff(log.time[corners])
        kinks = np.diff(np.concatenate([[0.0], slopes, [0.0]]))  # of which w'' consists
        axes = log.space.force_map.T @ rotation_matrix(log.space.base).T
        rows, spreads = np.zeros((len(axes), COUNT)), np.zeros((len(axes), COUNT))
        turns = np.einsum("k,kij->ij", kinks, self._R[corners])
        rows[:, MOMENT] = axes @ turns
        rows[:, MASS] = -w.step.sum() * axes @ log.gravity
        total = np.abs(kinks).sum()
        spreads += self._turn * total * self._farthest
        spreads[:, MASS] += errors.shove
        if log.position is not None:  # of the contact, which may move: p - R lever
            rows[:, MASS] += axes @ (kinks @ log.position[corners] - turns @ log.lever)
            spreads[:, MASS] += total * (errors.position + self._turn * float(np.linalg.norm(log.lever)))
        known = self._force[steps]
        size = np.linalg.norm(known, axis=1)
        late = (size + np.linalg.norm(log.contact_force[steps], axis=1)) @ (0.5 * w.duration**2 * np.abs(w.slope))
        turned = size @ (w.most * (self._turn + errors.rate * w.duration))
        error = late + errors.wrench * size @ w.most + turned + errors.contact_force * w.size.sum()
        values = (known + log.contact_force[steps]).T @ w.step
        return Cuts(rows, axes @ values, spreads, np.full(len(axes), error))

    def rates(self, window: Window) -> Cuts:
        """Of the balance of moments between two times at which the angular velocity was measured."""
        log, errors = self._log, self._errors
        assert log.angular_velocity is not None
        ends, steps = [window.first, window.last], slice(window.first, window.last)
        time = log.time[window.first : window.last + 1]
        duration = np.diff(time)
        around = np.concatenate([[0.5 * duration[0]], 0.5 * (duration[1:] + duration[:-1]), [0.5 * duration[-1]]])
        w = Weights(around, duration, duration, duration, np.zeros(len(duration)), duration)
        axes = len(log.axes)
        rows, spreads = np.zeros((axes, COUNT)), np.zeros((axes, COUNT))
        for sign, k in zip((-1.0, 1.0), ends, strict=True):
            spin = self._R[k].T @ log.angular_velocity[k]
            for a, axis in enumerate(log.axes @ self._R[k]):
                rows[a, 4:10] += sign * np.array([_symmetric(axis, spin, i, j) for i, j in ENTRIES])
        rows[:, MOMENT] = -np.einsum("k,akj->aj", around, self._arms[:, window.first : window.last + 1])
        along = log.axes @ self._moment[steps].T
        planar = log.space.dim == 2
        wrong = 2.0 * self._rate_error if planar else self._rate_error + 2.0 * self._turn * errors.rate
        spreads[:, self._size] = wrong
        turned = self._turn * w.size.sum() + self._between(w)
        heavy = self._across * turned + errors.shove
        spreads += heavy[:, None] * self._farthest
        return Cuts(rows, along @ duration, spreads, self._moment_error(w, steps, along))

    @property
    def _size(self) -> slice | list[int]:
        """Which unknowns sum up to the second moment of the mass about the contact: twice it, in space."""
        return [5] if self._log.space.dim == 2 else [4, 5, 6]

    @property
    def _rate_error(self) -> float:
        return self._errors.omega * float(np.sqrt(1.0 if self._log.space.dim == 2 else 3.0))

    def _momentum_error(self, w: Weights) -> float:
        """Error of the momentum's sum, as a multiple of the unknowns `_size`: of orientations, and between them."""
        turn, rate = self._turn, self._errors.rate
        kinks = np.abs(np.diff(np.concatenate([[0.0], w.slope, [0.0]]))).sum()
        slope = np.abs(w.slope)
        noise = turn * (kinks + 2.0 * rate * slope @ w.duration) + turn**2 * slope.sum()
        chords = 0.5 * rate**2 * slope @ w.duration**2
        return float(noise + chords) * self._second

    def _between(self, w: Weights) -> float:
        """The integral of w times the greatest angle from the nearest measurement [rad s]."""
        return float(0.25 * self._errors.rate * w.duration @ w.size)

    def _moment_error(self, w: Weights, steps: slice, along: Array) -> Array:
        """(A,) error of the known moments: their own, that of the axes that they are measured in, and what they turn
        by within a step."""
        moment, errors = self._moment[steps], self._errors
        own = errors.wrench * self._load[steps] + errors.rate * w.duration * self._arm[steps]
        error = np.full(len(along), own @ w.most)
        if self._log.space.dim == 3:
            angle = self._turn + errors.rate * w.duration
            across = np.sqrt(np.maximum(np.sum(moment**2, axis=1) - along**2, 0.0))
            error += (across * angle + 0.5 * np.abs(along) * angle**2) @ w.most
        return error


def _momentum_rows(R: Array, axis: Array) -> Array:
    """(N, 6) coefficients of J in axis . sum over the mass of (R_k xi) x (R_k+1 xi)."""
    x, y, z = axis
    hat = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    C = -np.swapaxes(R[:-1], 1, 2) @ hat @ R[1:]  # of the second moment S = tr(J) / 2 - J
    C = 0.5 * np.trace(C, axis1=1, axis2=2)[:, None, None] * np.eye(3) - C
    return np.stack([C[:, i, i] if i == j else C[:, i, j] + C[:, j, i] for i, j in ENTRIES], axis=-1)


def _symmetric(a: Array, b: Array, i: int, j: int) -> float:
    """The coefficient of J_ij in a' J b."""
    return float(a[i] * b[i] if i == j else a[i] * b[j] + a[j] * b[i])
