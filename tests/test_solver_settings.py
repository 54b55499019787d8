"""A file's own solver options, flags, margins, pairs and keyframes: with the chosen settings the plain file's slip."""

from pathlib import Path

import numpy as np
import pytest
from pivoting.models import ModelError
from pivoting.sim import Run, simulate

from tests.own_files import BOX, FLOOR, mjcf, own, pivoted

ODD = {
    "integrator": '"RK4"', "cone": '"pyramidal"', "impratio": '"7"', "jacobian": '"sparse"', "solver": '"PGS"',
    "iterations": '"3"', "tolerance": '"1e-3"', "ls_iterations": '"4"', "ls_tolerance": '".5"',
    "noslip_iterations": '"5"', "noslip_tolerance": '"1e-2"', "ccd_iterations": '"3"', "ccd_tolerance": '"1e-2"',
    "sdf_iterations": '"3"', "sdf_initpoints": '"3"',
}  # fmt: skip
FLAGS = {
    "disable": ["sensor", "warmstart", "refsafe", "midphase", "nativeccd", "eulerdamp", "island", "filterparent",
                "clampctrl", "limit", "spring", "damper", "frictionloss", "actuation", "equality", "autoreset"],
    "enable": ["energy", "fwdinv", "invdiscrete", "multiccd", "sleep"],
}  # fmt: skip
PAIR = '<contact><pair geom1="floor" geom2="g" {}/></contact>'
OVERRIDE = '<option><flag override="enable"/></option>'
PUSHED = BOX.replace("/>", " {}/>")


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return pivoted(tmp_path_factory.mktemp("plain"), mjcf())


def same(run: Run, plain: Run, rel: float = 1e-9) -> None:
    assert run.verdict == plain.verdict == "pass"
    assert run.measures.slip_max_m[0] == pytest.approx(plain.measures.slip_max_m[0], rel=rel)


@pytest.mark.parametrize("name", ODD)
def test_options(name: str, plain: Run, tmp_path: Path) -> None:
    run = pivoted(tmp_path, mjcf(option=f"{name}={ODD[name]}"))
    same(run, plain)
    assert name in run.summary()["contact_settings"]["replaced"]


@pytest.mark.parametrize("flag", [f"{name}={way}" for way, names in FLAGS.items() for name in names])
def test_flags(flag: str, plain: Run, tmp_path: Path) -> None:
    name, way = flag.split("=")
    same(pivoted(tmp_path, mjcf(extra=f'<option><flag {name}="{way}"/></option>')), plain)


def test_all_at_once(plain: Run, tmp_path: Path) -> None:
    options = " ".join(f"{name}={value}" for name, value in ODD.items())
    flags = " ".join(f'{name}="{way}"' for way, names in FLAGS.items() for name in names if name != "sleep")
    same(pivoted(tmp_path, mjcf(option=options, extra=f"<option><flag {flags}/></option>")), plain)


@pytest.mark.parametrize("flag", ["contact", "constraint", "gravity"])
def test_what_takes_the_contact_away(flag: str, plain: Run, tmp_path: Path) -> None:
    """The chosen settings give contacts back; as modelled, and without gravity, it is refused."""
    reason = "> 0, or f_min > 0" if flag == "gravity" else f'<flag {flag}="disable"/>: nothing sticks without contact'
    text = mjcf(extra=f'<option><flag {flag}="disable"/></option>')
    with pytest.raises(ValueError, match=reason):
        simulate(own(tmp_path, text, chosen=False))
    if flag != "gravity":
        same(pivoted(tmp_path, text), plain)


CONTACTS = {
    "margin": mjcf(PUSHED.format('margin=".004"')),
    "margin of the floor": mjcf(floor=FLOOR.replace("/>", ' margin=".01"/>')),
    "margin and gap": mjcf(PUSHED.format('margin=".004" gap=".002"'), floor=FLOOR.replace("/>", ' gap=".001"/>')),
    "pair": mjcf(extra=PAIR.format('margin=".004" gap=".001" solref="-100 -5" solimp=".1 .2 .3" condim="6"')),
    "friction solref": mjcf(extra=PAIR.format('solreffriction=".05 1"')),
    "override": mjcf(option='o_margin=".004" o_solref=".1 1" o_solimp=".1 .2 .3"', extra=OVERRIDE),
    "priority": mjcf(PUSHED.format('priority="2" solref=".1 .3" solimp=".1 .9 .1" condim="6" solmix="9"')),
    "direct solref": mjcf(floor=FLOOR.replace("/>", ' solref="-1000 -10"/>')),
    "torsion": mjcf(PUSHED.format('condim="6" friction="1 .1 .1"')),
    "default class": mjcf(extra='<default><geom margin=".002" solref=".2 2" condim="4"/></default>'),
    "mesh of a box": mjcf(
        '<geom name="g" type="mesh" mesh="m"/>',
        extra='<asset><mesh name="m" vertex="-1 -1 -1 -1 -1 1 -1 1 -1 -1 1 1 1 -1 -1 1 -1 1 1 1 -1 1 1 1" '
        'scale=".05 .04 .06"/></asset>',
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", CONTACTS)
def test_contact_parameters(kind: str, plain: Run, tmp_path: Path) -> None:
    run = pivoted(tmp_path, CONTACTS[kind])
    same(run, plain, 0.05 if "mesh" in kind else 1e-9)
    if "margin" in kind:
        assert "0.004" in run.summary()["contact_settings"]["replaced"]["margin"] or "floor" in kind


@pytest.mark.parametrize("margin", [0.0005, 0.004])
def test_as_modelled_it_starts_where_a_margin_holds_it(margin: float, tmp_path: Path) -> None:
    """It floats at the margin, where it rests, and is not kicked."""
    run = pivoted(tmp_path, mjcf(PUSHED.format(f'margin="{margin}"')), chosen=False)
    assert run.corner[0, 0, :, 2] == pytest.approx(margin, rel=0.05)
    assert np.abs(run.velocity).max() < 0.2
    assert run.measures.slip_max_m[0] < margin + 5e-4


OTHERS = (
    '<body name="blocker" pos="0 0 .06"><freejoint/><geom name="o" type="box" size=".02 .02 .02"/></body>'
    '<body name="hand" mocap="true" pos="0 0 .1"><geom name="h" size=".03"/></body>'
    '<body name="arm" pos="1 0 1"><joint name="swing" axis="0 1 0"/><geom size=".1" pos="0 0 -.3" mass="1"/></body>'
)
STATE = 'qpos="0 0 .06 1 0 0 0  .5 0 .02 1 0 0 0  .4" mpos="0 1 1" mquat="1 0 0 0" ctrl="0.3" act="0.2"'
MOTORS = '<actuator><general name="m" joint="swing" dyntype="integrator" gainprm="1"/></actuator>'


def test_others_are_where_the_keyframe_has_them(plain: Run, tmp_path: Path) -> None:
    """A free body, a mocap body, activations and controls: as the first keyframe has them."""
    text = mjcf(world=OTHERS, extra=MOTORS + f"<keyframe><key {STATE}/></keyframe>")
    run = pivoted(tmp_path, text)
    same(run, plain, 1e-6)
    np.testing.assert_allclose(run.start[0][0, 7:], [0.5, 0.0, 0.02, 1.0, 0.0, 0.0, 0.0, 0.4])
    with pytest.raises(ModelError, match=r"support = '[oh]': it can move; must be fixed; name another"):
        simulate(own(tmp_path, mjcf(world=OTHERS, extra=MOTORS)))
    with pytest.raises(ModelError, match=r"its geom 'g' is in '[oh]' by .* mm; must touch nothing but its support"):
        simulate(own(tmp_path, mjcf(world=OTHERS, extra=MOTORS), "lowest", support="floor"))
