"""Where a body may be pivoted, against MuJoCo's own contacts of the same body on a plane."""

import mujoco
import numpy as np
import pytest
from pivoting.models.placement import contact_candidates as candidates
from pivoting.models.placement.contact_candidates import Pivot, contact_points, find_pivot, support_points
from pivoting.models.rigid_body import ModelError, matrix

POINTS = np.random.default_rng(3).normal(size=(14, 3)) * [0.1, 0.15, 0.2]
GRID = np.array([(x, y, z) for x in range(5) for y in range(5) for z in range(5) if {x, y, z} & {0, 4}]) - 2.0
GRID = GRID @ np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0] * 0.05  # a cube, but for rounding
LEGS = "".join(
    f'<geom type="cylinder" size="{r} .2" pos="{x} {y} .2"/>'
    for x, y, r in ((-0.3, -0.2, 0.03), (-0.3, 0.2, 0.03), (0.3, -0.2, 0.02), (0.3, 0.2, 0.02))
)
BODIES = {
    "box": '<geom type="box" size=".1 .2 .3"/>',
    "offset": '<geom type="box" size=".1 .12 .2" pos=".3 -.1 .5" euler="20 30 40"/>',
    "cylinder": '<geom type="cylinder" size=".1 .2" euler="10 20 30"/>',
    "tetrahedron": '<geom type="mesh" mesh="tetrahedron"/>',
    "irregular": '<geom type="mesh" mesh="irregular" pos=".1 .2 .3" euler="50 10 0"/>',
    "subdivided": '<geom type="mesh" mesh="subdivided" euler="7 8 9"/>',
    "ell": '<geom type="box" size=".3 .1 .05"/><geom type="box" size=".05 .1 .2" pos="-.25 0 .25"/>',
    "bottle": '<geom type="cylinder" size=".04 .1" pos="0 .002 0"/><geom type="cylinder" size=".015 .14"/>',
    "stool": '<geom type="box" size=".32 .22 .01" pos="0 0 .41"/>' + LEGS,
    "legs": LEGS,
    "pill": '<geom type="capsule" size=".1 .2"/>',
    "skittle": '<geom type="sphere" size=".03" pos="0 0 .2"/><geom type="sphere" size=".05" pos=".01 0 -.1"/>',
    "hammer": '<geom type="capsule" size=".012" fromto="0 0 -.15 0 0 0"/><geom type="box" size=".05 .02 .02"/>',
    "mallet": '<geom type="capsule" size=".03 .2"/><geom type="cylinder" size=".05 .1" pos="0 0 .2" euler="90 0 9"/>',
    "ball on a box": '<geom type="box" size=".1 .1 .1" euler="0 0 15"/><geom type="sphere" size=".09" pos=".1 0 .08"/>',
    "egg and pill": '<geom type="box" size=".1 .2 .1"/><geom type="ellipsoid" size=".05 .3 .08" pos="0 0 .15"'
    ' euler="30 40 0"/><geom type="capsule" size=".03 .2" pos=".1 0 .1" euler="0 60 0"/>',
}


def model_of(geoms: str, frame: str = "", extra: str = "") -> mujoco.MjModel:
    """A body 1 of these geoms, moving freely above a plane; in its own frame they are moved by `frame`."""
    tetrahedron = "1 1 1 1 -1 -1 -1 1 -1 -1 -1 1"
    shapes = {"tetrahedron": tetrahedron, "irregular": POINTS, "subdivided": GRID}
    meshes = "".join(
        f'<mesh name="{name}" vertex="{" ".join(map(str, np.ravel(at))) if name != "tetrahedron" else at}"/>'
        for name, at in shapes.items()
    )
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><asset>{meshes}</asset><worldbody><geom name="table" type="plane" size="9 9 1"/><body name="thing" '
        f'pos="0 0 2"><freejoint/><frame {frame}>{geoms}</frame></body></worldbody>{extra}</mujoco>'
    )


def turned(axis: np.ndarray, angle: float) -> np.ndarray:
    quaternion = np.empty(4)
    mujoco.mju_axisAngle2Quat(quaternion, axis, angle)
    return matrix(quaternion)


def strays(model: mujoco.MjModel, at: Pivot, theta: float) -> tuple[int, int]:
    """At `theta`: at how many of the points MuJoCo finds contacts, and how many off them and the edge between them."""
    data = mujoco.MjData(model)
    R = turned(at.axis, theta) @ at.rotation
    data.qpos[:3] = [0.0, 0.0, at.radius[0] - 1e-5] - R @ at.points[0]
    mujoco.mju_mat2Quat(data.qpos[3:7], R.ravel())
    mujoco.mj_forward(model, data)
    found = (data.contact.pos - data.qpos[:3]) @ R
    edge = at.points[0] + np.linspace(0.0, 1.0, 5)[:, None] * (at.points[-1] - at.points[0])  # "subdivided" has these
    edge -= at.radius[0] * R[2]  # a ball touches below its centre
    near = np.linalg.norm(found[:, None] - edge, axis=2) < 5e-4
    return int(near[:, [0, -1]].any(axis=0)[: len(at.points)].sum()), int((~near).all(axis=1).sum())


@pytest.mark.parametrize("contact", ["vertex", "edge", "lowest"])
@pytest.mark.parametrize("body", BODIES)
def test_within_the_range_mujoco_touches_at_the_points_alone(body: str, contact: str) -> None:
    model = model_of(BODIES[body])
    if body in ("cylinder", "bottle", "pill", "skittle", "mallet") and contact == "edge":
        with pytest.raises(ModelError, match="contact = 'edge': body 'thing' lies on no face"):
            find_pivot(model, 1, contact)
        return
    at = find_pivot(model, 1, contact)
    end = at.range[1]
    assert at.range[0] == 0.0
    assert len(at.points) == 2 if contact == "edge" else len(at.points) in (1, 2)
    assert 0.0 < at.balance < np.pi / 2.0 + 0.1 * (at.radius[0] > 0.0)  # the CoM of a capsule is level with its ends
    for theta in (0.005, 0.5 * end, end - 0.005):
        touching, elsewhere = strays(model, at, theta)
        assert elsewhere == 0
        assert touching == len(at.points) or (body == "subdivided" and touching > 0)  # MuJoCo has 3 of an edge's 5
    for theta in (-0.005, end + 0.005):
        assert strays(model, at, theta)[1] > 0


@pytest.mark.parametrize("body", BODIES)
def test_at_balance_the_com_is_above_the_points(body: str) -> None:
    model = model_of(BODIES[body])
    at = find_pivot(model, 1, "vertex")
    lever = turned(at.axis, at.balance) @ at.rotation @ (model.body_ipos[1] - at.points[0])
    assert lever[2] > 0.0
    assert np.cross(at.axis, [0.0, 0.0, 1.0]) @ lever == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(at.rotation @ at.rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(at.rotation) > 0.0
    np.testing.assert_allclose(at.axis, [0.0, -1.0, 0.0], atol=1e-12)


def test_known_numbers() -> None:
    box = find_pivot(model_of('<geom type="box" size=".1 .2 .2"/>'), 1, "edge")
    assert (box.range[1], box.balance) == pytest.approx((np.pi / 2.0, np.arctan(2.0)), abs=1e-12)
    cube = find_pivot(model_of('<geom type="box" size=".1 .1 .1"/>'), 1, "edge")
    np.testing.assert_allclose(cube.points, [[-0.1, -0.1, -0.1], [-0.1, 0.1, -0.1]])
    np.testing.assert_allclose(cube.rotation, np.eye(3), atol=1e-12)
    tetrahedron = find_pivot(model_of(BODIES["tetrahedron"]), 1, "edge")
    assert tetrahedron.range[1] == pytest.approx(np.pi - np.arccos(1.0 / 3.0))
    rim = find_pivot(model_of(BODIES["cylinder"]), 1, "vertex")
    assert (rim.range[1], rim.balance) == pytest.approx((np.pi / 2.0, np.arctan(0.5)))
    bottle = find_pivot(model_of(BODIES["bottle"]), 1, "vertex")  # on the side of the rim that the CoM is on
    com = model_of(BODIES["bottle"]).body_ipos[1]
    assert bottle.balance == pytest.approx(np.arctan((0.015 - com[1]) / (0.14 + com[2])))
    slanted = find_pivot(model_of(BODIES["offset"]), 1, "edge")
    assert slanted.range[1] == pytest.approx(np.pi / 2.0, abs=1e-12)
    cap = '<geom type="box" size=".1 .1 .1"/><geom type="sphere" size=".1" pos=".1 0 .3"/>'
    ball = find_pivot(model_of(cap), 1, [[0.1, 0.1, -0.1], [0.1, -0.1, -0.1]])  # it lies on z = -0.1, the ball .4 above
    assert ball.range[1] == pytest.approx(np.pi / 2.0 - np.arcsin(0.1 / 0.4))


@pytest.mark.parametrize("body", ["offset", "irregular", "ell", "bottle", "stool", "ball on a box"])
@pytest.mark.parametrize("contact", ["vertex", "edge"])
def test_the_body_frame_does_not_matter(body: str, contact: str) -> None:
    """The same geoms elsewhere in the body frame: the same pivot, up to which of equals is chosen."""
    if (body, contact) == ("bottle", "edge"):
        return
    first = find_pivot(model_of(BODIES[body]), 1, contact)
    moved = model_of(BODIES[body], 'pos=".4 .5 -.6" euler="70 -20 130"')
    second = find_pivot(moved, 1, contact)
    assert second.range[1] == pytest.approx(first.range[1], abs=1e-5)
    assert second.balance == pytest.approx(first.balance, abs=1e-5)
    R, frame = np.empty((3, 3)), model_of('<geom type="box" size="1 1 1"/>', 'pos=".4 .5 -.6" euler="70 -20 130"')
    R = matrix(frame.geom_quat[1])
    again = find_pivot(moved, 1, first.points @ R.T + frame.geom_pos[1])
    np.testing.assert_allclose(again.points, (first.points @ R.T + frame.geom_pos[1])[:: _order(again, first, R)])
    assert again.range[1] == pytest.approx(first.range[1], abs=1e-5)
    if _order(again, first, R) == 1:
        np.testing.assert_allclose(again.rotation @ R, first.rotation, atol=1e-5)


def _order(a: Pivot, b: Pivot, R: np.ndarray) -> int:
    """-1 if the ends of the edge are in the other order."""
    return 1 if (a.points[-1] - a.points[0]) @ R @ (b.points[-1] - b.points[0]) >= 0.0 else -1


@pytest.mark.parametrize("body", sorted(set(BODIES) - {"egg and pill"}))
def test_lowest_keeps_the_orientation(body: str) -> None:
    model, rng = model_of(BODIES[body]), np.random.default_rng(7)
    table = np.array([np.cos(0.1), np.sin(0.1), 0.0, 0.0])
    for _ in range(10):
        xquat = rng.normal(size=4)
        xquat /= np.linalg.norm(xquat)
        at = find_pivot(model, 1, "lowest", xquat, table)
        now = matrix(table).T @ matrix(xquat)
        np.testing.assert_allclose(turned(at.axis, at.start) @ at.rotation, now, atol=1e-9)
        assert 0.0 < at.start < at.range[1]
        assert strays(model, at, at.start) == (1, 0)
        touching = at.points - at.radius[:, None] * now[2]
        np.testing.assert_allclose(touching, support_points(model, 1, -now[2]), atol=1e-12)


def test_lowest_edge_and_lowest_when_balanced() -> None:
    model = model_of(BODIES["box"])
    tilted = np.array([np.cos(0.15), np.sin(0.15), 0.0, 0.0])
    at = find_pivot(model, 1, "lowest", tilted)
    np.testing.assert_allclose(at.points, [[-0.1, -0.2, -0.3], [0.1, -0.2, -0.3]])
    assert (at.start, at.range[1]) == pytest.approx((0.3, np.pi / 2.0))
    cube = model_of('<geom type="box" size=".1 .1 .1"/>')
    at = find_pivot(cube, 1, "lowest", [np.cos(np.pi / 8.0), 0.0, np.sin(np.pi / 8.0), 0.0])
    assert (at.start, at.balance, at.range[1]) == pytest.approx((np.pi / 4.0, np.pi / 4.0, np.pi / 2.0))
    up = np.ones(3) / np.sqrt(3.0)
    axis = np.cross(up, [0.0, 0.0, 1.0])
    xquat = np.empty(4)
    mujoco.mju_axisAngle2Quat(xquat, axis / np.linalg.norm(axis), np.arccos(up[2]))
    at = find_pivot(cube, 1, "lowest", xquat)
    np.testing.assert_allclose(at.points, [[-0.1, -0.1, -0.1]])
    assert at.balance == pytest.approx(at.start)
    assert strays(cube, at, at.start) == (1, 0)
    assert strays(cube, at, -0.005)[1] > 0


def test_lowest_of_a_face_is_the_edge_that_the_com_is_closest_to() -> None:
    at = find_pivot(model_of(BODIES["ell"]), 1, "lowest")
    np.testing.assert_allclose(at.points, [[-0.3, -0.1, -0.05], [0.3, -0.1, -0.05]])
    np.testing.assert_allclose(at.rotation, np.eye(3), atol=1e-9)
    assert at.start == pytest.approx(0.0, abs=1e-9)


def test_ends_of_an_edge_between_two_rims_are_where_one_line_touches_both() -> None:
    at = find_pivot(model_of(BODIES["stool"]), 1, "lowest")
    along = (at.points[1] - at.points[0]) / np.linalg.norm(at.points[1] - at.points[0])
    centres = np.array([[-0.3, -0.2, 0.0], [0.3, -0.2, 0.0]])
    np.testing.assert_allclose(np.linalg.norm(at.points - centres, axis=1), [0.03, 0.02])
    np.testing.assert_allclose((at.points - centres) @ along, 0.0, atol=1e-12)


def test_an_edge_that_is_not_quite_level_is_made_so() -> None:
    xquat = np.array([np.cos(0.15), np.sin(0.15), 5e-6, 0.0])
    at = find_pivot(model_of(BODIES["box"]), 1, "lowest", xquat / np.linalg.norm(xquat))
    assert (at.rotation @ (at.points[1] - at.points[0]))[2] == pytest.approx(0.0, abs=1e-12)
    assert at.axis[2] == 0.0


def test_it_lies_on_what_it_rests_on() -> None:
    """A heavy top that does not collide: upside down the CoM would be below the table, and on a side it tips over."""
    top = '<geom type="box" size=".3 .1 .1" pos="0 0 .5" mass="9" contype="0" conaffinity="0"/>'
    at = find_pivot(model_of('<geom type="box" size=".1 .1 .1" mass="1"/>' + top), 1, "edge")
    np.testing.assert_allclose(at.rotation, np.eye(3), atol=1e-12)


def test_an_edge_above_which_the_com_can_be_brought() -> None:
    """A sheared plate: about its closest edge it lands on its slanted side after 18 degrees."""
    sheared = " ".join(f"{x - 3 * z} {y} {z}" for x in (0, 1) for y in (-1, 1) for z in (0, 0.1))
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><asset><mesh name="m" vertex="{sheared}"/></asset><worldbody><body><freejoint/>'
        '<geom type="mesh" mesh="m"/></body></worldbody></mujoco>'
    )
    at = find_pivot(model, 1, "edge")
    assert at.balance == pytest.approx(np.arctan(0.65 / 0.05), abs=1e-4)
    assert at.range[1] == pytest.approx(np.pi - np.arctan(1.0 / 3.0), abs=1e-4)
    near = find_pivot(model, 1, [[-0.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
    assert near.range[1] == pytest.approx(np.arctan(1.0 / 3.0), abs=1e-4)


def test_a_vertex_is_not_taken_for_the_edge_that_it_ends() -> None:
    """The CoM is above an edge: about its end, towards the CoM, the body would turn on all of the edge."""
    top = '<geom type="box" size=".1 .1 .1" pos="0 -.1 .5" mass="1000" contype="0" conaffinity="0"/>'
    model = model_of('<geom type="box" size=".1 .1 .1" mass="1e-6"/>' + top)
    at = find_pivot(model, 1, [-0.1, -0.1, -0.1])
    assert strays(model, at, 0.5 * at.range[1]) == (1, 0)


def test_a_rim_stays_put_only_about_its_tangent() -> None:
    """Standing on a slanted rim and a corner, it would roll on the rim while it turns about the line through both."""
    parts = [
        '<geom type="cylinder" size=".1 .2" {} euler="0 20 0"/>',
        '<geom type="box" size=".1 .1 .1" {} euler="40 30 20"/>',
    ]
    lowest = [support_points(model_of(part.format("")), 1, [0.0, 0.0, -1.0])[0] for part in parts]
    for way, works in (([0.0, 0.5], True), ([0.3, 0.4], False)):
        places = [-lowest[0], np.array([*way, 0.0]) - lowest[1]]
        geoms = "".join(part.format(f'pos="{" ".join(map(str, at))}"') for part, at in zip(parts, places, strict=True))
        model = model_of(geoms)
        if works:
            at = find_pivot(model, 1, "lowest", [1.0, 0.0, 0.0, 0.0])
            np.testing.assert_allclose(at.points, [[0.0, 0.0, 0.0], [0.0, 0.5, 0.0]], atol=1e-12)
            assert strays(model, at, 0.5 * at.range[1]) == (2, 0)
        else:  # not about the line: about the rim's lowest point alone, sideways
            at = find_pivot(model, 1, "lowest", [1.0, 0.0, 0.0, 0.0])
            assert len(at.points) == 1
            assert strays(model, at, 0.5 * at.range[1]) == (1, 0)


def test_corners_are_those_of_the_whole_body() -> None:
    assert len(contact_points(model_of(BODIES["ell"]), 1)) == 10  # 16, of which four are inside and two under an edge
    assert len(contact_points(model_of(BODIES["subdivided"]), 1)) == 8
    assert contact_points(model_of(BODIES["cylinder"]), 1).shape == (0, 3)
    hidden = '<geom type="box" size=".1 .1 .1"/><geom type="sphere" size=".18"/><geom type="box" size=".3 .01 .01"/>'
    np.testing.assert_allclose(np.abs(contact_points(model_of(hidden), 1)), np.tile([0.3, 0.01, 0.01], (8, 1)))
    ghost = '<geom type="box" size=".1 .1 .1"/><geom type="box" size="1 1 1" contype="0" conaffinity="0"/>'
    np.testing.assert_allclose(np.abs(contact_points(model_of(ghost), 1)), 0.1)
    paired = ghost.replace('size="1 1 1"', 'name="pair" size="1 1 1"')
    pair = '<contact><pair geom1="pair" geom2="table"/></contact>'
    np.testing.assert_allclose(np.abs(contact_points(model_of(paired, extra=pair), 1)), 1.0)
    model = model_of(BODIES["irregular"])
    wanted = matrix(model.geom_quat[1]) @ model.mesh_vert[4:18].T.astype(float) + model.geom_pos[1][:, None]
    some = contact_points(model, 1)
    assert 8 <= len(some) < 14
    assert np.linalg.norm(some[:, None] - wanted.T, axis=2).min(axis=1).max() < 1e-9
    for down in np.random.default_rng(0).normal(size=(50, 3)):
        assert (some @ down).max() == pytest.approx((down @ wanted).max(), rel=1e-6)


def test_what_touches() -> None:
    box = model_of(BODIES["box"])
    np.testing.assert_allclose(support_points(box, 1, [1.0, 2.0, -3.0]), [[0.1, 0.2, -0.3]])
    np.testing.assert_allclose(sorted(support_points(box, 1, [0.0, 9.0, 9.0])[:, 0]), [-0.1, 0.1])
    face = support_points(box, 1, [0.0, 0.0, -1.0])
    assert len(face) == 4
    assert np.linalg.norm(np.roll(face, 1, axis=0) - face, axis=1).sum() == pytest.approx(1.2)  # in order around it
    row = '<geom type="box" size=".1 .1 .1"/><geom type="box" size=".1 .1 .1" pos=".2 0 0"/>'
    ends = support_points(model_of(row), 1, [0.0, 1.0, 1.0])
    np.testing.assert_allclose(ends[ends[:, 0].argsort()], [[-0.1, 0.1, 0.1], [0.3, 0.1, 0.1]])
    upright = model_of('<geom type="cylinder" size=".1 .2"/>')
    np.testing.assert_allclose(support_points(upright, 1, [3.0, 4.0, -1.0]), [[0.06, 0.08, -0.2]])
    rim = support_points(upright, 1, [0.0, 0.0, 1.0])
    np.testing.assert_allclose(np.hypot(*rim[:, :2].T), 0.1)
    np.testing.assert_allclose(rim[:, 2], [0.2] * 4)
    assert len(support_points(box, 1, [0.0, 1e-3, -1.0])) == 2
    assert len(support_points(box, 1, [0.0, 1e-3, -1.0], tolerance=1e-2)) == 4


def test_contacts_given_by_hand() -> None:
    model = model_of(BODIES["box"])
    for given, end in (([0.1, 0.2, 0.3], np.pi / 2.0), ([[0.1, 0.2, 0.3], [0.1, -0.2, 0.3]], np.pi / 2.0)):
        at = find_pivot(model, 1, np.array(given) + 1e-4)
        np.testing.assert_allclose(np.sort(at.points, axis=0), np.sort(np.atleast_2d(given), axis=0))
        assert at.range[1] == pytest.approx(end)
        np.testing.assert_allclose(at.rotation[2], [-1.0, 0.0, 0.0], atol=1e-12)  # the lowest CoM: on x = 0.1
    upright = model_of('<geom type="cylinder" size=".1 .2"/>')
    at = find_pivot(upright, 1, [0.06, 0.08, 0.2])
    np.testing.assert_allclose(at.rotation[0], [-0.6, -0.8, 0.0], atol=1e-9)
    assert strays(upright, at, 1.0) == (1, 0)
    for corner in contact_points(model_of(BODIES["irregular"]), 1):
        at = find_pivot(model_of(BODIES["irregular"]), 1, corner)
        assert strays(model_of(BODIES["irregular"]), at, 0.5 * at.range[1]) == (1, 0)


@pytest.mark.parametrize(
    ("geoms", "contact", "words"),
    [
        ('<geom type="sphere" size=".1"/>', "vertex", "body = 'thing': it is all sphere or ellipsoid, and these roll"),
        ('<geom type="sphere" size=".3"/><geom type="box" size=".1 .1 .1"/>', "lowest", "'lowest': .* lies on no face"),
        ('<geom type="sphere" size=".3"/><geom type="box" size=".1 .1 .1"/>', "vertex", "'vertex': .* lies on no face"),
        ('<geom type="ellipsoid" size=".1 .2 .3"/>', [0.0, 0.0, 0.3], "it is all sphere or ellipsoid, and these roll"),
        (
            BODIES["pill"],
            "edge",
            "lies on no face .* about a line that ends on a round end it would only roll; must be",
        ),
        (BODIES["pill"], [[0.0, 0.0, -0.2], [0.0, 0.0, 0.2]], "a line that ends on a round end rolls; must be"),
        (BODIES["pill"], [0.0, 0.0, 0.05], "the nearest is 0, 0, 0.2, the centre of a round end of radius 0.1$"),
        ('<geom type="box" size="1 1 1" contype="0" conaffinity="0"/>', "vertex", "'thing': it has no colliding geom"),
        (BODIES["box"], "corner", "contact = 'corner': must be vertex, edge, lowest, or one or two corners"),
        (BODIES["box"], [0.1, 0.2, 0.32], r"contact = \[0.1, 0.2, 0.32\]: no corner .* the nearest is 0.1, 0.2, 0.3$"),
        (BODIES["box"], [0.1, 0.2, 0.0], "no corner of body 'thing'"),
        (BODIES["box"], [[0.1, 0.2, 0.3], [-0.1, -0.2, 0.3]], r"contact = .*tilted so, with nothing else touching"),
        (BODIES["box"], [[0.1, 0.2, 0.3]] * 2, "contact = .*: twice the same corner"),
        (BODIES["box"], np.zeros((3, 3)), "contact = .*one or two corners"),
        (BODIES["box"], [0.1, 0.2], r"contact = \[\[0.1, 0.2\]\]: must be"),
        (BODIES["box"], [0.1, 0.2, np.nan], "contact = .*nan.*: must be"),
        ('<geom type="cylinder" size=".1 .2" euler="90 0 0"/>', "lowest", "its geom .*#1.* rolls: no material point"),
        ('<geom type="cylinder" size=".1 .2"/>', [0.0, 0.0, 0.2], "no corner .* the nearest is 0.1, 0, 0.2"),
        (
            BODIES["box"] + '<geom type="ellipsoid" size=".1 .2 .1" pos="0 0 -.3"/>',
            "lowest",
            "geom .*#2.* it rolls",
        ),
        (
            '<geom type="sdf" mesh="irregular"/>',
            "vertex",
            "geom .*#?1.* is of type sdf; must be mesh, box, cyl",
        ),
    ],
)
def test_refusals(geoms: str, contact: object, words: str) -> None:
    with pytest.raises(ModelError, match=words):
        find_pivot(model_of(geoms), 1, contact)


def test_the_kind_that_was_refused_is_not_looked_for_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """However the word came about: one read from a command line is another object than the one compared with."""
    asked: list[object] = []
    monkeypatch.setattr(candidates, "search", lambda body, contact, *_: asked.append(contact) or iter(()))
    with pytest.raises(ModelError, match="contact = 'edge'"):
        find_pivot(model_of(BODIES["box"]), 1, "".join(["ed", "ge"]))
    assert asked == ["edge", "edge", "vertex"]  # what is asked for, with and without its arc; then a way out
