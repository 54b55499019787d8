"""Windows in time over which an equation of motion is integrated: weights that are zero at both ends.

Such a weight w(t) turns derivatives of what is measured into the measurements themselves, by parts (the method of
modulating functions, Shinbrot 1957). Those here consist of straight lines. They need measurements at their corners, or
plain sums along their slopes; and as |w| <= 1, however long a window is, an impulse counts at most once.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.validate import Array

SLOPES = (4, 16)  # how many of its slopes a window is long
HALVINGS = 3  # of the longest window, to the shortest one
OVERLAP = 2  # windows of one length that cover the same time
LEAST_STEPS = 8  # of a slope


class Window(NamedTuple):
    """A weight on part of a log: straight lines between corners, at states of the log in rising order."""

    corners: tuple[int, ...]
    heights: tuple[float, ...]

    @property
    def first(self) -> int:
        """The state at which it begins."""
        return self.corners[0]

    @property
    def last(self) -> int:
        """The state at which it ends."""
        return self.corners[-1]


class Weights(NamedTuple):
    """A window's weight w(t), on its steps (n) and states (n+1).

    Attributes:
        around: (n+1,) integral of w over the half steps around each state [s].
        step: (n,) integral of w over each step [s].  size: (n,) likewise, of |w|, or a little more.
        most: (n,) duration of each step times the greatest |w| in it [s].
        slope: (n,) derivative of w in each step [1/s].  duration: (n,) of each step [s].
    """

    around: Array
    step: Array
    size: Array
    most: Array
    slope: Array
    duration: Array


def windows(usable: NDArray[np.bool_]) -> list[Window]:
    """Windows of several lengths within each run of usable steps, the longest first.

    Those of one length are trapezoids, which find what the moments come to, and pairs of a trapezoid and its negative,
    which find how they change.
    """
    found = []
    for begin, end in runs_of(usable):
        for halving in range(HALVINGS + 1):
            length = (end - begin) >> halving
            starts = np.linspace(begin, end - length, OVERLAP * (2**halving - 1) + 1).astype(int)
            for start in np.unique(starts).tolist():
                found += _shapes(start, length)
    return sorted(found, key=lambda window: window.first - window.last)


def runs_of(usable: NDArray[np.bool_]) -> list[list[int]]:
    """The states at which each run of usable steps begins and ends."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], usable, [False]]).astype(int)))
    runs: list[list[int]] = edges.reshape(-1, 2).tolist()
    return runs


def _shapes(start: int, length: int) -> list[Window]:
    """The windows on so many steps from a state on."""
    found = []
    for slope in {max(length // share, LEAST_STEPS) for share in SLOPES}:
        half, end = start + length // 2, start + length
        if length > 2 * slope:
            found.append(Window((start, start + slope, end - slope, end), (0.0, 1.0, 1.0, 0.0)))
        if length >= 4 * slope + 2:
            corners = start, start + slope, half - slope, half + slope, end - slope, end
            found.append(Window(corners, (0.0, 1.0, 1.0, -1.0, -1.0, 0.0)))
    return found


def weights(window: Window, time: Array) -> Weights:
    """The weight of a window on a log at these times (N+1,) [s]."""
    at = time[window.first : window.last + 1]
    w = np.interp(at, time[list(window.corners)], window.heights)
    duration = np.diff(at)
    middle = 0.5 * (w[1:] + w[:-1])
    around = np.zeros_like(w)
    around[:-1] += 0.25 * duration * (w[:-1] + middle)
    around[1:] += 0.25 * duration * (middle + w[1:])
    ends = np.abs(w[:-1]), np.abs(w[1:])
    size, most = 0.5 * duration * (ends[0] + ends[1]), duration * np.maximum(*ends)
    return Weights(around, duration * middle, size, most, np.diff(w) / duration, duration)
