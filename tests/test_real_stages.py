"""The stages of a real loop: each does to measurements, wrenches and worlds what its key says, and nothing else."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pivoting import Run, load, simulate
from pivoting.controller import WrenchBounds
from pivoting.controller.rotations import CONJUGATE, exponential, quaternion_product, rotation_vector
from pivoting.controller.solution import FAILED, REPEATED, SOLVED
from pivoting.sim.pipeline.random_draws import Draws
from pivoting.sim.pipeline.stages import ORIENTATION, POSITION, Stages
from pivoting.sim.run_setup import set_up
from pivoting.sim.scenario_control import stages_of
from pivoting.sim.scenarios.key_declaration import declared_keys
from pivoting.sim.scenarios.loop_keys import LoopKeys
from pivoting.sim.scenarios.shipped_scenarios import scenario

SHORT = {"seconds": 0.5, "hold": 0.1, "theta_end": 30.0, "reference": "arc"}
ALL = {
    "noise": 0.1, "noise_position": 5e-4, "noise_distribution": "normal", "bias": 0.05, "bias_position": 1e-3,
    "resolution": 1e-3, "resolution_position": 1e-6, "measure_hz": 500.0, "delay": 0.004, "dropped": 0.1,
    "repeated": 0.1, "broken": 0.1, "observer": 60.0, "solver_failure": 0.1, "control_hz": 500.0, "safe_after": 0.05,
    "actuator_force": "3w", "force_resolution": "0.001w", "moment_resolution": 1e-3, "shove": 0.02, "mu_falls_to": 0.29,
}  # fmt: skip


def turned(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Rotation vectors [rad] from q to p, (..., 4) each."""
    return rotation_vector(quaternion_product(p, q * CONJUGATE))


def measured(name: str = "pivot-2d", **keys: Any) -> tuple[np.ndarray, np.ndarray, Run]:
    """Measured and true states (W, N, 13) of two worlds."""
    run = simulate(name, worlds=2, **SHORT, **keys)
    assert run.log.measured is not None
    return run.log.measured, run.log.states[:, :-1], run


def test_what_is_left_out_builds_no_stage() -> None:
    plain = set_up(scenario("pivot-2d"), None, worlds=1, seed=0, first_world=0)
    assert stages_of(plain) == Stages()
    zeros = {name: 0.0 for name, key in declared_keys(LoopKeys).items() if key.stages and not key.optional}
    assert stages_of(plain._replace(case=plain.case.change(**zeros))) == Stages()


def test_where_nothing_fails_the_guard_changes_nothing() -> None:
    plain, guarded = simulate("pivot-2d", **SHORT), simulate("pivot-2d", safe_after=0.01, **SHORT)
    assert np.array_equal(plain.wrench, guarded.wrench)
    assert np.array_equal(plain.log.states, guarded.log.states)


def test_rotation_vectors_are_those_of_which_quaternions_are_made() -> None:
    vectors = np.random.default_rng(0).normal(size=(50, 3))
    np.testing.assert_allclose(rotation_vector(exponential(vectors)), vectors, atol=1e-14)
    assert not rotation_vector(np.array([1.0, 0.0, 0.0, 0.0])).any()


def test_normal_draws_are_normal_and_keyed() -> None:
    values = np.concatenate([Draws(1, "a", 4).normal(k, 3).ravel() for k in range(2000)])
    assert abs(values.mean()) < 0.03
    assert abs(values.std() - 1.0) < 0.03
    assert abs((np.abs(values) < 1.0).mean() - 0.6827) < 0.01
    assert np.array_equal(Draws(1, "a", 4).normal(5, 3)[2:3], Draws(1, "a", 1, first=2).normal(5, 3))
    shares = np.concatenate([Draws(1, "a", 4).shares(k) for k in range(500)])
    assert 0.0 <= shares.min() < shares.max() < 1.0
    np.testing.assert_allclose(np.linalg.norm(Draws(1, "a", 9).direction(0, 3), axis=1), 1.0)


@pytest.mark.parametrize("name", ["pivot-2d", "pivot-3d"])
def test_noise_of_the_position(name: str) -> None:
    seen, true, run = measured(name, noise_position=5e-4)
    off = (seen - true)[..., POSITION]
    assert 0.95 * 5e-4 < np.abs(off).max() <= 5e-4
    assert np.array_equal(np.delete(seen, np.r_[POSITION], -1), np.delete(true, np.r_[POSITION], -1))
    assert bool(off[..., 1].any()) is (run.truth.dim == 3)


def test_biases_stay_and_are_each_worlds_own() -> None:
    seen, true, _ = measured("pivot-3d", bias=0.5, bias_position=0.01)
    turns = turned(seen[..., ORIENTATION], true[..., ORIENTATION])
    np.testing.assert_allclose(np.linalg.norm(turns, axis=-1), np.deg2rad(0.5), rtol=1e-6)
    for off in (turns, (seen - true)[..., POSITION]):
        np.testing.assert_allclose(off, off[:, :1].repeat(off.shape[1], axis=1), atol=1e-9)
        assert np.linalg.norm(off[0, 0] - off[1, 0]) > 0.1 * np.linalg.norm(off[0, 0])
    np.testing.assert_allclose(np.linalg.norm((seen - true)[..., POSITION], axis=-1), 0.01, rtol=1e-9)


def test_resolutions_round() -> None:
    seen, true, _ = measured("pivot-3d", resolution=0.1, resolution_position=1e-3)
    turns = np.rad2deg(turned(seen[..., ORIENTATION], true[..., ORIENTATION]))
    assert 0.03 < np.linalg.norm(turns, axis=-1).max() <= 0.05 * np.sqrt(3.0)
    np.testing.assert_allclose(seen[..., POSITION] * 1e3, np.round(seen[..., POSITION] * 1e3), atol=1e-9)
    assert np.abs((seen - true)[..., POSITION]).max() <= 5e-4 + 1e-12


def test_measurements_that_are_late_or_rare() -> None:
    seen, true, _ = measured(delay=0.005)
    assert np.array_equal(seen[:, 5:], true[:, :-5])
    assert np.array_equal(seen[:, :5], true[:, :1].repeat(5, axis=1))
    seen, true, _ = measured(measure_hz=100.0)
    assert np.array_equal(seen[:, ::10], true[:, ::10])
    assert np.array_equal(seen[:, 9::10], true[:, ::10][:, : seen[:, 9::10].shape[1]])


@pytest.mark.parametrize("fault", ["dropped", "repeated", "broken"])
def test_faults_of_measurements_begin_when_they_are_to_and_are_as_many(fault: str) -> None:
    seen, true, _ = measured(fault_start=0.1, safe_after=0.05, **{fault: 0.3})
    wrong = ~(seen == true).all(axis=-1)
    assert not wrong[:, :100].any()
    assert 0.2 < wrong[:, 100:].mean() < 0.4
    if fault == "broken":
        assert np.isnan(seen[wrong]).all()
    else:
        assert np.array_equal(seen[:, 1:][wrong[:, 1:]], seen[:, :-1][wrong[:, 1:]])
    assert not np.array_equal(wrong[0], wrong[1])


def test_without_a_guard_a_failed_solver_leaves_the_object_without_a_wrench() -> None:
    run = simulate("pivot-2d", solver_failure=0.2, fault_start=0.1, **SHORT)
    failed = run.status[0] == FAILED
    assert not failed[:100].any()
    assert 0.1 < failed[100:].mean() < 0.3
    assert not run.wrench_world[0, failed].any()
    assert run.measures.unsolved_steps[0] == failed.sum()


def test_with_one_the_last_wrench_is_held_and_is_not_passed_off_as_new() -> None:
    run = simulate("pivot-2d", solver_failure=0.2, fault_start=0.1, safe_after=0.02, **SHORT)
    again = np.flatnonzero(run.status[0] == REPEATED)
    assert run.measures.repeated_steps[0] == len(again) > 50
    assert np.array_equal(run.wrench[0, again], run.wrench[0, again - 1])
    assert np.isnan(run.residual[0, again]).all()
    assert run.measures.residual_max[0] < 1e-9
    assert run.measures.unsolved_steps[0] == 0.0


def test_a_slow_control_holds_its_wrench() -> None:
    run = simulate("pivot-2d", control_hz=200.0, **SHORT)
    assert (run.status[0, ::5] == SOLVED).all()
    for later in range(1, 5):
        assert (run.status[0, later::5] == REPEATED).all()
        assert np.array_equal(run.wrench[0, later::5], run.wrench[0, ::5][: len(run.wrench[0, later::5])])


def test_an_actuator_stops_at_its_bounds() -> None:
    run = simulate("pivot-2d", actuator_force=6.0, actuator_moment=2.0, actuator_force_rate=80.0, **SHORT)
    acting, dt = run.log.acting, run.dt
    assert acting is not None
    force, moment = np.linalg.norm(acting[0, :, :2], axis=-1), np.abs(acting[0, :, 2])
    assert force.max() <= 6.0 + 1e-9
    assert moment.max() == pytest.approx(2.0)
    assert np.linalg.norm(np.diff(acting[0, :, :2], axis=0), axis=-1).max() <= 80.0 * dt + 1e-9
    asked = np.linalg.norm(run.wrench[0, :, :2], axis=-1)
    assert (asked > 6.0 + 1e-6).any() or np.linalg.norm(np.diff(run.wrench[0, :, :2], axis=0), axis=-1).max() > 80 * dt


def test_what_an_actuator_makes_is_the_nearest_within_its_bounds() -> None:
    bounds, rng = WrenchBounds(force=2.0, moment=1.0, force_rate=30.0), np.random.default_rng(1)
    before = bounds.within(rng.normal(size=(200, 6)), None, 0.01)
    asked = 3.0 * rng.normal(size=(200, 6))
    acting = bounds.within(asked, before, 0.01)
    assert bounds.excess(acting, before, 0.01) <= 1e-12
    assert bounds.excess(asked, before, 0.01) > 1.0
    np.testing.assert_allclose(bounds.within(before, before, 0.01), before, rtol=1e-14)
    straight = np.cross(acting[:, 3:], asked[:, 3:])  # a moment keeps its direction
    np.testing.assert_allclose(straight, 0.0, atol=1e-12)


def test_an_actuator_makes_multiples() -> None:
    run = simulate("pivot-2d", force_resolution=0.05, moment_resolution=0.01, **SHORT)
    assert run.log.acting is not None
    steps = run.log.acting[0] / [0.05, 0.05, 0.01]
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    assert np.abs(run.log.acting[0] - run.wrench[0]).max() <= 0.025 + 1e-12


@pytest.mark.parametrize("name", ["pivot-2d", "pivot-3d"])
def test_a_shove_has_its_impulse_by_the_true_mass(name: str) -> None:
    run = simulate(name, worlds=3, shove=0.05, shove_seconds=0.02, world={"mass": 1.3}, f_min="2w", **SHORT)
    pushed = run.log.disturbance
    assert pushed is not None
    assert not pushed[..., 3:].any()
    impulse = pushed[..., :3].sum(axis=1) * run.dt
    np.testing.assert_allclose(np.linalg.norm(impulse, axis=-1), 0.05 * 1.3, rtol=1e-9)
    assert (np.count_nonzero(pushed.any(axis=-1), axis=1) == 20).all()
    starts = pushed.any(axis=-1).argmax(axis=1)
    assert len(set(starts.tolist())) == 3
    assert [round(event.time / run.dt) for event in run.events] == sorted(starts.tolist())
    assert bool(impulse[:, 1].any()) is (run.truth.dim == 3)
    still = simulate(name, worlds=3, world={"mass": 1.3}, f_min="2w", **SHORT)
    k = int(starts.min())
    assert np.array_equal(run.log.states[:, : k + 1], still.log.states[:, : k + 1])
    assert not np.isclose(run.velocity[:, starts.max() + 20], still.velocity[:, starts.max() + 20], atol=1e-5).all()


def test_friction_falls_in_the_world_alone() -> None:
    run = simulate("pivot-2d", mu_falls_to=0.1, mu_falls_at=0.4, **SHORT)
    share = np.abs(run.force_measured[0, :, 0, 0]) / np.maximum(run.force_measured[0, :, 0, 1], 1e-9)
    assert share[400:].max() == pytest.approx(0.1, rel=1e-6)
    assert share[200:400].max() > 0.11
    assert np.nanmax(run.friction_use[0, 400:]) == pytest.approx(1.0)
    planned = np.abs(run.force[0, 400:, 0, 0]) / run.force[0, 400:, 0, 1]
    assert planned.max() > 0.2
    early = simulate("pivot-2d", **SHORT)
    assert np.array_equal(run.log.states[:, :401], early.log.states[:, :401])


def test_a_world_with_everything_can_be_run_again_alone_and_kept(tmp_path: Path) -> None:
    many = simulate("pivot-2d", worlds=3, seed=5, **SHORT, **ALL)
    alone = simulate("pivot-2d", seed=5, first_world=1, **SHORT, **ALL)
    for name in ("states", "measured", "estimated", "acting", "disturbance", "wrench_world"):
        assert np.array_equal(getattr(many.log, name)[1], getattr(alone.log, name)[0], equal_nan=True), name
    assert np.array_equal(many.status[1], alone.status[0])
    assert [event._replace(world=0) for event in many.events if event.world == 1] == list(alone.events)
    again = load(many.save(tmp_path))
    assert isinstance(again, Run)
    assert again.log.disturbance is not None
    assert np.array_equal(again.log.disturbance, many.log.disturbance)
    assert again.events == many.events


def test_a_fleet_tells_of_safe_states() -> None:
    keys = {"solver_failure": 1.0, "fault_start": 0.3, "safe_after": 0.02, **SHORT}
    fleet = simulate("pivot-2d", worlds=2, keep="measures", **keys)
    assert (fleet.measures.safe_s > 0.3).all()
    assert [(event.world, event.state) for event in fleet.events][:1] == [(0, "lowered")]
    assert fleet.findings.reasons == [event.what for event in fleet.events if event.world == fleet.worst_world]
    assert fleet.replay(1).status[0, -1] == fleet.replay(0).status[0, -1]


@pytest.mark.parametrize(
    ("name", "keys", "message"),
    [
        ("pivot-2d", {"delay": 1e-4}, "^delay = 0.0001: must be 0, or at least the time step of 0.001 s"),
        ("pivot-2d", {"control_hz": 5e3}, "^control_hz = 5000.0: must be at most one for each time step, 1000 Hz"),
        ("pivot-2d", {"measure_hz": 5e3}, "^measure_hz = 5000.0: must be at most one"),
        ("mpc-2d", {"control_hz": 500.0}, "^control_hz = 500.0: must be left out with plan_hz"),
        ("pivot-2d", {"observer": 2e3}, "^observer = 2000.0: must be at most 1000 rad/s"),
        ("settle-3d", {"observer": 50.0}, "^observer = 50.0: must be 0 with landing=held"),
        ("settle-3d", {"safe_after": 0.05}, "^safe_after = 0.05: must be 0 with landing=held"),
        ("pivot-2d", {"safe_after": 0.01, "measure_hz": 50.0}, "^safe_after = 0.01: must be >= 0.021 s"),
        ("pivot-2d", {"safe_after": 0.01, "delay": 0.02}, "^safe_after = 0.01: must be >= 0.021 s"),
        ("pivot-2d", {"shove": 0.1, "shove_seconds": 9.0}, "^shove_seconds = 9.0: must be less than 4.65 s"),
        (
            "pivot-2d",
            {"noise_distribution": "normal"},
            "left out: it has no effect unless noise or noise_position is set",
        ),
        ("pivot-2d", {"fault_start": 1.0}, "^fault_start = 1.0: must be left out"),
        ("pivot-2d", {"safe_angle": 1.0}, "^safe_angle = 1.0: must be left out"),
        ("pivot-2d", {"mu_falls_at": 1.0}, "^mu_falls_at = 1.0: must be left out"),
        ("pivot-2d", {"dropped": 1.1}, "^dropped = 1.1: must be"),
    ],
)
def test_what_cannot_be_is_refused(name: str, keys: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        simulate(name, **keys)
