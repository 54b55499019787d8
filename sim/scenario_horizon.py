"""The horizon of a scenario: what is planned for an object on its contacts, and how often."""

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.orientation_references import Turn
from pivoting.controller.planning.horizon import Horizon
from pivoting.controller.planning.receding_horizon import RecedingHorizon
from pivoting.controller.planning.sequential_convex import Planner
from pivoting.controller.rotations import exponential, quaternion_product
from pivoting.controller.validate import fail
from pivoting.controller.wrench_controller import WrenchController
from pivoting.models.frames import matrix
from pivoting.models.placement.contact_candidates import contact_points
from pivoting.sim.belief import Believed
from pivoting.sim.pipeline.law_control import LawSolver
from pivoting.sim.pipeline.plan_playback import PlanPlayback
from pivoting.sim.pipeline.receding_horizon_control import RecedingHorizonControl
from pivoting.sim.scenarios.scenario import Scenario

Array = NDArray[np.float64]
NEAR = 0.02  # of the object's size: a corner that comes closer to the table within the contact's range is watched


def receding_horizon_control(
    case: Scenario, belief: Believed, law: LawSolver, reference: Turn, worlds: int, dt: float, steps: int
) -> RecedingHorizonControl:
    """The scenario's receding horizons, one for each world.

    Args:
        law: which follows their plans.  reference: of the orientation, as the controller believes it.
        dt: time step [s].  steps: of the run.
    """
    assert case.plan_hz is not None
    every = round(1.0 / (case.plan_hz * dt))
    whole = abs(every * dt * case.plan_hz - 1.0) < 1e-6
    planned = [scenario_horizon(case, belief, controller) for controller in belief.controllers]
    horizon = planned[0]
    if not whole or every < 1 or every * dt > horizon.steps * horizon.h:
        longest = f"{horizon.steps * horizon.h:g} s"
        allowed = f"such that a plan is made every {dt:g} s (the time step) to {longest}, in whole time steps"
        raise fail("plan_hz", case.plan_hz, allowed)
    horizons = [RecedingHorizon(Planner(planned[i % len(planned)]), every * dt) for i in range(worlds)]
    return RecedingHorizonControl(horizons, law, reference, dt, every, steps)


def plan_playback(case: Scenario, belief: Believed, reference: Turn, dt: float, steps: int) -> PlanPlayback:
    """The scenario's whole motion as one plan that is played; see `receding_horizon_control`."""
    step = float(case.plan_step)
    per = round(step / dt)
    if per < 1 or abs(per * dt - step) > 1e-9:
        raise fail("plan_step", case.plan_step, f"a whole number of time steps of {dt:g} s, in open loop")
    if per > 1 and (case.force_rate is not None or case.moment_rate is not None):
        allowed = f"the time step, {dt:g} s, with a bound on a rate: between two steps of a plan its wrench jumps"
        raise fail("plan_step", case.plan_step, allowed)
    horizon = scenario_horizon(case, belief, belief.attached.controller, steps=-(-steps // per))
    return PlanPlayback(Planner(horizon), reference, per)


def scenario_horizon(
    case: Scenario, belief: Believed, controller: WrenchController, steps: int | None = None
) -> Horizon:
    """The scenario's horizon, of one of the controllers; `steps` in place of its own."""
    return Horizon(
        controller,
        int(case.plan_steps) if steps is None else steps,
        float(case.plan_step),
        integrator=case.integrator,
        Q=case.track * np.diag((controller.units.force / controller.units.pose) ** 2),
        bounds=case.bounds(belief.placement.unit),
        stick=True,
        clear=_watched(belief),
    )


def _watched(belief: Believed) -> Array:
    """(P, 3) corners, from the CoM in object axes, that come down on the table at an end of the contact's range [m]."""
    there, model = belief.placement, belief.attached.model
    body, space = there.body, belief.attached.controller.space
    corners = np.array([space.lift(body.point(corner)) for corner in contact_points(model, body.index)])
    contacts = np.array([space.lift(body.point(contact)) for contact in there.contacts])
    if not len(corners) or there.axis @ matrix(body.table)[:, 2] > 0.5:  # turning about the table's normal, none does
        return np.zeros((0, 3))
    corners = np.unique(np.round(corners, 12), axis=0)
    size = float(np.linalg.norm(np.ptp(corners, axis=0)))
    up, watched = matrix(body.table)[:, 2], np.zeros(len(corners), dtype=bool)
    for angle in there.range:
        R = matrix(quaternion_product(exponential(angle * there.axis), there.start))
        watched |= (corners - contacts[0]) @ R.T @ up < NEAR * size
    away = np.linalg.norm(corners[:, None] - contacts, axis=2).min(axis=1) > 1e-9 * size
    return corners[watched & away]
