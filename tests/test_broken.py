"""Broken on purpose, it is caught: each mistake that physics.md warns of makes the verdict "fail"."""

from typing import Any

import numpy as np
import pytest
from pivoting.controller import Body, Contact, Law, WrenchController
from pivoting.sim import Run, assert_sticking, assert_tracking, simulate
from pivoting.sim.pipeline import apply_wrench


def failed(run: Run) -> set[str]:
    return {check.name for check in run.checks if not check.passed}


def test_the_printed_gravity_on_a_level_table() -> None:
    """Erratum 2 left in: at 30 deg the printed -g (cos, sin) points 30 deg off the world's gravity."""
    wrong = WrenchController(
        Body(1.0, 1.0 / 6.0),
        [Contact((-0.5, -0.5), 0.3)],
        Law.dynamic(),
        (-10.0 * np.sin(np.pi / 6), -10.0 * np.cos(np.pi / 6)),
        margin=1.0 / 6.0,
    )
    run = simulate("balance-2d", controller=wrong, seconds=2.0)
    assert run.verdict == "fail"
    assert "force_mismatch_rel" in failed(run)
    with pytest.raises(AssertionError, match="force_mismatch_rel"):
        assert_sticking(run)


def test_friction_overestimated_by_half_near_the_edge() -> None:
    """The plan uses 0.3 to the full; the world has 0.2: it slides."""
    run = simulate("incline-2d", world={"mu": 0.2}, seconds=2.0)
    assert run.verdict == "fail"
    assert {"slip_max_m", "friction_use_max"} <= failed(run)
    with pytest.raises(AssertionError, match=r"slip_max_m = .* > 2e-05 in world 0.*slip_floor_m"):
        assert_sticking(run)


def test_exactly_on_the_edge_nothing_sticks() -> None:
    """The world has just the friction that is planned with, and no margin is kept."""
    run = simulate("incline-2d", mu=0.3, seconds=2.0)
    assert run.verdict == "fail"
    assert "slip_max_m" in failed(run)
    assert simulate("incline-2d", mu=0.3, margin=0.1, seconds=2.0).verdict == "pass"


def test_the_wrench_in_the_wrong_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    """Object axes written to xfrc_applied as if they were the world's."""

    honest = apply_wrench.apply_wrenches

    def unturned(wrench_map: np.ndarray, states: np.ndarray, *rest: Any) -> None:
        honest(wrench_map, np.tile([0.0, 0, 0, 1, 0, 0, 0], (len(states), 1)), *rest)

    monkeypatch.setattr(apply_wrench, "apply_wrenches", unturned)
    run = simulate("balance-2d", seconds=2.0)
    assert run.verdict == "fail"


def test_the_wrench_not_applied_at_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(apply_wrench, "apply_wrenches", lambda *given: given[4].fill(0.0))
    run = simulate("balance-2d", seconds=1.0)
    assert {"angle_error_rms_deg", "force_mismatch_rel"} <= failed(run)
    with pytest.raises(AssertionError, match="angle_error_rms_deg"):
        assert_tracking(run)


@pytest.mark.parametrize("hidden", [{"mass": 1.3}, {"gravity": 12.0}, {"size": 1.2}])
def test_a_world_that_is_not_as_believed(hidden: dict) -> None:
    run = simulate("balance-2d", world=hidden, seconds=1.0)
    assert run.verdict == "fail"


def test_static_law_does_not_hold_its_balance() -> None:
    """The notes' first program balances; without feedback the least error grows."""
    run = simulate("balance-2d", law="static", spread=0.05)
    assert "angle_error_max_deg" in failed(run)


def test_quasi_dynamic_law_oscillates() -> None:
    """Erratum 7: with the velocity taken for zero, an error of the angle rings on undamped."""
    run = simulate("balance-2d", law="quasi-dynamic", spread=0.5, seed=1, seconds=3.0)
    error = run.angle_error[0]
    late = error[run.time > 2.0]
    assert np.abs(late).max() > 0.8 * abs(error[0])
    assert np.count_nonzero(np.diff(np.sign(late))) > 5
    assert "angle_error_max_deg" in failed(run)
    steady = simulate("balance-2d", spread=0.5, seed=1, seconds=3.0)
    assert np.abs(steady.angle_error[0, run.time > 2.0]).max() < 1e-5


def test_a_world_that_diverges_fails_and_takes_no_other_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """One world's wrench is blown up: its states stop being numbers, its neighbours pass."""
    honest = apply_wrench.apply_wrenches

    def blown(*given: Any) -> None:
        honest(*given)
        *_, out, xfrc, body = given
        out[1] *= 1e300
        xfrc[1, body] = out[1]

    monkeypatch.setattr(apply_wrench, "apply_wrenches", blown)
    run = simulate("balance-2d", worlds=3, seconds=1.0)
    assert run.failed_worlds.tolist() == [1]
    assert run.status[1].max() == 2
    assert np.isnan(run.wrench[1, -1]).all()
    assert not run.wrench_world[1, -1].any()
    assert run.summary()["verdict"] == "fail"
