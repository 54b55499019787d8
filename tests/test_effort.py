"""Planning the whole arc: with tight tracking it costs what each step's smallest wrench does, with free timing less."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pivoting.controller import (
    Body,
    BodyState,
    Contact,
    Horizon,
    Law,
    MinimumJerk,
    Plan,
    Planner,
    WrenchBounds,
    WrenchController,
    WrenchProblem,
    solve,
)
from pivoting.controller.bounded_solver import BoundedSolver, BoundedWrench
from pivoting.sim import simulate
from pivoting.sim.pipeline import bounded_control

BLOCK = WrenchController(Body(1.0, 1.0 / 6.0), [Contact((-0.5, -0.5), 0.3)], Law.dynamic(), (0.0, -10.0), margin=1 / 6)
START, END, STEPS, H = np.deg2rad(10.0), np.deg2rad(80.0), 50, 0.02
ANGLES = MinimumJerk((START, END), STEPS * H)(H * np.arange(1, STEPS + 1)).orientation
UNIT = np.diag([200.0, 200.0, 100.0])


def arc(Q: np.ndarray) -> Plan:
    """The whole arc in one plan."""
    horizon = Horizon(BLOCK, STEPS, H, integrator="semi-implicit", Q=Q, stick=True)
    up = START + np.pi / 4
    com = np.sqrt(0.5) * np.array([np.cos(up), 0.0, np.sin(up)])
    state = BodyState(com, BLOCK.space.orientation(START), np.zeros(3), np.zeros(3))
    plan = Planner(horizon).plan(state, horizon.arc(BLOCK.space.orientation(ANGLES), state))
    assert plan.status == "solved"
    return plan


def effort(plan: Plan) -> float:
    f = plan.force.reshape(STEPS, -1)
    return 0.5 * H * float(np.sum((plan.wrench @ BLOCK.Q_w) * plan.wrench) + np.sum((f @ BLOCK.Q_f) * f))


def of_each_step(plan: Plan) -> float:
    """Effort of the smallest wrenches along a plan's poses, which do not know of each other."""
    theta = np.insert(BLOCK.space.angle(plan.orientation), 0, START)
    com = np.insert(plan.position[:, [0, 2]], 0, plan.position[0, [0, 2]], axis=0)
    total = 0.0
    for t in range(STEPS):
        c, s = np.cos(theta[t + 1]), np.sin(theta[t + 1])
        acceleration = np.diff(com[t : t + 3], n=2, axis=0)[0] / H**2
        force = np.array([[c, s], [-s, c]]) @ (acceleration + np.array([0.0, 10.0]))
        required = np.append(force, np.diff(theta[t : t + 3], n=2) / H**2 / 6.0)
        jacobian = BLOCK.jacobian(plan.orientation[t])
        total += H * solve(WrenchProblem(jacobian, required, [0.3], margin=1 / 6, Q_w=BLOCK.Q_w)).objective
    return total


def test_with_tight_tracking_a_plan_costs_what_the_smallest_wrenches_cost() -> None:
    plan = arc(1e10 * UNIT)
    assert np.abs(BLOCK.space.angle(plan.orientation)[1:] - ANGLES).max() < 1e-7
    assert effort(plan) == pytest.approx(of_each_step(plan), rel=1e-9)


def test_a_plan_that_is_weighed_at_its_end_costs_less_and_ends_at_rest() -> None:
    Q = np.tile(1e-6 * UNIT, (STEPS, 1, 1))
    Q[-2:] = 1e10 * UNIT
    plan, tight = arc(Q), arc(1e10 * UNIT)
    np.testing.assert_allclose(BLOCK.space.angle(plan.orientation)[-2:], ANGLES[-2:], atol=1e-7)
    assert effort(plan) < 0.93 * effort(tight)
    assert effort(plan) == pytest.approx(of_each_step(plan), rel=1e-9)  # the gain is in the poses


def test_one_weight_or_one_for_each_step() -> None:
    np.testing.assert_array_equal(arc(1e4 * UNIT).wrench, arc(np.tile(1e4 * UNIT, (STEPS, 1, 1))).wrench)
    with pytest.raises(ValueError, match=r"Q\[3\].*positive definite"):
        Horizon(BLOCK, STEPS, H, Q=np.tile(UNIT, (STEPS, 1, 1)) * (np.arange(STEPS) != 3)[:, None, None])
    with pytest.raises(ValueError, match="Q"):
        Horizon(BLOCK, STEPS, H, Q=np.tile(UNIT, (STEPS - 1, 1, 1)))


class Poor(BoundedSolver):
    """Says that its answers are less accurate than asked."""

    def __call__(self, *problem: Any) -> BoundedWrench:
        return replace(super().__call__(*problem), residual=1e-5)


def test_a_poor_answer_within_bounds_is_applied_and_said_to_be_poor(monkeypatch: pytest.MonkeyPatch) -> None:
    """None at all would let the object fall. Two bounds at once are more than a heavier weight."""
    monkeypatch.setattr(bounded_control, "BoundedSolver", Poor)
    run = simulate("balance-2d", seconds=0.6, force_max=3.3, moment_max=0.9)
    assert np.isfinite(run.wrench).all()
    assert run.measures.unsolved_steps[0] > 0.0
    assert set(np.unique(run.status)) <= {0, 1}


def test_no_wrench_at_all_is_within_no_bound() -> None:
    assert np.isnan(WrenchBounds(force=1.0).excess(np.full((4, 3), np.nan)))
