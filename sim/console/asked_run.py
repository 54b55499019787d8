"""What `pivoting run` is asked for: a scenario by its name, of an object of one's own, or from a file; with changes."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import click
from pivoting.controller.validate import InputError
from pivoting.sim.console.scenario_options import own_scenario, pairs
from pivoting.sim.drawing.recording_id import digest
from pivoting.sim.experiment import Experiment
from pivoting.sim.scenarios.scenario_file import ScenarioFile, read
from pivoting.sim.scenarios.shipped_scenarios import OWN
from pivoting.sim.scenarios.shipped_scenarios import scenario as find


def ask(
    name: str | None,
    file: Path | None,
    *,
    worlds: int | None,
    seed: int | None,
    settings: tuple[str, ...],
    limits: tuple[str, ...],
    open_loop: bool,
    keep: str | None = None,
    **own: Any,
) -> ScenarioFile:
    """The run that is asked for, as if a file described it.

    Args:
        name: of the scenario.  file: that describes the run, in place of a name.
        worlds, seed, open_loop, keep: in place of those of the file, if they are given.
        settings, limits: KEY=VALUE, changes of the scenario and of its limits.
        own: the options that describe an object of one's own.

    Raises:
        ClickException: the options contradict one another.
        ValueError: an unknown scenario or key, a value out of range, or a file that cannot be run.
    """
    changes: dict[str, Any] = pairs("--set", settings)
    if "limits" in changes:
        raise click.BadParameter("--set limits: must be --limit KEY=VALUE")
    asked = _described(name, file, own)
    case = asked.scenario.change(**changes, limits=pairs("--limit", limits))
    case.refuse_without_effect(case.given, open_loop)
    given = [option for option, value in own.items() if value is not None and value is not False]
    if name != OWN and given:
        told = f"only the scenario {OWN} takes it, not {name or str(file)!r}"
        raise click.BadParameter(f"--{given[0].replace('_', '-')}: {told}")
    others: dict[str, Any] = {"worlds": worlds, "seed": seed, "open_loop": open_loop or None, "keep": keep}
    others = {option: value for option, value in others.items() if value is not None}
    changed = bool(settings or limits or others)
    return replace(asked, case=case, **others, digest=None if changed else asked.digest)


def changed_since(asked: ScenarioFile, run: Experiment) -> str:
    """What to say if the file describes a run that was another: its model, or what makes it, is not the same; or ""."""
    if asked.digest in (None, digest(run)):
        return ""
    made = ", ".join(f"{package} {version}" for package, version in asked.versions.items())
    told = f"it was written of a run with the digest {asked.digest}, and this one has {digest(run)}"
    return f"{told}: the model has changed, or what it was run with ({made})"


def _described(name: str | None, file: Path | None, own: dict[str, Any]) -> ScenarioFile:
    """Before it is changed."""
    if file is None and name is None:
        raise click.UsageError("Missing argument 'SCENARIO', or --scenario FILE")
    if file is None:
        return ScenarioFile(own_scenario(**own) if name == OWN else find(str(name)))
    if name is not None:
        raise click.UsageError(f"SCENARIO {name!r} and --scenario {str(file)!r}: must be one of the two")
    described = read(file)
    if described.python_objects:
        whose = ", ".join(described.python_objects)
        raise InputError(f"{file}: cannot be run again: Python objects, which no file holds, were its {whose}")
    return described
