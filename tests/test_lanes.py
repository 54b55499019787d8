"""Worlds that are stepped by several threads at the same time are the same as one after another."""

from dataclasses import replace
from threading import current_thread, main_thread

import pytest
from pivoting.controller.validate import frozen
from pivoting.sim import Run, simulate, simulation
from pivoting.sim.pipeline.measurement_noise import MeasurementNoise
from pivoting.sim.pipeline.stages import States

from tests.same_runs import assert_same

FEW = {"seconds": 0.1, "hold": 0.05, "noise": 0.05}


def timeless(run: Run) -> Run:
    """As if no step had taken any time."""
    return replace(run, wall_s=1.0, log=run.log._replace(control_ns=frozen(0.0 * run.log.control_ns)))


@pytest.mark.parametrize("name", ["pivot-2d", "settle-3d"])
def test_lanes_change_nothing(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bit for bit, also where the worlds are not shared out evenly, and where there are more lanes than threads."""
    several = len(simulation._lanes(135))
    monkeypatch.setattr(simulation, "MOST_IN_LANE", 1000)
    monkeypatch.setattr(simulation, "LANE", 45)
    monkeypatch.setattr("os.cpu_count", lambda: 3)
    assert [last - first for first, last in simulation._lanes(136)] == [45, 45, 46]
    apart = simulate(name, 136, **FEW)
    monkeypatch.setattr(simulation, "LANE", 1000)
    assert len(simulation._lanes(136)) == 1 <= several
    together = timeless(simulate(name, 136, **FEW))
    assert_same(timeless(apart), together)
    monkeypatch.setattr(simulation, "MOST_IN_LANE", 20)
    assert [last - first for first, last in simulation._lanes(136)] == [19, 19, 20, 19, 20, 19, 20]
    assert_same(timeless(simulate(name, 136, **FEW)), together)


@pytest.mark.parametrize("first", [True, False])
def test_a_lane_that_fails_ends_the_run(first: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """With its error, whichever it is, and long before the others would have come to their end."""
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    last, measured = [0, 0], MeasurementNoise.__call__

    def failing(self: MeasurementNoise, k: int, states: States) -> States:
        main = current_thread() is main_thread()
        last[main] = k
        if k == 7 and main == first:
            raise OverflowError("of this lane")
        return measured(self, k, states)

    monkeypatch.setattr(MeasurementNoise, "__call__", failing)
    with pytest.raises(OverflowError, match="of this lane"):
        simulate("balance-2d", 128, seconds=1.0, noise=0.05)
    assert last[first] == 7
    assert max(last) < 500


def test_progress_is_told_from_the_thread_that_asked() -> None:
    told = []
    simulate("balance-2d", 128, seconds=0.6, progress=lambda done, of: told.append((done, of, current_thread())))
    assert told[-1] == (600, 600, main_thread())
    assert {thread for *_, thread in told} == {main_thread()}
