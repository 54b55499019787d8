"""References on SO(3): their rates are the derivatives of their orientations, by finite differences of rotations."""

import numpy as np
import pytest
from pivoting.controller.orientation_references import SampledRotation, Turn, Waypoints
from pivoting.controller.references import Constant, MinimumJerk, Reference, Sine
from scipy.spatial.transform import Rotation

TILTED = np.array([0.8, 0.2, -0.4, 0.4])
POINTS = np.array([[1.0, 0.0, 0.0, 0.0], TILTED, [0.5, 0.5, 0.5, 0.5], [-0.8, -0.2, 0.4, -0.4]])
ALL = {
    "constant": Turn(Constant(0.3), [0.0, 0.0, 2.0], TILTED),
    "arc": Turn(MinimumJerk((0.0, 1.4), 1.5, 0.2), [1.0, 1.0, 0.0], TILTED),
    "sine": Turn(Sine(0.1, 0.4, 1.3), [0.0, 1.0, 0.3]),
    "waypoints": Waypoints(POINTS, 0.6, 0.1),
    "samples": SampledRotation(Waypoints(POINTS, 0.6, 0.1)(np.linspace(0.0, 2.2, 45))[0], 0.05),
}


def rotations(quaternions: np.ndarray) -> Rotation:
    return Rotation.from_quat(np.roll(quaternions, -1, axis=-1))


@pytest.mark.parametrize("name", ALL)
def test_rates_and_accelerations_are_derivatives(name: str) -> None:
    reference = ALL[name]
    t, h = np.linspace(0.013, 2.1, 61), 1e-5
    orientation, rate, acceleration = (np.asarray(values) for values in reference(t))
    before, after = reference(t - h), reference(t + h)
    np.testing.assert_allclose(np.linalg.norm(orientation, axis=1), 1.0, atol=1e-12)
    step = (rotations(after[0]) * rotations(before[0]).inv()).as_rotvec()  # world axes
    np.testing.assert_allclose(rate, step / (2 * h), atol=2e-5)
    assert name == "constant" or np.abs(rate).max() > 0.5
    smooth = np.ones(len(t), bool) if name != "samples" else np.abs(t / 0.05 % 1.0 - 0.5) < 0.49
    change = (np.asarray(after[1]) - np.asarray(before[1])) / (2 * h)
    np.testing.assert_allclose(acceleration[smooth], change[smooth], atol=5e-3)


@pytest.mark.parametrize(
    ("name", "duration"),
    [("constant", np.inf), ("arc", 1.9), ("sine", np.inf), ("waypoints", 2.2), ("samples", 2.2)],
)
def test_every_reference_says_when_it_ends(name: str, duration: float) -> None:
    """A turn when its angle does; and one time gives one value of each."""
    reference: Reference = ALL[name]
    assert reference.duration == pytest.approx(duration)
    assert [np.shape(value) for value in reference(1)] == [(4,), (3,), (3,)]
    if np.isfinite(duration):
        last, after = reference(duration), reference(duration + 1.0)
        assert abs(np.dot(last[0], after[0])) == pytest.approx(1.0, abs=1e-12)
        assert not np.any(after[1:])


def test_a_turn_by_a_plain_function_goes_on_for_ever() -> None:
    turn = Turn(lambda times: (np.sin(times), np.cos(times), -np.sin(times)), [0.0, 1.0, 0.0])  # type: ignore[arg-type]
    assert turn.duration == np.inf
    assert np.shape(turn(0.5)[0]) == (4,)


def test_waypoints_are_met_at_rest_by_the_shorter_way() -> None:
    reference = Waypoints(POINTS, 0.6, 0.1)
    assert reference.duration == pytest.approx(2.2)
    for i, time in enumerate((0.05, 0.75, 1.45, 2.2)):
        orientation, rate, acceleration = reference(np.array([time]))
        assert abs(np.asarray(orientation)[0] @ POINTS[i]) == pytest.approx(1.0, abs=1e-12)
        assert not np.asarray(rate).any()
        assert not np.asarray(acceleration).any()
    assert np.abs(np.asarray(reference(np.linspace(0.0, 2.2, 400))[1])).max() * 0.6 / 1.875 < np.pi


def test_a_quarter_turn_about_a_contact_normal() -> None:
    turn = Turn(MinimumJerk((0.0, np.pi / 2), 2.0), [0.0, 0.0, 1.0], TILTED)
    end = rotations(np.asarray(turn(np.array([2.0]))[0]))
    expected = Rotation.from_euler("z", 90, degrees=True) * rotations(TILTED)
    assert (end * expected.inv()).magnitude()[0] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Turn(Constant(0.0), [0.0, 0.0, 0.0]), "axis = .*not zero"),
        (lambda: Turn(Constant(0.0), [0.0, 0.0]), r"axis = .*shape"),
        (lambda: Turn(Constant(0.0), [0.0, 0.0, 1.0], [1.0, 1.0, 0.0, 0.0]), "start = .*unit quaternion"),
        (lambda: Waypoints(POINTS[:1], 1.0), "orientations = .*at least two"),
        (lambda: Waypoints(POINTS, 0.0), "seconds = 0"),
        (lambda: SampledRotation(POINTS, -1.0), "dt = -1"),
        (lambda: SampledRotation([[np.nan] * 4] * 2, 1.0), "orientations = .*finite"),
    ],
)
def test_bad_input_is_named(make, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ValueError, match=message):
        make()
