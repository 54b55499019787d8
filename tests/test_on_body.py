"""Contacts given to attach have to be on the body."""

import mujoco
import numpy as np
import pytest
from pivoting.models import ModelError
from pivoting.sim import attach

from tests.own_files import BOX, mjcf

PILL = '<geom name="g" type="capsule" size=".03 .07"/>'
CAN = '<geom name="g" type="cylinder" size=".05 .06"/>'
TURNED = '<geom name="g" type="cylinder" size=".05 .06" euler="90 0 0"/>'
SLIDES = '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/><joint type="hinge" axis="0 1 0"/>'
ON = [
    (BOX, "<freejoint/>", [(-0.05, -0.04, -0.06), (-0.05, 0.04, -0.06)], 0.0),
    (BOX, "<freejoint/>", [(-0.0506, -0.0403, -0.0604)], 0.0),  # within 1 %
    (BOX, "<freejoint/>", [(0.0, 0.0, -0.06)], 0.0),
    (CAN, "<freejoint/>", [(0.03, -0.04, -0.06)], 0.0),
    (PILL, "<freejoint/>", [(0.0, 0.0, -0.07)], 0.03),
    (PILL, "<freejoint/>", [(0.0, 0.0, -0.1)], 0.0),
    (BOX, SLIDES, [(-0.05, -0.06)], 0.0),
    (BOX, SLIDES, [(-0.05, 7.0, -0.06)], 0.0),  # only the plane counts
    (TURNED, SLIDES, [(0.0, 0.0)], 0.05),
]


@pytest.mark.parametrize(("geoms", "joint", "contacts", "radius"), ON)
def test_on_it(geoms: str, joint: str, contacts: list[tuple[float, ...]], radius: float) -> None:
    model = mujoco.MjModel.from_xml_string(mjcf(geoms, joint=joint, pose='pos="0 0 .1"'))
    held = attach(model, body="box", contacts=contacts, radius=radius)
    assert len(held.controller.contacts) == len(contacts)


OFF = [
    (BOX, "<freejoint/>", [(-0.05, -0.04, -0.06), (5.0, 0.0, 0.0)], 0.0, r"contacts\[1\] = \[5.0, 0.0, 0.0\]: 5 m off"),
    (BOX, "<freejoint/>", [(0.0, 0.0, 0.0)], 0.0, r"contacts\[0\] = \[0.0, 0.0, 0.0\]: 0.04 m off .*within 0.0018 m"),
    (BOX, "<freejoint/>", [(-0.05, -0.04, -0.06)], 2.0, "radius = 2: .* must be 0, as the body has no round ends"),
    (PILL, "<freejoint/>", [(0.0, 0.0, -0.07)], 2.0, r"radius = 2: .* must be 0 of a point, or .* of radius 0.03"),
    (PILL, "<freejoint/>", [(0.0, 0.0, -0.1)], 0.03, r"radius = 0.03: .*its centre: \[0.0, 0.0, -0.07\] of radius"),
    (PILL, "<freejoint/>", [(0.0, 0.0, -0.07)], 0.0, r"contacts\[0\] = .*: 0.03 m off the surface.*give its radius"),
    (BOX, SLIDES, [(-0.05, -0.6)], 0.0, r"contacts\[0\] = \[-0.05, -0.6\]: 0.54 m off"),
    (BOX, SLIDES, [(-0.05, 0.06)], 0.3, "radius = 0.3"),
]  # fmt: skip


@pytest.mark.parametrize(("geoms", "joint", "contacts", "radius", "message"), OFF)
def test_off_it(geoms: str, joint: str, contacts: list[tuple[float, ...]], radius: float, message: str) -> None:
    model = mujoco.MjModel.from_xml_string(mjcf(geoms, joint=joint, pose='pos="0 0 .1"'))
    with pytest.raises(ModelError, match=message):
        attach(model, body="box", contacts=contacts, radius=radius)


def test_corners_of_a_turned_body_are_on_it() -> None:
    """Geoms off the body's origin, a CoM elsewhere, axes turned: each corner is on it, its mirror image is not."""
    geoms = '<inertial pos=".02 .01 0" mass="1" diaginertia=".01 .01 .01"/>' + BOX.replace(
        "/>", ' pos=".1 .2 .3" quat="0.8 0.2 -0.4 0.4"/>'
    )
    model = mujoco.MjModel.from_xml_string(mjcf(geoms, pose='pos="0 0 .5"'))
    R = np.empty(9)
    mujoco.mju_quat2Mat(R, model.geom_quat[1])
    corner = model.geom_pos[1] + R.reshape(3, 3) @ [-0.05, 0.04, -0.06]
    attach(model, body="box", contacts=[corner])
    with pytest.raises(ModelError, match=r"contacts\[0\]"):
        attach(model, body="box", contacts=[-corner])
