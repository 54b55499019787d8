"""Receding horizon: what is followed between plans, and what happens when a plan fails."""

import numpy as np
import pytest
from pivoting.controller import Body, BodyState, Contact, Horizon, Law, Plan, Planner, WrenchBounds, WrenchController
from pivoting.controller.plane_and_space import space
from pivoting.controller.planning.receding_horizon import Followed, RecedingHorizon, followed_motion
from pivoting.controller.rotations import quaternion_product, rotated

G, H = 10.0, 0.02
CORNERS = np.array([[0.5, 0.0, -0.5], [-0.5, 0.0, 0.5]])  # that come down next


def receding(bounds: WrenchBounds | None = None, **options: object) -> RecedingHorizon:
    """Of the notes' block on its corner."""
    contact = Contact([-0.5, -0.5], 0.3)
    controller = WrenchController(Body(1.0, 1.0 / 6.0), [contact], Law.dynamic(), [0.0, -G], margin=1 / 6)
    given = {"integrator": "semi-implicit", "Q": 1e6 * np.eye(3), "stick": True, "clear": CORNERS, **options}
    return RecedingHorizon(Planner(Horizon(controller, 20, H, bounds=bounds, **given)), 0.01)  # type: ignore[arg-type]


def at(angle: float, rate: float = 0.0) -> BodyState:
    """On the corner, which is at the origin."""
    q = space(2).orientation(angle)
    arm, omega = rotated(q, np.array([0.5, 0.0, 0.5])), np.array([0.0, -rate, 0.0])
    return BodyState(arm, q, np.cross(omega, arm), omega)


def towards(*angles: float) -> np.ndarray:
    """(20, 4) from the first to the last angle."""
    return space(2).orientation(np.linspace(angles[0], angles[-1], 20))


def test_a_plan_is_followed_with_its_velocities_and_accelerations() -> None:
    """What is followed starts as the object is, and its rates are the derivatives of its orientations."""
    state = at(0.5, 0.3)
    followed = receding().replan(state, towards(0.5, 0.8), None)
    assert followed.outcome == "planned"
    times = np.arange(0.0, 0.1, 1e-4)
    q, omega, alpha = followed_motion(followed, state, times)
    angle, rate, acceleration = space(2).angle(q), -omega[:, 1], -alpha[:, 1]
    assert angle[0] == pytest.approx(0.5, abs=1e-12)
    assert rate[0] == pytest.approx(0.3, abs=1e-9)
    np.testing.assert_allclose(np.gradient(angle, times)[1:-1], rate[1:-1], atol=1e-4 * np.abs(acceleration).max())
    np.testing.assert_allclose(rate[0] + np.cumsum(acceleration)[:-1] * 1e-4, rate[1:], atol=1e-9)
    assert followed.plan is not None
    np.testing.assert_allclose(rate[::200], -followed.plan.angular_velocity[:5, 1], atol=1e-9)


def test_a_failed_plan_is_replaced_by_the_last_one_shifted_until_that_has_run_out() -> None:
    """The failure is a state that no wrench within the bounds can be planned from: the block is far into the table."""
    horizon = receding(WrenchBounds(force=6.0, moment=3.0))
    good = horizon.replan(at(0.5), towards(0.5, 0.6), None)
    assert good.outcome == "planned"
    broken = at(-0.5)
    followed, seen = good, []
    for _ in range(45):
        followed = horizon.replan(broken, towards(0.5, 0.6), followed)
        seen.append(followed)
    shifted = [each for each in seen if each.outcome == "shifted"]
    assert [each.outcome for each in seen] == ["shifted"] * len(shifted) + ["released"] * (45 - len(shifted))
    assert len(shifted) == 39  # of 0.4 s, 0.01 s at a time, and each is followed for 0.01 s
    assert all(each.plan is good.plan for each in shifted)
    assert all(each.attempt.status == "infeasible" for each in shifted)
    np.testing.assert_allclose([each.since for each in shifted], 0.01 * np.arange(1, 40), atol=1e-12)
    later = followed_motion(shifted[9], broken, np.array([0.0]))
    first = followed_motion(good, at(0.5), np.array([0.1]))
    for a, b in zip(later, first, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-12)


def test_without_a_plan_the_object_is_to_stay_and_is_let_go_once_it_is_down() -> None:
    horizon = receding(WrenchBounds(force=0.05 * G, moment=0.05 * G))
    followed = horizon.replan(at(np.deg2rad(10.0)), towards(0.2, 0.4), None)
    assert followed.outcome == "holding"
    assert followed.plan is None
    assert followed.attempt.status == "infeasible"
    q, omega, alpha = followed_motion(followed, at(0.1, 1.0), np.arange(3) * 1e-3)
    np.testing.assert_allclose(space(2).angle(q), 0.1)
    assert not omega.any()
    assert not alpha.any()
    down = horizon.replan(at(0.0), towards(0.2, 0.4), followed)
    assert down.outcome == "released"
    assert horizon.replan(at(0.5), towards(0.5, 0.6), down) is down


@pytest.mark.parametrize("target", [18.0, 30.0, 80.0])
def test_a_desired_pose_that_is_far_away_is_not_infeasible(target: float) -> None:
    """About it no corrections are admissible; about where the block is, they are."""
    planner = receding(WrenchBounds(force=8.0, moment=3.0)).planner
    state, goal = at(np.deg2rad(10.0)), space(2).orientation(np.full(20, np.deg2rad(target)))
    plan = planner.plan(state, planner.horizon.arc(goal, state))
    assert plan.status == "solved"
    assert planner.horizon.bounds.excess(plan.wrench) < 1e-8
    assert space(2).angle(plan.orientation[-1]) > np.deg2rad(11.0)


def test_a_guess_begins_where_the_object_is() -> None:
    """Whatever state it was made for."""
    planner = receding().planner
    old, state = at(0.5), at(0.52, 0.4)
    first = planner.plan(old, planner.horizon.arc(towards(0.5, 0.6), old))
    plan = planner.plan(state, planner.horizon.arc(towards(0.52, 0.6), state), guess=first.guess)
    assert plan.status == "solved"
    np.testing.assert_allclose(plan.orientation[0], state.orientation, atol=1e-15)
    np.testing.assert_allclose(plan.angular_velocity[0], state.angular_velocity, atol=1e-12)


def test_what_is_off_the_plane_is_refused() -> None:
    planner = receding().planner
    state = at(0.5)
    off = state._replace(orientation=np.array([np.cos(0.2), np.sin(0.2), 0.0, 0.0]))
    with pytest.raises(ValueError, match=r"orientation = .*: must be in the controller's plane"):
        planner.plan(off, planner.horizon.arc(towards(0.5, 0.6), state))


def test_plans_go_on_from_the_last_one() -> None:
    """One pass for each is enough: of the bilinear terms less than a hundredth of the weight is left out."""
    horizon = receding()
    followed: Followed | None = None
    changes = []
    for k in range(8):
        angle = 0.5 + 0.02 * k
        followed = horizon.replan(at(angle, 2.0), towards(angle, angle + 0.8), followed)
        changes.append(followed.attempt.changes[-1])
        assert isinstance(followed.plan, Plan)
        assert followed.plan.motion_defect < 0.01
    assert max(changes[2:]) < 0.1


def test_a_period_longer_than_the_horizon_is_refused() -> None:
    with pytest.raises(ValueError, match=r"period = 0\.5: must be > 0 and not longer than the horizon"):
        RecedingHorizon(receding().planner, 0.5)


def test_a_state_a_little_off_the_plane_is_planned_from_as_the_per_step_law_sees_it() -> None:
    """Measurements are never exactly in the plane; a degree beyond it is no planar state."""

    def leaning(by: float) -> BodyState:
        about_x = np.array([np.cos(0.5 * by), np.sin(0.5 * by), 0.0, 0.0])
        return at(0.5)._replace(orientation=quaternion_product(about_x, at(0.5).orientation))

    plain = receding().replan(at(0.5), towards(0.5, 0.8), None)
    near = receding().replan(leaning(np.deg2rad(0.1)), towards(0.5, 0.8), None)
    assert near.plan is not None
    assert plain.plan is not None
    np.testing.assert_allclose(near.plan.wrench, plain.plan.wrench, atol=1e-6)
    with pytest.raises(ValueError, match=r"orientation = .*within 1 deg of the controller's plane"):
        receding().replan(leaning(np.deg2rad(2.0)), towards(0.5, 0.8), None)
