"""The control of one law at every step: the wrench problem of each world, stated, solved and certified in one call."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.belief import for_worlds
from pivoting.controller.kernels.compiled_step import step_worlds
from pivoting.controller.wrench_bounds import WrenchBounds
from pivoting.controller.wrench_controller import WrenchController
from pivoting.sim.pipeline.stages import Answers, Correct, Desired, States, desired_values

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
        beliefs, unknown = for_worlds([each.belief for each in controllers])
        bounded = tuple(bounds.stacked(nw)) if bounds.any else None
        self._step = partial(step_worlds, beliefs, unknown, bounded, *controllers[0].workspace(), TOLERANCE)
        self._none = np.zeros((1, nw))
        self.correct = correct

    def __call__(self, states: States, desired: Desired, out: Answers, external: Array | None = None) -> None:
        """Write the answers on the corrected reference; `external`: (W or 1, nw) known wrenches, see `step_worlds`."""
        for correct in self.correct:
            desired = correct(states, desired)
        self.solve(states, desired, out, external)

    def solve(self, states: States, desired: Desired, out: Answers, external: Array | None = None) -> None:
        """Write the answers on the reference as it is."""
        self._step(states.values, desired.values, self._none if external is None else external, out.values, out.status)


class LawControl:
    """One law on a reference that is the same for all worlds.

    Args:
        desired: (N+1, 4), (N+1, 3), (N+1, 3), the reference at every step.
        external: (N+1, W, nw) known wrenches on the object at every step, object axes; or with axes of 1, always the
            same, and the same for all worlds.
    """

    def __init__(self, law: LawSolver, desired: tuple[Array, Array, Array], external: Array):
        self._desired, self._external = desired_values(*desired)[:, None], external
        self._always = external[0] if len(external) == 1 else None
        self._solve, self._decide = law.solve, law if law.correct else law.solve  # a call less at every step

    def __call__(self, k: int, states: States, before: Array | None, out: Answers) -> None:
        self._decide(
            states, Desired(self._desired[k]), out, self._external[k] if self._always is None else self._always
        )

    def prepare(self, states: States, out: Answers) -> None:
        """Compile."""
        self._solve(states, Desired(self._desired[0]), out, self._external[0])
