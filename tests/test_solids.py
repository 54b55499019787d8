"""Drawn shapes against their volumes, and MuJoCo's own masses and centres of mass; a camera against what it sees."""

import mujoco
import numpy as np
import pytest
from pivoting.models.rigid_body import read_body
from pivoting.models.support_surfaces import Surface
from pivoting.sim.drawing.camera import ROOM, fitted
from pivoting.sim.drawing.shapes import SIDES, body_solids, cone, shadow
from scipy.spatial import Delaunay
from scipy.spatial.transform import Rotation

TETRAHEDRON = '<asset><mesh name="tetrahedron" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>'


@pytest.mark.parametrize(
    ("geom", "edges"),
    [
        ('type="box" size="0.1 0.2 0.3"', 12),
        ('type="sphere" size="0.2"', 0),
        ('type="ellipsoid" size="0.1 0.2 0.3"', 0),
        ('type="capsule" size="0.1 0.2"', 0),
        ('type="cylinder" size="0.1 0.2"', 2 * SIDES),
        ('type="mesh" mesh="tetrahedron"', 6),
    ],
)
def test_a_geom_is_where_and_as_large_as_mujoco_has_it(geom: str, edges: int) -> None:
    """Volume within what 32 sides cut off, CoM at the origin of the object axes, normals outward."""
    pose = 'pos="0.3 -0.2 0.1" euler="20 30 40"'
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco>{TETRAHEDRON}<worldbody><geom name="table" type="plane" size="1 1 1"/>
        <body name="block"><freejoint/><geom density="1" {geom} {pose}/>
        <geom type="box" size="9 9 9" contype="0" conaffinity="0" mass="0"/></body></worldbody></mujoco>"""
    )
    (solid,) = body_solids(model, read_body(model, "block"))  # what does not collide is left out
    corners = solid.vertices.reshape(-1, 3, 3)
    volumes = np.linalg.det(corners) / 6.0
    assert volumes.sum() == pytest.approx(model.body_mass[1], rel=0.02)
    assert np.abs(volumes @ corners.mean(axis=1) * 0.75).max() < 1e-6 * volumes.sum()
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.allclose(across / np.linalg.norm(across, axis=1, keepdims=True), solid.normals[::3], atol=1e-6)
    assert len(solid.lines) == edges


def test_a_cone_has_its_slope_and_is_cut_at_its_floor() -> None:
    vertices, triangles, lines = cone(0.5, 1.0, 3.0, dim=3)
    assert np.allclose(np.hypot(vertices[:, 0], vertices[:, 1]), 0.5 * vertices[:, 2])
    assert set(vertices[:, 2]) == {1.0, 3.0}
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    assert area == pytest.approx(np.pi * 0.5 * np.hypot(1.0, 0.5) * (3.0**2 - 1.0**2), rel=0.01)
    wedge, quad, planar = cone(0.5, 1.0, 3.0, dim=2)
    assert not wedge[:, 1].any()
    assert quad.shape == (2, 3)
    assert len(planar) == 2
    assert len(lines) > len(planar)


@pytest.mark.parametrize("disc", [False, True])
def test_a_shadow_covers_what_is_below_a_body_and_on_the_face(disc: bool) -> None:
    """Counted on a grid, against another way to tell what is inside a hull; nothing where there is none."""
    rng = np.random.default_rng(0)
    axes = Rotation.from_euler("xyz", [0.3, -0.2, 0.5]).as_matrix()
    half = np.array([0.5, 0.5] if disc else [0.4, 0.6])
    surface = Surface(0, axes, np.array([1.0, 2.0, 3.0]), half, 1.0, disc)
    grid = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 201)] * 2), axis=-1).reshape(-1, 2)
    on_face = np.linalg.norm(grid, axis=1) <= half[0] if disc else (np.abs(grid) <= half).all(axis=1)
    for _ in range(20):
        local = rng.normal([*rng.uniform(-0.5, 0.5, 2), 1.0], 0.3, (30, 3))
        outline = shadow(surface.origin + local @ axes.T, surface)
        below = Delaunay(local[:, :2]).find_simplex(grid) >= 0
        x, y = outline.T
        area = 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))  # positive: counter-clockwise
        assert area == pytest.approx(1e-4 * np.count_nonzero(below & on_face), abs=0.012)
    assert len(shadow(surface.origin + np.add(local, [9.0, 0.0, 0.0]) @ axes.T, surface)) == 0


@pytest.mark.parametrize("aspect", [0.5, 1.0, 1.8])
def test_a_camera_is_as_near_as_it_can_be(aspect: float) -> None:
    """All points in view, as far to one side as to the other; from a little nearer they would not be."""
    rng = np.random.default_rng(1)
    for size in (1e-3, 1.0, 10.0):
        points = size * rng.normal([3.0, 2.0, 1.0], [1.0, 0.3, 0.6], (50, 3))
        camera = fitted(points, rng.normal(size=3), np.array([0.0, 0.0, 1.0]), aspect)
        right = np.cross(camera.forward, camera.up)
        assert np.allclose([np.linalg.norm(right), camera.forward @ camera.up], [1.0, 0.0])
        assert camera.up[2] > 0.0
        for eye, fits in ((camera.eye, True), (camera.eye + 0.05 * size * camera.forward, False)):
            away = points - eye
            seen = away @ np.column_stack([right, camera.up]) / (away @ camera.forward)[:, None]
            seen /= ROOM * camera.high * np.array([aspect, 1.0])
            assert (np.abs(seen).max() <= 1.0 + 1e-9) == fits
        assert (away @ camera.forward).min() > 0.0
