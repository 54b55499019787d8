"""A solver that fails at times: the control is asked, and what it answers is lost."""

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.solution import FAILED
from pivoting.sim.pipeline.random_draws import Chance
from pivoting.sim.pipeline.stages import Answers, Control, Setting, States

Array = NDArray[np.float64]


class SolverFailure:
    """In a share of the steps there is no answer.

    Args:
        share: of the steps.
    """

    slot = "wrap"

    def __init__(self, share: float, setting: Setting):
        self._happens = Chance(share, "SolverFailure", setting)

    def __call__(self, control: Control, desired: Array) -> Control:
        """The control whose solver fails."""
        return _Failing(control, self._happens)


class _Failing:
    def __init__(self, inner: Control, happens: Chance):
        self._inner, self._happens = inner, happens
        self.prepare = inner.prepare

    def __call__(self, k: int, states: States, before: Array | None, out: Answers) -> None:
        self._inner(k, states, before, out)
        failed = self._happens(k)
        for values in (out.wrench, out.force, out.residual):
            values[failed] = np.nan
        out.status[failed] = FAILED
