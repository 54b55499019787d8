"""Contacts that are not declared, and depth that the contact does not explain: measured, limited, and named."""

from pathlib import Path

import numpy as np
import pytest
from pivoting.controller.rotations import rotated
from pivoting.models import ModelError
from pivoting.sim import assert_sticking, simulate

from tests.own_files import BOX, mjcf, own, pivoted

SOFT = 'solref=".05 1" solimp=".01 .02 .001"'


def test_what_falls_on_the_object_is_named(tmp_path: Path) -> None:
    """A heavy ball: both geoms, the time and the world."""
    fall = 0.12
    ball = (
        f'<body name="ball" pos="0 0 {0.12 + 0.02 + fall}"><freejoint/><geom name="wall" size=".02" mass="50"/></body>'
    )
    run = simulate(own(tmp_path, mjcf(world=ball)))
    checks = {check.name: check for check in run.checks}
    assert run.verdict == "fail"
    assert not checks["undeclared_contact_s"].passed
    when = np.sqrt(2.0 * fall / 9.81)
    told = [line for line in run.strays if "'wall'" in line]
    assert told[0].startswith("geom 'g' touches 'wall' at ")
    assert float(told[0].split(" at ")[1].split(" s")[0]) == pytest.approx(when, abs=0.02)
    assert told == [line for line in run.summary()["undeclared_contacts"] if "'wall'" in line]
    assert told[0] in run.summary()["reasons"]
    with pytest.raises(AssertionError, match="undeclared_contact_s"):
        assert_sticking(run)


def test_a_wall_that_is_never_met_does_not_matter(tmp_path: Path) -> None:
    plain = pivoted(tmp_path, mjcf())
    corners = np.array([[x, y, z] for x in (-0.05, 0.05) for y in (-0.04, 0.04) for z in (-0.06, 0.06)])
    moved = plain.position[0][:, None] + rotated(plain.quaternion[0][:, None], corners - plain.truth.com)
    left = moved[..., 0].min()
    run = pivoted(tmp_path, mjcf(world=f'<geom name="wall" type="box" size=".01 .5 .5" pos="{left - 0.012} 0 .5"/>'))
    assert (run.verdict, run.strays) == ("pass", [])
    assert np.array_equal(run.position, plain.position)


def test_another_corner_of_the_object(tmp_path: Path) -> None:
    """The world's object is pressed on its face: corners that are not declared touch, and carry some of the load."""
    run = simulate(own(tmp_path, mjcf(), [[-0.05, -0.04, -0.06], [-0.05, 0.04, -0.06]]), world={"incline": 6.0})
    assert run.verdict == "fail"
    assert run.measures.undeclared_contact_s[0] > 0.0
    assert run.strays[0].startswith("geom 'g' touches 'floor' away from the contact at ")


def test_what_it_touches_at_the_start_is_refused(tmp_path: Path) -> None:
    post = '<geom name="post" type="box" size=".02 .5 .02" pos=".04 0 .01"/>'
    with pytest.raises(ModelError, match=r"its geom 'g' is in 'post' by .* mm; must touch nothing but its support"):
        simulate(own(tmp_path, mjcf(world=post), [[-0.05, -0.04, -0.06], [-0.05, 0.04, -0.06]], support="floor"))


def test_depth_that_the_contact_explains_is_no_matter(tmp_path: Path) -> None:
    """A contact so soft that the box sinks in by 1 mm under its weight: explained; the slip is another matter."""
    run = pivoted(tmp_path, mjcf(BOX.replace("/>", f" {SOFT}/>"), extra=""), chosen=False)
    assert run.log.contacts.depth.max() > 5e-4
    assert run.measures.penetration_rel[0] * run.size < 0.5 * run.log.contacts.depth.max()


def test_depth_beyond_that_fails(tmp_path: Path) -> None:
    """A hand that presses with ten weights more than the controller knows of."""
    pressed = own(tmp_path, mjcf(BOX.replace("/>", f" {SOFT}/>")), chosen=False)
    run = simulate(pressed, world={"gravity": 98.1}, limits={"penetration_rel": 1e-3})
    assert not {check.name: check for check in run.checks}["penetration_rel"].passed
