"""A run that is kept: its arrays in a NetCDF file and its scenario in a JSON file, written together and read again."""

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from pivoting import __version__
from pivoting.controller.planning.horizon_program import HorizonProgram
from pivoting.controller.planning.sequential_convex import Plan
from pivoting.controller.validate import InputError, frozen
from pivoting.models.errors import ModelError
from pivoting.sim.belief import Controllers
from pivoting.sim.drawing.recording_id import digest
from pivoting.sim.experiment import Experiment
from pivoting.sim.fleet import Fleet
from pivoting.sim.fleet_arrays import fleet_described, fleet_of, fleet_outcome
from pivoting.sim.netcdf import Variable, read_netcdf, write_netcdf
from pivoting.sim.run import Run
from pivoting.sim.run_arrays import Arrays, described, log_of, outcome_of, outcome_words, plan_of
from pivoting.sim.run_setup import Begun, set_up
from pivoting.sim.scenario_horizon import scenario_horizon
from pivoting.sim.scenarios.scenario import Scenario
from pivoting.sim.scenarios.scenario_file import ScenarioFile, expressible, read, written
from pivoting.sim.whole_files import Writer, write_together

SCENARIO, ARRAYS = "scenario.json", "run.nc"  # the files of a run that has a folder to itself
VERSIONS = {"pivoting": __version__, "mujoco": mujoco.__version__, "numpy": np.__version__}
_PLAN = sorted({each.name for each in fields(Plan)} - {"program", "desired", "guess"})  # what of a plan is no array


def save(run: Experiment, folder: str | os.PathLike[str]) -> Path:
    """Write a run into a folder and return it; see `Experiment.save`."""
    folder = Path(folder)
    write_together(folder, run_files(run, ARRAYS, SCENARIO))
    return folder


def run_files(run: Experiment, arrays: str, scenario: str) -> dict[str, Writer]:
    """The writers of a run's two files, by the names that these are to have.

    The arrays are written first, for the scenario's file says how long their file is, and what its digest is.
    """
    said = written(description(run))
    kept: dict[str, Any] = {}

    def write_arrays(part: Path) -> None:
        variables, outcome = _kept(run)
        texts = {"title": run.scenario.label, "scenario": json.dumps(said), "outcome": json.dumps(outcome)}
        write_netcdf(part, variables, {**texts, "coordinates": "time step_time"})  # xarray knows which are
        kept.update(file=arrays, **_fingerprint(part))

    def write_scenario(part: Path) -> None:
        part.write_text(json.dumps({**said, "arrays": kept}, allow_nan=False, indent=1) + "\n", encoding="utf-8")

    return {arrays: write_arrays, scenario: write_scenario}


def description(run: Experiment) -> ScenarioFile:
    """What the scenario's file says of a run, but for its arrays."""
    case = run.scenario
    return ScenarioFile(
        case,
        run.worlds,
        run.seed,
        run.first_world,
        open_loop=run.open_loop,
        keep=run.keep,
        python_objects=(*run.python_objects, *([] if expressible(case) else ["scenario"])),
        digest=digest(run),
        versions=VERSIONS,
    )


def is_run(path: Path, said: Mapping[str, Any]) -> bool:
    """Whether the scenario's file at `path` describes the run that `said` describes, whatever versions made them."""
    try:
        there = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return isinstance(there, dict) and not _different(there, json.loads(json.dumps(said)), ("versions", "arrays"))


def _different(a: Mapping[str, Any], b: Mapping[str, Any], but: tuple[str, ...]) -> list[str]:
    """The keys, but for some, that are not the same in both."""
    return [key for key in {**a, **b} if key not in but and a.get(key) != b.get(key)]


def load(
    folder: str | os.PathLike[str],
    *,
    scenario: Scenario | None = None,
    controller: Controllers = None,
) -> Run | Fleet:
    """The run that `Run.save` or `pivoting run --out` kept: the same arrays bit for bit, measures and verdict.

    Where only measures were kept it is the `Fleet`.

    World and belief are set up again from the scenario, which takes a model of one's own from where it was.

    Args:
        folder: of the run, or its scenario's file.
        scenario, controller: those of the run, if it was made with a scenario that holds a Python object, such as a
            reference of one's own, or with a controller of one's own.

    Raises:
        ValueError: the run is not whole, is of another version, or is not that of the scenario and controller.
        ModelError: the model has changed since, or is no longer there.
    """
    path = Path(folder)
    path = path / SCENARIO if path.is_dir() else path
    if not path.exists() and path.name == SCENARIO and (others := sorted(path.parent.glob(f"*.{SCENARIO}"))):
        raise InputError(f"{path}: there is no such file; load one of {', '.join(map(str, others))}")
    file = read(path)
    if file.arrays is None:
        raise InputError(f"{path}: names no arrays; it is a scenario to be run, by pivoting run --scenario")
    for name, given in (("scenario", scenario), ("controller", controller)):
        if (given is not None) != (name in file.python_objects):
            told = "was a Python object, which no file holds" if given is None else "is in the file"
            raise InputError(f"{path}: the run's {name} {told}; must be {'given' if given is None else 'left out'}")
    arrays, said, outcome = _read_arrays(path, file.arrays)
    case = scenario or file.scenario
    counts: dict[str, int] = {"worlds": file.worlds, "seed": file.seed, "first_world": file.first_world}
    try:
        begun = set_up(case, controller, **counts)
    except ValueError as error:
        kind = ModelError if isinstance(error, ModelError) else InputError
        raise kind(f"{path}: cannot be set up again: {error}") from None
    try:
        objects = tuple(name for name in file.python_objects if name != "scenario")
        if file.keep == "all":
            run: Run | Fleet = _restored(begun, arrays, outcome, objects)
        else:
            run = fleet_of(begun, arrays, outcome, objects, controller)
    except KeyError as error:
        raise InputError(f"{path.parent / file.arrays['file']}: has no {error.args[0]}") from None
    _check(path, run, said)
    return run


def _restored(begun: Begun, arrays: Arrays, outcome: Mapping[str, Any], python_objects: tuple[str, ...]) -> Run:
    plan = None
    if (found := plan_of(arrays)) is not None:
        desired, guess = found
        figures = {**outcome["plan"], "changes": tuple(outcome["plan"]["changes"])}
        program = HorizonProgram(
            scenario_horizon(begun.case, begun.belief, begun.belief.attached.controller, steps=len(guess.wrench))
        )
        plan = Plan(program, desired, guess, **figures)
    for values in arrays.values():
        frozen(values)
    return Run(
        **begun.experiment,
        start=(arrays["start_qpos"], arrays["start_qvel"]),
        desired=begun.desired,
        log=log_of(arrays),
        plan=plan,
        stance=arrays.get("stance"),
        **outcome_of(arrays, outcome),
        python_objects=python_objects,
    )


def _check(path: Path, run: Run | Fleet, said: Mapping[str, Any]) -> None:
    """Refuse a run that is not the one that was saved."""
    now = json.loads(json.dumps(written(description(run))))
    other = _different(said, now, ("model", "versions"))
    if "digest" in other:
        made, here = (", ".join(f"{name} {v}" for name, v in each.items()) for each in (said["versions"], VERSIONS))
        versions = "" if made == here else f"; it was saved by {made}, and this is {here}"
        raise ModelError(
            f"{path}: the model {str(run.scenario.path)!r}, or what the scenario makes of it, has changed since the "
            f"run was saved: its digest is {now['digest']}, and was {said['digest']}{versions}"
        )
    if other:
        raise InputError(f"{path}: {', '.join(other)} must be as in the run that was saved")


def _kept(run: Experiment) -> tuple[dict[str, Variable], dict[str, Any]]:
    """The arrays of a run or a fleet as their file has them, and what came of it beside them."""
    if isinstance(run, Fleet):
        return fleet_described(run), fleet_outcome(run)
    assert isinstance(run, Run)
    return described(run), _outcome(run)


def _outcome(run: Run) -> dict[str, Any]:
    """What came of a run beside its arrays."""
    return {
        **outcome_words(run),
        "plan": None if run.plan is None else {name: getattr(run.plan, name) for name in _PLAN},
    }


def _read_arrays(path: Path, kept: Mapping[str, Any]) -> tuple[Arrays, dict[str, Any], dict[str, Any]]:
    """Those of a scenario's file, what was said of the run then, and what came of it."""
    name = kept.get("file")
    if not isinstance(name, str):
        raise InputError(f"{path}: arrays: must name their file")
    where = path.parent / name
    try:
        found = _fingerprint(where)
    except OSError as error:
        raise InputError(f"{where}: cannot be read ({error.strerror})") from None
    if found["bytes"] != kept.get("bytes"):
        raise InputError(f"{where}: was cut or replaced, it has {found['bytes']} bytes and not {kept.get('bytes')}")
    if found["blake2b"] != kept.get("blake2b"):
        raise InputError(f"{where}: was changed, its digest is {found['blake2b']} and not {kept.get('blake2b')}")
    try:
        arrays, (scenario, outcome) = read_netcdf(where, "scenario", "outcome")
        return arrays, json.loads(scenario), json.loads(outcome)
    except (AttributeError, LookupError, TypeError, ValueError) as error:  # which SciPy raises of what is no NetCDF
        raise InputError(f"{where}: is no file of a run ({error})") from None


def _fingerprint(path: Path) -> dict[str, Any]:
    with path.open("rb") as file:
        digested = hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16))
    return {"bytes": path.stat().st_size, "blake2b": digested.hexdigest()}
