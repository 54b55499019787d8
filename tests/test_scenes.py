"""The shipped scenes and what changes them; reading bodies and placing them."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from pivoting.controller.plane_and_space import space
from pivoting.models import ModelError, corner, load, place, read_body, scene_path
from pivoting.sim import SCENARIOS
from pivoting.sim.placement import placed


@pytest.mark.parametrize("name", sorted(SCENARIOS))
def test_each_opens_on_its_own_standing_on_its_contact(name: str) -> None:
    """As a stranger would open it in the viewer: the start keyframe has the contact points on the table."""
    case = SCENARIOS[name]
    model = mujoco.MjModel.from_xml_path(str(case.path))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.keyframe("start").id)
    mujoco.mj_kinematics(model, data)
    plan = placed(case, model)
    normal = data.geom("table").xmat.reshape(3, 3)[:, 2]
    heights = (data.xpos[1] + plan.contacts @ data.xmat[1].reshape(3, 3).T) @ normal
    np.testing.assert_allclose(heights, 0.0, atol=1e-8)
    others = data.xpos[1] + _corners(model) @ data.xmat[1].reshape(3, 3).T
    assert np.count_nonzero(others @ normal > 1e-3) == 8 - (2 if model.nq == 3 else len(plan.contacts))
    np.testing.assert_allclose(model.geom_solref[:, 0], 2.1 * model.opt.timestep)


def _corners(model: mujoco.MjModel) -> np.ndarray:
    """(8, 3) of the block."""
    return np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T * model.geom("block").size


def test_the_notes_numbers_are_in_the_scene() -> None:
    body = read_body(load(scene_path("balance-2d")).compile(), "block", "table")
    assert body.mass == 1.0
    assert body.inertia == pytest.approx(1.0 / 6.0)
    np.testing.assert_allclose(body.point([-0.5, 0.0, -0.5]), [-0.5, -0.5])
    np.testing.assert_allclose(body.gravity, [0.0, 0.0, -10.0])


def test_changes_arrive_in_the_compiled_model() -> None:
    changes = {"mu": 0.7, "mass": 3.0, "size": 0.2, "incline": 10.0, "gravity": 1.6, "dt": 0.002, "impedance": 0.6,
               "impratio": 50.0}  # fmt: skip
    model = load(scene_path("pivot-2d"), changes).compile()
    body = read_body(model, "block", "table")
    assert model.opt.timestep == 0.002
    np.testing.assert_allclose(model.geom_solref[:, 0], 0.0042)
    assert (model.geom_solimp[:, :2] == 0.6).all()
    assert model.opt.impratio == 50.0
    assert (model.geom_friction[:, 0] == 0.7).all()
    assert body.mass == pytest.approx(3.0)
    assert body.inertia == pytest.approx(3.0 * 0.2**2 / 6.0)
    np.testing.assert_allclose(body.gravity, [0.0, 0.0, -1.6])
    assert 2.0 * np.arctan2(-body.table[2], body.table[0]) == pytest.approx(np.deg2rad(10.0))
    relaid = load(scene_path("incline-2d"), {"incline": 0.0}).compile()
    np.testing.assert_allclose(read_body(relaid, "block", "table").table, [1.0, 0.0, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("theta", [0.1, 0.8, 1.5])
def test_place_puts_the_corner_there(theta: float) -> None:
    model = load(scene_path("incline-2d")).compile()
    data, body = mujoco.MjData(model), read_body(model, "block", "table")
    place(model, data, body, space(2, body.table).orientation(theta), corner(model), [0.1, 0.0, 0.3])
    mujoco.mj_kinematics(model, data)
    R = data.xmat[1].reshape(3, 3)
    np.testing.assert_allclose(data.xpos[1] + R @ corner(model), [0.1, 0.0, 0.3], atol=1e-12)
    assert data.qpos[2] == pytest.approx(theta + np.deg2rad(30.0))


def test_a_file_that_is_not_mjcf(tmp_path: Path) -> None:
    bad = tmp_path / "notes.xml"
    bad.write_text("<html>not a model</html>")
    for path in (bad, tmp_path / "missing.xml", Path(__file__)):
        with pytest.raises(ModelError, match=f"model = '.*{path.name}': not a readable MJCF file"):
            load(path)
