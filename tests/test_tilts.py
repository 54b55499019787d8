"""Ranges, and whether there is a contact at all, against a body that is turned step by step: see tilt_oracle."""

import mujoco
import numpy as np
import pytest
from pivoting.models.candidates import stance
from pivoting.models.naming import ModelError
from pivoting.models.tilt import Arc, Stance

from tests.tilt_oracle import Elements, arcs_about_vertices, longest_about_edges, mjcf, random_shapes, range_end

KINDS = ("box", "mesh", "cylinder", "capsule", "sphere", "ellipsoid")


def found(model: mujoco.MjModel, contact: object, least: float) -> Stance | None:
    """A contact with a range of at least `least` [rad], or None if it is refused for want of one."""
    try:
        return stance(model, 1, contact, arc=Arc(0.0, least))  # type: ignore[arg-type]
    except ModelError:
        return None


def cloud(rng: np.random.Generator) -> tuple[np.ndarray, mujoco.MjModel, Elements]:
    """Points on an ellipsoid, and a body of them whose CoM is anywhere within: near a point it is under few tilts."""
    points = rng.normal(size=(rng.integers(6, 50), 3))
    points *= rng.uniform(0.03, 0.1, 3) / np.linalg.norm(points, axis=1, keepdims=True)
    com = 0.7 * rng.dirichlet(np.full(len(points), 0.2)) @ points + 0.3 * points[0]
    shapes = [("mesh", points, np.zeros(3), np.eye(3))]
    return points, mujoco.MjModel.from_xml_string(mjcf(shapes, com)), Elements(shapes)


@pytest.mark.parametrize("seed", range(16))
def test_ranges_are_those_of_a_body_turned_step_by_step(seed: int) -> None:
    shapes = random_shapes(np.random.default_rng(seed), KINDS)
    model, elements = mujoco.MjModel.from_xml_string(mjcf(shapes)), Elements(shapes)
    for contact, least in (("vertex", 0.1), ("vertex", 0.6), ("vertex", 1.0), ("edge", 0.1), ("edge", 0.6)):
        at = found(model, contact, least)
        if at is not None:
            first, last = range_end(elements, at, 1e-6)
            assert at.range[1] >= least
            assert (first, last) == pytest.approx((0.0, at.range[1]), abs=5e-3)


@pytest.mark.parametrize("seed", range(16))
def test_no_vertex_of_a_cloud_is_missed(seed: int) -> None:
    """Also where the tilt towards the CoM digs a neighbour in, and another does not."""
    _, model, elements = cloud(np.random.default_rng(100 + seed))
    longest = max(arc for _, arc in arcs_about_vertices(elements))
    for share in (0.5, 0.8, 0.95):
        at = found(model, "vertex", share * longest)
        assert at is not None
        assert range_end(elements, at, 1e-6) == pytest.approx((0.0, at.range[1]), abs=5e-3)
    assert found(model, "vertex", longest + 0.08) is None


@pytest.mark.parametrize("seed", range(16))
def test_no_edge_of_a_cloud_is_missed(seed: int) -> None:
    points, model, _ = cloud(np.random.default_rng(200 + seed))
    longest = longest_about_edges(points)
    for least in (0.5 * longest, longest - 0.01):
        assert found(model, "edge", least) is not None
    assert found(model, "edge", longest + 0.01) is None


@pytest.mark.parametrize("seed", range(16))
def test_each_corner_round_end_and_point_of_a_rim_has_the_arc_that_there_is(seed: int) -> None:
    shapes = random_shapes(np.random.default_rng(300 + seed), KINDS)
    model = mujoco.MjModel.from_xml_string(mjcf(shapes))
    for point, arc in arcs_about_vertices(Elements(shapes)):
        if 0.1 < arc < 3.0:
            at = found(model, point, 0.9 * arc - 0.02)
            assert at is not None
            assert range_end(Elements(shapes), at, 1e-6)[1] == pytest.approx(at.range[1], abs=5e-3)
            assert found(model, point, arc + 0.1) is None
