"""Known damping and dry friction of a body's own joints: compensated, in runs and through attach."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from pivoting.controller import Motion, solve
from pivoting.controller.kernels.compiled_step import world_wrench
from pivoting.controller.orientation_references import Turn
from pivoting.models import ModelError
from pivoting.sim import attach, simulate
from pivoting.sim.joint_drag import drag_wrench

from tests.own_files import BOX, mjcf, own, pivoted

OFF = '<geom name="g" type="box" size=".05 .04 .06" pos=".03 .02 .06"/>'  # the body's origin is not its centre
PILL = '<geom name="g" type="capsule" size=".03 .07" mass=".4"/>'
DRAG = 'damping="{}" frictionloss="{}"'
FREE = '<joint name="j" type="free" {}/>'
PLANAR = (
    '<joint name="x" type="slide" axis="1 0 0" {0}/><joint type="slide" axis="0 0 1" {0}/>'
    '<joint type="hinge" axis="0 1 0" pos=".01 0 .02" {0}/>'
)
BOTH = '<option><flag {}="disable"/></option>'


@pytest.mark.parametrize("share", [(1.0, 0.0), (0.0, 1.0), (1.0, 1.0)], ids=["damped", "dry", "both"])
@pytest.mark.parametrize(
    ("geoms", "joint", "contact", "friction"),
    [
        (BOX, FREE, "edge", 0.05),
        (OFF, FREE, "vertex", 0.05),
        (PILL, FREE, "vertex", 0.01),
        (OFF, PLANAR, "corner", 0.05),
        (BOX, PLANAR, "corner", 0.05),
    ],
    ids=["box", "off its origin", "rolling", "planar, off", "planar"],
)
def test_drag_is_compensated(
    geoms: str, joint: str, contact: str, friction: float, share: tuple[float, float], tmp_path: Path
) -> None:
    """0.5 N s/m and N m s/rad, 0.05 N and N m: slip and angle stay nearly what they are without any drag.

    What is left of the slip is MuJoCo's own, which counts implicit damping after it has solved for the contact.
    """
    damping, friction = 0.5 * share[0], friction * share[1]
    pose = 'pos="0 0 0"' if geoms is OFF else 'pos="0 0 .1"'
    runs = [
        pivoted(tmp_path, mjcf(geoms, joint=joint.format(drag), pose=pose), contact)
        for drag in ("", DRAG.format(damping, friction))
    ]
    plain, run = runs
    assert plain.verdict == run.verdict == "pass", [check for check in run.checks if not check.passed]
    assert run.measures.angle_error_rms_deg[0] < plain.measures.angle_error_rms_deg[0] + 0.02
    assert run.measures.slip_max_m[0] < plain.measures.slip_max_m[0] + 3e-5
    assert (run.object["damping"], run.object["frictionloss"]) == (damping, friction)


@pytest.mark.parametrize("friction", [0.02, 0.1, 0.5, 3.0])
def test_dry_friction_of_any_size_is_compensated(friction: float, tmp_path: Path) -> None:
    """MuJoCo's is soft, and at these speeds partly below its limit: the full limit would push the object ahead."""
    run = pivoted(tmp_path, mjcf(joint=f'<joint type="free" frictionloss="{friction}"/>'))
    plain = pivoted(tmp_path, mjcf())
    assert run.verdict == "pass"
    assert run.measures.angle_error_rms_deg[0] < plain.measures.angle_error_rms_deg[0] + 0.02


def test_its_wrench_is_mujocos_own() -> None:
    """qfrc_damper at random poses and rates of turn, about a point that stays put, against the wrench at the CoM."""
    rng = np.random.default_rng(0)
    model = mujoco.MjModel.from_xml_string(
        mjcf(OFF, joint=FREE.format('damping=".7"'), pose='pos="0 0 0"', option='integrator="RK4"')
    )
    data = mujoco.MjData(model)
    corner = np.array([-0.02, -0.02, 0.0])
    held = attach(model, body="box", contacts=[corner])
    for _ in range(20):
        q, omega = rng.normal(size=4), rng.normal(size=3)
        data.qpos[3:7] = q / np.linalg.norm(q)
        mujoco.mj_kinematics(model, data)
        R = data.xmat[1].reshape(3, 3)
        data.qvel[:3], data.qvel[3:] = np.cross(omega, -R @ corner), R.T @ omega
        mujoco.mj_forward(model, data)
        force, moment = data.qfrc_passive[:3], R @ data.qfrc_passive[3:]  # at the body's origin
        moment = moment + np.cross(data.xpos[1] - data.xipos[1], force)
        mine = drag_wrench(held.body, held.controller, data.qpos[3:7], omega, np.zeros(3))[0].reshape(2, 3) @ R.T
        np.testing.assert_allclose(mine, [force, moment], atol=1e-12)


def tilted_by_hand(damping: float, known: bool) -> float:
    """[deg] greatest error of a tilt of 20 deg in 0.3 s about an edge, in a loop of one's own."""
    joint = FREE.format(DRAG.format(damping, 0.05))
    cone = 'cone="elliptic" impratio="1000" gravity="0 0 -9.81"'
    soft = '<default><geom solref=".0021 1" solimp=".5 .5 .001"/></default>'
    model = mujoco.MjModel.from_xml_string(mjcf(joint=joint, option=cone, extra=soft))
    data = mujoco.MjData(model)
    edge = np.array([[-0.05, -0.04, -0.06], [-0.05, 0.04, -0.06]])
    held = attach(model, body="box", contacts=list(edge))
    time = model.opt.timestep * np.arange(300)
    s = time / time[-1]
    angles = (0.1 + 0.35 * s**3 * (10 - 15 * s + 6 * s * s), 0.35 * 30 * s**2 * (1 - s) ** 2 / time[-1])
    bend = 0.35 * 60 * s * (1 - s) * (1 - 2 * s) / time[-1] ** 2
    desired = Turn(lambda times: Motion(*angles, bend), [0.0, -1.0, 0.0], [1.0, 0.0, 0.0, 0.0])(time)  # type: ignore[arg-type]
    data.qpos[3:7] = np.asarray(desired.orientation)[0]
    mujoco.mj_kinematics(model, data)
    data.qpos[:3] = -data.xmat[1].reshape(3, 3) @ edge.mean(axis=0) - [0.0, 0.0, 1e-6]
    off, out = 0.0, np.empty((1, 6))
    for k in range(time.size):
        target = Motion(*(np.asarray(values)[k] for values in desired))
        state = held.state(data)
        if known:
            out[0] = held.wrench(data, target)
        else:
            answer = solve(held.controller.problem(state, target))
            q = np.asarray(state.orientation)
            world_wrench(held.controller.belief.source.map, q, answer.wrench, out[0])
        dot = abs(float(np.asarray(state.orientation) @ np.asarray(target.orientation)))
        off = max(off, float(np.rad2deg(2.0 * np.arccos(min(dot, 1.0)))))
        data.xfrc_applied[1] = out[0]
        mujoco.mj_step(model, data)
    return off


def test_attached_it_is_compensated_too() -> None:
    known, unknown = tilted_by_hand(0.5, True), tilted_by_hand(0.5, False)
    assert known < 0.1
    assert unknown > 5.0 * known


@pytest.mark.parametrize(("flag", "drag"), [("damper", 'damping="5"'), ("frictionloss", 'frictionloss=".5"')])
def test_what_is_switched_off_does_not_drag(flag: str, drag: str, tmp_path: Path) -> None:
    plain = pivoted(tmp_path, mjcf())
    run = pivoted(tmp_path, mjcf(joint=FREE.format(drag), extra=BOTH.format(flag)))
    assert run.truth.drag is None
    assert run.measures.slip_max_m[0] == pytest.approx(plain.measures.slip_max_m[0], rel=1e-9)


def test_a_plan_does_not_know_of_it(tmp_path: Path) -> None:
    case = own(tmp_path, mjcf(joint=FREE.format('damping=".5"')))
    for options in ({"open_loop": True}, {"plan_hz": 100.0}):
        with pytest.raises(ModelError, match="a plan knows no joint damping or friction"):
            simulate(case, **options)  # type: ignore[arg-type]
