"""Values in weights and natural times of the object: what they come to, and that mass and gravity may then change."""

from collections.abc import Callable

import numpy as np
import pytest
from pivoting.sim import Run, Scenario, simulate
from pivoting.sim.scenarios.relative_values import Load, absolute, load, multiple
from pivoting.sim.scenarios.shipped_scenarios import SCENARIOS

LEVER = np.sqrt(0.5)  # of the block of 1 m, 1 kg, where gravity is 10 m/s^2


def test_what_one_weight_and_one_natural_time_are() -> None:
    """By hand: weight m g, lever from the CoM to the contacts' mean and out to the surface of what rolls."""
    points, radius = np.array([[0.3, 0.1, 0.0], [0.3, -0.1, 0.0]]), np.array([0.02, 0.02])
    of = load(2.0, np.array([0.0, 3.0, -4.0]), points, radius)
    assert of == pytest.approx((10.0, 0.32, np.sqrt(0.32 / 5.0)))
    for text, sign, unit, value in (
        ("0.8w", "w", "N", 8.0),
        ("0.8w", "w", "N/s", 8.0),
        ("0.5w", "w", "N m", 1.6),
        ("0.5w", "w", "N m/s", 1.6),
        ("3T", "T", "s", 3.0 * np.sqrt(0.064)),
        (0.8, "w", "N", 0.8),
    ):
        assert absolute("key", text, sign, of, unit, {}) == pytest.approx(value, rel=1e-9)
    assert [multiple(text, "w") for text in ("2w", " 2 w ", "w", "2x", "2", "2T", 2.0)] == [2.0, 2.0, *[None] * 5]
    assert multiple("2w", "") is None


@pytest.mark.parametrize(
    ("text", "sign", "of", "message"),
    [
        ("2w", "w", Load(0.0, 1.0, np.inf), r"key = '2w': must be a number \[N\]: without gravity it says nothing"),
        ("2T", "T", Load(0.0, 1.0, np.inf), r"key = '2T': must be a number .*without gravity"),
        ("2T", "T", Load(1.0, 0.0, 0.0), r"key = '2T': must be a number .*without a lever from the contacts"),
        ("2w", "w", Load(1.0, 1.0, 1.0), r"key = 2w, that is key = 2.0: must be a finite number <= 1 \[N\]"),
    ],
)
def test_what_there_is_nothing_to_be_relative_to(text: str, sign: str, of: Load, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        absolute("key", text, sign, of, "N", {"at_most": 1.0})


def test_relative_bounds_are_those_in_newtons() -> None:
    """Of the object as it is believed: what the world has is not known."""
    given = {"seconds": 0.7, "mass": 2.0, "gravity": 5.0, "world": {"mass": 2.1}}
    relative = simulate("balance-2d", **given, force_max="0.33w", moment_max="0.13w", f_min="0.2w")
    resolved = relative.summary()["resolved"]
    assert resolved == pytest.approx({"force_max": 3.3, "moment_max": 1.3 * LEVER, "f_min": 2.0}, rel=1e-9)
    newtons = simulate("balance-2d", **given, **resolved)
    assert newtons.summary()["resolved"] == {}
    assert np.array_equal(relative.wrench, newtons.wrench)
    assert np.linalg.norm(relative.wrench[..., :2], axis=-1).max() <= 3.3 * (1.0 + 1e-6)
    assert relative.scenario.force_max == "0.33w"  # as it was asked for
    assert relative.scenario.label.endswith("force_max=0.33w moment_max=0.13w world.mass=2.1")


def test_rates_are_per_second() -> None:
    run = simulate("balance-2d", reference="sine", seconds=0.8, force_rate="5w", moment_rate="5w", amplitude=1.0)
    assert run.summary()["resolved"] == pytest.approx({"force_rate": 50.0, "moment_rate": 50.0 * LEVER})
    rate = np.diff(run.wrench[0], axis=0) / run.dt
    assert np.linalg.norm(rate[:, :2], axis=1).max() <= 50.0 * (1.0 + 1e-6)


@pytest.mark.parametrize("change", [{"mass": 1e10}, {"mass": 0.01}, {"gravity": 1.62}, {"gravity": 24.8}], ids=str)
@pytest.mark.parametrize("name", ["snap-2d", "mpc-2d"])
def test_mass_and_gravity_may_change(name: str, change: dict[str, float], shipped: Callable[[str], Run]) -> None:
    """What is asked of the contact scales with the weight; of another mass it is the same to rounding."""
    run, as_shipped = simulate(name, **change), shipped(name)
    assert run.verdict == "pass", [check for check in run.checks if not check.passed]
    if "mass" in change:
        assert np.abs(run.theta - as_shipped.theta).max() < 1e-6
        assert np.abs(run.wrench / change["mass"] - as_shipped.wrench).max() < 1e-3


def test_gravity_may_change_in_space() -> None:
    assert simulate("mpc-3d", gravity=1.62).verdict == "pass"


def test_shipped_values_are_what_they_were() -> None:
    """In N and s, to the last bit: a block of 1 kg in 10 m/s^2."""
    of = Load(10.0, LEVER, float(np.sqrt(LEVER / 10.0)))
    case = SCENARIOS["mpc-2d"].absolute(of)
    assert (case.force_max, case.seconds, case.plan_step) == (8.0, 1.0, 0.02)
    assert SCENARIOS["snap-2d"].absolute(of).f_min == 50.0
    assert SCENARIOS["mpc-3d"].absolute(of).force_max == 8.0


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("force_max", "0.8x", r"force_max = '0.8x': must be a number, or in weights of the object, such as 0.8w"),
        ("force_max", "w", "force_max = 'w': must be a number, or in weights"),
        ("force_max", "-1w", "force_max = '-1w': must be .*finite and > 0"),
        ("force_max", "0w", "force_max = '0w': must be .*finite and > 0"),
        ("moment_rate", "nanw", "moment_rate = 'nanw': must be .*finite and > 0"),
        ("f_min", "-1w", "f_min = '-1w': must be .*finite and >= 0"),
        ("f_min", "1T", "f_min = '1T': must be a number, or in weights"),
        ("seconds", "1w", "seconds = '1w': must be a number, or in natural times"),
        ("seconds", "infT", "seconds = 'infT': must be .*finite and > 0"),
        ("seconds", "1e9T", r"seconds = 1e9T, that is seconds = .*<= 3600 \[s\]"),
        ("mass", "1w", "mass = '1w': must be a number, or an interval LOW:HIGH$"),
    ],
)
def test_bad_text_is_named(key: str, value: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        simulate("pivot-2d", **{key: value})
    if key != "seconds":
        with pytest.raises(ValueError, match=f"^{key} = "):
            Scenario("mine", "", "pivot-2d", **{key: value})
