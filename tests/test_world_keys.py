"""Keys that change the object or its table: mass however the file gives it, size, and inclines of the world alone."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from pivoting.models import ModelError, load
from pivoting.sim import simulate

from tests.own_files import BOX, FLOOR, mjcf, own

INERTIAL = '<inertial pos="0 0 -.01" mass="2" fullinertia=".004 .003 .002 .0005 0 .0002"/>'
LID = '<body name="lid" pos="0 0 .06"><geom name="l" type="box" size=".03 .03 .01" mass=".2"/></body>'
OTHER = '<body pos="1 0 1"><geom size=".1"/><joint/></body>'
FILES = {
    "geoms": mjcf(),
    "inertial": mjcf(INERTIAL + BOX),
    "settotalmass": mjcf(extra='<compiler settotalmass="7"/>'),
    "geom mass": mjcf(BOX.replace("/>", ' mass=".3"/>')),
    "fused child": mjcf(BOX + LID),
    "inertial and align": mjcf(INERTIAL + BOX, joint='<freejoint align="true"/>'),
}


@pytest.mark.parametrize("kind", FILES)
def test_mass_is_that_of_the_compiled_body(kind: str, tmp_path: Path) -> None:
    """Its inertia in proportion, other bodies as they were."""
    path = tmp_path / "own.xml"
    path.write_text(
        FILES[kind].replace("</worldbody>", '<body pos="1 0 1"><geom size=".1"/><joint/></body></worldbody>')
    )
    plain = load(path, body="box", support=None).compile()
    heavy = load(path, {"mass": 50.0}, body="box", support=None).compile()
    assert heavy.body_mass[1] == pytest.approx(50.0, rel=1e-12)
    np.testing.assert_allclose(heavy.body_inertia[1] / plain.body_inertia[1], 50.0 / plain.body_mass[1], rtol=1e-9)
    np.testing.assert_allclose(heavy.body_ipos, plain.body_ipos, atol=1e-12)
    assert heavy.body_mass[2] == plain.body_mass[2]
    assert heavy.body_subtreemass[0] == pytest.approx(heavy.body_mass.sum())
    mass = np.zeros((heavy.nv, heavy.nv))
    data = mujoco.MjData(heavy)
    mujoco.mj_forward(heavy, data)
    mujoco.mj_fullM(heavy, data, mass)
    np.testing.assert_allclose(np.diag(mass)[:3], 50.0, rtol=1e-9)


@pytest.mark.parametrize("kind", FILES)
def test_a_world_that_weighs_more_fails(kind: str, tmp_path: Path) -> None:
    case = own(tmp_path, FILES[kind])
    assert simulate(case, mass=3.0).verdict == "pass"
    run = simulate(case, world={"mass": 50.0})
    assert run.truth.mass == pytest.approx(50.0)
    assert run.attached.body.mass < 10.0
    assert run.verdict == "fail"


def test_size_with_inertial_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"size = 0.3: the body's <inertial> would not change with it"):
        simulate(own(tmp_path, FILES["inertial"]), size=0.3)
    from_geom = FILES["inertial"].replace("<worldbody>", '<compiler inertiafromgeom="true"/><worldbody>')
    assert simulate(own(tmp_path, from_geom), size=0.3).verdict == "pass"


@pytest.mark.parametrize("contact", ["lowest", "edge", [[-0.05, -0.04, -0.06], [-0.05, 0.04, -0.06]]], ids=str)
@pytest.mark.parametrize("incline", [0.5, -5.0])
def test_the_contact_is_found_once_as_it_is_believed(contact: object, incline: float, tmp_path: Path) -> None:
    """On a table that is inclined a little the same corners stick; by 5 deg the verdict says what is wrong.

    Rising along the edge it shifts the load from one end to the other, which the angle does not show.
    """
    case = own(tmp_path, mjcf(), contact)
    plain, run = simulate(case), simulate(case, world={"incline": incline})
    np.testing.assert_allclose(run.points, plain.points, atol=1e-12)
    assert run.measures.angle_error_rms_deg[0] < 1.1 * abs(incline)
    assert run.measures.slip_max_m[0] < (2e-5 if incline == 0.5 else 0.01)
    assert abs(np.rad2deg(run.theta[0, 0] - plain.theta[0, 0])) < 1e-6
    worse = max(check.value / check.limit for check in run.checks if check.limit > 0.0)
    assert 0.5 * abs(incline) < worse
    assert run.verdict == "fail"


def test_an_incline_of_what_is_no_plane_of_the_world_is_refused(tmp_path: Path) -> None:
    """It would be in the frame of what holds it."""
    box = '<geom name="t" type="box" size=".5 .5 .1" pos="0 0 -.1"/>'
    for floor in (box, f'<body euler="0 0 90">{FLOOR}</body>', f'<frame euler="0 0 90">{FLOOR}</frame>'):
        with pytest.raises(ModelError, match="incline = 3: the support is not a plane of the world body"):
            simulate(own(tmp_path, mjcf(floor=floor)), world={"incline": 3.0})


def test_mujocos_warnings_at_reading_are_one_line_each(tmp_path: Path, recwarn: pytest.WarningsRecorder) -> None:
    run = simulate(own(tmp_path, FILES["settotalmass"]))
    told = [line for line in run.summary()["engine_warnings"] if "settotalmass" in line]
    assert len(told) == 1
    assert "\n" not in told[0]
    assert not recwarn.list
