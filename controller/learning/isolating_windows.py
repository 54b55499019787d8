"""Windows that isolate one unknown: weights whose balance tells as much of it, and as little of the others, as can be.

A balance is linear in the weight of its window, and a weight of straight lines is a sum of hats. Which sum bounds an
unknown most closely is a linear program: the balance is to hold it once, and what it holds of the others, times how
far they are known, is to be small together with the errors. What is best for bounds on the errors of the measurements
and on the impulse of a disturbance need not look like anything; the cut that it makes is as valid as any other.
"""

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.learning.balances import Balances
from pivoting.controller.learning.windows import LEAST_STEPS, Window, runs_of
from pivoting.controller.validate import Array
from scipy.optimize import linprog

HATS = 16  # of which a weight is the sum, at most
SEEN = 1e-6  # share of the largest entry of a balance, below which it does not hold an unknown


def isolating_windows(balances: Balances, usable: NDArray[np.bool_], low: Array, high: Array) -> list[Window]:
    """A window for each unknown that the balance about some axis holds, within each run of usable steps.

    Args:
        low, high: (n,) where the unknowns are known to be.
    """
    found = []
    for begin, end in runs_of(usable):
        hats = min(HATS, (end - begin) // LEAST_STEPS - 1)
        if hats < 3:  # fewer cannot tell apart what a balance in the plane holds: two moments and an inertia
            continue
        corners = np.linspace(begin, end, hats + 2).astype(int)
        rows = np.stack(
            [
                balances.moments(Window((a, b, c), (0.0, 1.0, 0.0))).rows
                for a, b, c in zip(corners, corners[1:], corners[2:], strict=False)
            ],
            axis=1,
        )  # (axes, hats, 11)
        for axis, each in enumerate(balances.unknowns.select(rows)):
            impulse, kink = balances.sizes_of_errors(axis, 0.5 * (low + high))
            for heights in _isolating(each, 0.5 * (high - low), balances.time[corners], impulse, kink):
                found.append(Window(tuple(corners.tolist()), (0.0, *heights, 0.0)))
    return found


def _isolating(rows: Array, half: Array, time: Array, impulse: float, kink: float) -> list[tuple[float, ...]]:
    """Heights (H,) of the hats, at most 1, of each unknown that rows (H, n) hold.

    Args:
        half: (n,) half the widths of what is known.  time: (H + 2,) of the corners [s].
        impulse: error of a weight of height 1.  kink: error of a change of its slope by 1/s.
    """
    hats, slope = len(rows), 1.0 / np.diff(time)
    bends = np.zeros((hats + 2, hats))  # changes of the slope
    for n in range(hats):
        bends[n, n] += slope[n]
        bends[n + 1, n] -= slope[n] + slope[n + 1]
        bends[n + 2, n] += slope[n + 1]
    told, found = np.abs(rows).sum(axis=0) * half, []
    for i in np.flatnonzero(told > SEEN * told.max()):
        others = np.delete(rows, i, axis=1).T * np.delete(half, i)[:, None]
        sized = np.vstack([others, kink * bends])  # of which the absolute values are added up
        m, eye = len(sized), np.eye(len(sized))
        cost = np.concatenate([np.zeros(hats), [impulse], np.ones(m)])
        tall = np.ones((hats, 1))
        A = np.block(
            [
                [np.eye(hats), -tall, np.zeros((hats, m))],
                [-np.eye(hats), -tall, np.zeros((hats, m))],
                [sized, np.zeros((m, 1)), -eye],
                [-sized, np.zeros((m, 1)), -eye],
            ]
        )
        once = np.concatenate([rows[:, i] * half[i], np.zeros(1 + m)])[None]
        bounds = [(None, None)] * hats + [(0.0, None)] * (1 + m)
        answer = linprog(cost, A, np.zeros(len(A)), once, [1.0], bounds)
        # without an answer there is a window less, which is all that it costs
        if answer.x is not None and (most := np.abs(answer.x[:hats]).max()) > 0.0:
            found.append(tuple((answer.x[:hats] / most).tolist()))
    return found
