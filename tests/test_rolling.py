"""Contacts that roll: the end of a capsule does not slide on the table, and no material point of it stays put.

Formulas against MuJoCo's own kinematics and dynamics, then the closed loop: free, mixed, planar, tilted, spun.
"""

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.typing import ArrayLike
from pivoting.controller import Body, Contact, Law, Motion, WrenchController
from pivoting.controller.kernels.compiled_step import world_wrench
from pivoting.controller.orientation_references import Turn
from pivoting.models import ModelError, load, read_body
from pivoting.models.placement.convex_hull import read_hull
from pivoting.models.placement.resting_faces import faces
from pivoting.sim import Run, assert_sticking, assert_tracking, attach, own_object, simulate
from pivoting.sim.drawing.rerun_recording import record
from pivoting.sim.drawing.shapes import body_solids
from pivoting.sim.judging.measures import predicted_slip
from pivoting.sim.scenarios.scenario import Scenario
from scipy.spatial.transform import Rotation

FREE = "<freejoint/>"
PLANAR = "".join(
    f'<joint type="{kind}"/>' for kind in ('slide" axis="1 0 0', 'slide" axis="0 0 1', 'hinge" axis="0 1 0')
)
PILL = '<geom type="capsule" size=".03 .07" mass=".4"/>'
HAMMER = (
    '<geom type="capsule" fromto="0 0 -.15 0 0 0" size=".012" mass=".1"/>'
    '<geom type="box" size=".05 .02 .02" pos="0 0 .02" mass=".5"/>'
)


def mjcf(geoms: str, joints: str = FREE, pose: str = "", table: str = "") -> str:
    return (
        f'<mujoco><default><geom friction="0.6 0 0"/></default><worldbody><geom type="plane" size="1 1 1" {table}/>'
        f'<body name="b" pos="0 0 .3" {pose}>{joints}{geoms}</body></worldbody></mujoco>'
    )


def own(folder: Path, text: str, contact: object = "vertex", **keys: object) -> Scenario:
    path = folder / "own.xml"
    path.write_text(text)
    return replace(own_object(path, "b", contact), **keys)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def pill(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A free capsule tilted from 5 to 25 deg about its cap, in two worlds."""
    return simulate(own(tmp_path_factory.mktemp("pill"), mjcf(PILL)), worlds=2, seed=1)


def rolls(run: Run) -> None:
    """It does, as exactly as a corner sticks: within limits, and the slip is what MuJoCo's contact itself makes."""
    assert run.verdict == "pass"
    assert_sticking(run, slip_m=1e-4)
    assert_tracking(run, rms_deg=0.05)
    assert run.measures.force_mismatch_rel.max() <= 0.03
    assert np.linalg.norm(run.slip - predicted_slip(run), axis=-1).max() < 0.1 * max(
        run.measures.slip_max_m.max(), 1e-9
    )


@pytest.mark.parametrize("seed", range(5))
def test_a_force_where_the_ball_touches_does_the_work_of_its_wrench(seed: int) -> None:
    """Virtual work, in any pose and on any table, against MuJoCo's Jacobian of that point."""
    rng = np.random.default_rng(seed)
    turned, table = Rotation.random(random_state=rng), Rotation.random(random_state=rng).as_matrix()
    point, radius, force = rng.normal(size=3), rng.uniform(0.1, 2.0), rng.normal(size=3)
    contact = Contact(point, 0.3, frame=table, radius=radius)
    controller = WrenchController(Body(1.0, np.eye(3)), [contact], Law.static(), (0.0, 0.0, -9.81))
    q = np.roll(turned.as_quat(), 1)
    wrench = controller.problem(Motion(q)).jacobian @ force
    model = mujoco.MjModel.from_xml_string(mjcf(PILL))
    data = mujoco.MjData(model)
    data.qpos[3:] = q
    mujoco.mj_forward(model, data)
    at_contact, at_com, turn = np.zeros((3, 3, model.nv))
    touching = data.xipos[1] + turned.apply(point) - radius * table[:, 2]
    mujoco.mj_jac(model, data, at_contact, None, touching, 1)
    mujoco.mj_jac(model, data, at_com, turn, data.xipos[1], 1)
    by_wrench = at_com.T @ turned.apply(wrench[:3]) + turn.T @ turned.apply(wrench[3:])
    np.testing.assert_allclose(by_wrench, at_contact.T @ table @ force, atol=1e-12)


def test_the_plane_is_a_slice_of_space() -> None:
    """Jacobian and required wrench of a rolling contact in the plane are rows of those in space."""
    theta, rate, goal = 0.4, 2.0, (0.5, -1.0, 3.0)
    flat = WrenchController(
        Body(2.0, 0.3), [Contact((-0.4, 0.1), 0.3, radius=0.2)], Law.dynamic(), (1.0, -9.0)
    ).problem(Motion(theta, rate), Motion(*goal))
    about = np.array([0.0, -1.0, 0.0])
    whole = WrenchController(
        Body(2.0, 0.3 * np.eye(3)), [Contact((-0.4, 0.0, 0.1), 0.3, radius=0.2)], Law.dynamic(), (1.0, 0.0, -9.0)
    )
    q, q_d = (np.array([np.cos(angle / 2), 0.0, -np.sin(angle / 2), 0.0]) for angle in (theta, goal[0]))
    deep = whole.problem(Motion(q, rate * about), Motion(q_d, goal[1] * about, goal[2] * about))
    np.testing.assert_allclose(flat.required, deep.required[[0, 2, 4]] * [1.0, 1.0, -1.0], atol=1e-12)
    rows = deep.jacobian[[0, 2, 4]][:, [0, 2]] * np.array([[1.0], [1.0], [-1.0]])
    np.testing.assert_allclose(flat.jacobian, rows, atol=1e-12)


@pytest.mark.parametrize("radius", [0.3, 0.0])
def test_the_required_wrench_makes_a_free_body_roll(radius: float) -> None:
    """Applied in MuJoCo without contact: alpha as commanded, and the ball's centre moves on as it rolls.

    Its path is MuJoCo's own, over 100 steps. With radius 0 in the controller's belief it is another.
    """
    s, n = 0.3, np.array([0.0, 0.6, 0.8])
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><option timestep="1e-5" gravity="1 -2 -9"/><worldbody><body name="b"><freejoint/>'
        '<geom type="box" size=".5 .35 .7" mass="2"/></body></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    inertia = 2.0 / 3.0 * np.diag([0.35**2 + 0.7**2, 0.5**2 + 0.7**2, 0.5**2 + 0.35**2])
    point, table = np.array([-0.5, -0.35, -0.7]), np.column_stack([[1.0, 0.0, 0.0], [0.0, 0.8, -0.6], n])
    contact = Contact(point, 0.4, frame=table, radius=radius)
    controller = WrenchController(Body(2.0, inertia), [contact], Law.dynamic(20.0), (1.0, -2.0, -9.0))
    turned, omega = Rotation.from_quat([0.2, -0.4, 0.4, 0.8]), np.array([1.5, -2.0, 3.0])
    q, alpha = np.roll(turned.as_quat(), 1), np.array([5.0, 1.0, -3.0])
    wrench = controller.problem(Motion(q, omega), Motion(q, omega, alpha)).required
    out = np.empty((1, 6))
    world_wrench(controller.belief.source.map, q, wrench, out[0])
    data.qpos[3:], data.qvel[3:] = q, turned.inv().apply(omega)  # a free joint's rates are in object axes
    data.qvel[:3] = -np.cross(omega, turned.apply(point) - s * n)
    data.xfrc_applied[1] = out[0]
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(turned.apply(data.qacc[3:]), alpha, rtol=1e-9)
    centres, rolled, steps = [turned.apply(point)], np.zeros(3), 100
    for _ in range(steps):
        mujoco.mj_step(model, data)
        now = Rotation.from_quat(np.roll(data.qpos[3:7], -1))
        centres.append(data.qpos[:3] + now.apply(point))
        rolled += np.cross(now.apply(data.qvel[3:]), s * n) * 1e-5
    acceleration = 2.0 * (centres[-1] - centres[0] - rolled) / (steps * 1e-5) ** 2
    assert np.linalg.norm(rolled) > 1e-4
    assert (np.linalg.norm(acceleration) < 0.2) == (radius == s)  # of 10 m/s^2


def test_a_capsule_is_pivoted_on_its_cap(pill: Run) -> None:
    rolls(pill)
    assert pill.world.radius.tolist() == [0.03]
    assert np.ptp(np.rad2deg(pill.theta[0])) == pytest.approx(20.0, abs=0.05)
    moved = pill.corner[0, -1, 0] - pill.corner[0, 0, 0]  # the contact rolls on as far as the arc of the cap is long
    assert np.linalg.norm(moved[:2]) == pytest.approx(0.03 * np.ptp(pill.theta[0]), rel=1e-3)
    assert np.abs(pill.corner[..., 2]).max() < 5e-5  # but for the softness of the contact


def turning(run: Run) -> np.ndarray:
    """(N,) angular acceleration about the axis, MuJoCo's less the law's, once settled [rad/s^2]."""
    law = run.attached.controller.law
    error, rate = run.reference[0] - run.theta[0], run.reference[1] - run.omega[0]
    wanted = run.reference[2] + law.kp * error + law.kd * rate
    return (np.diff(run.omega[0]) / run.dt - wanted[:-1])[50:]  # type: ignore[no-any-return]


def test_what_turns_and_pushes_is_what_was_commanded(pill: Run) -> None:
    """Contact force included: alpha about the axis is the law's, and Newton holds of MuJoCo's sensors."""
    assert np.abs(pill.reference[2]).max() > 0.4
    assert np.abs(turning(pill)).max() < 2e-3
    weight = pill.truth.mass * pill.truth.gravity
    pushed = pill.force_measured[0, :, 0] @ pill.table_axes.T + pill.wrench_world[0, :, :3] + weight
    np.testing.assert_allclose(pushed, pill.truth.mass * np.diff(pill.velocity[0], axis=0) / pill.dt, atol=1e-3)


def sticking(run: Run, point: ArrayLike) -> WrenchController:
    """A controller that believes that a point (3,) in the body frame stays put."""
    mine, body = run.attached.controller, run.attached.body
    contact = replace(mine.contacts[0], point=body.point(point), radius=0.0)
    return WrenchController(mine.body, [contact], mine.law, body.gravity, base=body.table, margin=0.2)


def test_a_radius_that_is_left_out_is_caught(pill: Run, tmp_path: Path) -> None:
    """The controller believes that the cap's centre, or the point of it that is down on its side, stays put."""
    centre = pill.truth.com + pill.points[0]
    with pytest.raises(ModelError, match=r"contacts\[0\] = .*: 0.03 m off the surface .* give its radius"):
        attach(pill.model, body="b", contacts=[centre])
    run = simulate(
        pill.scenario, controller=sticking(pill, centre)
    )  # on a level table, at leisure, f_t has little moment about it
    assert run.measures.force_mismatch_rel[0] > 0.03 > 100.0 * pill.measures.force_mismatch_rel.max()
    assert np.abs(turning(run)).max() > 0.5
    case = own(tmp_path, mjcf(PILL, table='euler="0 20 0"'), "vertex")
    right = simulate(case)
    assert right.verdict == "pass"
    for point in (centre, [0.03, 0.0, -0.07]):
        assert simulate(case, controller=sticking(right, point)).verdict == "fail"


def test_slip_is_counted_from_rolling(pill: Run) -> None:
    """Pushed sideways by a hand that no one told the controller of, the cap slides, and the slip is how far."""
    run = simulate(pill.scenario, world={"mu": 0.02})
    assert run.verdict == "fail"
    assert run.measures.slip_max_m[0] > 1e-3


@pytest.mark.parametrize(
    ("text", "contact", "keys"),
    [
        (mjcf(PILL, table='euler="6 4 0"'), "vertex", {}),
        (mjcf(PILL, pose='euler="0 70 10"'), "lowest", {"theta": 25.0, "theta_end": 5.0}),
        (mjcf(PILL, pose='euler="0 20 0"'), [[0.0, 0.0, -0.1]], {"theta_end": 150.0}),
        (mjcf(PILL), "vertex", {"reference": "sine", "theta": 20.0, "amplitude": 8.0, "period": 1.0}),
        (mjcf(HAMMER), [[0.0, 0.0, -0.15]], {"theta": 1.5, "theta_end": 21.5}),
        (mjcf(PILL), "vertex", {"about": "yaw", "theta": 0.0, "theta_end": 90.0}),
        (mjcf(PILL.replace("/>", ' euler="0 90 0"/>'), PLANAR), "lowest", {}),
        (mjcf(PILL, PLANAR), [0.0, 0.0, -0.07], {}),
    ],
    ids=[
        "tilted table",
        "lowest",
        "tip, over the top",
        "from a turning start",
        "mixed",
        "yaw",
        "planar",
        "planar, on end",
    ],
)
def test_rolls(text: str, contact: object, keys: dict, tmp_path: Path) -> None:
    run = simulate(own(tmp_path, text, contact, **keys))
    rolls(run)
    assert run.world.radius[0] in (0.03, 0.012)
    assert (np.abs(run.rolled).max() > 1e-3) == ("about" not in keys)


def test_of_a_ball_only_the_way_to_its_centre_turns(tmp_path: Path) -> None:
    """MuJoCo's own slip of a fat capsule on a soft contact, turned by 40 deg in 0.3 s, is predicted within 3 %."""
    fat = '<geom type="capsule" size=".2 .05" mass=".4"/>'
    keys = {"theta": 2.0, "theta_end": 42.0, "seconds": 0.3, "timeconst": 0.01, "spread": 0.0}
    run = simulate(own(tmp_path, mjcf(fat), **keys))  # type: ignore[arg-type]
    assert run.measures.slip_max_m[0] > 2e-4
    assert np.linalg.norm(run.slip - predicted_slip(run), axis=-1).max() < 0.03 * run.measures.slip_max_m[0]


def test_a_capsule_is_laid_on_its_side(tmp_path: Path) -> None:
    case = own(tmp_path, mjcf(PILL), theta=20.0, theta_end=0.0)
    run = simulate(replace(case, limits=replace(case.limits, contacts_end=2)))
    assert run.verdict == "pass"
    assert (run.contacts_found[0, 0], run.contacts_found[0, -1]) == (1, 2)


def test_attached_in_a_loop_of_ones_own() -> None:
    """The cap turned by 20 deg at both a number and a list for the radius; its centre ends where rolling takes it."""
    spec = load_text(mjcf(PILL))
    model = spec.compile()
    data = mujoco.MjData(model)
    centre, radius, axis = np.array([0.0, 0.0, -0.07]), 0.03, np.array([0.0, -1.0, 0.0])
    held = attach(model, body="b", contacts=[centre], radius=radius)
    listed = attach(model, body="b", contacts=[centre], radius=[radius])
    assert held.controller.contacts[0].radius == listed.controller.contacts[0].radius == radius
    lying = Rotation.from_euler("y", 90.0, degrees=True)  # cap 1 to the left: theta lifts the other end
    start = np.roll(lying.as_quat(), 1)
    time = model.opt.timestep * np.arange(600)
    s = time / time[-1]
    rates = (0.4 + 0.35 * s**3 * (10 - 15 * s + 6 * s * s), 0.35 * 30 * s**2 * (1 - s) ** 2 / time[-1])
    bend = 0.35 * 60 * s * (1 - s) * (1 - 2 * s) / time[-1] ** 2
    desired = Turn(lambda times: Motion(*rates, bend), axis, start)(time)  # type: ignore[arg-type]
    data.qpos[3:7] = np.asarray(desired.orientation)[0]
    data.qpos[:3] = [0.0, 0.0, radius - 1e-7] - Rotation.from_rotvec(0.4 * axis).apply(lying.apply(centre))
    for k in range(time.size):
        data.xfrc_applied[1] = held.wrench(data, Motion(*(np.asarray(values)[k] for values in desired)))
        mujoco.mj_step(model, data)
    turned = Rotation.from_quat(np.roll(data.qpos[3:7], -1))
    off = turned * (Rotation.from_rotvec(0.75 * axis) * lying).inv()
    assert np.rad2deg(off.magnitude()) < 0.05
    at = data.qpos[:3] + turned.apply(centre)
    np.testing.assert_allclose(at, [-0.35 * radius, 0.0, radius], atol=5e-5)


def load_text(text: str) -> mujoco.MjSpec:
    """With the contact parameters of the shipped scenes."""
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "own.xml"
        path.write_text(text)
        return load(path, body="b", support=None, chosen=True)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Contact((0.0, -1.0), 0.3, radius=-0.1), "radius = -0.1.*>= 0"),
        (lambda: attach(load_text(mjcf(PILL)).compile(), body="b", contacts=[(0, 0, 0)], radius=[1, 2]), "radius = .*"),
        (lambda: attach(load_text(mjcf(PILL)).compile(), body="b", contacts=[(0, 0, 0)], radius=-1), "radius = -1"),
    ],
)
def test_bad_input_is_named(make: Callable[[], object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


def test_the_faces_of_a_mixed_body_are_exact(tmp_path: Path) -> None:
    """Hull facets of a ball are of samples; the planes to lie on touch what they are of, within rounding."""
    body = read_hull(load_text(mjcf(HAMMER)).compile(), 1)
    planes = [one.up for one in faces(body, np.ones(len(body.ups), dtype=bool))]
    lying = [up for up in planes if len(body.support(up)[0]) == 3]  # two corners of the head and the cap of the handle
    assert len(lying) >= 2
    for up in lying:
        depth = np.sort(body.least(up))
        assert depth[2] - depth[0] < 1e-9


def test_recording(pill: Run, tmp_path: Path) -> None:
    """The capsule is drawn, cone and forces are where the cap touches: on the table, and moving on as it rolls."""
    from rerun.chunk import RrdReader

    path = record(pill, tmp_path / "run.rrd")
    chunks = [
        chunk.to_record_batch() for chunk in RrdReader(path).stream() if str(chunk.entity_path) == "/world/contact"
    ]
    (posed,) = [chunk for chunk in chunks if "Transform3D:translation" in chunk.schema.names]
    at = np.array([row[0] for row in posed.column("Transform3D:translation").to_pylist()])
    assert np.abs(at[:, 2]).max() < 5e-5
    assert np.linalg.norm(at[-1] - at[0]) == pytest.approx(0.03 * np.ptp(pill.theta[0]), rel=1e-2)
    (solid,) = body_solids(pill.model, read_body(pill.model, "b"))
    assert np.abs(solid.vertices).max(axis=0) == pytest.approx([0.03, 0.03, 0.1])


@pytest.mark.parametrize(
    ("geoms", "contact", "message"),
    [
        (PILL.replace("/>", ' euler="90 0 0"/>'), "lowest", "it is round in the plane, and rolls"),
        (PILL, [0.0, 0.0, 0.07], "must be one lowest corner"),
        (PILL, [0.0, 0.0, 0.0], "the centre of a round end of radius 0.03"),
        (PILL, [0.0, 0.0], "must be vertex, edge"),
        ('<geom size=".1"/>', "lowest", "no tilt lifts it off one point"),
    ],
)
def test_refused_in_the_plane(geoms: str, contact: object, message: str, tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=message):
        simulate(own(tmp_path, mjcf(geoms, PLANAR), contact))


def test_command_line(tmp_path: Path) -> None:
    path = tmp_path / "cap.xml"
    path.write_text(mjcf(PILL))

    def pivoting(contact: str) -> subprocess.CompletedProcess[str]:
        words = ["run", "pivot", "--model", str(path), "--body", "b", "--contact", contact, "--json"]
        return subprocess.run(
            [sys.executable, "-m", "pivoting.sim", *words], capture_output=True, text=True, timeout=300, check=False
        )

    done = pivoting("vertex")
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["verdict"] == "pass"
    assert summary["radius"] == [0.03]
    refused = pivoting("edge")
    assert refused.returncode == 2
    assert "about a line that ends on a round end it would only roll" in refused.stderr
