"""What a run leaves in a folder: recording, arrays, scenario and summary, named after the scenario, or the object."""

import json
import re
import shlex
from collections.abc import Mapping
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pivoting.sim.console.json_values import jsonable
from pivoting.sim.drawing.rerun_recording import RecordingOffError, record, refuse_if_off
from pivoting.sim.fleet import Fleet
from pivoting.sim.run import Run
from pivoting.sim.saved_run import SCENARIO, description, is_run, run_files
from pivoting.sim.scenarios.scenario import Scenario
from pivoting.sim.scenarios.scenario_file import written
from pivoting.sim.whole_files import Writer, write_together

LATEST = "summary.json"
ENDINGS = ("rrd", "nc", SCENARIO, "summary.json")  # of the files of a run


class Saved(NamedTuple):
    """summary: as it was written, with what was recorded.  said: of what was written where, a line each."""

    summary: dict[str, Any]
    said: list[str]


def stem(case: Scenario) -> str:
    """What a scenario's files are called: its name; of your own object also the model, body and contact."""
    parts = [case.name]
    if case.own:
        contact = case.contact
        if not isinstance(contact, str):
            contact = "+".join(",".join(f"{x:g}" for x in point) for point in np.atleast_2d(contact))
        parts += [case.path.stem, case.body, contact]
    return "-".join(re.sub(r"[^\w.,+#-]+", "_", part) for part in dict.fromkeys(parts) if part)


def save(run: Run | Fleet, folder: Path, world: int | None = None, *, also: Mapping[str, Any] | None = None) -> Saved:
    """Write NAME.rrd, NAME.nc, NAME.scenario.json and NAME.summary.json, which is also the folder's summary.json.

    All of them are written, whole, or none. NAME is that of `stem`, with a number behind it if another run has it.

    Args:
        run: of `simulate`; of a fleet the world that is recorded is run again.
        folder: that exists.
        world: that is recorded; None: the worst.
        also: further entries of the summary.

    Raises:
        ValueError: there is no such world.
        OSError: a file cannot be written.
    """
    name = _free_name(run, folder)
    chosen = run.worst_world if world is None else world
    recording: str | None = f"{name}.rrd"
    writers: dict[str, Writer] = {}
    try:
        refuse_if_off()
        writers[f"{name}.rrd"] = partial(_record, run, world=chosen)
        which = (
            f"world {chosen} of {run.worlds}" + (", the worst," if world is None else "") if run.worlds > 1 else "it"
        )
        where = folder / f"{name}.rrd"
        told = f"{which} is in {where}, see it with: rerun {shlex.quote(str(where))}"
    except RecordingOffError as off:
        recording, told = None, f"nothing is recorded: {off}"
    summary = {
        **jsonable(run.summary()),
        **jsonable(dict(also or {})),
        "recording": recording,
        "recorded_world": None if recording is None else chosen,
        "scenario_file": f"{name}.{SCENARIO}",
    }
    text = json.dumps(summary, allow_nan=False, indent=1) + "\n"
    writers |= run_files(run, f"{name}.nc", f"{name}.{SCENARIO}")
    writers |= dict.fromkeys((f"{name}.summary.json", LATEST), lambda part: part.write_text(text))
    wrote = "replaced" if (folder / f"{name}.summary.json").exists() else "wrote"
    write_together(folder, writers)
    with_it = f"with {name}.nc and {name}.{SCENARIO}"
    return Saved(summary, [f"{wrote} {folder / f'{name}.summary.json'}, also as {LATEST}, {with_it}", told])


def _record(run: Run | Fleet, path: Path, *, world: int) -> Path:
    return record(run, path, world=world) if isinstance(run, Run) else record(run.replay(world), path, world=0)


def _free_name(run: Run | Fleet, folder: Path) -> str:
    """The run's own name in the folder, with a number behind it if another run's files have that name."""
    first, here = stem(run.scenario), written(description(run))
    for number in count(1):
        name = first if number == 1 else f"{first}-{number}"
        taken = [path for ending in ENDINGS if (path := folder / f"{name}.{ending}").exists()]
        if not taken or is_run(folder / f"{name}.{SCENARIO}", here):
            return name
    raise AssertionError("there are as many names as numbers")
