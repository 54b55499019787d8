"""Friction as MuJoCo combines it: by pair, priority, the larger of both, or overridden; and contacts without any."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pivoting.models import ModelError
from pivoting.models.friction_coefficient import contact_friction, read_friction
from pivoting.sim import attach, simulate

from tests.own_files import BOX, FLOOR, mjcf, own

rubs = st.sampled_from([0.0, 1e-7, 0.05, 0.3, 1.0, 2.5])
geoms = st.tuples(st.sampled_from([1, 3, 4, 6]), st.sampled_from([-1, 0, 2]), rubs)


@settings(max_examples=60, deadline=None)
@given(geoms, geoms, st.none() | st.tuples(st.sampled_from([1, 3, 6]), rubs, rubs), st.none() | st.tuples(rubs, rubs))
def test_as_in_mujocos_own_contact(box, floor, pair, override) -> None:  # type: ignore[no-untyped-def]
    """condim and both tangents, against mjContact of the box pressed into the floor."""

    def attributes(one: tuple[int, int, float]) -> str:
        return f'condim="{one[0]}" priority="{one[1]}" friction="{one[2]}"/>'

    extra, option = "", ""
    if pair:
        friction = f"{pair[1]} {pair[2]} 0.01 0.001 0.001"
        extra = f'<contact><pair geom1="floor" geom2="g" condim="{pair[0]}" friction="{friction}"/></contact>'
    if override:
        extra += '<option><flag override="enable"/></option>'
        option = f'o_friction="{override[0]} {override[1]} 0.01 0.001 0.001"'
    text = mjcf(
        BOX.replace("/>", attributes(box)),
        floor=FLOOR.replace("/>", attributes(floor)), pose='pos="0 0 .0599"', extra=extra, option=option,
    )  # fmt: skip
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.ncon == 4
    condim, tangents = contact_friction(model, 1, 0)
    assert condim == data.contact[0].dim
    np.testing.assert_allclose(tangents, data.contact[0].friction[:2], rtol=1e-12)


PAIR = '<contact><pair geom1="g" geom2="floor" {}/></contact>'
SLICK = [
    mjcf(BOX.replace("/>", ' condim="1"/>'), floor=FLOOR.replace("/>", ' condim="1"/>')),
    mjcf(BOX.replace("/>", ' condim="1" priority="1"/>')),
    mjcf(floor=FLOOR.replace("/>", ' condim="1" priority="3"/>')),
    mjcf(extra=PAIR.format('condim="1"')),
    mjcf(BOX.replace("/>", ' friction="0"/>'), floor=FLOOR.replace("/>", ' friction="0"/>')),
    mjcf(BOX.replace("/>", ' friction="0" priority="1"/>')),
    mjcf(extra=PAIR.format('friction="0 0 0 0 0"')),
    mjcf(option='o_friction="0 0 0 0 0"', extra='<option><flag override="enable"/></option>'),
]


@pytest.mark.parametrize("text", SLICK)
def test_without_friction_nothing_sticks(text: str, tmp_path: Path) -> None:
    """Refused by a run, with settings chosen or not, and by attach."""
    model = mujoco.MjModel.from_xml_string(text)
    for chosen in (True, False):
        with pytest.raises(ModelError, match="'g' touches 'floor' without friction"):
            simulate(own(tmp_path, text, chosen=chosen))
    with pytest.raises(ModelError, match="'g' touches 'floor' without friction"):
        attach(model, body="box", contacts=[(-0.05, -0.04, -0.06)])


@pytest.mark.parametrize(
    ("extra", "option", "mu"),
    [
        (PAIR.format('friction="1 0.05 0.01 0.001 0.001"'), "", 0.05),
        (PAIR.format('friction="0.05 1 0.01 0.001 0.001"'), "", 0.05),
        ('<option><flag override="enable"/></option>', 'o_friction="0.2 0.08 0.01 0.001 0.001"', 0.08),
    ],
)
def test_the_least_of_both_tangents_is_planned_with(extra: str, option: str, mu: float, tmp_path: Path) -> None:
    run = simulate(own(tmp_path, mjcf(extra=extra, option=option)))
    assert run.world.mu == pytest.approx(mu)
    assert run.attached.controller.contacts[0].mu == pytest.approx(mu)
    assert run.verdict == "pass"
    assert run.measures.slip_max_m[0] < 1e-5
    run = simulate(own(tmp_path, mjcf(extra=extra, option=option)), mu=0.4)  # a key says otherwise, of both tangents
    assert (run.world.mu, run.verdict) == (0.4, "pass")


def test_geoms_that_are_at_the_contact_count() -> None:
    """Feet of rubber under a box of steel: at the feet theirs, without a contact it is to be said."""
    feet = "".join(
        f'<geom name="foot{i}" type="box" size=".01 .01 .01" pos="{x} {y} -.07" friction="1.2"/>'
        for i, (x, y) in enumerate([(-0.04, -0.03), (0.04, -0.03), (-0.04, 0.03), (0.04, 0.03)])
    )
    floor = FLOOR.replace("/>", ' friction=".1"/>')
    text = mjcf(BOX.replace("/>", ' friction=".1"/>') + feet, pose='pos="0 0 .08"', floor=floor)
    model = mujoco.MjModel.from_xml_string(text)
    assert read_friction(model, 1, 0, [[-0.05, -0.04, -0.08]]) == 1.2
    assert read_friction(model, 1, 0, [[0.05, 0.04, 0.06]]) == 0.1
    with pytest.raises(ModelError, match=r"mu = None: the body's geoms give \[0.1, 1.2\]; give mu"):
        read_friction(model, 1, 0)
    assert attach(model, body="box", contacts=[(-0.05, -0.04, -0.08)]).controller.contacts[0].mu == 1.2
