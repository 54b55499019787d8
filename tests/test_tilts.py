"""About what a body can be tilted, and how far, against an oracle that tries normals of the table one after another."""

from collections.abc import Callable

import mujoco
import numpy as np
import pytest
from pivoting.models.errors import ModelError
from pivoting.models.placement.contact_search import search
from pivoting.models.placement.convex_hull import Hull, read_hull
from pivoting.models.placement.tilt_range import LEAST, Arc, Pivot
from scipy.spatial.transform import Rotation

from tests.tilt_oracle import STEP, Array, Shape, edge_range, rim_range, vertex_range

TOUCHES = 2e-4  # of the size: a plane that close is touched
CLOSE = LEAST + 2.0 * STEP  # [rad]: a range of less than LEAST is none
SIGNS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
Built = tuple[mujoco.MjModel, Shape]


def built(geoms: str, assets: str = "") -> Built:
    """A body of these geoms, and its corners, balls and rims as MuJoCo has compiled them, in its frame."""
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><asset>{assets}</asset><worldbody><geom type="plane" size="9 9 1"/><body name="thing" pos="0 0 2">'
        f"<freejoint/>{geoms}</body></worldbody></mujoco>"
    )
    corners, balls, rims = [], [], []
    for geom in range(1, model.ngeom):
        turn = Rotation.from_quat(model.geom_quat[geom][[1, 2, 3, 0]]).as_matrix()
        at, size = model.geom_pos[geom], model.geom_size[geom]
        kind = mujoco.mjtGeom(int(model.geom_type[geom])).name.removeprefix("mjGEOM_")
        if kind == "MESH":
            corners += list(at + model.mesh_vert[: model.mesh_vertnum[0]].astype(float) @ turn.T)
        elif kind == "BOX":
            corners += list(at + SIGNS * size @ turn.T)
        elif kind == "SPHERE":
            balls.append((at, size[0]))
        else:
            for end in (-size[1], size[1]):
                middle = at + end * turn[:, 2]
                balls += [(middle, size[0])] * (kind == "CAPSULE")
                rims += [(middle, turn[:, 2], size[0])] * (kind == "CYLINDER")
    return model, Shape(
        np.reshape(corners, (-1, 3)),
        np.reshape([ball[0] for ball in balls], (-1, 3)),
        np.array([ball[1] for ball in balls]),
        np.reshape([rim[0] for rim in rims], (-1, 3)),
        np.reshape([rim[1] for rim in rims], (-1, 3)),
        np.array([rim[2] for rim in rims]),
    )


def mesh(points: Array) -> Built:
    vertices = " ".join(f"{x:.9g}" for x in points.ravel())
    return built('<geom type="mesh" mesh="m"/>', f'<mesh name="m" vertex="{vertices}"/>')


def cloud(rng: np.random.Generator) -> Built:
    return mesh(rng.normal(size=(int(rng.integers(5, 13)), 3)) * rng.uniform(0.05, 0.3, 3))


def prism(rng: np.random.Generator) -> Built:
    """A regular one or not, sheared and tapered; its corners stand out by more than what counts as touching."""
    gaps = rng.uniform(0.3, 1.5, int(rng.integers(4, 9))) if rng.random() < 0.5 else np.ones(6)
    turn = 2.0 * np.pi * np.cumsum(gaps) / gaps.sum()
    around = np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1) * rng.uniform(0.05, 0.2)
    return mesh(np.concatenate([around, rng.uniform(0.4, 1.0) * around + rng.uniform(0.05, 0.3, 3)]))


def posed(rng: np.random.Generator) -> str:
    pos, euler = rng.uniform(-0.1, 0.1, 3), rng.uniform(-180.0, 180.0, 3)
    return f'pos="{pos[0]:.6g} {pos[1]:.6g} {pos[2]:.6g}" euler="{euler[0]:.6g} {euler[1]:.6g} {euler[2]:.6g}"'


def boxes(rng: np.random.Generator) -> Built:
    sizes = rng.uniform(0.03, 0.2, (int(rng.integers(1, 3)), 3))
    return built("".join(f'<geom type="box" size="{a:.6g} {b:.6g} {c:.6g}" {posed(rng)}/>' for a, b, c in sizes))


def discs(rng: np.random.Generator) -> Built:
    disc = f'<geom type="cylinder" size="{rng.uniform(0.05, 0.2):.6g} {rng.uniform(0.01, 0.1):.6g}" {{}}/>'
    box = f'<geom type="box" size=".1 .05 .08" {posed(rng)}/>' * (rng.random() < 0.7)
    return built(disc.format(posed(rng)) + box)


def capsules(rng: np.random.Generator) -> Built:
    capsule = f'<geom type="capsule" size="{rng.uniform(0.03, 0.1):.6g} {rng.uniform(0.02, 0.2):.6g}" {posed(rng)}/>'
    return built(capsule + f'<geom type="box" size=".1 .05 .08" {posed(rng)}/>')


KINDS: list[Callable[[np.random.Generator], Built]] = [cloud, prism, boxes, discs, capsules]
BODIES = [(kind, seed) for kind in KINDS for seed in range(3)]
each_body = pytest.mark.parametrize(("kind", "seed"), BODIES, ids=lambda value: getattr(value, "__name__", str(value)))


def numbers(shape: Shape, one: Pivot) -> list[int]:
    """Which of the shape's corners, balls and rims a pivot is about."""
    if one.radius[0] > 0.0:
        return [len(shape.corners) + int(np.linalg.norm(shape.balls - one.points[0], axis=1).argmin())]
    found = []
    for point in one.points:
        off = np.linalg.norm(shape.corners - point, axis=1)
        level = np.abs(np.einsum("ri,ri->r", point - shape.rims, shape.rim_axes))
        away = level + np.abs(np.linalg.norm(point - shape.rims, axis=1) - shape.rim_radii)
        every = np.concatenate([off, np.full(len(shape.balls), np.inf), away])
        assert every.min() < 1e-6 * shape.size
        found.append(int(every.argmin()))
    return found


def range_of(body: Hull, contact: Array | str, least: float = 0.0) -> float:
    """[rad] about points given by hand, or any of a kind; 0 if it cannot be tilted so, or by less than `least`."""
    try:
        return next((one.range[1] for one in search(body, contact, Arc(0.0, least), None)), 0.0)
    except ModelError:  # of points inside the body
        return 0.0


@each_body
def test_what_is_found_can_be_tilted_as_far_as_is_said(kind: Callable[..., Built], seed: int) -> None:
    """Within its range it touches with nothing else, and at both ends it does, or lies on the rim that it is about."""
    model, shape = kind(np.random.default_rng(seed))
    tested = 0
    for word in ("vertex", "edge"):
        for one, _ in zip(search(read_hull(model, 1), word, None, None), range(25), strict=False):
            held, end = numbers(shape, one), one.range[1]
            normals = np.array([one.up(theta) for theta in np.linspace(0.0, end, 200)])
            clear = shape.clearance(normals, held) / shape.size
            heights = normals @ one.points.T - one.radius
            assert np.abs(heights - shape.heights(normals)[:, held]).max() < TOUCHES * shape.size  # they are the lowest
            assert clear[1:-1].min() > -1e-6, (word, one.points, np.rad2deg(end))
            for ends in (0, -1) if end < np.pi - 1e-6 else (0,):
                flat = np.linalg.norm(np.cross(shape.rim_axes, normals[ends]), axis=1) < TOUCHES
                lies = any(flat[k - shape.points] for k in held if k >= shape.points)
                assert clear[ends] < TOUCHES or lies, (word, one.points, np.rad2deg(end))
            tested += 1
    assert tested > 0


@each_body
def test_every_edge_has_the_range_of_the_oracle(kind: Callable[..., Built], seed: int) -> None:
    model, shape = kind(np.random.default_rng(seed))
    body, widest = read_hull(model, 1), 0.0
    for i, j in zip(*np.triu_indices(len(shape.corners), 1), strict=True):
        wanted = edge_range(shape, i, j)
        assert range_of(body, shape.corners[[i, j]]) == pytest.approx(wanted, abs=CLOSE), (i, j)
        widest = max(widest, wanted)
    assert range_of(body, "edge", widest - CLOSE) >= widest - CLOSE


@each_body
def test_every_corner_and_ball_is_tilted_as_far_as_the_oracle_can(kind: Callable[..., Built], seed: int) -> None:
    rng = np.random.default_rng(seed)
    model, shape = kind(rng)
    body, widest = read_hull(model, 1), 0.0
    for held, point in enumerate(np.concatenate([shape.corners, shape.balls])):
        most = 0.98 * min(vertex_range(shape, held, rng), np.pi)
        if most > np.deg2rad(5.0):
            assert range_of(body, point, most) >= most, (held, np.rad2deg(most))
            widest = max(widest, most)
    assert range_of(body, "vertex", widest) >= widest


@pytest.mark.parametrize("seed", range(6))
def test_points_of_rims_have_the_range_of_the_oracle(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model, shape = discs(rng)
    body = read_hull(model, 1)
    for rim, (centre, axis, radius) in enumerate(zip(shape.rims, shape.rim_axes, shape.rim_radii, strict=True)):
        first = np.linalg.svd(axis[None])[2][1]
        for turn in rng.uniform(0.0, 2.0 * np.pi, 6):
            point = centre + radius * (np.cos(turn) * first + np.sin(turn) * np.cross(axis, first))
            assert range_of(body, point) == pytest.approx(rim_range(shape, rim, point), abs=CLOSE), (rim, turn)
