"""What an object stands on: against a body that is let down in small steps until MuJoCo finds a contact."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from pivoting.models import ModelError
from pivoting.models.rigid_body import initial_data
from pivoting.models.support_surfaces import find_support, support_surface
from pivoting.sim import attach, simulate
from scipy.spatial.transform import Rotation

from tests.own_files import BOX, FLOOR, mjcf, own, pivoted

STEP = 1e-3  # [m] by which the body is let down
TILT = 'euler="0 30 0"'


def let_down(model: mujoco.MjModel, body: int) -> set[int]:
    """The geoms that the body touches first."""
    data = initial_data(model)
    first, last = int(model.body_geomadr[body]), int(model.body_geomadr[body] + model.body_geomnum[body])
    for _ in range(4000):
        mujoco.mj_forward(model, data)
        found = {g for c in data.contact for g in c.geom.tolist() if any(first <= h < last for h in c.geom)}
        if found:
            return {g for g in found if not first <= g < last}
        data.qpos[:3] += STEP * model.opt.gravity / np.linalg.norm(model.opt.gravity)
    return set()


def table(rng: np.random.Generator, depth: int) -> str:
    """A fixed body with one plate or disc, any way up, perhaps nested in others."""
    half = np.array([rng.uniform(0.15, 0.4), rng.uniform(0.15, 0.4), rng.uniform(0.01, 0.05)])
    turn = Rotation.from_euler("xyz", rng.uniform(-10.0, 10.0, 3) * [1.0, 1.0, 9.0], degrees=True)
    if rng.random() < 0.3:
        shape = f'type="cylinder" size="{half[0]} {half[2]}"'
    else:  # its thin side is up, whichever of its own axes that is
        k = int(rng.integers(3))
        half, turn = np.roll(half, k + 1), turn * Rotation.from_matrix(np.roll(np.eye(3), k + 1, axis=1))
        shape = f'type="box" size="{half[0]} {half[1]} {half[2]}"'
    quat = np.roll(turn.as_quat(), 1)
    at = [*rng.uniform(-0.25, 0.25, 2), rng.uniform(0.05, 0.45)]
    text = f'<geom {shape} pos="{at[0]} {at[1]} {at[2]}" quat="{quat[0]} {quat[1]} {quat[2]} {quat[3]}"/>'
    for _ in range(depth):
        text = f'<body pos="0.01 0 0.01" euler="0 0 20">{text}</body>'
    return text


@pytest.mark.parametrize("seed", range(40))
def test_it_is_what_a_falling_body_meets_first(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shapes = (BOX, '<geom type="cylinder" size=".06 .05"/>', '<geom type="capsule" size=".03 .06"/>', BOX + BOX)
    world = "".join(table(rng, int(rng.integers(0, 3))) for _ in range(int(rng.integers(1, 4))))
    euler = "0 0 30" if rng.random() < 0.5 else " ".join(f"{x}" for x in rng.uniform(-60.0, 60.0, 3))
    text = mjcf(shapes[seed % 4].replace(' name="g"', ""), pose=f'pos="0 0 .8" euler="{euler}"', world=world)
    model = mujoco.MjModel.from_xml_string(text)
    data = initial_data(model)
    body = model.body("box").id
    assert find_support(model, data, body) in let_down(model, body)
    if euler == "0 0 30":  # in motion's way: gravity to the side, the same
        model.opt.gravity = Rotation.from_euler("x", 5.0, degrees=True).apply(model.opt.gravity)
        assert find_support(model, data, body) in let_down(model, body)


def test_rails_and_posts_between_the_corners() -> None:
    """A plate on narrow rails, and on one post amid it, far from its corners."""
    rail = '<geom type="box" size=".006 .3 .1" pos="{} 0 .1"/>'
    for under in (
        rail.format(-0.031) + rail.format(0.027),
        '<geom name="t" type="cylinder" size=".008 .1" pos=".011 .013 .1"/>',
        '<geom name="t" type="box" size=".004 .004 .1" pos=".021 -.017 .1" euler="0 0 30"/>',
    ):
        model = mujoco.MjModel.from_xml_string(mjcf(pose='pos="0 0 .265"', world=under))
        body = model.body("box").id
        assert find_support(model, initial_data(model), body) in let_down(model, body)


FACES = [
    ('<geom name="t" type="box" size=".3 .2 .3" pos="0 0 -.3"/>', [0.0, 0.0, 1.0], 0.0),
    ('<geom name="t" type="box" size=".2 .3 .3" pos="0 0 -.3" euler="0 90 0"/>', [0.0, 0.0, 1.0], -0.1),
    ('<geom name="t" type="box" size=".3 .3 .2" pos="0 0 -.2" euler="180 0 0"/>', [0.0, 0.0, 1.0], 0.0),
    ('<geom name="t" type="box" size=".3 .3 .2" euler="0 20 0"/>', [np.sin(np.pi / 9), 0, np.cos(np.pi / 9)], None),
    ('<geom name="t" type="box" fromto="-.3 0 -.2 .3 0 -.2" size=".2"/>', [0.0, 0.0, 1.0], 0.0),
    ('<geom name="t" type="cylinder" fromto="0 0 0 0 0 -.2" size=".2"/>', [0.0, 0.0, 1.0], 0.0),
    ('<geom name="t" type="plane" size="1 1 1" euler="0 0 90"/>', [0.0, 0.0, 1.0], 0.0),
]  # fmt: skip


@pytest.mark.parametrize(("floor", "normal", "top"), FACES)
def test_the_face_that_is_up(floor: str, normal: list[float], top: float | None) -> None:
    model = mujoco.MjModel.from_xml_string(mjcf(floor=floor, pose='pos="0 0 .3"'))
    face = support_surface(model, initial_data(model), model.geom("t").id)
    np.testing.assert_allclose(face.axes[:, 2], normal, atol=1e-12)
    assert np.linalg.det(face.axes) == pytest.approx(1.0)
    if top is not None:
        assert face.origin[2] == pytest.approx(top, abs=1e-12)
        assert face.beyond([[0.0, 0.0, top]]) == pytest.approx(0.0)


TABLES = [
    '<geom name="t" type="box" size=".3 .2 .3" pos="0 0 -.3" euler="90 0 0"/>',
    '<geom name="t" type="box" fromto="-.3 0 -.2 .3 0 -.2" size=".2"/>',
    '<geom name="t" type="cylinder" fromto="0 0 0 0 0 -.2" size=".2"/>',
    '<body name="leg"><body name="top" pos="0 0 -.1"><geom name="t" type="box" size=".3 .3 .1"/></body></body>',
    '<geom name="t" type="plane" size=".1 .1 .1"/>',  # drawn small, endless in contacts
]


@pytest.mark.parametrize("contact", ["vertex", "edge", "lowest"])
@pytest.mark.parametrize("floor", TABLES)
def test_tables_that_lie_any_way(floor: str, contact: str, tmp_path: Path) -> None:
    """The slip of the plain file; on a cylinder MuJoCo makes other contacts of a box, and none that hold an edge."""
    if 'type="cylinder"' in floor and contact == "edge":
        with pytest.raises(ModelError, match="held by one contact at a time, as MuJoCo makes few contacts of such geo"):
            pivoted(tmp_path, mjcf(floor=floor), contact)
        return
    plain = pivoted(tmp_path, mjcf(), contact)
    run = pivoted(tmp_path, mjcf(floor=floor), contact)
    assert run.summary()["support"] == "t"
    assert plain.verdict == run.verdict == "pass"
    same = 1.0 if 'type="cylinder"' in floor else 1e-3
    assert run.measures.slip_max_m[0] == pytest.approx(plain.measures.slip_max_m[0], rel=same)


def test_a_tilted_table(tmp_path: Path) -> None:
    """Plane or box, inclined by 12 deg: the same figures."""
    pose = 'pos="-.012474 0 .058689" euler="0 -12 0"'
    plane = pivoted(tmp_path, mjcf(floor=FLOOR.replace("/>", ' euler="0 -12 0"/>'), pose=pose))
    sunk = 0.1 * np.array([np.sin(np.deg2rad(12)), 0.0, -np.cos(np.deg2rad(12))])
    at = " ".join(f"{x:.12g}" for x in sunk)
    box = pivoted(tmp_path, mjcf(floor=f'<geom type="box" size=".5 .5 .1" pos="{at}" euler="0 -12 0"/>', pose=pose))
    assert plane.verdict == box.verdict == "pass"
    assert box.measures.slip_max_m[0] == pytest.approx(plane.measures.slip_max_m[0], rel=1e-3)
    np.testing.assert_allclose(box.table_axes, plane.table_axes, atol=1e-9)


def test_it_stands_where_its_keyframe_or_another_table_has_it(tmp_path: Path) -> None:
    """On a desk amid a room, whose floor is the only plane; elsewhere by the first keyframe."""
    desk = '<geom name="desk" type="box" size=".2 .2 .02" pos="1 0 .7"/>'
    run = pivoted(tmp_path, mjcf(world=desk, pose='pos="1 0 .78"'))
    assert (run.summary()["support"], run.verdict) == ("desk", "pass")
    key = '<keyframe><key qpos="1 0 .78 1 0 0 0"/></keyframe>'
    assert pivoted(tmp_path, mjcf(world=desk, extra=key)).summary()["support"] == "desk"
    assert pivoted(tmp_path, mjcf(world=desk)).summary()["support"] == "floor"


EGG = '<geom type="ellipsoid" size=".3 .3 .1" pos="0 0 -.1"/>'
ROLLER = '<geom name="t" type="cylinder" size=".1 .3" pos="0 0 -.1" euler="90 0 0"/>'
CART = '<body name="cart" pos="0 0 -1"><freejoint/><geom name="c" size=".1"/></body>'
POST = '<geom name="post" type="box" size=".1 .1 .1" pos="{} 0 .1"/>'
REFUSED = [
    (mjcf(floor=EGG), None, r"'#0' \(ellipsoid of the world\): of geoms of type ellipsoid no .*give the model a box"),
    (mjcf(floor=ROLLER), None, "'t': the cylinder lies on its side.*must be a plane"),
    (mjcf(floor=""), None, "None: nothing that body 'box' can collide with is under it; name a --support"),
    (mjcf(floor=FLOOR.replace("/>", ' contype="0" conaffinity="0"/>')), None, "None: nothing that body 'box'"),
    (mjcf(), "moon", "'moon': the model has no geom of that name; fixed ones are 'floor'"),
    (mjcf(world=CART), "c", "'c': it can move; must be fixed"),
    (mjcf(world=POST.format(1)), "post", "'post': its centre of mass would be 0.9 m beside its upper face; must be un"),
]


@pytest.mark.parametrize(("text", "support", "message"), REFUSED)
def test_what_it_cannot_stand_on(text: str, support: str | None, message: str, tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=f"support = {message}"):
        simulate(own(tmp_path, text, support=support))


def test_unnamed_everything(tmp_path: Path) -> None:
    """Body '#1' on support '#0', as by name; and the names that there are where one is wrong."""
    text = mjcf(BOX.replace(' name="g"', ""), floor=FLOOR.replace(' name="floor"', "")).replace(' name="box"', "")
    with pytest.raises(ModelError, match="body = '': must be one of '#1'"):
        simulate(own(tmp_path, text, body=""))
    named, unnamed = pivoted(tmp_path, mjcf()), pivoted(tmp_path, text, body="#1", support="#0")
    assert np.array_equal(named.position, unnamed.position)
    assert unnamed.summary()["support"].startswith("#0")
    model = mujoco.MjModel.from_xml_string(text)
    assert attach(model, body="#1", contacts=[(-0.05, -0.04, -0.06)], support="#0").body.support == 0
