"""The disturbance observer: it leaves no steady error, does not wind up, and refuses what it cannot do."""

import numpy as np
import pytest
from pivoting import simulate
from pivoting.sim.pipeline.stages import States
from pivoting.sim.run_setup import set_up
from pivoting.sim.scenario_control import stages_of
from pivoting.sim.scenarios.shipped_scenarios import scenario


def test_it_goes_by_the_estimated_state_whatever_the_order_of_the_keys() -> None:
    """And not by rates that are measured exactly, which an observer does not use."""
    begun = set_up(scenario("pivot-2d").change(disturbance=20.0, observer=60.0), None, worlds=1, seed=0, first_world=0)

    class Own:  # a Kalman filter may well have a method of this name
        def __call__(self, k: int, measured: States, applied: np.ndarray | None) -> States:
            return measured

        def correct(self) -> None:
            raise AssertionError

    assert [type(stage).__name__ for stage in stages_of(begun, Own()).observe] == [
        "ModelObserver", "Own", "DisturbanceObserver",
    ]  # fmt: skip


def test_it_outlives_measurements_that_are_no_numbers() -> None:
    keys = {"seconds": 0.6, "theta_end": 25.0, "safe_after": 0.02, "broken": 0.3, "observer": 60.0}
    run = simulate("pivot-2d", worlds=8, disturbance=10.0, **keys)
    assert np.isnan(run.log.measured).any()
    assert np.isfinite(run.log.measured[:, 0]).all()  # or there would be nothing to begin with
    assert not run.measures.safe_s.any()
    assert run.measures.slip_max_m.max() < 2e-5


@pytest.mark.parametrize("name", ["balance-2d", "pivot-3d"])
def test_it_removes_a_steady_error(name: str) -> None:
    """The world is a tenth heavier than is believed, about a corner in the plane and an edge in space."""
    seconds = {"seconds": 2.0} if name == "balance-2d" else {"seconds": 1.0, "reference": "arc", "hold": 0.8}
    errors = [
        abs(simulate(name, world={"mass": 1.1}, disturbance=rate, **seconds).angle_error[0, -1]) for rate in (0.0, 20.0)
    ]
    assert errors[0] > 1e-4
    assert errors[1] < 1e-6


def test_it_does_not_wind_up() -> None:
    """From 5 deg off, bounds hold the wrench back. Integral action sums up the error, and then loses the object."""
    keys = {"seconds": 0.8, "spread": 6.0, "world": {"mass": 1.05}, "force_max": "0.6w", "moment_max": "0.5w"}
    swung = {}
    for stage in ("integral", "disturbance"):
        run = simulate("balance-2d", seed=3, **keys, **{stage: 20.0})
        error = np.rad2deg(run.angle_error[0])
        swung[stage] = (-np.sign(error[0]) * error).max()
        assert abs(error[0]) > 4.0
        assert (run.status == 3).any()  # as far as the bounds allowed
    assert swung["integral"] > 5.0
    assert swung["disturbance"] < 1e-6
    assert abs(error[-1]) < 1e-6


def test_it_changes_nothing_where_all_is_as_believed() -> None:
    plain, observed = (simulate("balance-2d", seconds=0.6, disturbance=rate) for rate in (0.0, 20.0))
    np.testing.assert_allclose(observed.theta, plain.theta, atol=1e-6)
    assert observed.verdict == "pass"


def test_each_world_has_its_own() -> None:
    """One of them is run again alone."""
    keys = {"seconds": 0.6, "spread": 1.0, "disturbance": 20.0, "world": {"mass": 1.1}}
    fleet = simulate("balance-2d", worlds=3, seed=2, **keys)
    alone = simulate("balance-2d", seed=2, first_world=1, **keys)
    assert np.array_equal(fleet.log.states[1], alone.log.states[0])
    assert not np.array_equal(fleet.wrench[0], fleet.wrench[1])


@pytest.mark.parametrize(
    ("name", "keys", "message"),
    [
        ("balance-2d", {"disturbance": 1000.0}, r"^disturbance = 1000.0: must be < 1 / dt = 1000 1/s"),
        ("balance-2d", {"disturbance": 1.0, "law": "static"}, r"^disturbance = 1.0: must be left out"),
        ("balance-2d", {"disturbance": -1.0}, r"^disturbance = -1.0: must be .*>= 0"),
        (
            "settle-3d",
            {"disturbance": 1.0},
            r"^landing = 'held': must be ignored with a plan, integral action or a dist",
        ),
    ],
)
def test_what_it_cannot_do_is_refused(name: str, keys: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        simulate(name, **keys)
