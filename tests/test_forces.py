"""Forces that the controller does not know of are refused by name, by a run and by attach; those of others are not."""

from pathlib import Path

import mujoco
import pytest
from pivoting.models import ModelError
from pivoting.sim import attach, simulate

from tests.own_files import BOX, FLOOR, mjcf, own, pivoted

SITE = '<site name="eye" pos="0 0 .06"/>'
HOOK = '<site name="hook" pos="0 0 1"/>'
OTHER = '<body name="other" pos="1 0 .5"><joint name="swing"/><geom size=".1"/><site name="far"/></body>'
NAMED = '<freejoint name="root"/>'


def equality(text: str) -> dict[str, str]:
    return {"extra": f"<equality>{text}</equality>", "world": OTHER}


def tendon(attributes: str, path: str = '<site site="eye"/><site site="hook"/>', more: str = "") -> dict[str, str]:
    extra = f'<tendon><spatial name="rope" {attributes}>{path}</spatial></tendon>{more}'
    return {"geoms": BOX + SITE, "world": HOOK + OTHER, "extra": extra}


def motor(attributes: str, kind: str = "motor") -> dict[str, str]:
    return {
        "geoms": BOX + SITE, "world": HOOK + OTHER, "extra": f'<actuator><{kind} name="m" {attributes}/></actuator>',
    }  # fmt: skip


FLEX = (
    '<deformable><flex name="cloth" dim="1" radius=".01" body="box other" vertex="0 0 .1  0 0 0" element="0 1"/>'
    "</deformable>"
)
SPRUNG = '<joint name="x" type="slide" axis="1 0 0" {}/>'
REST = '<joint type="slide" axis="0 0 1"/><joint type="hinge" axis="0 1 0"/>'
UNKNOWN = {
    "weld": (equality('<weld name="glue" body1="box" body2="other"/>'), r"equality constraint 'glue' \(weld\) holds"),
    "weld, world": (equality('<weld body1="box"/>'), r"equality constraint '#0' \(weld\) holds it"),
    "weld, as second": (equality('<weld body1="other" body2="box"/>'), r"\(weld\) holds it"),
    "connect": (equality('<connect body1="box" anchor="0 0 .06"/>'), r"\(connect\) holds it"),
    "connect, sites": (
        {**equality('<connect site1="far" site2="eye"/>'), "geoms": BOX + SITE}, r"\(connect\) holds it"),
    "joint equality": (
        {**equality('<joint joint1="x" joint2="swing"/>'), "joint": SPRUNG.format("") + REST}, r"\(joint\) holds it"),
    "tendon equality": (
        {**tendon(""), "extra": tendon("")["extra"] + '<equality><tendon tendon1="rope"/></equality>'},
        r"\(tendon\) holds it"),
    "spring": (tendon('stiffness="5"'), r"tendon 'rope' pulls on it \(stiffness\)"),
    "damper": (tendon('damping="5"'), r"tendon 'rope' pulls on it \(damping\)"),
    "rope": (tendon('range="0 .95" limited="true"'), r"tendon 'rope' pulls on it \(limited\)"),
    "dry rope": (tendon('frictionloss="1"'), r"tendon 'rope' pulls on it \(frictionloss\)"),
    "heavy rope": (tendon('armature="1"'), r"tendon 'rope' pulls on it \(armature\)"),
    "around it": (
        {**tendon('stiffness="5"', '<site site="hook"/><geom geom="b"/><site site="far"/>'),
         "geoms": BOX + '<geom name="b" size=".02"/>'}, "tendon 'rope' pulls on it"),
    "fixed tendon": (
        {"joint": SPRUNG.format("") + REST, "world": OTHER,
         "extra": '<tendon><fixed name="gear" stiffness="2"><joint joint="x" coef="1"/></fixed></tendon>'},
        "tendon 'gear' pulls on it"),
    "winch": (
        tendon("", more='<actuator><motor name="m" tendon="rope"/></actuator>'), "the actuator 'm' drives it"),
    "motor": ({**motor('joint="root" gear="0 0 1 0 0 0"'), "joint": NAMED}, "the actuator 'm' drives it"),
    "motor, in parent": ({**motor('jointinparent="root"'), "joint": NAMED}, "the actuator 'm' drives it"),
    "thruster": (motor('site="eye" gear="0 0 1 0 0 0"'), "the actuator 'm' drives it"),
    "thruster, relative": (motor('site="far" refsite="eye" gear="0 0 1 0 0 0"'), "the actuator 'm' drives it"),
    "position": ({**motor('joint="x" kp="3"', "position"), "joint": SPRUNG.format("") + REST}, "actuator 'm' drives"),
    "crank": (motor('cranksite="far" slidersite="eye" cranklength=".1"'), "the actuator 'm' drives it"),
    "adhesion": (motor('body="box" ctrlrange="0 1"', "adhesion"), "the actuator 'm' drives it"),
    "gravcomp": ({"body": 'gravcomp=".5"'}, "it has gravcomp = 0.5"),
    "fluid": ({"option": 'density="1.2"'}, "a fluid acts on it .density = 1.2, visc.*<option density=\"0\" viscosity"),
    "honey": ({"option": 'viscosity="3"'}, "a fluid acts on it .density = 0, viscosity = 3"),
    "wind": ({"option": 'density="1.2" wind="5 0 0"'}, r"a fluid acts on it .*wind = \[5.0, 0.0, 0.0\]"),
    "belt": ({"floor": FLOOR.replace("/>", ' surfacevel="1 0 0 0 0 0"/>')}, "the surface of geom 'floor' moves"),
    "track": ({"geoms": BOX.replace("/>", ' surfacevel="1 0 0 0 0 0"/>')}, "the surface of geom 'g' moves"),
    "sticky": ({"geoms": BOX.replace("/>", ' adhesion="5"/>')}, "geom 'g' is sticky"),
    "stiffness": ({"joint": SPRUNG.format('stiffness="3"') + REST}, "joint 'x' has stiffness = 3"),
    "limit": ({"joint": SPRUNG.format('range="-1 1" limited="true"') + REST}, "joint 'x' has limited = 1"),
    "rotor": ({"joint": NAMED.replace("/>", ' armature=".1"/>').replace("freejoint", "joint type='free'")},
              "joint 'root' has armature = 0.1"),
    "flex": ({"extra": FLEX, "world": OTHER}, "flexible body"),
}  # fmt: skip


@pytest.mark.parametrize("kind", UNKNOWN)
def test_what_is_unknown_is_refused_by_name(kind: str, tmp_path: Path) -> None:
    changes, message = UNKNOWN[kind]
    text = mjcf(**changes)
    model = mujoco.MjModel.from_xml_string(text)
    with pytest.raises(ModelError, match=f"body = 'box': .*{message}"):
        attach(model, body="box", contacts=[(-0.05, -0.04, -0.06)])
    with pytest.raises(ModelError, match=f"body = 'box': .*{message}"):
        simulate(own(tmp_path, text))


OFF = {
    "weld": (equality('<weld body1="box"/>'), "equality"),
    "motor": ({**motor('joint="root"'), "joint": NAMED}, "actuation"),
}
HARMLESS = {
    "weld, not active": equality('<weld body1="box" active="false"/>'),
    "weld of others": equality('<weld body1="other"/>'),
    "tendon that only measures": tendon(""),
    "tendon of others": tendon('stiffness="5"', '<site site="hook"/><site site="far"/>'),
    "motor of others": motor('joint="swing"'),
    **{
        f"{name}, switched off": {**changes, "extra": changes["extra"] + f'<option><flag {flag}="disable"/></option>'}
        for name, (changes, flag) in OFF.items()
    },
}


@pytest.mark.parametrize("kind", HARMLESS)
def test_what_does_not_act_on_it_is_no_matter(kind: str, tmp_path: Path) -> None:
    plain, run = pivoted(tmp_path, mjcf()), pivoted(tmp_path, mjcf(**HARMLESS[kind]))
    assert run.verdict == "pass"
    assert run.measures.slip_max_m[0] == pytest.approx(plain.measures.slip_max_m[0], rel=1e-6)
