"""Drawn shapes against their volumes, and MuJoCo's own masses and centres of mass."""

import mujoco
import numpy as np
import pytest
from pivoting.models.rigid_body import read_body
from pivoting.sim.drawing.shapes import SIDES, body_solids, cone

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
