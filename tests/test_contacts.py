"""The contact Jacobian against the notes, MuJoCo's own and a symmetry."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pivoting.controller import Body, Contact, Law, Motion, WrenchController
from pivoting.models import load, scene_path


def jacobian(theta: float, point: tuple[float, float], tilt: float = 0.0) -> np.ndarray:
    base = (np.cos(0.5 * tilt), 0.0, -np.sin(0.5 * tilt), 0.0)
    controller = WrenchController(Body(1.0, 0.1), [Contact(point, 0.3)], Law.static(), (0.0, -10.0), base=base)
    return controller.problem(Motion(theta)).jacobian


def test_as_the_notes_print_it() -> None:
    """[R(theta); r^ R(theta)] with r^ = [-r_y, r_x]: erratum 3, the printed r^ has the other sign."""
    theta, (r_x, r_y) = np.deg2rad(30.0), (-0.5, -0.5)
    R = np.array([[np.cos(theta), np.sin(theta)], [-np.sin(theta), np.cos(theta)]])
    np.testing.assert_allclose(jacobian(theta, (r_x, r_y)), np.vstack([R, np.array([-r_y, r_x]) @ R]), atol=1e-15)


@pytest.mark.parametrize("theta", [0.1, 0.7, 1.4])
def test_against_mujocos_jacobian(theta: float) -> None:
    """Virtual work: a force at the corner does the work of its wrench about the CoM, in MuJoCo's own kinematics."""
    model = load(scene_path("balance-2d")).compile()
    data = mujoco.MjData(model)
    data.qpos[:] = [0.3, -0.2, theta]
    mujoco.mj_forward(model, data)
    R = data.xmat[1].reshape(3, 3)
    at_corner, at_com, turn = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3))
    mujoco.mj_jac(model, data, at_corner, None, data.xipos[1] + R @ [-0.5, 0.0, -0.5], 1)
    mujoco.mj_jac(model, data, at_com, turn, data.xipos[1], 1)
    force = np.array([1.3, 4.7])
    F_u, F_v, M = jacobian(theta, (-0.5, -0.5)) @ force
    by_wrench = at_com.T @ (R @ [F_u, 0.0, F_v]) + turn.T @ [0.0, -M, 0.0]
    np.testing.assert_allclose(by_wrench, at_corner.T @ [force[0], 0.0, force[1]], atol=1e-12)


@given(st.floats(0.05, 1.5), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(-1.0, 1.0))
def test_tilting_everything_changes_nothing_in_object_axes(theta: float, u: float, v: float, tilt: float) -> None:
    if np.hypot(u, v) < 1e-3:
        return
    np.testing.assert_allclose(jacobian(theta, (u, v), tilt), jacobian(theta, (u, v)), atol=1e-12)


def test_own_frame_of_a_contact() -> None:
    """A contact whose normal is the table's tangent: its f_n is the other one's f_t."""
    upright = WrenchController(
        Body(1.0, 0.1), [Contact((-0.5, -0.5), 0.3, frame=[[0.0, 1.0], [-1.0, 0.0]])], Law.static(), (0.0, -10.0)
    )
    np.testing.assert_allclose(
        upright.problem(Motion(0.4)).jacobian @ [0.0, 1.0], jacobian(0.4, (-0.5, -0.5)) @ [1.0, 0.0], atol=1e-15
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"point": (0.0, np.nan), "mu": 0.3}, "point = .*finite"),
        ({"point": (0.0, 1.0, 2.0, 3.0), "mu": 0.3}, "point = .*length 2"),
        ({"point": (0.0, 1.0), "mu": 0.0}, "mu = 0.0.*> 0"),
        ({"point": (0.0, 1.0), "mu": -0.3}, "mu = -0.3.*> 0"),
        ({"point": (0.0, 1.0), "mu": "wet"}, "mu = 'wet'.*number"),
        ({"point": (0.0, 1.0), "mu": 0.3, "f_min": -1.0}, "f_min = -1.0.*>= 0"),
        ({"point": (0.0, 1.0), "mu": 0.3, "frame": np.ones((2, 2))}, "frame = .*orthonormal"),
    ],
)
def test_bad_contacts_are_named(arguments: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Contact(**arguments)
