"""What is read of MuJoCo's contacts, against its own net force sensor and mj_contactForce, step by step."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from pivoting.models.rigid_body import initial_data
from pivoting.sim import simulate
from pivoting.sim.contact_sensing import Declared

from tests.own_files import BOX, FLOOR, mjcf, own, pivoted

PLATE = "".join(f'<geom name="p{i}" type="box" size=".05 .04 .06" pos="{x} 0 0"/>' for i, x in enumerate("000"))
FRAME = "".join(
    f'<geom name="bar{i}" type="box" size=".05 .005 .06" pos="0 {y} 0"/>' for i, y in enumerate((-0.04, 0.0, 0.035))
)
PILL = '<geom name="g" type="capsule" size=".03 .07" mass=".4"/>'
PLANAR = '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/><joint type="hinge" axis="0 1 0"/>'
TILTED = FLOOR.replace("/>", ' euler="0 -8 0"/>')
CASES = {
    "edge": (mjcf(), "edge"),
    "vertex": (mjcf(), "vertex"),
    "three boxes in one place": (mjcf(PLATE), "edge"),
    "bars along the edge": (mjcf(FRAME), "edge"),
    "rolls": (mjcf(PILL, pose='pos="0 0 .1"'), "vertex"),
    "planar": (mjcf(joint=PLANAR), "corner"),
    "tilted": (mjcf(floor=TILTED, pose='pos="-.00835 0 .05942" euler="0 -8 0"'), "edge"),
}  # fmt: skip


@pytest.mark.parametrize("kind", CASES)
def test_forces_add_up_to_mujocos(kind: str, tmp_path: Path) -> None:
    """Net force and moment of what is declared, at every tenth step of a replay."""
    text, contact = CASES[kind]
    run = pivoted(tmp_path, text, contact)
    assert run.verdict == "pass"
    assert run.measures.undeclared_contact_s[0] == 0.0
    model, data, body = run.model, initial_data(run.model), run.truth.index
    data.qpos[:], data.qvel[:] = (values[0] for values in run.start)
    sunk = 3.0 * float(run.log.contacts.depth.max() * np.abs(run.force_measured).max())  # MuJoCo puts it half as deep
    force = run.force_measured[0] @ (run.table_axes @ run.space.force_map).T
    for k in range(len(run.time) - 1):
        data.xfrc_applied[body] = run.wrench_world[0, k]
        mujoco.mj_step(model, data)  # forces of the step that it makes
        if k % 10:
            continue
        net, moment, one = np.zeros(3), np.zeros(3), np.empty(6)
        here = run.position[0, k]
        for i, contact_ in enumerate(data.contact):
            mujoco.mj_contactForce(model, data, i, one)
            sign = 1.0 if int(model.geom_bodyid[contact_.geom2]) == body else -1.0
            pushed = sign * contact_.frame.reshape(3, 3).T @ one[:3]
            net, moment = net + pushed, moment + np.cross(contact_.pos - here, pushed)
        sensed = data.sensor("pivoting/touching").data[1:4]
        mine = force[k].sum(axis=0)
        if run.truth.dim == 3:
            np.testing.assert_allclose(mine, net, atol=1e-9)
            levers = run.lever[0, k] @ run.table_axes.T
            np.testing.assert_allclose(np.cross(levers, force[k]).sum(axis=0), moment, atol=sunk)
        else:
            np.testing.assert_allclose(mine, net * [1.0, 0.0, 1.0], atol=1e-9)
        np.testing.assert_allclose(np.abs(sensed), np.abs(net), atol=1e-9)
        assert run.contacts_found[0, k] == len(data.contact)


def declared(points: list[list[float]], near: float = 1e-3) -> Declared:
    at = np.array(points)
    return Declared(at, np.zeros_like(at), np.eye(3)[:2], near, False)


def test_a_force_amid_an_edge_is_shared_by_the_law_of_the_lever() -> None:
    ends = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    points = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.1], [2.0, 0.0, 0.0], [2.3, 0.0, 0.0], [1.0, 0.4, 0.0]])
    found = [declared(ends.tolist()).share(point, ends) for point in points]
    np.testing.assert_allclose([share for share, _ in found], [[1, 0], [0.75, 0.25], [0, 1], [0, 1], [0.5, 0.5]])
    np.testing.assert_allclose([away for _, away in found], [0.0, 0.0, 0.0, 0.3, 0.4], atol=1e-15)


def test_of_points_the_nearest_carries_it() -> None:
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    found = [declared(corners.tolist()).share(np.array(point), corners) for point in ([0.9, 0.0, 5.0], [0.1, 0.8, 0.0])]
    np.testing.assert_allclose([share for share, _ in found], [[0, 1, 0], [0, 0, 1]])
    np.testing.assert_allclose([away for _, away in found], [0.1, np.hypot(0.1, 0.2)])


def test_what_leaves_the_table_is_missed(tmp_path: Path) -> None:
    """Thrown, in a world of little gravity: contact is lost, and said to be."""
    run = simulate(own(tmp_path, mjcf(BOX)), world={"gravity": 0.5})
    assert run.verdict == "fail"
    lost = ~(run.force_measured[0, :, :, -1] > 0.0).any(axis=1)
    assert run.measures.contact_lost_s[0] >= 0.9 * np.count_nonzero(lost[100:]) * run.dt > 0.0
