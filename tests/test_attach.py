"""`attach`: other people's planar models in their own loops, and clear refusals."""

import mujoco
import numpy as np
import pytest
from pivoting.controller import Law, Motion
from pivoting.models import ModelError, load, scene_path
from pivoting.sim import ControlError, attach

# A model of someone else: x-y plane, gravity along -y, two geoms, a CoM off the body's origin, a stray body beside it.
STRANGER = """
<mujoco>
  <option timestep="0.0005" gravity="0 -9.81 0" cone="elliptic" impratio="1000" jacobian="dense"/>
  <default><geom friction="0.6 0 0" solref="0.001 1" solimp="0.5 0.5 0.001"/></default>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 .1" zaxis="0 1 0" pos="0.2 0.1 0"/>
    <body name="elsewhere" pos="2 2 0"><joint type="hinge" axis="0 0 1"/><geom size="0.01"/></body>
    <body name="bracket" pos="0.2 0.4 0">
      <joint name="bx" type="slide" axis="1 0 0"/>
      <joint name="by" type="slide" axis="0 1 0"/>
      <joint name="turn" type="hinge" axis="0 0 1"/>
      <geom type="box" size="0.1 0.02 0.05" mass="0.4"/>
      <geom type="box" size="0.02 0.1 0.05" pos="0.08 0.12 0" mass="0.3"/>
    </body>
  </worldbody>
</mujoco>
"""


def test_a_strangers_model_is_pivoted_in_their_own_loop() -> None:
    model = mujoco.MjModel.from_xml_string(STRANGER)
    data = mujoco.MjData(model)
    corner = np.array([-0.1, -0.02, 0.0])
    controller = attach(model, body="bracket", contacts=[corner])
    assert controller.controller.body.mass == pytest.approx(0.7)
    start, end, T = np.deg2rad(20.0), np.deg2rad(50.0), 1.0
    turn = np.array([[np.cos(start), -np.sin(start)], [np.sin(start), np.cos(start)]])
    data.joint("turn").qpos[0] = start
    at = np.array([0.2, 0.1 - 1e-6]) - turn @ corner[:2]
    data.joint("bx").qpos[0], data.joint("by").qpos[0] = at - [0.2, 0.4]
    body = model.body("bracket").id
    errors, slips, first = [], [], None
    for k in range(int(1.4 / model.opt.timestep)):
        s = np.clip((k * model.opt.timestep - 0.2) / T, 0.0, 1.0)
        theta = start + (end - start) * s**3 * (10 - 15 * s + 6 * s * s)
        rate = (end - start) / T * 30 * s**2 * (1 - s) ** 2
        bend = (end - start) / T**2 * 60 * s * (1 - s) * (1 - 2 * s)
        data.xfrc_applied[body] = controller.wrench(data, Motion(theta, rate, bend))
        errors.append(controller.state(data).orientation - theta)
        where = (data.xpos[body] + data.xmat[body].reshape(3, 3) @ corner)[0]
        first = where if first is None else first
        slips.append(where - first)
        mujoco.mj_step(model, data)
    assert np.rad2deg(np.sqrt(np.mean(np.square(errors[400:])))) < 0.05
    assert np.abs(slips).max() < 1e-4
    assert data.joint("turn").qpos[0] == pytest.approx(end, abs=1e-3)


def test_the_angle_is_the_one_of_now_not_of_one_step_back() -> None:
    model = load(scene_path("balance-2d")).compile()
    data = mujoco.MjData(model)
    controller = attach(model, body="block", contacts=[(-0.5, -0.5)])
    data.qpos[2], data.qvel[2] = 0.3, 0.7  # no mj_forward
    state = controller.state(data)
    assert state.orientation == pytest.approx(0.3)
    assert state.velocity == pytest.approx(0.7)


def test_solution_shows_its_certificate_and_its_force() -> None:
    model = load(scene_path("incline-2d")).compile()
    data = mujoco.MjData(model)
    data.qpos[:] = model.keyframe("start").qpos
    plain = attach(model, body="block", contacts=[(-0.5, -0.5)], law=Law.static(), mu=0.3, margin=0.0, Q_w=np.eye(3))
    solution = plain.solution(data, np.deg2rad(30.0))
    assert solution.residual < 1e-12
    np.testing.assert_allclose(solution.force[0], [1.39789, 4.65964], atol=1e-4)


def test_friction_is_read_as_mujoco_combines_it() -> None:
    model = load(scene_path("balance-2d")).compile()
    model.geom_friction[0, 0] = 0.7
    assert attach(model, body="block", contacts=[(-0.5, -0.5)]).controller.contacts[0].mu == 0.7
    model.geom_priority[1] = 1
    assert attach(model, body="block", contacts=[(-0.5, -0.5)]).controller.contacts[0].mu == 0.3


def model_with(joints: str, extra: str = "", child: str = "") -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><geom type="plane" size="1 1 1"/>{extra}'
        f'<body name="b" pos="0 0 1">{joints}<geom name="g" type="box" size=".1 .1 .1"/>{child}</body>'
        "</worldbody></mujoco>"
    )


def scene(geom: str = "", joint: str = "", body: str = "", extra: str = "") -> mujoco.MjModel:
    """The 1 m block on a plane, with something added to its geom, its first joint, its body or the model."""
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/><body name="b" pos="0 0 1" {body}>'
        f'<joint type="slide" axis="1 0 0" {joint}/><joint type="slide" axis="0 0 1"/>'
        '<joint type="hinge" axis="0 1 0"/>'
        f'<geom name="g" type="box" size=".5 .2 .5" {geom}/></body></worldbody>{extra}</mujoco>'
    )


PAIR = '<contact><pair geom1="floor" geom2="g" friction="0.05 0.05 0.005 0.0001 0.0001"/></contact>'


def test_friction_of_an_explicit_pair() -> None:
    assert attach(scene(extra=PAIR), body="b", contacts=[(-0.5, -0.5)]).controller.contacts[0].mu == 0.05


@pytest.mark.parametrize(
    ("model", "message"),
    [
        (scene(geom='condim="1"', extra="<default/>"), None),
        (scene(geom='contype="0" conaffinity="0"'), "no colliding geom"),
        (scene(extra='<contact><exclude body1="world" body2="b"/></contact>'), "nothing that body 'b' can collide"),
        (scene(body='gravcomp="1"'), "gravcomp = 1"),
        (scene(joint='stiffness="30"'), "stiffness = 30"),
        (scene(joint='range="-1 1" limited="true"'), "limited = 1"),
        (scene(joint='armature="0.1"'), "armature = 0.1"),
    ],
)
def test_a_model_with_other_forces_or_no_contact_is_refused(model: mujoco.MjModel, message: str | None) -> None:
    if message is None:  # MuJoCo takes the larger condim, the plane's 3: there is friction
        assert attach(model, body="b", contacts=[(-0.5, -0.5)]).controller.contacts[0].mu == 1.0
        return
    with pytest.raises(ModelError, match=message):
        attach(model, body="b", contacts=[(-0.5, -0.5)])


def test_frictionless_contact_is_refused() -> None:
    model = scene()
    model.geom_condim[:] = 1
    with pytest.raises(ModelError, match="without friction"):
        attach(model, body="b", contacts=[(-0.5, -0.5)])


def test_a_support_that_moves_is_refused() -> None:
    with pytest.raises(ModelError, match="support = 'g': it can move"):
        attach(scene(), body="b", contacts=[(-0.5, -0.5)], support="g")


def test_inertia_given_about_turned_axes() -> None:
    """ipos and iquat of a body: the inertia about the plane's normal, against MuJoCo's own mass matrix."""
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom type="plane" size="1 1 1"/><body name="b" pos="0 0 1">'
        '<inertial pos="0.1 0.02 -0.2" euler="20 50 -30" mass="1.5" diaginertia="0.3 0.2 0.15"/>'
        '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/><joint type="hinge" axis="0 -1 0"/>'
        '<geom type="box" size=".5 .2 .5"/></body></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    M = np.zeros((3, 3))
    mujoco.mj_fullM(model, data, M)
    body = attach(model, body="b", contacts=[(-0.5, 0.0, -0.5)]).body
    assert body.inertia == pytest.approx(M[2, 2] - 1.5 * (0.1**2 + 0.2**2), rel=1e-9)
    np.testing.assert_allclose(body.point([-0.5, 0.0, -0.5]), [-0.6, -0.3])


SLIDES = '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>'
HINGE = '<joint type="hinge" axis="0 1 0"/>'


@pytest.mark.parametrize(
    ("model", "arguments", "message"),
    [
        (model_with(SLIDES + HINGE), {"body": "nope"}, "body = 'nope': must be one of 'b'"),
        (model_with(""), {}, "body = 'b': it has no joint, so no free motion"),
        (model_with("<freejoint/>"), {}, "contact = .*3 body-frame coordinates"),
        (model_with('<joint type="ball"/>'), {}, "body = 'b': its joints are ball; needs a free joint, or"),
        (model_with(HINGE), {}, "body = 'b': its joints are hinge"),
        (model_with(SLIDES + '<joint type="hinge" axis="1 0 0"/>'), {}, "joint axes are not perpendicular"),
        (model_with(SLIDES + HINGE, child='<body><geom size=".01"/></body>'), {}, "other bodies hang on it"),
        (model_with(SLIDES + HINGE), {"support": "moon"}, "support = 'moon'"),
        (model_with(SLIDES + HINGE), {"contacts": [(-0.1, -0.1), (0.1, -0.1)]}, "contacts = .*one point"),
        (model_with(SLIDES + HINGE), {"contacts": [(float("nan"), -0.1)]}, "contact = .*finite"),
        (model_with(SLIDES + HINGE), {"mu": -1.0}, "mu = -1.0.*> 0"),
        (model_with(SLIDES + HINGE), {"margin": 1.5}, "margin = 1.5.*< 1"),
    ],
)
def test_what_cannot_be_served_is_refused_with_a_reason(model: mujoco.MjModel, arguments: dict, message: str) -> None:
    with pytest.raises((ModelError, ValueError), match=message):
        attach(model, **{"body": "b", "contacts": [(-0.1, -0.1)], **arguments})


def test_a_state_that_is_not_a_number_is_an_error_with_its_evidence() -> None:
    model = load(scene_path("balance-2d")).compile()
    data = mujoco.MjData(model)
    controller = attach(model, body="block", contacts=[(-0.5, -0.5)])
    data.qpos[0] = np.nan
    with pytest.raises(ControlError, match="not finite at time 0 s") as caught:
        controller.wrench(data, 0.5)
    assert np.isnan(caught.value.qpos[0])
    data.qpos[0] = 0.0
    with pytest.raises(ValueError, match="orientation = nan"):
        controller.wrench(data, float("nan"))


def test_data_of_another_model_is_refused() -> None:
    controller = attach(load(scene_path("balance-2d")).compile(), body="block", contacts=[(-0.5, -0.5)])
    other = model_with("<freejoint/>")
    with pytest.raises(ValueError, match=r"data = .*7 positions"):
        controller.wrench(mujoco.MjData(other), 0.5)


def test_not_a_model() -> None:
    with pytest.raises(ValueError, match=r"model = 'file.xml'"):
        attach("file.xml", body="b", contacts=[(0.0, 0.0)])  # type: ignore[arg-type]


def test_the_wrench_acts_where_the_attached_model_has_its_centre_of_mass() -> None:
    """In a model that is simulated in its place, whose own is elsewhere, its moment counts about that."""
    believed, true = (mujoco.MjModel.from_xml_string(STRANGER) for _ in range(2))
    body = believed.body("bracket").id
    true.body_ipos[body] += [0.03, -0.02, 0.01]
    data = mujoco.MjData(true)
    data.qpos[-1] = 0.4
    controller = attach(believed, body="bracket", contacts=[(-0.1, -0.02, 0.0)])
    plain, moved = controller.wrench(data, 0.4), controller.wrench(data, 0.4, simulated=true)
    np.testing.assert_array_equal(controller.wrench(data, 0.4, simulated=believed), plain)
    points = [data.xpos[body] + data.xmat[body].reshape(3, 3) @ each.body_ipos[body] for each in (believed, true)]
    generalised = []
    for wrench, point in zip((plain, moved), points, strict=True):
        acts = np.zeros(true.nv)
        mujoco.mj_kinematics(true, data)
        mujoco.mj_comPos(true, data)
        mujoco.mj_applyFT(true, data, wrench[:3], wrench[3:], point, body, acts)
        generalised.append(acts)
    np.testing.assert_allclose(*generalised, atol=1e-14)
    assert np.abs(plain - moved).max() > 1e-3
