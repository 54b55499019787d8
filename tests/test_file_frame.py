"""Points are given and told in the frame that the file gives the body, also where the compiler moves it."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from pivoting.models import load
from pivoting.models.rigid_body import file_frame
from pivoting.sim import simulate

from tests.own_files import mjcf, own

TOOL = (
    '<geom name="g" type="box" size=".05 .04 .06" pos=".01 .02 .07" euler="0 0 15"/>'
    '<geom name="head" type="box" size=".02 .01 .03" pos=".07 .02 .17" euler="0 40 0"/>'
)
INERTIAL = '<inertial pos=".01 0 .06" quat="3 1 0 2" mass="1" diaginertia="3e-3 2e-3 15e-4"/>'
POSE = 'pos=".2 .1 0" euler="0 0 70"'
FREE = '<freejoint align="{}"/>'


@pytest.mark.parametrize("contact", ["vertex", "edge", "lowest"])
@pytest.mark.parametrize("inertial", ["", INERTIAL])
def test_an_aligned_free_joint_moves_as_one_that_is_not(contact: str, inertial: str, tmp_path: Path) -> None:
    runs = []
    for align in ("false", "true"):
        case = own(tmp_path, mjcf(inertial + TOOL, joint=FREE.format(align), pose=POSE), contact)
        runs.append(simulate(case))
    plain, aligned = runs
    assert plain.verdict == aligned.verdict == "pass"
    moved = np.abs(aligned.model.body_ipos[1] - plain.model.body_ipos[1]).max()
    assert moved > 0.01, "not vacuous: the compiled frame is another"
    np.testing.assert_allclose(aligned.theta, plain.theta, atol=2e-5)
    np.testing.assert_allclose(aligned.position, plain.position, atol=2e-6)
    np.testing.assert_allclose(aligned.corner, plain.corner, atol=2e-6)
    assert aligned.measures.slip_max_m[0] == pytest.approx(plain.measures.slip_max_m[0], abs=2e-6)


def test_points_of_ones_own_are_in_the_files_frame(tmp_path: Path) -> None:
    """The same corner, given as the file has it, with align and without."""
    turned = np.array([[np.cos(np.pi / 12), -np.sin(np.pi / 12)], [np.sin(np.pi / 12), np.cos(np.pi / 12)]])
    corner = [*(turned @ [-0.05, -0.04] + [0.01, 0.02]), 0.01]
    ends = []
    for align in ("false", "true"):
        run = simulate(own(tmp_path, mjcf(TOOL, joint=FREE.format(align), pose=POSE), [corner]))
        assert run.verdict == "pass"
        ends.append(run.position)
    np.testing.assert_allclose(*ends, atol=2e-6)
    with pytest.raises(ValueError, match=r"no corner of body 'box'; the nearest is -0.02") as told:
        simulate(own(tmp_path, mjcf(TOOL, joint=FREE.format("true"), pose=POSE), [[-0.03, -0.03, 0.01]]))
    nearest = [float(x) for x in str(told.value).split("nearest is ")[1].split(", the")[0].split(";")[0].split(", ")]
    np.testing.assert_allclose(nearest, corner, atol=1e-5)


def test_the_frame_is_the_files(tmp_path: Path) -> None:
    """A point of the file's frame is where the file, compiled without align, has it in the world."""
    path, point = tmp_path / "own.xml", np.array([0.03, -0.02, 0.05])
    at = []
    for align in ("false", "true"):
        path.write_text(mjcf(TOOL, joint=FREE.format(align), pose=POSE))
        model = load(path, body="box", support=None).compile()
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        origin, axes = file_frame(model, 1)
        at.append(data.xpos[1] + data.xmat[1].reshape(3, 3) @ (origin + axes @ point))
    np.testing.assert_allclose(*at, atol=1e-12)
