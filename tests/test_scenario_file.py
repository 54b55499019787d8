"""Scenarios as files: what is written of them is read again, by hand they may be short, and what is wrong is named."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pivoting import load
from pivoting.controller.references import Constant
from pivoting.sim import SCENARIOS, Scenario, own_object, simulate
from pivoting.sim.scenarios.scenario_file import ScenarioFile, expressible, read, written

from tests.own_files import mjcf, own
from tests.processes import called

MUG = own_object("/somewhere/mug.xml", "mug", "vertex")
CASES = [
    *SCENARIOS.values(),
    SCENARIOS["incline-2d"].change(mu=0.3),  # which takes the world's own away
    SCENARIOS["incline-2d"].change(mu=0.3, **{"world.mu": 0.35, "world.size": 2}),
    SCENARIOS["snap-2d"].change(f_min=None, seconds="2T"),
    SCENARIOS["pivot-2d"].change(theta=np.float64(0.1) + 0.2 + 11.0, plan_hz=100, plan_steps=np.int64(7)),
    MUG,
    MUG.change(force_max="0.8w", limits={"slip_m": 1e-3, "contacts_end": 4}),
    own_object("/somewhere/mug.xml", "#1", np.array([[0.1, 0.2, 1 / 3]]), support="shelf", chosen=False),
    Scenario("mine", "my own", "pivot-2d", theta=12.0),
    Scenario("mine", "my own", Path("/somewhere/mug.xml"), theta=12.0, contact="edge", about="yaw"),
    replace(SCENARIOS["pivot-3d"], contact="vertex"),
]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.label[:60])
def test_what_is_written_is_read_again(case: Scenario, tmp_path: Path) -> None:
    """With all that was changed, and what it was set to as it was set."""
    assert expressible(case)
    file = ScenarioFile(case, 3, seed=10**20, first_world=2, open_loop=True, digest="abc", versions={"numpy": "2"})
    (tmp_path / "it.json").write_text(json.dumps(written(file)))
    again = read(tmp_path / "it.json")
    assert replace(again, case=None) == replace(file, case=None)
    for name in ("name", "summary", "body", "support", "chosen", "about", "path", "changes"):
        assert getattr(again.scenario, name) == getattr(case, name), name
    points = case.contact if isinstance(case.contact, str) else np.asarray(case.contact).tolist()
    assert again.scenario.contact == points
    assert again.scenario.label == case.label


@pytest.mark.parametrize(
    "case",
    [
        SCENARIOS["pivot-2d"].change(reference=Constant(0.5)),
        SCENARIOS["pivot-2d"].change(theta=np.float32(11.5)),  # with which NumPy computes in single precision
        replace(SCENARIOS["incline-2d"], world={}),  # which no key says
    ],
    ids=["reference", "float32", "world"],
)
def test_what_no_file_says_is_known(case: Scenario) -> None:
    assert not expressible(case)
    json.dumps(written(ScenarioFile(case, python_objects=("scenario",))))


def test_by_hand_it_may_be_short(tmp_path: Path) -> None:
    """A model's path counts from the file."""
    (tmp_path / "a.json").write_text('{"scenario": "pivot-2d"}')
    assert read(tmp_path / "a.json") == ScenarioFile(SCENARIOS["pivot-2d"])
    (tmp_path / "b.json").write_text(
        '{"scenario": "pivot", "model": "mug.xml", "body": "mug", "contact": "vertex", "changes": {"theta": "7"}}'
    )
    assert read(tmp_path / "b.json").case == own_object(tmp_path / "mug.xml", "mug", "vertex").change(theta=7.0)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "must be a scenario in JSON"),
        ("[1]", 'must be a JSON object such as {"scenario": "pivot-2d"}'),
        ("{}", "must be a JSON object such as"),
        ('{"scenario": "fly-2d"}', "scenario = 'fly-2d': must be one of balance-2d"),
        ('{"scenario": "pivot"}', "scenario = 'pivot': must be one of balance-2d"),
        ('{"scenario": 3}', "scenario = 3: must be text"),
        ('{"scenario": "pivot-2d", "worlds": true}', "worlds = true: must be a whole number"),
        ('{"scenario": "pivot-2d", "worlds": 1.5}', "worlds = 1.5: must be a whole number"),
        ('{"scenario": "pivot-2d", "open_loop": 1}', "open_loop = 1: must be true or false"),
        ('{"scenario": "pivot-2d", "sed": 1}', "sed: must be one of format, scenario,"),
        ('{"scenario": "pivot-2d", "body": "mug"}', "body: must be a model, or a scene, and a body, or left out"),
        ('{"scenario": "pivot", "model": "mug.xml"}', "model: must be a model, or a scene, and a body"),
        ('{"scenario": "pivot", "model": "m.xml", "body": "m", "contact": 3}', "contact = 3: must be text or a list"),
        ('{"scenario": "pivot-2d", "changes": {"thet": 1}}', "thet = 1: must be a known key"),
        ('{"scenario": "pivot-2d", "changes": {"theta": [1]}}', "theta = [1]: must be a finite number"),
        ('{"scenario": "pivot-2d", "changes": {"theta": NaN}}', "theta = nan: must be a finite number"),
        ('{"scenario": "pivot-2d", "changes": {"limit.slip": 1}}', "limits.slip = 1: must be a known limit"),
        ('{"scenario": "pivot-2d", "changes": {"limits": {}}}', "changes: limits must be limit.KEY"),
        ('{"scenario": "pivot-2d", "changes": {"world": {}}}', "changes: world must be world.KEY"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named_with_the_file(text: str, told: str, tmp_path: Path) -> None:
    file = tmp_path / "it.json"
    file.write_text(text)
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        read(file)
    assert str(caught.value).startswith(f"{file}: ")
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


def run(*words: str, cwd: Path) -> dict[str, Any]:
    done = called("run", *words, "--json", cwd=cwd)
    assert done.returncode in (0, 1), done.stderr
    return dict(json.loads(done.stdout))


@pytest.mark.parametrize(
    "words",
    [
        ["snap-2d", "--worlds", "3", "--seed", "5", "--set", "world.mu=0.29", "--limit", "slip_m=1e-6"],
        ["mpc-2d", "--open-loop", "--set", "seconds=0.3"],
        ["pivot", "--model", "own.xml", "--body", "box", "--contact", "edge", "--set", "seconds=0.3"],
    ],
    ids=lambda words: words[0],
)
def test_a_kept_run_is_run_again_to_the_same_arrays(words: list[str], tmp_path: Path) -> None:
    """Bit for bit, from another folder; and kept there it is the same run."""
    own(tmp_path, mjcf())
    told = run(*words, "--out", "out", cwd=tmp_path)
    file = tmp_path / "out" / told["scenario_file"]
    (tmp_path / "elsewhere").mkdir()
    again = run("--scenario", str(file), "--out", "out", cwd=tmp_path / "elsewhere")
    first, second = (load(folder / "out" / told["scenario_file"]) for folder in (tmp_path, tmp_path / "elsewhere"))
    for values, others in zip(arrays(first.log), arrays(second.log), strict=True):
        assert values.tobytes() == others.tobytes()
    assert first.log.answers.wrench.any()
    for name in ("changes", "limits", "seed", "worlds", "verdict", "scenario_file"):
        assert told[name] == again[name], name
    files = sorted(path.name for path in (tmp_path / "out").iterdir())
    done = called("run", "--scenario", str(file), "--out", "out", cwd=tmp_path)
    assert f"replaced out/{told['scenario_file'].removesuffix('.scenario.json')}.summary.json" in done.stdout
    assert files == sorted(path.name for path in (tmp_path / "out").iterdir())


def arrays(log: Any) -> list[np.ndarray]:
    """Those that no clock is in."""
    found = [each for name, each in log._asdict().items() if name != "control_ns" and each is not None]
    flat = [values for each in found for values in (each if isinstance(each, tuple) else (each,))]
    return [values for values in flat if isinstance(values, np.ndarray)]


def test_more_can_be_changed_of_a_file(tmp_path: Path) -> None:
    """What is given on the command line holds; and a file of later worlds is of these."""
    case = SCENARIOS["snap-2d"].change(f_min="4w")
    simulate(case, 2, seed=3, first_world=7, seconds=0.35).save(tmp_path)
    told = run("--scenario", "scenario.json", "--set", "mu=0.35", "--worlds", "1", "--out", "out", cwd=tmp_path)
    assert told["changes"] == {"f_min": "4w", "seconds": 0.35, "mu": 0.35}
    again = load(tmp_path / "out" / "snap-2d.scenario.json")
    expected = simulate(case, 1, seed=3, first_world=7, seconds=0.35, mu=0.35)
    assert again.wrench.tobytes() == expected.wrench.tobytes()


def test_a_model_that_has_changed_since_is_said(tmp_path: Path) -> None:
    """It may be what is wanted; but the arrays are others."""
    simulate(own(tmp_path, mjcf())).save(tmp_path)
    (tmp_path / "own.xml").write_text(mjcf().replace(".05 .04 .06", ".05 .04 .0601"))
    done = called("run", "--scenario", "scenario.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stderr.startswith("pivoting: scenario.json: it was written of a run with the digest ")
    assert "the model has changed" in done.stderr
    same = own(tmp_path, mjcf())
    assert same.path.exists()
    assert called("run", "--scenario", "scenario.json", cwd=tmp_path).stderr == ""


def test_wrong_calls_are_one_line_and_exit_2(tmp_path: Path) -> None:
    case = SCENARIOS["pivot-2d"].change(reference=Constant(0.5), seconds=0.3)
    simulate(case, control=lambda moment: np.zeros(3)).save(tmp_path)
    (tmp_path / "plain.json").write_text('{"scenario": "pivot-2d"}')
    (tmp_path / "none.json").write_text('{"scenario": "pivot-2d", "worlds": 0}')
    before = sorted(tmp_path.iterdir())
    for words, told in (
        ([], "Missing argument 'SCENARIO', or --scenario FILE"),
        (["pivot-2d", "--scenario", "plain.json"], "SCENARIO 'pivot-2d' and --scenario 'plain.json': must be one of"),
        (["--scenario", "plain.json", "--body", "x"], "--body: only the scenario pivot takes it, not 'plain.json'"),
        (["--scenario", "gone.json"], "gone.json: cannot be read (No such file or directory)"),
        (["--scenario", "."], ".: cannot be read (Is a directory)"),
        (["--scenario", "run.nc"], "run.nc: must be a scenario in JSON"),
        (["--scenario", "none.json"], "worlds = 0: must be a whole number >= 1"),
        (["--scenario", "scenario.json"], "scenario.json: cannot be run again: Python objects, which no file holds"),
    ):
        done = called("run", *words, "--out", "out", cwd=tmp_path)
        assert (done.returncode, done.stdout) == (2, ""), words
        assert told in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1
    assert [path for path in sorted(tmp_path.iterdir()) if path.name != "out"] == before
