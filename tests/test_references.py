"""References: their rates and accelerations are the derivatives of their angles, and they start and end at rest."""

import numpy as np
import pytest
from click.testing import CliRunner
from pivoting.controller.references import (
    REFERENCES,
    Constant,
    MinimumJerk,
    Reference,
    Sampled,
    Sine,
    reference,
)
from pivoting.sim import SCENARIOS, simulate
from pivoting.sim.console.command_line import cli
from pivoting.sim.scenarios.scenario_keys import KEYS

ALL = {
    "constant": Constant(0.4),
    "arc": MinimumJerk((0.2, 1.3, 0.4), 1.0, 0.3),
    "sine": Sine(0.7, 0.2, 1.5),
    "samples": Sampled(0.5 + 0.3 * np.sin(np.linspace(0.0, 4.0, 60)), 0.05),
}


@pytest.mark.parametrize("name", ALL)
def test_derivatives(name: str) -> None:
    reference: Reference = ALL[name]
    t, h = np.linspace(0.05, 2.85, 97), 1e-5
    _, rate, acceleration = reference(t)
    before, after = reference(t - h), reference(t + h)
    np.testing.assert_allclose(rate, (after[0] - before[0]) / (2 * h), atol=1e-6)
    np.testing.assert_allclose(acceleration, (after[1] - before[1]) / (2 * h), atol=2e-3)


@pytest.mark.parametrize(
    "reference",
    [Constant(1), MinimumJerk((0, 1), 2, 1), Sine(0, 1, 2), Sampled([0, 0, 0, 1, 2, 2, 2], 1)],
    ids=lambda reference: type(reference).__name__,
)
def test_whole_numbers_are_as_good_as_any(reference: Reference) -> None:
    """Of which a reference is made, or at which it is asked for; one time gives one value of each."""
    for time in (0, 1, 0.5):
        values = reference(time)
        assert [np.shape(value) for value in values] == [()] * 3
        assert [np.asarray(value).dtype for value in values] == [float] * 3
        many = reference([time, time])
        np.testing.assert_array_equal(many, np.stack([values] * 2, axis=1))


@pytest.mark.parametrize(
    ("name", "duration"), [("constant", np.inf), ("arc", 2.9), ("sine", np.inf), ("samples", 2.95)]
)
def test_every_reference_says_when_it_ends(name: str, duration: float) -> None:
    reference: Reference = ALL[name]
    assert reference.duration == pytest.approx(duration)
    if np.isfinite(duration):
        last, after = reference(duration), reference(duration + 1.0)
        assert float(after[0]) == pytest.approx(float(last[0]), abs=1e-12)
        assert float(after[1]) == float(after[2]) == 0.0


def test_minimum_jerk_rests_at_its_waypoints() -> None:
    arc = MinimumJerk((0.2, 1.3, 0.4), 1.0, 0.3)
    assert arc.duration == pytest.approx(2.9)
    for time, angle in ((0.0, 0.2), (0.3, 0.2), (1.3, 1.3), (1.6, 1.3), (2.6, 0.4), (9.0, 0.4)):
        assert [float(value) for value in arc(np.array(time))] == pytest.approx([angle, 0.0, 0.0], abs=1e-12)


def test_samples_are_met_and_held() -> None:
    samples = np.array([0.3, 0.35, 0.5, 0.8, 1.0, 1.1, 1.15])
    reference = Sampled(samples, 0.1)
    np.testing.assert_allclose(reference(0.1 * np.arange(7))[0], samples, atol=1e-12)
    assert [float(value) for value in reference(np.array(5.0))] == pytest.approx([1.15, 0.0, 0.0])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Constant(float("nan")), "theta = nan"),
        (lambda: MinimumJerk((0.1,), 1.0), "waypoints = "),
        (lambda: MinimumJerk((0.1, 0.2), 0.0), "seconds = 0"),
        (lambda: Sine(0.1, 0.1, 0.0), "period = 0"),
        (lambda: Sampled([0.1], 0.1), "samples = "),
        (lambda: Sampled([0.1, float("nan")], 0.1), "samples = .*finite"),
    ],
)
def test_bad_input_is_named(make, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ValueError, match=message):
        make()


def test_named_references_are_made_of_keys_in_radians() -> None:
    """As the formulas say, to the last bit; and of no value that is not a key of a scenario."""
    rad = np.deg2rad
    made = {
        "constant": Constant(rad(20.0)),
        "arc": MinimumJerk((rad(20.0), rad(50.0)), 0.7, 0.1),
        "return": MinimumJerk((rad(20.0), rad(50.0), rad(20.0)), 0.7, 0.1),
        "sine": Sine(rad(20.0), rad(3.0), 0.9),
    }
    assert set(made) == set(REFERENCES)
    values = {"theta": 20.0, "theta_end": 50.0, "seconds": 0.7, "hold": 0.1, "amplitude": 3.0, "period": 0.9}
    for name, expected in made.items():
        assert set(REFERENCES[name].keys) <= set(KEYS)
        own = {key: value for key, value in values.items() if key in REFERENCES[name].keys}
        case = SCENARIOS["balance-2d"].change(reference=name, **own)
        assert case.motion == expected
        assert case.duration == (expected.duration if np.isfinite(expected.duration) else case.seconds)


def test_a_reference_needs_nothing_but_its_name() -> None:
    """It is then taken by --set, listed in help and in errors, and refuses the keys that it is not made of."""

    def run(*settings: str):  # type: ignore[no-untyped-def]
        words = [word for setting in settings for word in ("--set", setting)]
        return CliRunner().invoke(cli, ["run", "balance-2d", *words, "--json"], standalone_mode=False)

    assert "must be one of constant, arc, return, sine" in str(run("reference=drift").exception)
    try:

        @reference("drift", "drift from theta by amplitude")
        def drift(theta: float, amplitude: float, seconds: float) -> MinimumJerk:
            return MinimumJerk((theta, theta + amplitude), seconds)

        assert "must be one of constant, arc, return, sine, drift" in str(run("reference=fly").exception)
        told = " ".join(CliRunner().invoke(cli, ["run", "--help"]).output.split())
        assert "drift (drift from theta by amplitude)" in told
        assert "only if reference is sine or drift" in told
        assert run("reference=drift", "amplitude=4", "seconds=0.6").exception is None
        turned = simulate("balance-2d", reference="drift", amplitude=4.0, seconds=0.6)
        assert np.rad2deg(turned.reference[0][[0, -1]]) == pytest.approx([30.0, 34.0])
        assert turned.scenario.changes == {"reference": "drift", "amplitude": 4.0, "seconds": 0.6}
        assert "period = 3.0: must be left out" in str(run("reference=drift", "period=3").exception)
        with pytest.raises(ValueError, match="name = 'drift': must be a name that no other reference has"):
            reference("drift", "another")
    finally:
        REFERENCES.pop("drift", None)
