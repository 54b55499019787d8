"""The horizon in the loop: two rates, bounds that hold, plans that fail, and plans played in open loop."""

import numpy as np
import pytest
from click.testing import CliRunner
from pivoting.controller.errors import PlanError
from pivoting.controller.planning.receding_horizon import OUTCOMES
from pivoting.sim import Run, assert_sticking, assert_tracking, simulate
from pivoting.sim.console.command_line import cli

WEIGHT = 10.0  # of the 1 kg blocks


def sizes(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """|force| and |moment| of every wrench."""
    d = run.truth.dim
    return np.linalg.norm(run.wrench[..., :d], axis=-1), np.linalg.norm(run.wrench[..., d:], axis=-1)


@pytest.fixture(scope="module")
def mpc() -> Run:
    return simulate("mpc-2d", worlds=2, seed=3)


def test_mpc_2d(mpc: Run) -> None:
    assert mpc.verdict == "pass"
    assert_sticking(mpc, slip_m=1e-4)
    assert_tracking(mpc, rms_deg=0.2)
    force, _ = sizes(mpc)
    assert force.max() <= 0.8 * WEIGHT * (1.0 + 1e-6)
    assert force.max() > 0.79 * WEIGHT  # the bound is met, so it is one
    assert mpc.plans is not None
    assert mpc.plans.outcome.shape == (2, 150)
    assert not mpc.plans.outcome.any()
    assert np.array_equal(mpc.plans.step, 10 * np.arange(150))
    assert mpc.plans.residual.max() < 1e-8
    assert mpc.events == ()


def test_mpc_3d() -> None:
    run = simulate("mpc-3d", seconds=1.0, theta_end=50.0)
    assert run.verdict == "pass"
    assert_sticking(run, slip_m=1e-4)
    assert_tracking(run, rms_deg=0.2)
    assert sizes(run)[0].max() <= run.scenario.absolute(run.load).bounds().force * (1.0 + 1e-6)
    assert run.plans is not None
    assert not run.plans.outcome.any()


def test_the_same_seed_gives_the_same_run(mpc: Run) -> None:
    """World by world, whatever else is planned beside it."""
    alone = simulate("mpc-2d", worlds=1, seed=3)
    np.testing.assert_array_equal(alone.theta[0], mpc.theta[0])
    np.testing.assert_array_equal(alone.wrench[0], mpc.wrench[0])


def test_every_bound_holds_in_the_loop() -> None:
    """Rates as well, from step to step of the simulation; the component bounds are the horizon's alone."""
    keys = {"force_max": 8.0, "moment_max": 4.0, "force_rate": 60.0, "moment_rate": 40.0}
    run = simulate("mpc-2d", **keys)
    force, moment = sizes(run)
    assert force.max() <= keys["force_max"] * (1.0 + 1e-6)
    assert moment.max() <= keys["moment_max"] * (1.0 + 1e-6)
    rates = np.diff(run.wrench[0], axis=0) / run.dt
    assert np.linalg.norm(rates[:, :2], axis=1).max() <= keys["force_rate"] * (1.0 + 1e-6)
    assert np.abs(rates[:, 2]).max() <= keys["moment_rate"] * (1.0 + 1e-6)
    assert run.verdict == "pass"


def test_bounds_hold_for_the_plain_law_too() -> None:
    run = simulate("pivot-2d", seconds=0.4, force_max=6.0, moment_max=1.5)
    force, moment = sizes(run)
    assert force.max() <= 6.0 * (1.0 + 1e-6)
    assert moment.max() <= 1.5 * (1.0 + 1e-6)
    assert (run.status == 3).any()
    assert run.summary()["bounded_steps"] == np.count_nonzero(run.status == 3)


@pytest.mark.parametrize("name", ["mpc-2d", "mpc-3d"])
def test_bounds_that_cannot_hold_the_block_end_in_a_status_and_set_it_down(name: str) -> None:
    run = simulate(name, seconds=1.0, force_max=0.05 * WEIGHT, moment_max=0.05 * WEIGHT, theta_end=40.0)
    force, moment = sizes(run)
    assert force.max() <= 0.05 * WEIGHT * (1.0 + 1e-6)
    assert moment.max() <= 0.05 * WEIGHT * (1.0 + 1e-6)
    assert run.verdict == "fail"
    assert run.events[0].time == 0.0
    assert run.events[0].what.startswith("plan infeasible")
    assert run.events[-1].what == "set down and let go"
    assert run.plans is not None
    assert OUTCOMES[run.plans.outcome[0, 0]] == "holding"
    assert OUTCOMES[run.plans.outcome[0, -1]] == "released"
    assert not run.wrench[0, -1].any()
    assert np.isfinite(run.theta).all()
    assert np.abs(run.omega).max() < 4.0  # it falls, and does not spin
    assert np.abs(run.theta[0, -1]) < np.deg2rad(1.0)


def test_open_loop_at_the_simulators_own_step_predicts_what_mujoco_does() -> None:
    """The plan is of a rigid contact; MuJoCo's is soft, and balance on a corner unstable: nothing corrects it."""
    run = simulate("mpc-2d", open_loop=True, plan_step=0.001, spread=0.0, hold=0.0)
    assert run.plan is not None
    assert run.plan.status == "solved"
    assert run.plan_error.shape == (1, 1001)
    assert np.rad2deg(run.plan_error.max()) < 0.005
    assert run.measures.force_mismatch_rel[0] < 1e-3
    assert run.measures.slip_max_m[0] < 2e-5
    assert run.summary()["plan_angle_error_max_deg"] == pytest.approx(np.rad2deg(run.plan_error.max()))


def test_open_loop_shows_what_a_formulation_leaves_out() -> None:
    """The notes' quasi-dynamic steps start from rest, which an object with inertia does not."""
    run = simulate("mpc-2d", open_loop=True, plan_step=0.005, spread=0.0, hold=0.0, integrator="quasi-dynamic")
    assert run.plan is not None
    assert run.plan.status == "solved"
    assert np.rad2deg(run.plan_error.max()) > 30.0


def test_a_plan_that_is_impossible_is_an_error_with_its_evidence() -> None:
    with pytest.raises(PlanError, match="infeasible") as caught:
        simulate("mpc-2d", open_loop=True, force_max=0.5, moment_max=0.5)
    assert caught.value.plan.status == "infeasible"


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"plan_hz": 1.0}, "plan_hz = 1.0: must be such that a plan is made every 0.001 s"),
        ({"plan_steps": 2.5}, "plan_steps = 2.5: must be a whole number"),
        ({"plan_steps": float("inf")}, "plan_steps = inf: must be a finite number >= 1"),
        ({"integrator": "rk4"}, "integrator = 'rk4': must be one of quasi-dynamic, implicit, semi-implicit, forward"),
        ({"force_max": 0.0}, "force_max = 0.0: must be a finite number > 0"),
        ({"track": -1.0}, "track = -1.0: must be a finite number > 0"),
    ],
)
def test_keys_that_make_no_sense_are_refused(keys: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        simulate("mpc-2d", **keys)
    with pytest.raises(ValueError, match=r"plan_step = 0\.0015: must be a whole number of time steps"):
        simulate("mpc-2d", open_loop=True, plan_step=0.0015)
    with pytest.raises(ValueError, match=r"plan_step = 0\.02: must be the time step, 0\.001 s, with a bound on a rate"):
        simulate("mpc-2d", open_loop=True, force_rate=20.0)
    with pytest.raises(ValueError, match=r"plan_hz = 600\.0: must be .* in whole time steps"):
        simulate("mpc-2d", plan_hz=600.0)


def test_a_start_far_off_the_reference_is_planned_for() -> None:
    """Up to 10 deg, within the bound on the force: every plan is found."""
    run = simulate("mpc-2d", worlds=2, seed=1, spread=10.0, seconds=0.3, theta_end=30.0)
    assert run.plans is not None
    assert not run.plans.outcome.any()
    assert run.events == ()


def test_the_command_line_says_what_happened() -> None:
    small = ["run", "mpc-2d", "--set", "seconds=0.3", "--set", "hold=0.05", "--set", "theta_end=15"]
    told = CliRunner().invoke(cli, [*small, "--open-loop", "--set", "plan_step=0.005"], standalone_mode=False)
    assert "open loop: a plan of 80 steps" in told.output
    told = CliRunner().invoke(cli, small, standalone_mode=False)
    assert "40 plans, 0 failed" in told.output
