"""The control of one law at every step: the wrench problem of each world, stated, solved and certified in one call."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.belief import for_worlds
from pivoting.controller.kernels.compiled_step import step_worlds
from pivoting.controller.wrench_bounds import WrenchBounds
from pivoting.controller.wrench_controller import WrenchController
from pivoting.sim.pipeline.stages import Answers, Correct, Desired, States, stacked

Array = NDArray[np.float64]
TOLERANCE = 1e-9  # relative KKT residual of an answer that counts as solved


class LawSolver:
    """The controllers' law for all worlds, within bounds as far as the compiled step keeps them.

    Args:
        controllers: one for each world, or one that they share.
        correct: what is added to the reference, see `stages.Correct`.
    """

    def __init__(
        self, controllers: Sequence[WrenchController], bounds: WrenchBounds, correct: tuple[Correct, ...] = ()
    ):
        nw, _ = controllers[0].widths
        self._beliefs, self._work = for_worlds([each.belief for each in controllers]), controllers[0].workspace()
        self._bounds = tuple(bounds.stacked(nw)) if bounds.any else None
        self._none = np.zeros((1, nw))
        self._correct = correct

    def __call__(self, states: States, desired: Desired, out: Answers, external: Array | None = None) -> None:
        """Write the answers on the corrected reference; `external`: (W or 1, nw) known wrenches, see `step_worlds`."""
        for correct in self._correct:
            desired = correct(states, desired)
        self.solve(states, desired, out, external)

    def solve(self, states: States, desired: Desired, out: Answers, external: Array | None = None) -> None:
        """Write the answers on the reference as it is."""
        known = self._none if external is None else external
        step_worlds(self._beliefs, self._bounds, *self._work, TOLERANCE, states.values, desired.values, known, *out[:2])


class LawControl:
    """One law on a reference that is the same for all worlds.

    Args:
        desired: (N+1, 4), (N+1, 3), (N+1, 3), the reference at every step.
        external: (N+1, W, nw) known wrenches on the object at every step, object axes; or with axes of 1, always the
            same, and the same for all worlds.
    """

    def __init__(self, law: LawSolver, desired: tuple[Array, Array, Array], external: Array):
        self._law, self._external = law, external
        self._desired = stacked(*desired)[:, None]

    def __call__(self, k: int, states: States, before: Array | None, out: Answers) -> None:
        self._law(states, self._at(k), out, self._known(k))

    def prepare(self, states: States, out: Answers) -> None:
        """Compile."""
        self._law.solve(states, self._at(0), out, self._known(0))

    def _at(self, k: int) -> Desired:
        return Desired(self._desired[k])

    def _known(self, k: int) -> Array:
        return self._external[min(k, len(self._external) - 1)]
