"""`pivoting check`: a reference is qualified before it starts, and what cannot hold comes with a proof."""

import json
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pivoting.controller import FarkasCertificate
from pivoting.sim import check_reference, simulate
from pivoting.sim.console.command_line import main

from tests.own_files import own
from tests.test_certificates import accepted
from tests.test_lengths import scaled

SET = ["mu=0.25", "mass=0.8:1.2", "com=-0.05:0.05", "inertia=0.8:1.2"]
Said = Callable[..., tuple[int, str, str]]


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Said:
    """Exit code, stdout and stderr of the command in this process."""

    def call(*words: str, keys: list[str] = []) -> tuple[int, str, str]:  # noqa: B006
        given = [word for key in keys for word in ("--set", key)]
        monkeypatch.setattr(sys, "argv", ["pivoting", "check", *words, *given])
        code = main()
        return code, *capfd.readouterr()

    return call


def test_a_yes_tells_where_it_is_tightest(said: Said) -> None:
    keys = ["force_max=6", "moment_max=3", *SET]
    code, text, _ = said("pivot-2d", "--points", "20", keys=keys)
    assert code == 0
    assert "yes: at each of them there is a wrench within the bounds" in text
    assert "times as wide" in text
    found = check_reference(
        "pivot-2d", 20, force_max=6.0, moment_max=3.0, mu=0.25, mass=(0.8, 1.2), com=(-0.05, 0.05), inertia=(0.8, 1.2)
    )
    assert found.answer == "yes"
    assert found.scale is not None
    assert 1.0 < found.scale.scale < 2.0
    assert found.fullest is not None
    assert 0.5 < found.fullest.share <= 1.0 + 1e-6
    assert found.tightest.margin == min(moment.margin for moment in found.moments) > 0.0
    for moment in found.moments:
        assert moment.wrench is not None
        assert found.bounds.excess(moment.wrench) < 1e-6


def test_a_no_names_the_first_moment_and_carries_a_proof(said: Said, tmp_path: Path) -> None:
    keys, path = ["force_max=2", "moment_max=1", *SET], tmp_path / "proof.json"
    code, text, _ = said("pivot-2d", "--points", "12", "--json", "--out", str(path), keys=keys)
    told = json.loads(text)
    assert (code, told["answer"]) == (1, "no")
    first = next(moment for moment in told["moments"] if moment["answer"] == "no")
    assert told["first"]["time_s"] == first["time_s"]
    kept = json.loads(path.read_text())
    assert kept == told["first"]["certificate"]
    assert accepted(kept)
    assert FarkasCertificate.from_dict(kept).holds()
    assert accepted(told["feasible_scale"]["certificate"])
    assert told["feasible_scale"]["scale"] < 1.0
    kept["b"] = [value + 1.0 for value in kept["b"]]
    assert not accepted(kept)
    code, text, _ = said("pivot-2d", "--points", "12", keys=keys)
    assert code == 1
    assert "no: first at" in text
    assert "< 0 with |x| <= R" in text


@pytest.mark.parametrize(
    ("name", "keys"),
    [("pivot-2d", {"force_max": "0.6w", "mass": (0.9, 1.1)}), ("pivot-3d", {}), ("balance-3d", {})],
    ids=["a set, a bound that binds", "an edge", "a vertex"],
)
def test_what_is_checked_is_what_a_run_asks_for(name: str, keys: dict) -> None:
    """The first moment is a run's first step, where that starts on its reference."""
    run, found = simulate(name, seconds=0.15, spread=0.0, **keys), check_reference(name, 2, spread=0.0, **keys)
    assert found.answer == "yes"
    np.testing.assert_allclose(found.moments[0].wrench, run.wrench[0, 0], atol=1e-4 * np.abs(run.required).max())


def test_without_bounds_it_is_always_a_yes_and_says_so(said: Said) -> None:
    code, text, _ = said("pivot-2d", "--points", "5", keys=SET)
    assert code == 0
    assert "without force_max or moment_max a wrench that is large enough always exists" in text
    assert "largest force of the smallest wrench" in text
    code, text, _ = said("pivot-2d", "--points", "5", "--json", keys=SET)
    told = json.loads(text)
    assert (told["answer"], told["bounded"], told["set"]) == ("yes", False, True)
    assert (told["feasible_scale"]["scale"], told["feasible_scale"]["ends"]) == (None, "nothing")


def test_of_several_stances_the_first_is_checked(said: Said) -> None:
    code, text, _ = said("settle-3d", "--points", "10", keys=["force_max=2w"])
    assert code == 0
    assert "moments are not checked: once it has landed, the object is held by other contacts" in text


def test_several_contacts_and_what_is_not_considered_are_told(said: Said) -> None:
    code, text, _ = said("pivot-3d", "--points", "3", keys=["force_max=2w", "force_rate=100", "mass=1.9:2.1"])
    assert code in (0, 1)
    assert "weak stability" in text
    assert "bounds on rates are not checked" in text


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["mpc-2d"], "plan_hz = 100.0: must be left out"),
        (["nothing"], "scenario = 'nothing'"),
        (["pivot-2d", "--points", "1"], "1 is not in the range"),
        (["pivot-2d", "--set", "force_max=-1"], "force_max"),
        ([], "Missing argument"),
    ],
)
def test_wrong_uses_are_one_line_and_exit_2(said: Said, words: list[str], message: str) -> None:
    code, text, told = said(*words)
    assert (code, text) == (2, "")
    assert message in told
    assert told.count("\n") == 1


def test_figures_are_in_si_whatever_the_unit_of_the_file_is(tmp_path: Path) -> None:
    def found(unit: float, most: str) -> dict:
        keys = {"force_max": most, "moment_max": 0.2, "mass": (0.9, 1.0)}
        told = check_reference(own(tmp_path, scaled(unit)), 3, **keys).summary()
        first = told["first"]
        proof = [] if first is None else [first["certificate"][f"unit_of_{each}"] for each in ("force_N", "length_m")]
        return {
            "answer": told["answer"],
            "scale": [told["feasible_scale"]["scale"], *proof],
            "margins": [moment["margin_N"] for moment in told["moments"]],
            "wrench": [moment["wrench"] for moment in told["moments"] if moment["wrench"]],
        }

    for most, answer in (("1w", "yes"), ("0.02w", "no")):
        right, other = found(1.0, most), found(1e-3, most)
        assert right["answer"] == other["answer"] == answer
        for key in ("scale", "margins", "wrench"):
            np.testing.assert_allclose(other[key], right[key], rtol=1e-3, atol=1e-4)
