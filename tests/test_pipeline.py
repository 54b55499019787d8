"""The stages of a step: what they change is logged, what they draw is keyed, and what is left out changes nothing."""

from dataclasses import dataclass

import numpy as np
import pytest
from pivoting import Run, assert_sticking, simulate, solve
from pivoting.controller import Motion
from pivoting.controller.rotations import CONJUGATE, quaternion_product
from pivoting.sim import Scenario, scenario
from pivoting.sim.pipeline.own_control import Moment
from pivoting.sim.pipeline.random_draws import Draws
from pivoting.sim.pipeline.stages import ORIENTATION, Setting, States
from pivoting.sim.scenarios.key_declaration import key

SHORT = {"seconds": 1.0, "hold": 0.1, "theta_end": 40.0}


def angle_between(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """[deg] of quaternions (..., 4)."""
    turned = quaternion_product(p, q * CONJUGATE)
    return np.rad2deg(2.0 * np.arctan2(np.linalg.norm(turned[..., 1:], axis=-1), np.abs(turned[..., 0])))


def test_draws_belong_to_a_seed_a_world_and_a_step() -> None:
    many = Draws(7, "a", 5)
    assert np.array_equal(many.uniform(3, 6)[2:4], Draws(7, "a", 2, first=2).uniform(3, 6))
    others = Draws(8, "a", 5).uniform(3, 6), Draws(7, "b", 5).uniform(3, 6), many.uniform(4, 6)
    assert all(not np.isclose(many.uniform(3, 6), other).any() for other in others)
    values = np.concatenate([many.uniform(k, 6).ravel() for k in range(2000)])
    assert -1.0 <= values.min() < -0.999
    assert 0.999 < values.max() < 1.0
    assert abs(values.mean()) < 5.0 / np.sqrt(3.0 * values.size)


def test_without_stages_nothing_of_them_is_kept() -> None:
    log = simulate("balance-2d", seconds=0.6).log
    assert log.measured is log.estimated is log.acting is None


@pytest.mark.parametrize("name", ["pivot-2d", "spin-3d"])
def test_noise_is_of_the_measurement_alone(name: str) -> None:
    run = simulate(name, worlds=2, noise=0.05, seconds=1.0, theta_end=40.0)
    assert run.log.measured is not None
    off = angle_between(run.log.measured[..., ORIENTATION], run.quaternion[:, :-1])
    most = 0.05 * np.sqrt(1.0 if name.endswith("2d") else 3.0)
    assert 0.9 * 0.05 < off.max() <= most + 1e-6
    assert np.array_equal(np.delete(run.log.measured, np.r_[ORIENTATION], -1), run.log.states[:, :-1, np.r_[:3, 7:13]])
    assert not np.isclose(off[0], off[1]).all()
    assert_sticking(run, force_mismatch_rel=1.0)


def test_a_world_of_a_noisy_fleet_can_be_run_again_alone() -> None:
    fleet = simulate("pivot-2d", worlds=4, seed=3, noise=0.1, **SHORT)
    alone = simulate("pivot-2d", seed=3, first_world=2, noise=0.1, **SHORT)
    for values, own in ((fleet.wrench, alone.wrench), (fleet.log.states, alone.log.states)):
        assert np.array_equal(values[2], own[0])
    assert not np.array_equal(fleet.wrench[1], alone.wrench[0])


def test_integral_action_removes_a_steady_error() -> None:
    """The world is a tenth heavier than is believed."""
    errors = [
        abs(simulate("balance-2d", seconds=3.0, world={"mass": 1.1}, integral=rate).angle_error[0, -1])
        for rate in (0.0, 20.0)
    ]
    assert errors[0] > 1e-4
    assert errors[1] < 1e-9


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"integral": 80.0}, r"^integral = 80.0: must be < 2 damping bandwidth = 80 1/s"),
        ({"integral": 1.0, "law": "static"}, r"^integral = 1.0: must be left out"),
        ({"integral": -1.0}, r"^integral = -1.0: must be .*>= 0"),
        ({"noise": 11.0}, r"^noise = 11.0: must be .*<= 10"),
    ],
)
def test_stages_that_cannot_be_are_refused(keys: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        simulate("balance-2d", seconds=0.6, **keys)


def test_a_control_of_ones_own_that_solves_the_same_problems_makes_the_same_run() -> None:
    told = simulate("pivot-2d", worlds=2, **SHORT)
    controller = told.attached.controller

    def mine(now: Moment) -> np.ndarray:
        space = controller.space
        desired = Motion(
            float(space.angle(now.desired.orientation)[0]),
            float(now.desired.angular_velocity[0] @ space.axial(1.0)),
            float(now.desired.angular_acceleration[0] @ space.axial(1.0)),
        )
        angles = space.angle(now.states.orientation)
        rates = now.states.angular_velocity @ space.axial(1.0)
        return np.array(
            [
                solve(controller.problem(Motion(float(a), float(w)), desired)).wrench
                for a, w in zip(angles, rates, strict=True)
            ]
        )

    run = simulate("pivot-2d", worlds=2, control=mine, **SHORT)
    np.testing.assert_allclose(run.position, told.position, atol=1e-9)
    assert run.verdict == "pass"
    assert run.controller == "own control"
    assert "force_mismatch_rel" not in {check.name for check in run.checks}
    assert np.isnan(run.force).all()


def test_a_poor_control_of_ones_own_fails_the_verdict() -> None:
    """A force that balances the weight alone leaves the object to fall."""
    run = simulate("balance-2d", control=lambda now: np.zeros(3), seconds=1.0)
    assert run.verdict == "fail"
    run = simulate("balance-2d", control=lambda now: np.full(3, np.nan if now.time > 0.3 else 0.0), seconds=0.6)
    assert run.measures.unsolved_steps[0] == np.count_nonzero(run.time[:-1] > 0.3)
    assert not run.wrench_world[0, run.time[:-1] > 0.3].any()


@pytest.mark.parametrize(
    ("control", "message"),
    [
        (lambda now: np.zeros(6), r"^control = 'float64 of shape \(6,\)': must be .*\(1, 3\) or \(3,\)"),
        (lambda now: "push", r"^control = .*must be a function that gives numbers"),
        (0.5, r"^control = 0.5: must be a function"),
    ],
    ids=["shape", "text", "number"],
)
def test_what_is_no_control_is_refused(control: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        simulate("balance-2d", control=control, seconds=0.6)  # type: ignore[arg-type]


def test_an_observer_of_ones_own_is_what_the_control_believes() -> None:
    """A mean over the last measurements, of an object at rest, has less noise than each."""

    def run(observe: "Mean | None") -> Run:
        return simulate("balance-2d", noise=0.2, seconds=1.0, observe=observe)

    class Mean:
        kept = np.zeros((0, 1, 13))

        def __call__(self, k: int, measured: States, applied: np.ndarray | None) -> States:
            self.kept = np.concatenate([self.kept, measured.values[None]])[-5:]
            values = self.kept.mean(axis=0)
            values[:, ORIENTATION] /= np.linalg.norm(values[:, ORIENTATION], axis=1, keepdims=True)
            return measured.changed(values)

    seen, calm = run(None), run(Mean())
    assert calm.log.estimated is not None
    off = [
        angle_between(values[0, 200:, ORIENTATION], calm.quaternion[0, 200:-1]).std()
        for values in (calm.log.measured, calm.log.estimated)
        if values is not None
    ]
    assert off[1] < 0.7 * off[0]
    assert np.std(calm.wrench[0, 200:, 2]) < 0.8 * np.std(seen.wrench[0, 200:, 2])


class HeldWrench:
    """An actuator that takes a new wrench every so many steps only."""

    slot = "actuate"

    def __init__(self, every: float, setting: Setting):
        self._every, self._held = int(every), np.zeros(0)

    def __call__(self, k: int, wrench: np.ndarray) -> np.ndarray:
        if k % self._every == 0:
            self._held = wrench.copy()
        return self._held


@dataclass(frozen=True)
class HeldScenario(Scenario):
    """With a key of the user's own."""

    every: float = key(
        0.0, "steps for which a wrench is held", group="mine", at_least=0.0, stage="tests.test_pipeline:HeldWrench"
    )


def test_a_stage_of_ones_own_needs_a_class_and_a_key() -> None:
    given = vars(scenario("pivot-2d"))
    case = HeldScenario(**{**given, "world": {}}).change(every="5", **SHORT)
    run = simulate(case)
    assert run.log.acting is not None
    assert np.array_equal(run.log.acting[0, 1:5], np.repeat(run.wrench[0, :1], 4, axis=0))
    assert np.array_equal(run.log.acting[0, ::5], run.wrench[0, ::5])
    assert run.verdict == "pass"
    plain = simulate("pivot-2d", **SHORT)
    assert run.measures.angle_error_max_deg > plain.measures.angle_error_max_deg
