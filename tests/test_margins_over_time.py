"""Margins of a run: those of its logged states and wrenches, in the recording too."""

from pathlib import Path

import numpy as np
import pytest
from pivoting.controller import Motion, price
from pivoting.sim import Run, load, simulate
from pivoting.sim.drawing.rerun_recording import record

from tests.recordings import one_each, read, steps

TOLD = {"mass": (0.8, 1.2), "com": (-0.05, 0.05), "inertia": (0.8, 1.2), "mu": 0.25}
LOOP = {"seconds": 0.4, "hold": 0.05, "theta_end": 30.0}


@pytest.fixture(scope="module")
def run() -> Run:
    """With noise and an actuator that does not give all of the wrench: what the margins count is what was logged."""
    return simulate("pivot-2d", 2, **TOLD, **LOOP, noise=0.05, actuator_force=4.0)


def test_they_are_those_of_the_controller_at_what_was_logged(run: Run) -> None:
    found, controller = run.margins, run.attached.controller
    assert found is not None
    assert run.log.measured is not None
    assert run.log.acting is not None
    assert 50 < found.steps.size <= 101
    assert found.steps[-1] == run.status.shape[1] - 1
    assert found.slack.min() < -0.01  # what the actuator does not give
    world, here = run.worst_world, controller.space
    for i in (0, 30, int(found.slack.argmin()), found.steps.size - 1):
        k = found.steps[i]
        q, omega = run.log.measured[world, k, 3:7], run.log.measured[world, k, 10:13]
        state = Motion(float(here.angle(q)), float(omega @ here.axial(1.0)))
        alone = controller.margins(state, run.log.acting[world, k])
        assert found.slack[i] == pytest.approx(alone.slack, abs=1e-9)
        assert found.share[i] == pytest.approx(alone.share, abs=1e-9)
        assert found.wrench_scale[i] == pytest.approx(alone.wrench_scale, abs=1e-6)
        sought = [np.asarray(each[k]) for each in run.desired]
        wanted = Motion(float(here.angle(sought[0])), *(float(each @ here.axial(1.0)) for each in sought[1:]))
        assert (found.price[i], found.price_objective[i]) == pytest.approx(price(controller, state, wanted), abs=1e-9)


def test_the_least_of_them(run: Run) -> None:
    found = run.margins
    assert found is not None
    assert found.figures() == {
        "slack_min_N": found.slack.min(),
        "share_min": found.share.min(),
        "wrench_scale_min": found.wrench_scale.min(),
        "price_median": np.median(found.price),
        "price_objective_median": np.median(found.price_objective),
    }


def test_the_recording_has_them(run: Run, tmp_path: Path) -> None:
    for world in (run.worst_world, 1 - run.worst_world):
        entities = read(record(run, tmp_path / "held.rrd", world=world))
        found = run.margins
        assert found is not None
        slack = entities["/plots/slack/worst_member"]
        assert np.array_equal(steps(slack), found.steps)
        assert np.array_equal(one_each(slack["Scalars:scalars"]), found.slack) == (world == run.worst_world)
        if world == run.worst_world:
            assert np.array_equal(one_each(entities["/plots/set/share"]["Scalars:scalars"]), found.share)
            assert np.array_equal(one_each(entities["/plots/set/wrench_scale"]["Scalars:scalars"]), found.wrench_scale)


def test_a_saved_run_has_the_same(run: Run, tmp_path: Path) -> None:
    run.save(tmp_path)
    again = load(tmp_path)
    assert isinstance(again, Run)
    assert run.margins is not None
    assert again.margins is not None
    assert all(np.array_equal(a, b) for a, b in zip(run.margins, again.margins, strict=True))


def test_a_guarantee_that_is_kept_shows_in_them() -> None:
    """Without noise and bounds the wrench that acts is the one that is guaranteed."""
    held = simulate("pivot-2d", **TOLD, **LOOP).margins
    assert held is not None
    assert held.slack.min() >= -1e-8
    assert held.wrench_scale.min() >= 1.0 - 1e-6


def test_without_a_set_there_are_none(tmp_path: Path) -> None:
    run = simulate("pivot-2d", **TOLD, **LOOP, guarantee="none")
    assert run.margins is None
    entities = read(record(run, tmp_path / "none.rrd"))
    assert not {"/plots/slack/worst_member", "/plots/set/share"} & set(entities)
