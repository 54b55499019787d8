"""Why a run failed, and what would hold it: reasons against the run's arrays, and remedies by running them."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pivoting.sim import Run, simulate
from pivoting.sim.judging.advice import SLIDES, reasons, remedies, tried
from pivoting.sim.scenarios.scenario import Scenario

from tests.own_files import BOX, mjcf, own

HEAVY = '<inertial pos="0 0 0" mass=".025" diaginertia="1 1 1"/>'


def slid(folder: Path) -> Scenario:
    return own(folder, mjcf()).change(world={"mu": 0.05}, mu=1.0)


def short(folder: Path) -> Scenario:
    return own(folder, mjcf(), "vertex").change(seconds=0.04, theta_end=40.0, f_min=0.0)


def absurd(folder: Path) -> Scenario:
    return own(folder, mjcf(HEAVY + BOX), "vertex").change(seconds=0.5)


def crept(folder: Path) -> Scenario:
    return own(folder, mjcf(option='cone="elliptic"'), chosen=False).change(limits={"slip_m": 5e-5})


def diverged(folder: Path) -> Scenario:
    return own(folder, mjcf()).change(bandwidth=3000.0)


def rang(folder: Path) -> Scenario:
    """A vertex far from the CoM of a plate of little inertia: the law rings with a soft contact."""
    light = '<inertial pos="0 0 0" mass="1" diaginertia="1e-3 1e-3 1e-3"/><geom type="box" size=".2 .2 .015"/>'
    soft = {"timeconst": 0.0046, "impedance": 0.23}
    return own(folder, mjcf(light, pose='pos="0 0 .015"'), "vertex").change(seconds=2.0, bandwidth=100.0, **soft)


def obstacle(folder: Path) -> Scenario:
    ball = '<geom name="ball" type="sphere" size=".02"/>'
    return own(folder, mjcf(world=f'<body pos="0 0 .25"><freejoint/>{ball}</body>'))


CASES: list[Callable[[Path], Scenario]] = [slid, short, absurd, crept, diverged, rang, obstacle]
SAID = {
    "slid": "the contact slid at ", "short": "the contact let go at ", "absurd": "the contact let go at ",
    "crept": "the contact ", "diverged": "the object diverged at ", "rang": "the object diverged at ",
    "obstacle": "geom 'g' touches 'ball' at ",
}  # fmt: skip


@pytest.fixture(scope="module")
def failing(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Run]:
    return {case.__name__: simulate(case(tmp_path_factory.mktemp(case.__name__))) for case in CASES}


@pytest.mark.parametrize("name", SAID)
def test_it_says_why(name: str, failing: dict[str, Run]) -> None:
    run = failing[name]
    assert run.verdict == "fail"
    assert any(reason.startswith(SAID[name]) for reason in reasons(run)), reasons(run)


def numbers(sentence: str) -> list[float]:
    out = []
    for word in sentence.replace("(", " ").replace(",", " ").replace(":", " ").split():
        try:
            out.append(float(word))
        except ValueError:
            continue
    return out


@pytest.mark.parametrize("name", SAID)
def test_what_it_says_is_so(name: str, failing: dict[str, Run]) -> None:
    """Every time, angle and size in a sentence is that of the arrays."""
    run = failing[name]
    use, push = np.nan_to_num(run.friction_use[0]).max(axis=1), run.force_measured[0, :, :, -1]
    for reason in reasons(run):
        said = numbers(reason)
        if reason.startswith("the contact slid at"):
            k = int(np.abs(run.time - said[0]).argmin())
            assert use[max(k - 2, 0) : k + 3].max() >= SLIDES > use[: max(k - 2, 0)].max(initial=0.0)
            assert said[1] == pytest.approx(np.rad2deg(run.theta[0, k]), rel=0.02)
            assert said[2] == pytest.approx(run.world.mu, rel=0.01)
        elif reason.startswith("the contact let go at"):
            k = int(np.abs(run.time - said[0]).argmin())
            assert (~(push[max(k - 2, 0) : k + 3] > 0.0).any(axis=1)).any()
            assert said[2] == pytest.approx(run.measures.contact_lost_s[0], rel=0.01)
            assert said[3] == pytest.approx(np.nanmin(run.force[0, :, :, -1]), rel=0.01)
            assert said[4] == pytest.approx(said[3] / run.load.force, rel=0.06)
        elif reason.startswith("the object diverged"):
            k = int(np.abs(run.time - said[0]).argmin())
            size = np.abs(np.hstack([run.position[0], run.velocity[0], run.angular_velocity[0]]))
            assert not (size[k] < 1e6).all()
            assert (size[: max(k - 1, 0)] < 1e6).all()
        elif reason.startswith("the contact crept"):
            assert said[0] == pytest.approx(1e3 * run.measures.slip_max_m[0], rel=0.01)
            assert use.max() < SLIDES
        elif reason.startswith("the angle was off"):
            assert said[0] == pytest.approx(run.measures.angle_error_max_deg[0], rel=0.01)
        elif reason.startswith("the contact force was not"):
            assert said[0] == pytest.approx(100.0 * run.measures.force_mismatch_rel[0], rel=0.01)


@pytest.mark.parametrize("name", sorted(SAID.keys() - {"obstacle"}))  # nothing holds what something falls on
def test_what_is_said_to_hold_it_does(name: str, failing: dict[str, Run]) -> None:
    """The first that was tried and passed, given again as text, as the command line does."""
    run = failing[name]
    found = tried(run, simulate)
    assert found["holds"] is not None, found["tried"]
    pairs = [pair.split("=") for pair in found["setting"].replace("--set ", "").split()]
    again = simulate(run.scenario.change(**dict(pairs)))
    assert again.verdict == "pass", [check for check in again.checks if not check.passed]
    assert found["setting"] in [one.setting for one in remedies(run)]


def test_remedies_are_tried_on_the_worlds_that_failed() -> None:
    run = simulate("snap-2d", 2, seed=3, first_world=5, f_min=0.0)
    seen: list[Run] = []

    def noted(*arguments: Any, **options: Any) -> Run:
        seen.append(simulate(*arguments, **options))
        return seen[-1]

    assert tried(run, noted)["holds"] is not None
    assert {(one.worlds, one.seed, one.first_world) for one in seen} == {(2, 3, 5)}


def test_absurd_inertia_is_held_by_a_floor(failing: dict[str, Run]) -> None:
    assert any("f_min" in one.keys for one in remedies(failing["absurd"]))


@pytest.mark.parametrize("name", ["diverged", "rang"])
def test_of_what_diverges_the_law_is_made_slower(name: str, failing: dict[str, Run]) -> None:
    """Also if its bandwidth is within what the time step can follow."""
    assert remedies(failing[name])[0].keys["bandwidth"] < failing[name].scenario.bandwidth


def test_of_a_files_own_parameters_it_says_so(failing: dict[str, Run]) -> None:
    assert any("without --as-modelled they are chosen" in reason for reason in reasons(failing["crept"]))
    case = failing["crept"].scenario
    assert simulate(replace(case, chosen=True)).verdict == "pass"


def test_a_run_that_passes_has_nothing_to_say(tmp_path: Path) -> None:
    run = simulate(own(tmp_path, mjcf()))
    assert (reasons(run), remedies(run)) == ([], [])
