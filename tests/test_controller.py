"""`WrenchController` and its compiled loop: the same functions for one state and for many worlds, never stale."""

import os
from pathlib import Path

import numpy as np
import pytest
from pivoting.controller import Body, Contact, Law, Motion, WrenchBounds, WrenchController, solve
from pivoting.controller.controller import step_worlds, world_wrench
from pivoting.controller.stale import drop_stale_kernels

BLOCK = WrenchController(
    Body(2.0, 0.3), [Contact((-0.4, -0.6), 0.35, f_min=3.0)], Law.dynamic(), (1.0, -9.0), margin=0.1
)

FREE = WrenchBounds().stacked(3)


def at(desired: Motion) -> list[np.ndarray]:
    """The same reference for all worlds."""
    return [values[None] for values in BLOCK.space.lift_motion(desired)]


def test_many_worlds_are_as_many_problems() -> None:
    rng = np.random.default_rng(4)
    thetas, omegas = rng.uniform(0.1, 1.4, 50), rng.normal(size=50)
    desired = Motion(0.7, 0.2, -1.0)
    wrench, force, residual, status = np.empty((50, 3)), np.empty((50, 2)), np.empty(50), np.empty(50, np.int8)
    q, omega = BLOCK.space.orientation(thetas), BLOCK.space.axial(omegas)
    out = (wrench, force, residual, status)
    step_worlds(BLOCK.belief, FREE, BLOCK.workspace(), 1e-9, q, omega, *at(desired), *out)
    assert not status.any()
    for i in range(50):
        solution = solve(BLOCK.problem(Motion(thetas[i], omegas[i]), desired))
        np.testing.assert_allclose(wrench[i], solution.wrench, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(force[i], solution.force[0], rtol=1e-12, atol=1e-12)
        assert residual[i] == pytest.approx(solution.residual, abs=1e-15)


def test_a_state_that_is_not_a_number_has_no_answer_and_applies_nothing() -> None:
    q = np.stack([BLOCK.space.orientation(0.5), np.full(4, np.nan)])
    omega = np.zeros((2, 3))
    wrench, force, residual, status = np.ones((2, 3)), np.ones((2, 2)), np.zeros(2), np.zeros(2, np.int8)
    out = (wrench, force, residual, status)
    step_worlds(BLOCK.belief, FREE, BLOCK.workspace(), 1e-9, q, omega, *at(Motion(0.5)), *out)
    assert status.tolist() == [0, 2]
    assert np.isnan(wrench[1]).all()
    applied = np.ones((2, 6))
    world_wrench(BLOCK.belief.wrench_map, q, wrench, applied)
    assert applied[0].any()
    assert not applied[1].any()


def test_a_tolerance_that_is_not_met_is_a_status() -> None:
    q, omega = BLOCK.space.orientation(np.array([0.5])), np.zeros((1, 3))
    wrench, force, residual, status = np.ones((1, 3)), np.ones((1, 2)), np.zeros(1), np.zeros(1, np.int8)
    out = (wrench, force, residual, status)
    step_worlds(BLOCK.belief, FREE, BLOCK.workspace(), -1.0, q, omega, *at(Motion(0.5)), *out)
    assert status.tolist() == [1]


def test_kernels_compiled_of_other_sources_are_dropped(tmp_path: Path) -> None:
    """Also where the new source is the older file, as an installer that keeps dates may leave it."""
    cache = tmp_path / "cache"
    cache.mkdir()
    source, index, code = tmp_path / "law.py", cache / "law.f-1.py311.nbi", cache / "law.f-1.py311.1.nbc"
    source.write_text("mu = 1")
    assert drop_stale_kernels(tmp_path, cache) == []
    for path in (index, code):
        path.write_text("")
    os.utime(source, (100.0, 100.0))
    assert drop_stale_kernels(tmp_path, cache) == []
    assert index.exists()
    source.write_text("mu = 2")
    os.utime(source, (100.0, 100.0))
    assert set(drop_stale_kernels(tmp_path, cache)) == {index, code}
    assert drop_stale_kernels(tmp_path, cache) == []
    assert not list(cache.glob("*.nb*"))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"contacts": []}, "contacts = .*at least one"),
        ({"contacts": [Contact((0.0, 0.0), 0.3)]}, "contacts = .*away from the centre of mass"),
        ({"contacts": [Contact((0.0, 1.0), 0.3), Contact((0.0, 1.0, 0.0), 0.3)]}, "contacts = .*all planar"),
        ({"gravity": (0.0, float("nan"))}, "gravity = .*finite"),
        ({"gravity": (0.0,)}, "gravity = .*shape"),
        ({"margin": 1.0}, "margin = 1.0"),
        ({"Q_w": -np.eye(3)}, "Q_w = .*positive definite"),
    ],
)
def test_bad_input_is_named(change: dict, message: str) -> None:
    good = {
        "body": Body(1.0, 0.1),
        "contacts": [Contact((0.0, -1.0), 0.3)],
        "law": Law.static(),
        "gravity": (0.0, -10.0),
    }
    with pytest.raises(ValueError, match=message):
        WrenchController(**{**good, **change})
