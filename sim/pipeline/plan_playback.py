"""The control in open loop: the wrenches of one plan are played back, whatever the object does."""

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.errors import PlanError
from pivoting.controller.orientation_references import Turn
from pivoting.controller.planning.sequential_convex import Plan, Planner
from pivoting.sim.pipeline.receding_horizon_control import body_state
from pivoting.sim.pipeline.stages import Answers, States

Array = NDArray[np.float64]


class PlanPlayback:
    """Open loop: one plan of the whole motion, its wrenches applied in object axes whatever the object does.

    Args:
        planner: of as many steps as the run has, `per` time steps each.  What is required is what its wrenches and
            forces make together on the object as it is.
        reference: of the orientation, as the controller believes it.
    """

    def __init__(self, planner: Planner, reference: Turn, per: int):
        self._planner, self._reference, self._per = planner, reference, per
        self.plan: Plan | None = None

    def prepare(self, states: States, out: Answers) -> None:
        """Plan from the state of the first world.

        Raises:
            PlanError: there is no plan.
        """
        horizon = self._planner.horizon
        state = body_state(states, 0)
        wanted = np.asarray(self._reference(horizon.times).orientation)
        plan = self._planner.plan(state, horizon.arc(wanted, state))
        if plan.status != "solved":
            raise PlanError(plan)
        self.plan = plan

    def __call__(self, k: int, states: States, before: Array | None, out: Answers) -> None:
        assert self.plan is not None
        t = k // self._per
        out.wrench[:], out.force[:] = self.plan.wrench[t], self.plan.force[t].ravel()
        for i, orientation in enumerate(states.orientation):
            out.required[i] = self.plan.horizon.controller.jacobian(orientation) @ out.force[i] + out.wrench[i]
        out.residual[:], out.status[:] = self.plan.residual, 0
