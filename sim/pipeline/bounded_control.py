"""A control within bounds: what exceeds them is solved for again."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.bounded_solver import BoundedSolver
from pivoting.controller.solution import BOUNDED, FAILED, INACCURATE, UNGUARANTEED
from pivoting.controller.solvers.conic_program import USABLE
from pivoting.controller.wrench_bounds import WrenchBounds, fill_excess
from pivoting.controller.wrench_controller import WrenchController
from pivoting.sim.pipeline.stages import Answers, Control, States

Array = NDArray[np.float64]
OVER = 1e-9  # of a bound: a wrench that exceeds it by more is solved for again, within bounds
BETTER_THAN_NONE = 1e-3  # relative KKT residual within bounds


class BoundedControl:
    """Another control within bounds: a wrench that still exceeds one is solved for again, see `BoundedSolver`.

    Args:
        controllers: one for each world, or one that they share.
        dt: time step [s].
        external: (N+1 or 1, W or 1, nw) wrenches that the controllers know of besides, object axes, see `LawControl`.

    Attributes:
        inner: the other control.
    """

    def __init__(
        self,
        inner: Control,
        controllers: Sequence[WrenchController],
        bounds: WrenchBounds,
        dt: float,
        external: Array,
    ):
        self.inner, self._dt, self._external = inner, dt, external
        self._sets = [controller.uncertainty is not None for controller in controllers]
        self._bounds = bounds.stacked(len(controllers[0].Q_w))
        self._rated = bounds.rated
        self._solvers = [BoundedSolver(controller, bounds, dt) for controller in controllers]

    def __call__(self, k: int, states: States, before: Array | None, out: Answers) -> None:
        self.inner(k, states, before, out)
        last = applied(before) if self._rated else None
        excess = np.empty(len(out.wrench))
        most = fill_excess(self._bounds, out.wrench, out.wrench if last is None else last, self._dt, excess)
        if not most > OVER:
            return
        external = self._external[k % len(self._external)]
        for i in np.flatnonzero(excess > OVER):
            solve = self._solvers[i % len(self._solvers)]
            seen, known = (states.orientation[i], states.angular_velocity[i]), external[i % len(external)]
            answer = solve(seen[0], out.required[i], None if last is None else last[i], seen[1], known)
            if not answer.residual <= BETTER_THAN_NONE:
                out.wrench[i], out.status[i] = np.nan, FAILED
                continue
            out.wrench[i], out.force[i], out.residual[i] = answer.wrench, answer.force.ravel(), answer.residual
            if answer.residual > USABLE:
                out.status[i] = INACCURATE
            elif not answer.guaranteed and self._sets[i % len(self._sets)]:
                out.status[i] = UNGUARANTEED
            elif not answer.exact:
                out.status[i] = BOUNDED

    def prepare(self, states: States, out: Answers) -> None:
        """Compile, and set the solver up."""
        self.inner.prepare(states, out)
        fill_excess(self._bounds, out.wrench, out.wrench, self._dt, np.empty(len(out.wrench)))
        for _ in range(2):  # set up, then in place
            self._solvers[0](states.orientation[0], out.required[0])


def applied(wrench: Array | None) -> Array | None:
    """Wrenches (W, nw) as they were applied: none where there was no answer."""
    return None if wrench is None else np.where(np.isfinite(wrench), wrench, 0.0)
