"""What the simulator itself does to a sticking contact is predicted, or said to be unknown; never wrong."""

import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from pivoting.models.contact_softness import read_rows
from pivoting.sim import Run, own_object, simulate
from pivoting.sim.console.json_values import jsonable
from pivoting.sim.console.run_tables import print_run
from pivoting.sim.judging.measures import predicted_slip, slip_floor_unknown
from rich.console import Console

from tests.altered_runs import altered

BOX = '<geom type="box" size=".05 .04 .06" mass="1" {}/>'
STACK = '<geom type="box" size=".1 .098 .115" pos="0 0 .115"/><geom type="box" size=".1 .098 .07" pos="0 0 .3"/>'
HEAVY = '<inertial pos=".02 .01 .03" mass="1" diaginertia=".002 .001 .0015" quat=".9 .1 .2 .1"/>'
PAIR = '<pair geom1="floor" geom2="g" friction="1 .5" solreffriction=".1 1"/>'
NAMED = BOX.replace("<geom", '<geom name="g"')
ELLIPTIC, SOFT = 'cone="elliptic"', 'solref=".01 1" solimp=".6 .6 .001"'


def own(
    folder: Path,
    option: str = "",
    geom: str = "",
    *,
    body: str = BOX,
    contact: str = "edge",
    chosen: bool = False,
    floor: str = "",
    joint: str = "",
    extra: str = "",
    **keys: Any,
) -> Run:
    """A file of a user's, pivoted: as it is modelled, if not with the chosen settings."""
    path = folder / "object.xml"
    path.write_text(
        f'<mujoco><option {option}/><worldbody><geom name="floor" type="plane" size="5 5 .1" {geom} {floor}/>'
        f'<body name="object" pos="0 0 1"><joint type="free" {joint}/>{body.format(geom)}</body></worldbody>'
        f"{extra}</mujoco>"
    )
    return simulate(own_object(path, "object", contact, chosen=chosen), **{"spread": 0.0, "seconds": 0.5, **keys})


def told(run: Run, within: float = 1e-3) -> None:
    """The path of every contact is as predicted, within a share of the greatest slip."""
    assert not slip_floor_unknown(run)
    gap = np.linalg.norm(predicted_slip(run) - run.slip, axis=-1).max(axis=(1, 2))
    assert (gap <= within * run.measures.slip_max_m).all(), gap / run.measures.slip_max_m


@pytest.mark.parametrize(
    "name", ["balance-2d", "incline-2d", "pivot-2d", "snap-2d", "spin-3d", "pivot-3d", "settle-3d"]
)
def test_shipped_scenes(name: str, shipped: Callable[[str], Run]) -> None:
    told(shipped(name))


@pytest.mark.parametrize(
    "keys",
    [{"impratio": 1.0}, {"timeconst": 0.003}, {"timeconst": 0.002}, {"impedance": 0.2, "timeconst": 0.02}, {"mu": 0.1},
     {"dt": 0.0005}, {"dt": 0.004}, {"mass": 500.0}, {"spread": 1.0}, {"world": {"mass": 1.1}}, {"impratio": 1e6}],
    ids=str,
)  # fmt: skip
@pytest.mark.parametrize("name", ["pivot-2d", "pivot-3d"])
def test_shipped_scenes_changed(name: str, keys: dict[str, Any]) -> None:
    told(simulate(name, seconds=1.5, reference="arc", theta_end=40.0, **{"spread": 0.0, **keys}))


@pytest.mark.parametrize("contact", ["edge", "vertex"])
@pytest.mark.parametrize(
    "case",
    [
        {},
        {"option": 'integrator="RK4" solver="PGS" noslip_iterations="3" cone="pyramidal"'},
        {"body": STACK},
        {"body": 3 * '<geom type="box" size=".1 .1 .02" mass=".3"/>'},
        {"body": HEAVY + BOX},
        {"body": '<geom type="box" size=".005 .004 .006" mass=".01"/>'},
        {"body": '<geom type="box" size="1.5 1.2 1.8" mass="500"/>'},
        {"mu": 0.05},
        {"geom": 'margin=".004"'},
        {"floor": 'euler="8 5 30"'},
        {"joint": 'damping=".3"'},
        {"joint": 'frictionloss=".05"'},
        {"theta_end": 60.0, "f_min": 20.0},
        {"theta": 25.0, "theta_end": 5.0},
        {"impratio": 1.0},
        {"impedance": 0.9, "timeconst": 0.02},
    ],
    ids=str,
)
def test_known_with_the_chosen_settings(tmp_path: Path, case: dict[str, Any], contact: str) -> None:
    """Whatever the file has: coincident and stacked geoms, margins, damping, tilted tables, 1 cm and 3 m."""
    told(own(tmp_path, contact=contact, chosen=True, **case))


@pytest.mark.parametrize("contact", ["edge", "vertex"])
@pytest.mark.parametrize(
    "case",
    [
        {},
        {"option": ELLIPTIC},
        {"geom": 'solimp=".1 .9 .0001 .3 3"'},
        {"option": ELLIPTIC, "geom": 'solimp=".99 .5 .0001"'},
        {"geom": 'solref=".01 .5"'},
        {"option": ELLIPTIC, "geom": 'solref="-1000 -50"'},
        {"option": 'impratio="10"', "geom": 'margin=".004" gap=".001"'},
        {"geom": 'friction=".45"'},
        {"option": 'integrator="implicitfast"', "geom": SOFT},
        {"option": 'integrator="implicit"', "geom": SOFT, "body": HEAVY + BOX},
        {"option": 'integrator="implicitfast"', "geom": SOFT, "joint": 'damping=".1"'},
        {"option": 'o_solref=".01 1" o_solimp=".8 .8 .001 .5 2"><flag override="enable"/></option><option '},
        {"body": STACK, "geom": SOFT},
        {"option": ELLIPTIC, "geom": 'margin=".002" solimp=".1 .9 .0001 .3 3"'},
        {"option": ELLIPTIC, "body": NAMED, "extra": f"<contact>{PAIR}</contact>"},
    ],
    ids=str,
)
def test_known_as_modelled(tmp_path: Path, case: dict[str, Any], contact: str) -> None:
    """Pyramids, impedance that varies with the depth, margins, implicit integrators, overridden parameters."""
    told(own(tmp_path, contact=contact, **{"seconds": 1.0, **case}))


@pytest.mark.parametrize(
    ("case", "reason"),
    [
        ({"option": 'integrator="RK4"'}, "integrator rk4"),
        ({"option": 'integrator="discrete"'}, "integrator discrete"),
        ({"option": 'solver="PGS" iterations="5" cone="elliptic"'}, "solver PGS"),
        ({"option": 'noslip_iterations="3"'}, "noslip_iterations"),
        ({"geom": 'condim="6"'}, "condim 6"),
        ({"option": '><flag diagexact="enable"/></option><option '}, "diagexact"),
        ({"body": BOX + '<geom type="box" size=".05 .04 .06" mass="1" solref=".01 1"/>'}, "differ"),
        ({"option": ELLIPTIC, "world": {"mu": 0.16}}, "a contact slides"),
        ({"option": ELLIPTIC, "geom": 'solref=".004 1"', "theta_end": 60.0, "seconds": 0.4}, "no contact holds it"),
    ],
)
def test_unknown_with_its_reason(tmp_path: Path, case: dict[str, Any], reason: str) -> None:
    """Nan in the measures, null in JSON, the word and its reason for people; and no reason is given for nothing."""
    run = own(tmp_path, **case)
    assert reason in slip_floor_unknown(run)
    assert np.isnan(run.measures.slip_floor_m).all()
    summary = json.loads(json.dumps(jsonable(run.summary()), allow_nan=False))
    assert summary["slip_floor_m"] is None
    assert reason in summary["slip_floor_unknown"]
    out = io.StringIO()
    print_run(Console(file=out, width=200), run)
    assert f"unknown: {summary['slip_floor_unknown']}" in out.getvalue()


@pytest.mark.parametrize(
    ("first", "second", "reason"),
    [
        ([*range(500, 510), *range(600, 900, 2)], range(601, 900, 2), ""),
        (range(500, 511), [], "an end of the edge is without contact at 0.51 s"),
        ([500], [500], "no contact holds it at 0.5 s"),
        (range(90), range(90), ""),
    ],
)
def test_an_end_of_an_edge_may_be_without_contact_for_a_while(
    first: list[int], second: list[int], reason: str, shipped: Callable[[str], Run]
) -> None:
    """As that of a mesh, to which MuJoCo gives one contact, at either end in turn; at the start both may be."""
    run = shipped("pivot-3d")
    give = run.log.held.give.copy()
    give[:, first, 0] = give[:, second, 1] = np.nan
    less = altered(run, held=run.log.held._replace(give=give))
    assert slip_floor_unknown(less) == reason
    if not reason:
        told(less)


def test_a_planar_body_of_ones_own(tmp_path: Path) -> None:
    """MuJoCo steps the velocity of the hinge, wherever that is; the centripetal terms implicitly, if asked to."""
    for integrator in ("Euler", "implicit"):
        path = tmp_path / "planar.xml"
        path.write_text(
            f'<mujoco><option integrator="{integrator}" cone="elliptic"/><worldbody><geom type="plane" size="5 5 .1" '
            f'{SOFT}/><body name="b" pos="0 0 1"><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>'
            f'<joint axis="0 -1 0" pos=".05 0 -.02" damping=".02"/><geom type="box" size=".05 .04 .06" {SOFT}/></body>'
            "</worldbody></mujoco>"
        )
        told(simulate(own_object(path, "b", "vertex", chosen=False), theta_end=60.0, seconds=0.6))


@pytest.mark.parametrize("contact", ["edge", "vertex"])
def test_an_object_of_ones_own_starts_at_rest(tmp_path: Path, contact: str) -> None:
    """In the table as deep as its load presses it, and so does not slide at once; and rises as that grows less."""
    small = '<geom type="box" size=".005 .004 .006" mass=".1"/>'
    run = own(tmp_path, body=small, contact=contact, chosen=True, mu=0.3, theta=25.0, theta_end=5.0)
    np.testing.assert_allclose(run.force_measured[0, 0], run.force[0, 0], rtol=0.05, atol=0.005)
    assert not run.log.held.slides.any()
    assert np.diff(run.corner[0, [0, -1], 0, 2])[0] > 1e-6
    assert run.measures.contact_lost_s[0] == 0.0


def test_creep_under_a_constant_load() -> None:
    """Once settled it is -R_t f_t / b, which goes with 1 / impratio."""
    for impratio in (1000.0, 1.0):
        run = simulate("balance-2d", impratio=impratio, seconds=2.0, spread=0.0)
        rows, f_t = run.world.contact_rows, run.force[0, -1, 0, 0]
        assert rows is not None
        R_t = rows.D[1] * rows.softness(np.array(0.0))
        late = run.slip[0, -1, 0, 0] - run.slip[0, run.time.size // 2, 0, 0]
        assert late / (run.time[-1] - run.time[run.time.size // 2]) == pytest.approx(
            -R_t * f_t / rows.points / rows.b, rel=1e-3
        )


def test_rotation_and_depth_while_turning() -> None:
    """Once settled they are c_t (1 / b - h / 2) and w delta / 2, at the depth where k delta = R_n f_n."""
    for timeconst in (0.003, 0.0021):
        run = simulate("pivot-2d", timeconst=timeconst, spread=0.0, seconds=4.0, impratio=1e6)
        rows = run.world.contact_rows
        assert rows is not None
        w = run.angular_velocity[0] @ run.table_axes
        c = np.cross(w[:, None], np.cross(w[:, None], run.turning[0]))[:-1, 0]
        below = c[:, 2] * (1.0 - 0.5 * rows.b * rows.h) / rows.softness(np.array(0.0)) / rows.D[0]
        depth = rows.depth(run.force[0, :, 0, 1] / rows.points - below)
        speed = c[:, 0] * (1.0 / rows.b - 0.5 * rows.h) - w[:-1, 1] * depth / 2.0
        assert np.abs(np.cumsum(speed) * run.dt - run.slip[0, 1:, 0, 0]).max() < 0.05 * run.measures.slip_max_m[0]


def test_a_corner_opens_where_it_is_predicted_to() -> None:
    """c_n (1 - b h / 2) > R_n f_n: a stiff contact (impedance 0.9) opens in the pivot, a soft one does not."""
    stiff = simulate("pivot-2d", impedance=0.9, timeconst=0.004)
    assert stiff.measures.contact_lost_s[0] > 0.05
    assert "no contact holds it" in slip_floor_unknown(stiff)
    assert simulate("pivot-2d", impedance=0.5, timeconst=0.004).measures.contact_lost_s[0] == 0.0


def test_default_contact_settings_would_fail() -> None:
    """MuJoCo's defaults (timeconst 0.02, impedance 0.9, impratio 1): the verdict sees it."""
    run = simulate("pivot-2d", timeconst=0.02, impedance=0.9, impratio=1.0)
    assert run.verdict == "fail"
    assert run.measures.slip_max_m[0] > 1e-4


def test_a_pyramid_makes_the_shipped_settings_bounce(tmp_path: Path) -> None:
    """Its edges make the normal as hard as impratio makes friction: stable beyond a timeconst of 2.23 h, not at 2.1."""
    pyramid = 'cone="pyramidal" impratio="1000"'
    lost = {}
    for timeconst in (0.0042, 0.005):
        geom = f'solref="{timeconst} 1" solimp=".5 .5 .001"'
        lost[timeconst] = own(tmp_path, pyramid, geom, seconds=2.0).measures.contact_lost_s[0]
    assert lost[0.0042] > 1.5
    assert lost[0.005] == 0.0


def resting(cone: str, solimp: str) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><option cone="{cone}" impratio="7"/><default><geom solimp="{solimp}" friction=".6"/></default>'
        '<worldbody><geom type="plane" size="1 1 1"/><body><freejoint/>'
        '<geom type="box" size=".1 .1 .1" mass="3"/></body></worldbody></mujoco>'
    )


def placed(model: mujoco.MjModel, height: float) -> np.ndarray:
    return np.array([*model.qpos0[:2], height, 1.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize(
    "solimp", [".9 .95 .001", ".1 .9 .0001 .3 3", ".99 .5 .0001 .5 1", ".2 .6 0", "0 1 .001 0 2", ".5 .5 .001"]
)
@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_rows_at_any_depth_are_mujocos(solimp: str, cone: str) -> None:
    """The impedance and with it R follow from the depth as MuJoCo's own rows say."""
    model = resting(cone, solimp)
    rows = read_rows(model, 1, 0, [placed(model, 0.09)])
    assert rows is not None
    assert (rows.points, rows.pyramidal) == (4, cone == "pyramidal")
    data = mujoco.MjData(model)
    for depth in (1e-6, 2e-5, 5e-5, 9e-5, 3e-4, 2e-3):
        data.qpos[:] = placed(model, 0.1 - depth)
        mujoco.mj_forward(model, data)
        R, d = data.efc_R, float(rows.impedance(np.array(depth)))
        np.testing.assert_allclose(data.efc_KBIP[0, :3], [rows.k, rows.b, d], rtol=1e-9)
        D = rows.D * [4.0, 2 * 0.6**2, 2 * 0.6**2] if rows.pyramidal else rows.D  # of each edge
        np.testing.assert_allclose(R[:3], rows.softness(np.array(depth)) * D, rtol=1e-9)


@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
@pytest.mark.parametrize("solimp", [".5 .5 .001", ".9 .95 .001", ".1 .9 .0001 .3 3"])
def test_a_box_rests_at_the_depth_that_its_rows_say(cone: str, solimp: str) -> None:
    model = resting(cone, solimp)
    rows = read_rows(model, 1, 0, [placed(model, 0.0999)])
    data = mujoco.MjData(model)
    data.qpos[:] = placed(model, 0.1)
    mujoco.mj_step(model, data, nstep=5000)
    assert rows is not None
    assert rows.depth(np.array(3.0 * 9.81 / 4.0)) == pytest.approx(0.1 - data.qpos[2], rel=1e-6)
