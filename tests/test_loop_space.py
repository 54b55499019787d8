"""The closed loop in space: scenes, objects of one's own, and the symmetries that no controller may break."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pivoting.controller import Motion, solve
from pivoting.controller.rotations import Turn, Waypoints
from pivoting.models import ModelError
from pivoting.sim import SCENARIOS, assert_sticking, assert_tracking, attach, own_object, simulate
from pivoting.sim.monitor import predicted_slip
from scipy.spatial.transform import Rotation

SPATIAL = [name for name in SCENARIOS if name.endswith("3d")]
seeds = st.integers(0, 2**32 - 1)


@pytest.mark.parametrize("name", SPATIAL)
def test_scenes(name: str) -> None:
    """What issue and README promise, and the slip is the one that MuJoCo's contact itself makes."""
    run = simulate(name, worlds=4, seed=3)
    assert_sticking(run, slip_m=1e-4)
    assert_tracking(run, rms_deg=0.05)
    assert run.verdict == "pass"
    assert run.measures.force_mismatch_rel.max() <= 0.03
    assert (run.measures.contact_lost_s == 0.0).all()
    assert run.residual.max() <= 1e-12
    gap = np.linalg.norm(run.slip - predicted_slip(run), axis=-1).max()
    assert gap < 0.15 * max(run.measures.slip_max_m.max(), 1e-9)


def test_what_the_loop_applies_is_the_problem_solved_again_by_clarabel() -> None:
    run = simulate("pivot-3d", seconds=0.5)
    for k in range(0, run.time.size - 1, 100):
        state = Motion(run.quaternion[0, k], run.angular_velocity[0, k])
        problem = run.attached.controller.problem(state, Motion(*(values[k] for values in run.desired)))
        other = solve(problem, "clarabel", tolerance=1e-6)
        np.testing.assert_allclose(run.force[0, k], other.force, atol=1e-5)
        R = Rotation.from_quat(np.roll(run.quaternion[0, k], -1)).as_matrix()
        world = np.concatenate([R @ run.wrench[0, k, :3], R @ run.wrench[0, k, 3:]])
        np.testing.assert_allclose(run.wrench_world[0, k], world, atol=1e-12)


def test_measured_forces_and_weight_balance_the_block() -> None:
    """Newton and Euler, from MuJoCo's own sensors: contact forces, applied force and weight make m a."""
    run = simulate("pivot-3d")
    forces = run.force_measured[0].sum(axis=1) @ run.table_axes.T + run.wrench_world[0, :, :3]
    forces[:, 2] -= 10.0
    acceleration = np.diff(run.velocity[0], axis=0) / run.dt
    np.testing.assert_allclose(forces, acceleration, atol=2e-3)


def test_settle_lands_on_four_contacts() -> None:
    run = simulate("settle-3d")
    assert run.contacts_found[0, 0] == 2
    assert run.contacts_found[0, -1] == 4
    assert run.clearance[0, 0] > 0.2
    assert run.measures.bounce_m[0] < 1e-5
    dropped = simulate("settle-3d", law="static")  # no feedback: it does not get there
    assert dropped.verdict == "fail"


def test_a_slippery_world_or_a_wrong_mass_is_caught() -> None:
    assert simulate("pivot-3d", world={"mu": 0.15}).verdict == "fail"
    assert simulate("pivot-3d", world={"mass": 1.5}).verdict == "fail"


def test_a_table_that_the_controller_does_not_know_of() -> None:
    run = simulate("pivot-3d", seconds=1.0, world={"incline": 2.0}, spread=0.0)
    assert np.rad2deg(run.angle_error[0, -1]) == pytest.approx(-2.0, abs=0.2)
    assert run.verdict == "fail"


def test_worlds_are_the_same_bit_for_bit_and_one_by_one() -> None:
    many, again = simulate("spin-3d", worlds=3, seed=9, seconds=0.3), simulate("spin-3d", worlds=3, seed=9, seconds=0.3)
    one = simulate("spin-3d", worlds=1, seed=9, seconds=0.3)
    assert np.array_equal(many.quaternion, again.quaternion)
    assert np.array_equal(many.quaternion[0], one.quaternion[0])


BOX = """<mujoco><option gravity="{gravity}" timestep="{dt}"/><worldbody>
  <geom name="floor" type="plane" size="{span} {span} 1" quat="{plane}" pos="{origin}"/>
  <body name="b" pos="{position}" quat="{quat}"><freejoint/>
    <geom type="box" size="{size}" pos="{offset}" mass="{mass}" friction="0.6 0 0"/>
    <geom type="cylinder" size="{rod}" pos="{offset}" mass="{mass}" friction="0.6 0 0"/></body>
</worldbody></mujoco>"""


def text(values: object) -> str:
    """Numbers as MJCF wants them, to the last bit."""
    return " ".join(repr(float(value)) for value in np.ravel(values))


def box(turned: Rotation, *, length: float = 1.0, mass: float = 1.0) -> str:
    """A box with a rod in it on a plane, the whole scene turned, in other units of length and mass."""
    sizes = {"size": [0.03, 0.04, 0.07], "rod": [0.01, 0.05], "offset": [0.004, -0.003, 0.002]}
    quat = np.roll(turned.as_quat(), 1)
    return BOX.format(
        gravity=text(turned.apply([0.0, 0.0, -9.81 * length])),
        dt="0.002",
        span=text(length),
        plane=text(quat),
        origin=text(turned.apply(length * np.array([0.1, 0.2, -0.3]))),
        position=text(turned.apply(length * np.array([0.2, 0.1, 0.1]))),
        quat=text(quat),
        mass=text(0.4 * mass),
        **{key: text(length * np.array(value)) for key, value in sizes.items()},
    )


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_the_wrench_turns_with_the_scene(seed: int) -> None:
    """Turn gravity, table, body, state and reference together: the wrench turns with them, to 1e-9."""
    rng = np.random.default_rng(seed)
    whole = Rotation.random(random_state=rng)
    contacts = np.array([[-0.026, -0.043, -0.068], [0.034, -0.043, -0.068]])[: rng.integers(1, 3)]
    pose, goal = (Rotation.from_rotvec(0.3 * rng.normal(size=3)) for _ in range(2))
    spin, rate, push = rng.normal(size=(3, 3))
    wrenches = []
    for turned in (Rotation.identity(), whole):
        model = mujoco.MjModel.from_xml_string(box(turned))
        data = mujoco.MjData(model)
        data.qpos[3:] = np.roll((turned * pose).as_quat(), 1)
        data.qvel[3:] = pose.inv().apply(spin)  # a free joint's angular velocity is in the body's axes
        held = attach(model, body="b", contacts=list(contacts), f_min=0.5)
        target = Motion(np.roll((turned * goal).as_quat(), 1), turned.apply(rate), turned.apply(push))
        wrenches.append(held.wrench(data, target).reshape(2, 3))
    still, moved = wrenches
    np.testing.assert_allclose(moved, whole.apply(still), atol=1e-9 * np.abs(still).max())


def turn_object(folder: Path, mjcf: str, contact: object = "vertex", **keys: float):  # type: ignore[no-untyped-def]
    """Run it as an object of one's own."""
    path = folder / "own.xml"
    path.write_text(mjcf)
    return simulate(own_object(path, "b", contact).change(**keys))  # type: ignore[arg-type]


@settings(max_examples=6, deadline=None)
@given(seed=seeds)
def test_motion_does_not_depend_on_orientation_or_units(seed: int, tmp_path_factory: pytest.TempPathFactory) -> None:
    """Metres or millimetres, kilograms or grams, table level or on the ceiling: theta and friction use are the same."""
    rng = np.random.default_rng(seed)
    folder = tmp_path_factory.mktemp("own")
    kind = ("vertex", "edge")[rng.integers(2)]
    plain = turn_object(folder, box(Rotation.identity()), kind, seconds=0.5)
    length, mass = 10.0 ** rng.uniform(-2.0, 3.0, 2)
    other = turn_object(folder, box(Rotation.random(random_state=rng), length=length, mass=mass), kind, seconds=0.5)
    assert plain.verdict == "pass"
    np.testing.assert_allclose(other.theta, plain.theta, atol=1e-7)
    np.testing.assert_allclose(other.force, mass * length * plain.force, atol=1e-4 * mass * length * plain.force.max())
    slip = other.measures.slip_max_m / other.unit  # gravity like the earth's in cm or mm is read as such
    np.testing.assert_allclose(slip, length * plain.measures.slip_max_m, rtol=0.05)


MESH = """<mujoco><asset><mesh name="m" vertex="{vertices}"/></asset><worldbody>
  <geom type="plane" size="1 1 1" euler="{tilt} 0 0"/>
  <geom type="box" size=".1 .1 .1" pos="0.5 0.5 0.1"/><body name="other" pos="-.5 0 .05"><freejoint/>
    <geom type="sphere" size=".05"/></body>
  <body name="b" pos="0 0 0.3"><freejoint/><geom type="mesh" mesh="m" density="700"/></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize(("seed", "tilt"), [(0, 0.0), (1, 5.0), (2, 0.0)])
def test_a_convex_mesh_made_here(seed: int, tilt: float, tmp_path: Path) -> None:
    """A lump of 12 random points, among other bodies, also on a table that is not level."""
    points = 0.06 * Rotation.random(random_state=seed).apply(np.random.default_rng(seed).normal(size=(12, 3)))
    run = turn_object(tmp_path, MESH.format(vertices=text(points), tilt=tilt), "vertex", theta=2.0, theta_end=22.0)
    assert_sticking(run, slip_m=5e-4)
    assert_tracking(run, rms_deg=0.1)


def refused(folder: Path, mjcf: str, message: str, contact: object = "vertex") -> None:
    """It is, with the reason."""
    with pytest.raises((ModelError, ValueError), match=message):
        turn_object(folder, mjcf, contact)


def test_what_cannot_be_pivoted_is_refused_with_a_reason(tmp_path: Path) -> None:
    world = (
        '<mujoco><worldbody><geom type="plane" size="1 1 1"/><body name="b" pos="0 0 .2">{}</body></worldbody></mujoco>'
    )
    refused(tmp_path, world.format('<freejoint/><geom size=".1"/>'), "roll")
    refused(tmp_path, world.format('<geom type="box" size=".1 .1 .1"/>'), "no joint, so no free motion")
    cube = world.format('<freejoint/><geom type="box" size=".1 .1 .1"/>')
    refused(tmp_path, cube, "no corner of body 'b'", [[-0.05, -0.1, -0.1]])
    refused(tmp_path, cube, "contact = 'floor'", "floor")
    refused(tmp_path, cube.replace("plane", "sphere"), "support = .*sphere of the world.*must be a plane, a box or an")


def test_references_on_so3_in_a_loop_of_ones_own() -> None:
    """Waypoints through `attach`: the box yaws on its vertex, then tilts, the vertex staying put."""
    model = mujoco.MjModel.from_xml_path(str(SCENARIOS["balance-3d"].path))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    vertex = np.array([-0.5, -0.35, -0.7])
    held = attach(model, body="block", contacts=[vertex])
    start = np.array(data.qpos[3:7])
    yaw = Turn(lambda times: Motion(times, times, times), [0.0, 0.0, 1.0], start)(np.array(0.4)).orientation  # type: ignore[arg-type]
    tilted = Turn(lambda times: Motion(times, times, times), [1.0, 1.0, 0.0], yaw)(np.array(0.1)).orientation  # type: ignore[arg-type]
    path = Waypoints([start, yaw, tilted], 0.5, 0.1)  # type: ignore[list-item]
    mujoco.mj_kinematics(model, data)
    where = data.xpos[1] + data.xmat[1].reshape(3, 3) @ vertex
    steps = round(path.duration / model.opt.timestep)
    desired = path(model.opt.timestep * np.arange(steps))
    for k in range(steps):
        data.xfrc_applied[1] = held.wrench(data, Motion(*(np.asarray(values)[k] for values in desired)))
        mujoco.mj_step(model, data)
    off = Rotation.from_quat(np.roll(data.qpos[3:7], -1)) * Rotation.from_quat(np.roll(np.asarray(tilted), -1)).inv()
    assert np.rad2deg(off.magnitude()) < 0.05
    mujoco.mj_kinematics(model, data)
    moved = data.xpos[1] + data.xmat[1].reshape(3, 3) @ vertex - where
    assert np.linalg.norm(moved[:2]) < 1e-4


WEDGE = """<mujoco><asset><mesh name="w" vertex="0 0 0 .2 0 0 .05 0 .1 0 .1 0 .2 .1 0 .05 .1 .1"/></asset><worldbody>
  <geom type="plane" size="1 1 1"/><body name="b" pos="0 0 .1"><joint type="slide" axis="1 0 0"/>
    <joint type="slide" axis="0 0 1"/><joint type="hinge" axis="0 1 0"/><geom type="mesh" mesh="w"/></body>
</worldbody></mujoco>"""


def test_a_planar_object_of_ones_own(tmp_path: Path) -> None:
    """The contact is the left end of its base; the next corner comes down at 180 deg less its 63.4."""
    run = turn_object(tmp_path, WEDGE, "lowest")
    assert run.truth.dim == 2
    assert run.verdict == "pass"
    with pytest.raises(ValueError, match=r"theta_end = 130 deg: .* within \[0.1, 116.465\] deg, then the corner"):
        turn_object(tmp_path, WEDGE, "lowest", theta_end=130.0)
    refused(tmp_path, WEDGE, "no corner of body 'b'", [0.0, 0.0, 0.05])
    refused(tmp_path, WEDGE, "one lowest corner", [0.05, 0.0, 0.1])


def test_given_corners_are_turned_from_the_face_that_is_down(tmp_path: Path) -> None:
    """A tall box standing: of the two faces that meet in the edge, the one that it stands on in its file."""
    tall = BOX.replace("cylinder", "box").replace('size="{rod}"', 'size="0.01 0.01 0.01"')
    standing = tall.format(
        gravity="0 0 -9.81", dt="0.002", span="1", plane="1 0 0 0", origin="0 0 0", position="0 0 .3", quat="1 0 0 0",
        size="0.03 0.04 0.07", offset="0 0 0", mass="0.4", rod="",
    )  # fmt: skip
    run = turn_object(tmp_path, standing, [[-0.03, -0.04, -0.07], [-0.03, 0.04, -0.07]])
    assert run.verdict == "pass"
    np.testing.assert_allclose(np.sort(run.face, axis=0)[:, 2], -0.07, atol=1e-9)
