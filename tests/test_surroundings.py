"""An object among others: what is above it is no support, and contacts that cannot be had there are passed over."""

from pathlib import Path

import numpy as np
import pytest
from pivoting.models.errors import ModelError
from pivoting.sim import Run, own_object, simulate

FLOOR = '<geom name="floor" type="plane" size="2 2 .1"/>'
BOX = '<body name="box" pos="{0}"><freejoint/><geom name="g" type="box" size=".05 .04 .06"/></body>'
WALLS = "".join(f'<geom name="w{x}" type="box" size=".01 .1 .1" pos="{x} 0 .1"/>' for x in (0.0601, -0.0601))
SHELF = '<geom name="shelf" type="box" size=".2 .2 .01" pos="0 0 .13"/>'
ROOF = '<geom name="roof" type="box" size=".4 .2 .01" pos="0 0 {0}"/>'
TABLES = "".join(f'<geom name="t{x}" type="box" size=".5 .5 .05" pos="{x} 0 0"/>' for x in (0.5, -0.5))
SMALL = '<geom name="table" type="box" size=".03 .03 .05" pos="0 0 .05"/>'


def run(folder: Path, world: str, contact: str) -> Run:
    (path := folder / "scene.xml").write_text(f"<mujoco><worldbody>{world}</worldbody></mujoco>")
    return simulate(own_object(path, "box", contact))


@pytest.mark.parametrize("contact", ["lowest", "edge", "vertex"])
@pytest.mark.parametrize("height", [0.63, 0.6295])
def test_a_roof_that_is_touched_from_below_is_no_support(height: float, contact: str, tmp_path: Path) -> None:
    done = run(tmp_path, FLOOR + ROOF.format(height) + BOX.format("0 0 .56"), contact)
    assert done.object["support"] == "floor"
    assert done.verdict == "pass"


@pytest.mark.parametrize(
    ("around", "at", "contact"),
    [
        (FLOOR + WALLS, "0 0 .06", "edge"),  # it can turn only about the edges that go from wall to wall
        (TABLES, ".01 0 .11", "vertex"),  # some vertices are beyond the table that its middle is on
        (FLOOR + SHELF, "0 0 .06", "edge"),  # about none of the face that it stands on
    ],
)
def test_contacts_that_cannot_be_had_there_are_passed_over(around: str, at: str, contact: str, tmp_path: Path) -> None:
    assert run(tmp_path, around + BOX.format(at), contact).verdict == "pass"


def test_a_refusal_says_what_is_in_the_way_and_offers_only_what_is_not(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"at 5 deg, its geom 'g' is in 'w-?0.0601' .*; nearest: --contact edge"):
        run(tmp_path, FLOOR + WALLS + BOX.format("0 0 .06"), "vertex")
    for contact in ("edge", "vertex"):
        with pytest.raises(ModelError, match=r"'table': the contact would be 0.0\d+ m beside its upper face") as said:
            run(tmp_path, FLOOR + SMALL + BOX.format("0 0 .16"), contact)
        assert "--contact" not in str(said.value)


@pytest.mark.parametrize("contact", ["edge", "vertex"])
def test_it_is_turned_as_it_stands_in_the_file_where_that_can_be(contact: str, tmp_path: Path) -> None:
    """Upright, though it would lie more stably on its side, and with its yaw."""
    done = run(tmp_path, FLOOR + BOX.format('0 0 .06" euler="0 0 20'), contact)
    assert done.object["laid_over_deg"] == 0.0
    assert np.allclose(done.points[:, 2], -0.06)


def test_what_is_laid_on_another_side_is_said(tmp_path: Path) -> None:
    done = run(tmp_path, FLOOR + SHELF + BOX.format("0 0 .06"), "edge")
    assert done.object["laid_over_deg"] == pytest.approx(90.0)


def test_what_hovers_far_above_stands_on_nothing(tmp_path: Path) -> None:
    """It is laid down as it rests best; a little above, it is turned as it stands."""
    assert run(tmp_path, FLOOR + BOX.format("0 0 .08"), "edge").object["laid_over_deg"] == 0.0
    assert run(tmp_path, FLOOR + BOX.format("0 0 .4"), "edge").object["laid_over_deg"] == pytest.approx(90.0)
