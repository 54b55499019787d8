"""The law against MuJoCo's forward dynamics and the statics that it must reduce to."""

import mujoco
import numpy as np
import pytest
from pivoting.controller import Body, Contact, Law, Motion, WrenchController
from pivoting.controller.kernels.compiled_step import world_wrench
from pivoting.models import load, scene_path

CORNER = Contact((-0.5, -0.5), 0.3)
BLOCK = Body(1.0, 1.0 / 6.0)


def required(law: Law, state: Motion, desired: Motion | None = None, gravity: tuple = (0.0, -10.0)) -> np.ndarray:
    return WrenchController(BLOCK, [CORNER], law, gravity).problem(state, desired).required


def test_static_is_the_weight_in_object_axes() -> None:
    """Erratum 2: R(theta)(0, -g) = -g (sin, cos); printed is -g (cos, sin), a table inclined by 90 - 2 theta."""
    theta = np.deg2rad(30.0)
    np.testing.assert_allclose(required(Law.static(), Motion(theta)), [10.0 * np.sin(theta), 10.0 * np.cos(theta), 0.0])
    incline = np.deg2rad(90.0) - 2.0 * theta
    printed = required(Law.static(), Motion(theta), gravity=(-10.0 * np.sin(incline), -10.0 * np.cos(incline)))
    np.testing.assert_allclose(printed, [10.0 * np.cos(theta), 10.0 * np.sin(theta), 0.0], atol=1e-14)


def test_static_ignores_motion() -> None:
    still = required(Law.static(), Motion(0.5))
    np.testing.assert_array_equal(required(Law.static(), Motion(0.5, 3.0), Motion(0.9, 2.0, 5.0)), still)


def test_quasi_dynamic_is_the_notes_equation() -> None:
    """M (q_d - q) / h^2 - m g with q = (CoM, theta), on the arc, to first order in the angle error."""
    h, error, theta = 0.02, 1e-6, 0.6
    got = required(Law.quasi_dynamic(h), Motion(theta, 4.0), Motion(theta + error, 4.0, 9.0))
    R = np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])
    moved = np.array([[0.0, -error], [error, 0.0]]) @ R @ [0.5, 0.5]
    expected = np.append(R.T @ (moved / h**2 + [0.0, 10.0]), error / h**2 / 6.0)
    np.testing.assert_allclose(got, expected, rtol=1e-9)


@pytest.mark.parametrize("theta", [0.2, 0.8, 1.3])
@pytest.mark.parametrize("omega", [-2.0, 0.0, 5.0])
def test_dynamic_gives_the_acceleration_it_asks_for(theta: float, omega: float) -> None:
    """The whole required wrench, applied in MuJoCo without contact: alpha as commanded, and the corner does not move.

    The corner's acceleration is a finite difference of MuJoCo's own positions, no formula of ours.
    """
    law = Law.dynamic(30.0, 0.7)
    desired = Motion(theta + 0.05, omega + 0.3, 4.0)
    controller = WrenchController(BLOCK, [CORNER], law, (0.0, -10.0))
    state = Motion(theta, omega)
    wrench = controller.problem(state, desired).required
    scene = load(scene_path("balance-2d"), {"dt": 1e-5})
    scene.spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    model = scene.compile()
    data = mujoco.MjData(model)
    data.qpos[2] = theta
    R = np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])
    data.qvel[:2] = omega * (np.array([[0.0, -1.0], [1.0, 0.0]]) @ R @ [0.5, 0.5])  # turning about the corner
    data.qvel[2] = omega
    q = controller.space.orientation(theta)
    out = np.empty((1, 6))
    world_wrench(controller.belief.source.map, q, wrench, out[0])
    data.xfrc_applied[1] = out[0]
    mujoco.mj_forward(model, data)
    alpha = 4.0 + 30.0**2 * 0.05 + 2.0 * 0.7 * 30.0 * 0.3
    assert data.qacc[2] == pytest.approx(alpha, rel=1e-9)
    corners = [corner(data)]
    for _ in range(200):
        data.xfrc_applied[1] = out[0]
        mujoco.mj_step(model, data)
        corners.append(corner(data))
    acceleration = 2.0 * (corners[-1] - corners[0]) / (200 * 1e-5) ** 2
    assert np.linalg.norm(acceleration) < 0.02 * max(1.0, abs(alpha) * 0.7, omega**2 * 0.7)


def test_dynamic_law_in_space_with_its_gyroscopic_terms() -> None:
    """As in the plane: the required wrench, applied to a free body in MuJoCo, gives alpha and leaves the vertex alone.

    A block of three different sides that spins about no axis of its own, so that omega x I omega counts.
    """
    spec = mujoco.MjSpec.from_string(
        '<mujoco><option timestep="1e-5" gravity="1 -2 -9"/><worldbody><body name="b"><freejoint/>'
        '<geom type="box" size=".5 .35 .7" mass="2"/></body></worldbody></mujoco>'
    )
    model = spec.compile()
    data = mujoco.MjData(model)
    inertia = 2.0 / 3.0 * np.diag([0.35**2 + 0.7**2, 0.5**2 + 0.7**2, 0.5**2 + 0.35**2])
    vertex = np.array([-0.5, -0.35, -0.7])
    controller = WrenchController(Body(2.0, inertia), [Contact(vertex, 0.4)], Law.dynamic(20.0), (1.0, -2.0, -9.0))
    q = np.array([0.8, 0.2, -0.4, 0.4])
    omega, omega_d, alpha_d = np.array([1.5, -2.0, 3.0]), np.array([1.6, -2.1, 2.8]), np.array([5.0, 1.0, -3.0])
    tip = np.array([0.02, -0.03, 0.01])  # the reference is turned by this rotation vector, object axes
    q_d = np.empty(4)
    mujoco.mju_copy(q_d, q)
    mujoco.mju_quatIntegrate(q_d, tip, 1.0)
    wrench = controller.problem(Motion(q, omega), Motion(q_d, omega_d, alpha_d)).required
    out = np.empty((1, 6))
    world_wrench(controller.belief.source.map, q, wrench, out[0])
    R = np.empty(9)
    mujoco.mju_quat2Mat(R, q)
    R = R.reshape(3, 3)
    data.qpos[3:] = q
    data.qvel[:3] = -np.cross(omega, R @ vertex)  # the vertex is at rest
    data.qvel[3:] = R.T @ omega  # a free joint's rates are in object axes
    data.xfrc_applied[1] = out[0]
    mujoco.mj_forward(model, data)
    alpha = alpha_d + 400.0 * (R @ tip) + 40.0 * (omega_d - omega)
    np.testing.assert_allclose(R @ data.qacc[3:], alpha, rtol=1e-9)
    moved = data.qacc[:3] + np.cross(alpha, R @ vertex) + np.cross(omega, np.cross(omega, R @ vertex))
    np.testing.assert_allclose(moved, 0.0, atol=1e-9)


def corner(data: mujoco.MjData) -> np.ndarray:
    return data.qpos[:2] + np.array(
        [[np.cos(data.qpos[2]), -np.sin(data.qpos[2])], [np.sin(data.qpos[2]), np.cos(data.qpos[2])]]
    ) @ [-0.5, -0.5]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Law("elastic", 0.0, 0.0, 0.0, 0.0), "formulation = 'elastic'.*static"),
        (lambda: Law.quasi_dynamic(0.0), "h = 0.*> 0"),
        (lambda: Law.dynamic(bandwidth=-1.0), "bandwidth = -1.*> 0"),
        (lambda: Body(0.0, 1.0), "mass = 0.*> 0"),
        (lambda: Body(1.0, float("nan")), "inertia = nan"),
        (lambda: required(Law.static(), Motion(float("nan"))), "orientation = nan"),
        (lambda: required(Law.static(), Motion(0.1), Motion(0.1, float("inf"))), "velocity = inf"),
    ],
)
def test_bad_input_is_named(make, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ValueError, match=message):
        make()
