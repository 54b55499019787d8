"""Whether the simulator holds an edge, asked of MuJoCo by hand: a body on it, one end deeper than the other."""

import mujoco
import numpy as np
import pytest
from pivoting.models.placement.contact_candidates import find_pivot
from pivoting.models.placement.contact_search import search
from pivoting.models.placement.convex_hull import read_hull
from pivoting.models.placement.edge_grip import Grip, grip
from pivoting.models.placement.tilt_range import Arc, Pivot
from pivoting.models.rigid_body import read_body
from scipy.spatial.transform import Rotation

ARC = Arc(np.deg2rad(5.0), np.deg2rad(25.0), np.deg2rad(0.1))
DEEP, LEANING = 2e-5, 1e-5  # [m] the middle of the edge, and how much more or less its ends


def cloud(seed: int) -> mujoco.MjModel:
    """A mesh of random points."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(int(rng.integers(5, 14)), 3)) * [0.1, 0.15, 0.2]
    vertices = " ".join(f"{x:.6g}" for x in points.ravel())
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><asset><mesh name="m" vertex="{vertices}"/></asset><worldbody><geom type="plane" size="1 1 1"/>'
        '<body name="box" pos="0 0 1"><freejoint/><geom type="mesh" mesh="m"/></body></worldbody></mujoco>'
    )


def ends_held(model: mujoco.MjModel, one: Pivot, theta: float, deeper: int) -> int:
    """At how many ends of an edge MuJoCo makes contacts, that of index `deeper` being the deeper one."""
    data = mujoco.MjData(model)
    turned = Rotation.from_rotvec(theta * one.axis) * Rotation.from_matrix(one.rotation)
    ends = turned.apply(one.points)
    along = ends[1] - ends[0]
    across = np.cross([0.0, 0.0, 1.0], along / np.linalg.norm(along))
    lean = np.arctan(2.0 * LEANING / np.linalg.norm(along)) * (1.0 if deeper else -1.0)
    turned = Rotation.from_rotvec(lean * across) * turned
    ends = turned.apply(one.points)
    data.qpos[:3] = -ends.mean(axis=0) - [0.0, 0.0, DEEP]
    data.qpos[3:] = np.roll(turned.as_quat(), 1)
    mujoco.mj_forward(model, data)
    places = ends + data.qpos[:3]
    assert places[:, 2].argmin() == deeper
    gaps = np.linalg.norm(data.contact.pos[:, None, :2] - places[:, :2], axis=2)
    return int((gaps < 1e-3).any(axis=0).sum())


@pytest.mark.parametrize("seed", [30, 32, 37, 46, 50])
def test_it_tells_edges_that_are_held_whichever_end_is_deeper(seed: int) -> None:
    model = cloud(seed)
    held, kinds = grip(model, read_body(model, "box"), ARC), set()
    for one in search(read_hull(model, 1), "edge", ARC, None):
        kinds.add(kind := held(one))
        found = [[ends_held(model, one, theta, end) for theta in np.linspace(0.1, 0.4, 7)] for end in (0, 1)]
        both = [min(ends) == 2 for ends in found]
        assert kind is (Grip.FIRM if all(both) else Grip.ONE_SIDED), (one.points, found)
    assert kinds == {Grip.FIRM, Grip.ONE_SIDED}


def test_an_edge_that_is_held_whichever_end_is_deeper_is_taken_first() -> None:
    passed_over = 0
    for seed in range(30, 60):
        model = cloud(seed)
        held = grip(model, read_body(model, "box"), ARC)
        assert held(find_pivot(model, 1, "edge", arc=ARC, gripped=held)) is Grip.FIRM
        passed_over += held(find_pivot(model, 1, "edge", arc=ARC)) is Grip.ONE_SIDED
    assert passed_over > 0
