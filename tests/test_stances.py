"""Stances: the block is held on an edge and, once it has landed, on its face, by one control for each."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pivoting import load
from pivoting.controller import WrenchBounds
from pivoting.sim import Run, chunks, scenario, simulate
from pivoting.sim.judging.measures import predicted_slip
from pivoting.sim.pipeline.law_control import LawControl, LawSolver
from pivoting.sim.pipeline.stages import Answers, States
from pivoting.sim.pipeline.stance_control import StanceControl
from pivoting.sim.scenarios.scenario import Scenario

from tests.own_files import mjcf, own

EDGE, FACE = [0, 1], [2, 3]


@pytest.fixture(scope="module")
def settled() -> Run:
    return simulate("settle-3d", worlds=2, seed=3, spread=0.2)


def test_the_block_is_held_on_its_edge_and_then_on_its_face(settled: Run) -> None:
    """In each stance all of its contacts carry their share, and none that is not to hold is asked for any."""
    assert settled.verdict == "pass"
    assert settled.stance is not None
    for world in range(settled.worlds):
        (change,) = np.flatnonzero(np.diff(settled.stance[world]))
        assert settled.stance[world, -1] == 1
        assert (settled.contacts_found[world, change - 9 : change] == 4).all()  # found for 0.01 s before it changes
        assert not settled.force[world, : change + 1, FACE].any()
        assert (settled.force[world, : change + 1, EDGE, 2] > 0.0).all()
        assert (settled.force[world, change + 1 :, :, 2] > 0.0).all()


def test_the_forces_of_both_stances_are_those_that_are_measured(settled: Run) -> None:
    weight = settled.truth.mass * 10.0
    on_edge = settled.time[:-1] < 1.9
    off = settled.force_measured - settled.force
    assert np.abs(off[:, on_edge & (settled.time[:-1] > 0.1)]).max() < 5e-3 * weight
    assert np.abs(off[:, -50:]).max() < 1e-3 * weight
    assert settled.force[:, -1].sum(axis=1)[:, 2] == pytest.approx(
        weight - settled.wrench_world[:, -1, 2], rel=1e-9
    )  # which balance what is not carried by the wrench


def test_slip_is_counted_for_each_contact_while_it_is_to_hold(settled: Run) -> None:
    """The landing corners come down from afar; what counts is what they move from then on, and it is predicted."""
    assert settled.stance is not None
    path = settled.corner[..., :2] - settled.corner[:, :1, :, :2]
    assert np.abs(path[:, :, FACE]).max() > 1e-2
    for world in range(settled.worlds):
        first = int(settled.stance[world].argmax())
        assert not settled.slip[world, :first, FACE].any()
        own_path = settled.corner[world, first:, FACE, :2] - settled.corner[world, first, FACE, None, :2]
        assert np.array_equal(settled.slip[world, first:, FACE], own_path)
    assert np.array_equal(settled.slip[:, :, EDGE], path[:, :, EDGE])
    assert np.abs(settled.slip - predicted_slip(settled)).max() < 1e-9
    assert np.abs(settled.slip[:, :, FACE]).max() < 1e-8


def test_until_it_lands_it_is_the_same_run(settled: Run) -> None:
    """Bit for bit that of one stance, whose wrench goes on holding the block on its edge."""
    alone = simulate("settle-3d", worlds=2, seed=3, spread=0.2, landing="ignored")
    assert alone.stance is None
    assert alone.force.shape[2] == 2
    assert settled.stance is not None
    first = int(settled.stance.argmax(axis=1).min())
    assert np.array_equal(alone.wrench[:, :first], settled.wrench[:, :first])
    assert np.array_equal(alone.force[:, :first], settled.force[:, :first, EDGE])
    moment = np.abs(settled.wrench[:, :, 3:]).max(axis=2)
    assert np.abs(alone.wrench[:, -1, 3:]).max() > 1.0
    assert moment[:, -1].max() < 1e-3  # a face needs none


def test_worlds_change_their_stance_apart(settled: Run) -> None:
    """Of three worlds one has landed from the first step on, one for a while, one never; each has its own answers."""
    laws = [
        LawControl(LawSolver(stance.controllers, WrenchBounds()), settled.desired, np.zeros((1, 1, 6)))
        for stance in settled.stances
    ]
    control = StanceControl(settled.stances, laws, dt=0.005, worlds=3, steps=6)
    values = np.repeat(settled.log.states[:1, 100], 3, axis=0)
    found = np.array([[4, 4, 2], [4, 2, 2], [4, 4, 2], [4, 4, 2], [2, 4, 2], [4, 4, 2]])
    for k, touching in enumerate(found):
        states = States(values, np.zeros((3, 7)), np.zeros((3, 6)), touching.astype(float))
        out = Answers.empty((3,), 6, 12)
        control(k, states, None, out)
        for world, number in enumerate(control.stance[k]):
            alone = Answers.empty((1,), 6, 12 if number else 6)
            laws[number](k, states.of(np.array([world])), None, alone)
            assert np.array_equal(out.wrench[world], alone.wrench[0])
            assert np.array_equal(out.force[world, : alone.force.shape[1]], alone.force[0])
            assert not out.force[world, alone.force.shape[1] :].any()
            assert (out.status[world], out.residual[world]) == (0, alone.residual[0])
    assert control.stance.T.tolist() == [[0, 1, 1, 1, 1, 1], [0, 0, 0, 1, 1, 1], [0, 0, 0, 0, 0, 0]]


def test_a_table_on_four_legs_is_refused(tmp_path: Path) -> None:
    """Tilted, it stands on two of them, at four corners: to count contacts tells of no landing."""
    legs = "".join(
        f'<geom type="box" size=".01 .01 .05" pos="{x} {y} -.05"/>' for x in (-0.1, 0.1) for y in (-0.1, 0.1)
    )
    text = mjcf('<geom type="box" size=".12 .12 .01" pos="0 0 .01"/>' + legs, pose='pos="0 0 .1"')
    case = own(tmp_path, text).change(landing="held", theta=15.0, theta_end=0.0, limits={"contacts_end": 4})
    with pytest.raises(ValueError, match="must be ignored: of other objects than a single box"):
        simulate(case)


def test_a_fleet_of_stances_does_not_depend_on_its_chunks(settled: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chunks, "CHUNK", 1)
    fleet = simulate("settle-3d", worlds=2, seed=3, spread=0.2, keep="measures")
    for name, values in vars(settled.measures).items():
        assert np.array_equal(getattr(fleet.measures, name), values), name
    assert fleet.replay(1).stance is not None


def test_a_run_of_stances_is_kept(settled: Run, tmp_path: Path) -> None:
    again = load(settled.save(tmp_path))
    assert settled.stance is not None
    assert np.array_equal(again.stance, settled.stance)
    assert np.array_equal(again.measures.slip_floor_m, settled.measures.slip_floor_m)
    assert again.verdict == settled.verdict


def test_a_box_of_ones_own_is_set_down_and_held(tmp_path: Path) -> None:
    case = own(tmp_path, mjcf()).change(
        landing="held", theta=15.0, theta_end=0.0, seconds=1.0, limits={"contacts_end": 4}
    )
    run = simulate(case)
    assert run.stance is not None
    assert run.stance[0, -1] == 1
    assert run.verdict == "pass", run.checks


def test_a_controller_that_is_given_has_the_stance_that_it_is_made_for() -> None:
    given = simulate("settle-3d", seconds=0.3).attached.controller
    run = simulate("settle-3d", controller=given)
    assert run.scenario.landing == "ignored"
    assert run.stance is None
    assert run.verdict == "pass"


@pytest.mark.parametrize(
    ("case", "keys", "message"),
    [
        ("pivot-2d", {}, "landing = 'held': must be ignored: only what is tilted in space lands on a face"),
        ("spin-3d", {}, "landing = 'held': must be ignored: only what is tilted in space lands on a face"),
        ("pivot-3d", {}, "landing = 'held': must be ignored: nothing is to land without limit.contacts_end"),
        (
            "pivot-3d",
            {"limits": {"contacts_end": 4}, "contact": "vertex"},
            "of other objects than a single box, on an edge",
        ),
        ("settle-3d", {"plan_hz": 100}, "landing = 'held': must be ignored with a plan"),
        ("settle-3d", {"reference": "return"}, "the reference return does not set it down and leave it there"),
        ("settle-3d", {"reference": "constant"}, "the reference constant does not set it down and leave it there"),
        ("settle-3d", {"force_rate": 50.0}, "a bound on a rate does not let the wrench change as the contacts do"),
        ("settle-3d", {"integral": 2.0}, "landing = 'held': must be ignored with a plan, integral action"),
        (
            "settle-3d",
            {"control": lambda now: np.zeros(6)},
            "landing = 'held': must be left out: a controller or control",
        ),
        (
            "settle-3d",
            {"controller": "given"},
            "landing = 'held': must be left out: a controller or control of your own",
        ),
        ("settle-3d", {"landing": "later"}, "landing = 'later': must be one of ignored, held"),
    ],
)
def test_what_knows_one_stance_is_refused(case: str | Scenario, keys: dict, message: str) -> None:
    if contact := keys.pop("contact", None):
        case = replace(scenario(str(case)), contact=contact)
    if keys.get("controller") == "given":
        keys = {"controller": simulate("settle-3d", seconds=0.3).attached.controller}
    with pytest.raises(ValueError, match=message):
        simulate(case, **{"landing": "held", **keys})
