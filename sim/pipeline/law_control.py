"""The control of one law at every step: the wrench problem of each world, stated, solved and certified in one call."""

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.kernels.compiled_step import step_worlds
from pivoting.controller.wrench_bounds import WrenchBounds
from pivoting.controller.wrench_controller import WrenchController
from pivoting.sim.pipeline.stages import Answers, Correct, Desired, States, stacked

Array = NDArray[np.float64]
TOLERANCE = 1e-9  # relative KKT residual of an answer that counts as solved


class LawSolver:
    """The controller's law for all worlds, within bounds as far as the compiled step keeps them.

    Args:
        correct: what is added to the reference, see `stages.Correct`.
    """

    def __init__(self, controller: WrenchController, bounds: WrenchBounds, correct: tuple[Correct, ...] = ()):
        self._belief, self._work = tuple(controller.belief), controller.workspace()
        self._bounds = tuple(bounds.stacked(len(controller.Q_w))) if bounds.any else None
        self._none = np.zeros((1, len(controller.Q_w)))
        self._correct = correct

    def __call__(self, states: States, desired: Desired, out: Answers, external: Array | None = None) -> None:
        """Write the answers on the corrected reference; `external`: (W or 1, nw) known wrenches, see `step_worlds`."""
        for correct in self._correct:
            desired = correct(states, desired)
        self.solve(states, desired, out, external)

    def solve(self, states: States, desired: Desired, out: Answers, external: Array | None = None) -> None:
        """Write the answers on the reference as it is."""
        known = self._none if external is None else external
        step_worlds(self._belief, self._bounds, *self._work, TOLERANCE, states.values, desired.values, known, *out[:2])


class LawControl:
    """One law on a reference that is the same for all worlds.

    Args:
        desired: (N+1, 4), (N+1, 3), (N+1, 3), the reference at every step.
        external: (N+1, nw) known wrenches on the object at every step, object axes; or (1, nw), always the same.
    """

    def __init__(self, law: LawSolver, desired: tuple[Array, Array, Array], external: Array):
        self._law, self._external = law, external[:, None]
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
