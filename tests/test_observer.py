"""The model of the pivot, the observer that uses it, and the safe action: against MuJoCo and against formulas."""

import numpy as np
import pytest
from pivoting import Body, Contact, Law, Run, WrenchController, simulate
from pivoting.controller.lowering import Lowering
from pivoting.controller.motion import Motion
from pivoting.controller.pivot_model import PivotModel
from pivoting.controller.pose_observer import PoseObserver
from pivoting.controller.rotations import CONJUGATE, angle_between, exponential, quaternion_product, rotation_vector
from pivoting.sim.pipeline.free_reference import FreeReference
from pivoting.sim.pipeline.stages import ANGULAR_VELOCITY, ORIENTATION, VELOCITY, Desired, States, desired_values
from pivoting.sim.run_setup import set_up
from pivoting.sim.scenarios.shipped_scenarios import scenario

POSE = {"noise": 0.1, "noise_position": 5e-4, "delay": 0.002}
SHORT = {"seconds": 1.0, "hold": 0.2, "theta_end": 45.0, "reference": "arc"}


def block(mass: float = 1.3) -> WrenchController:
    """In the plane, on a corner."""
    return WrenchController(Body(mass, 0.2), [Contact((-0.4, -0.3), mu=0.3)], Law.dynamic(), (0.0, -10.0))


def state(controller: WrenchController, theta: float, rate: float) -> np.ndarray:
    """(1, 13)."""
    q, omega, _ = controller.space.lift_motion(Motion(theta, rate))
    return np.r_[0.0, 0.0, 0.0, q, 0.0, 0.0, 0.0, omega][None]


def test_the_model_is_the_equation_of_a_pivot() -> None:
    """alpha = (tau - m g r_x) / I_P about the contact, tau of the wrench about it."""
    controller, rng = block(), np.random.default_rng(0)
    model, dt = PivotModel([controller], 1e-3), 1e-3
    for _ in range(20):
        theta, rate, wrench = rng.uniform(-1.0, 1.0), rng.normal(), rng.normal(size=(1, 3)) * 10.0
        c, s = np.cos(theta), np.sin(theta)
        rx, rz = 0.4 * c - 0.3 * s, 0.4 * s + 0.3 * c
        Fx, Fz = c * wrench[0, 0] - s * wrench[0, 1], s * wrench[0, 0] + c * wrench[0, 1]
        tau = wrench[0, 2] + rx * Fz - rz * Fx
        alpha = (tau - 1.3 * 10.0 * rx) / (0.2 + 1.3 * 0.25)
        now = state(controller, theta, rate)
        model.advance(now, wrench, np.zeros((1, 3)))
        assert now[0, ANGULAR_VELOCITY] @ controller.space.axial(1.0) == pytest.approx(rate + dt * alpha, abs=1e-12)
        assert controller.space.angle(now[0, ORIENTATION]) == pytest.approx(theta + dt * (rate + dt * alpha), abs=1e-9)


@pytest.mark.parametrize("name", ["pivot-2d", "pivot-3d", "spin-3d"])
def test_the_model_says_what_mujoco_does_next(name: str) -> None:
    run = simulate(name, seconds=1.0)
    model = PivotModel([run.attached.controller], run.dt)
    worst, most = 0.0, 0.0
    for k in range(100, len(run.time) - 1, 50):
        now = run.log.states[0, k : k + 1].copy()
        model.advance(now, np.array(run.wrench[0, k : k + 1]), np.zeros((1, 3)))
        true, before = run.log.states[0, k + 1], run.log.states[0, k]
        worst = max(worst, float(np.abs(now[0, ANGULAR_VELOCITY] - true[ANGULAR_VELOCITY]).max()))
        most = max(most, float(np.abs(before[ANGULAR_VELOCITY] - true[ANGULAR_VELOCITY]).max()))
        assert float(angle_between(now[0, ORIENTATION], true[ORIENTATION])) < 1e-6
        np.testing.assert_allclose(now[0, VELOCITY], true[VELOCITY], atol=3e-3)
    assert worst < 0.02 * most + 1e-7


def estimate_errors(run: Run) -> tuple[float, float]:
    """RMS of the estimated angle [deg] and rate [deg/s] after 0.2 s."""
    assert run.log.estimated is not None
    seen, true = run.log.estimated[:, 200:], run.log.states[:, 200:-1]
    angle = angle_between(seen[..., ORIENTATION], true[..., ORIENTATION])
    rate = np.linalg.norm((seen - true)[..., ANGULAR_VELOCITY], axis=-1)
    return float(np.rad2deg(np.sqrt(np.mean(angle**2)))), float(np.rad2deg(np.sqrt(np.mean(rate**2))))


@pytest.mark.parametrize("name", ["pivot-2d", "pivot-3d"])
def test_an_observer_does_better_than_a_differentiator(name: str) -> None:
    """Of which the best bandwidth of some is taken; what is measured is not used for rates by either."""
    best = min(
        (simulate(name, differentiator=bandwidth, **POSE, **SHORT) for bandwidth in (50.0, 100.0, 200.0)),
        key=lambda run: float(run.measures.slip_max_m[0]),
    )
    run = simulate(name, observer=60.0, **POSE, **SHORT)
    assert run.measures.slip_max_m[0] < 2e-5
    assert run.measures.friction_use_max[0] < 0.95
    assert run.measures.angle_error_rms_deg[0] < 0.5 * best.measures.angle_error_rms_deg[0]
    assert run.measures.slip_max_m[0] < best.measures.slip_max_m[0]
    (angle, rate), (_, poor) = estimate_errors(run), estimate_errors(best)
    assert angle < 0.03
    assert rate < 0.25 * poor


def test_without_noise_a_delay_is_made_up_for() -> None:
    run = simulate("pivot-2d", observer=60.0, delay=0.02, **SHORT)
    angle, rate = estimate_errors(run)
    assert angle < 2e-3
    assert rate < 0.05
    late = simulate("pivot-2d", delay=0.02, **SHORT)
    assert run.measures.angle_error_max_deg[0] < 0.02 * late.measures.angle_error_max_deg[0]


def test_what_the_model_does_not_know_is_estimated() -> None:
    """A world that is a fifth heavier: without the unknown acceleration the estimated rate would be biased."""
    run = simulate("balance-2d", observer=60.0, world={"mass": 1.2}, seconds=1.5)
    assert run.log.estimated is not None
    off = (run.log.estimated - run.log.states[:, :-1])[0, -200:, ANGULAR_VELOCITY]
    assert np.rad2deg(np.abs(off).max()) < 0.05


def test_lost_measurements_are_bridged() -> None:
    """Of every second one: the estimate gets worse by less than the square root of two does."""
    whole, half = (simulate("pivot-2d", observer=60.0, dropped=share, **POSE, **SHORT) for share in (0.0, 0.5))
    assert estimate_errors(half)[0] < 1.6 * estimate_errors(whole)[0]


def test_each_world_may_believe_something_else() -> None:
    """Worlds of a filter that knows their controllers are those of filters of their own."""
    controllers, rng = [block(1.0), block(2.0)], np.random.default_rng(3)
    both = PoseObserver(controllers, 50.0, 1e-3, 1e-3)
    each = [PoseObserver([controller], 50.0, 1e-3, 1e-3) for controller in controllers]
    start = np.concatenate([state(controllers[0], 0.2, 0.0), state(controllers[0], 0.3, 0.0)])
    both.begin(start)
    for i, one in enumerate(each):
        one.begin(start[i : i + 1])
    for _ in range(20):
        wrench, fresh = rng.normal(size=(2, 3)), rng.random(2) < 0.7
        both.advance(wrench)
        both.correct(start, fresh)
        for i, one in enumerate(each):
            one.advance(wrench[i : i + 1])
            one.correct(start[i : i + 1], fresh[i : i + 1])
    for i, one in enumerate(each):
        np.testing.assert_array_equal(both.states[i], one.states[0])
        np.testing.assert_array_equal(both.unknown[i], one.unknown[0])
    assert not np.isclose(both.states[0], both.states[1]).all()


def test_the_safe_action_presses_straight_along_the_normal_and_lowers() -> None:
    """By the equation of motion of the plane, the contact force is the given one and the rate is braked to its goal."""
    controller = block()
    lowering, model = Lowering(controller, press=20.0), PivotModel([controller], 1e-3)
    assert lowering.force.tolist() == [[0.0, 20.0]]
    for theta, side in ((0.3, -1.0), (1.3, 1.0)):  # to either side of the balance, at atan(4/3)
        now = state(controller, theta, 0.5)
        for _ in range(600):
            wrench, required = lowering.wrench(now[0, ORIENTATION], now[0, ANGULAR_VELOCITY])
            J = controller.jacobian(now[0, ORIENTATION])
            np.testing.assert_allclose(J @ lowering.force.ravel() + wrench, required, atol=1e-12)
            model.advance(now, wrench[None], np.zeros((1, 3)))
        rate = float(now[0, ANGULAR_VELOCITY] @ controller.space.axial(1.0))
        goal = lowering.rate(now[0, ORIENTATION], blind=False) @ controller.space.axial(1.0)
        assert np.sign(rate) == side
        assert rate == pytest.approx(float(goal), rel=0.05)


@pytest.mark.parametrize(("name", "free"), [("pivot-3d", True), ("spin-3d", False)])
def test_only_what_the_contacts_leave_free_is_fed_back(name: str, free: bool) -> None:
    """About an edge one axis; about a vertex all."""
    begun = set_up(scenario(name), None, worlds=2, seed=0, first_world=0)
    axis = begun.world.turn[0]
    across = np.cross(axis, [0.36, 0.48, 0.8])
    now = begun.told[0][:1].repeat(2, axis=0)
    off, rate, alpha = 0.01 * axis + 0.02 * across, axis - across, 3.0 * axis + across
    wanted = Desired(desired_values(quaternion_product(exponential(off), now[0]), rate, alpha)[None])
    states = States.turning(now, np.zeros((2, 3)))
    given = FreeReference(60.0, begun.setting)(states, wanted)
    left = [0.01 * axis, axis, 3.0 * axis] if free else [off, rate, alpha]
    error = rotation_vector(quaternion_product(given.orientation, now * CONJUGATE))
    for values, expected in zip((error, given.angular_velocity, given.angular_acceleration), left, strict=True):
        np.testing.assert_allclose(np.broadcast_to(values, (2, 3)), np.array([expected, expected]), atol=1e-9)


@pytest.mark.parametrize("wrong", [0.0, -1.0, np.nan])
def test_observers_that_cannot_be_are_refused(wrong: float) -> None:
    with pytest.raises(ValueError, match=r"^bandwidth = "):
        PoseObserver([block()], wrong, 1e-3, 1e-3)
    with pytest.raises(ValueError, match=r"^bandwidth = 2000.0: must be at most"):
        PoseObserver([block()], 2000.0, 1e-3, 1e-3)
