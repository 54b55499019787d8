"""The control through several stances: each world is held in its own, and goes on to the next when it has landed."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.validate import frozen
from pivoting.sim.pipeline.stages import Answers, Control, States
from pivoting.sim.stances import Stance

Array = NDArray[np.float64]
LANDED = 0.01  # for how long all contacts of the next stance have to be found before it begins [s]


class StanceControl:
    """One control for each stance; the contact forces of an answer are those of all declared contacts, zero elsewhere.

    A stance follows as soon as the simulator has found as many contacts as it holds for `LANDED` seconds on end: what
    is measured decides, not the time at which they should be there.

    Args:
        controls: of the stances.
        dt: time step [s].  worlds, steps: of the run.

    Attributes:
        stance: (N, W) number of the stance at each step.
    """

    def __init__(self, stances: Sequence[Stance], controls: Sequence[Control], dt: float, worlds: int, steps: int):
        self._stances, self._controls = stances, controls
        self._needed = np.array([np.count_nonzero(stance.held) for stance in stances])
        self._patience = max(1, round(LANDED / dt))
        self._now, self._found = np.zeros(worlds, np.int8), np.zeros(worlds, np.int64)
        self.stance = np.zeros((steps, worlds), np.int8)

    def __call__(self, k: int, states: States, before: Array | None, out: Answers) -> None:
        following = np.minimum(self._now + 1, len(self._stances) - 1)
        there = (states.touching >= self._needed[following]) & (following > self._now)
        self._found = np.where(there, self._found + 1, 0)
        landed = self._found >= self._patience
        self._now, self._found = np.where(landed, following, self._now), np.where(landed, 0, self._found)
        self.stance[k] = self._now
        for number in np.unique(self._now):
            self._decide(int(number), np.flatnonzero(self._now == number), k, states, before, out)

    def prepare(self, states: States, out: Answers) -> None:
        """Compile what the first stance takes; the others take the same."""
        own = Answers.empty(out.status.shape, out.nw, len(self._stances[0].columns))
        self._controls[0].prepare(states, own)
        out.force[:] = 0.0
        out.force[:, self._stances[0].columns] = own.force

    def by_world(self) -> NDArray[np.int8]:
        """(W, N) the same, read-only."""
        return frozen(self.stance.T.copy())

    def _decide(
        self, number: int, worlds: NDArray[np.intp], k: int, states: States, before: Array | None, out: Answers
    ) -> None:
        """Write the answers of the worlds that are in one stance."""
        columns = self._stances[number].columns
        own = Answers.empty((len(worlds),), out.nw, len(columns))
        self._controls[number](k, states.of(worlds), None if before is None else before[worlds], own)
        out.values[worlds] = 0.0
        out.status[worlds], out.residual[worlds] = own.status, own.residual
        out.required[worlds], out.wrench[worlds] = own.required, own.wrench
        out.force[np.ix_(worlds, columns)] = own.force
