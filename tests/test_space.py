"""The plane inside space: angles, rotations and errors against MuJoCo's own quaternion functions."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pivoting.controller.motion import Motion
from pivoting.controller.plane_and_space import space, tilt
from pivoting.controller.rotations import quaternion_product, rotation_error, rotation_matrix

unit = st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 0.1)


@settings(deadline=None)  # the first call compiles
@given(unit, unit)
def test_quaternions_against_mujoco(p: list, q: list) -> None:
    a, b = np.array(p) / np.linalg.norm(p), np.array(q) / np.linalg.norm(q)
    product, matrix = np.empty(4), np.empty(9)
    mujoco.mju_mulQuat(product, a, b)
    mujoco.mju_quat2Mat(matrix, a)
    np.testing.assert_allclose(quaternion_product(a, b), product, atol=1e-12)
    np.testing.assert_allclose(rotation_matrix(a), matrix.reshape(3, 3), atol=1e-12)


@settings(deadline=None)  # the first call compiles
@given(unit, unit)
def test_rotation_error_against_mujoco(p: list, q: list) -> None:
    """mju_subQuat(b, a) is the rotation, in a's axes, that turns a into b; its length is at most pi."""
    a, b = np.array(p) / np.linalg.norm(p), np.array(q) / np.linalg.norm(q)
    theirs = np.empty(3)
    mujoco.mju_subQuat(theirs, b, a)
    ours = np.array(rotation_error(a, b))
    assert np.linalg.norm(ours) <= np.pi + 1e-12
    if np.linalg.norm(ours) < np.pi - 1e-3:
        np.testing.assert_allclose(ours, theirs, atol=1e-9)


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5))
def test_angles_on_any_table(theta: float, incline: float) -> None:
    plane = space(2, tilt(incline))
    assert float(plane.angle(plane.orientation(theta))) == pytest.approx(theta, abs=1e-12)
    x_axis = rotation_matrix(plane.orientation(theta))[:, 0]
    np.testing.assert_allclose(x_axis, [np.cos(theta + incline), 0.0, np.sin(theta + incline)], atol=1e-12)


def test_positive_theta_lifts_the_right_side() -> None:
    plane = space(2)
    right = rotation_matrix(plane.orientation(0.1)) @ [1.0, 0.0, 0.0]
    assert right[2] > 0.0
    np.testing.assert_array_equal(plane.axial(1.0), [0.0, -1.0, 0.0])


def test_motion_of_space_is_checked() -> None:
    with pytest.raises(ValueError, match=r"orientation = .*unit quaternion"):
        space(3).lift_motion(Motion([1.0, 1.0, 0.0, 0.0]))
    with pytest.raises(ValueError, match=r"orientation = .*plane"):
        space(2).lift_motion(Motion([1.0, 0.0, 0.0, 0.0]))
