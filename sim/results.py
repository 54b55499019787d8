"""What a run leaves in a folder: its recording and its summary, named after the scenario, or the object and contact."""

import json
import os
import re
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pivoting.sim.recording import RecordingOffError, record
from pivoting.sim.report import jsonable
from pivoting.sim.run import Run
from pivoting.sim.scenario import Scenario

LATEST = "summary.json"


class Saved(NamedTuple):
    """summary: as it was written, with what was recorded.  said: of what was written where, a line each."""

    summary: dict[str, Any]
    said: list[str]


def stem(case: Scenario) -> str:
    """What a scenario's files are called: its name; of your own object also the model, body and contact."""
    if isinstance(case.scene, str):
        parts = [case.name]
    else:
        contact = case.contact
        if not isinstance(contact, str):
            contact = "+".join(",".join(f"{x:g}" for x in point) for point in np.atleast_2d(contact))
        parts = [case.name, Path(case.scene).stem, case.body, contact]
    return "-".join(re.sub(r"[^\w.,+#-]+", "_", part) for part in dict.fromkeys(parts) if part)


def save(run: Run, folder: Path, world: int | None = None, *, also: Mapping[str, Any] | None = None) -> Saved:
    """Write NAME.rrd and NAME.summary.json, which is also the folder's summary.json, each whole or not at all.

    Args:
        run: of `simulate`.
        folder: that exists.
        world: that is recorded; None: the worst.
        also: further entries of the summary.

    Raises:
        ValueError: there is no such world.
        OSError: a file cannot be written.
    """
    name = stem(run.scenario)
    chosen = run.worst_world if world is None else world
    recording: Path | None = folder / f"{name}.rrd"
    assert recording is not None
    replaced = recording.exists() or (folder / f"{name}.summary.json").exists()
    try:
        record(run, recording, world=chosen)
        which = (
            f"world {chosen} of {run.worlds}" + (", the worst," if world is None else "") if run.worlds > 1 else "it"
        )
        told = f"{which} is in {recording}, see it with: rerun {shlex.quote(str(recording))}"
    except RecordingOffError as off:
        recording, told = None, f"nothing is recorded: {off}"
    summary = {
        **jsonable(run.summary()),
        **jsonable(dict(also or {})),
        "recording": None if recording is None else recording.name,
        "recorded_world": None if recording is None else chosen,
    }
    text = json.dumps(summary, allow_nan=False, indent=1) + "\n"
    for target in (folder / f"{name}.summary.json", folder / LATEST):
        partial = target.with_name(f".{target.name}.{os.getpid()}.part")
        try:
            partial.write_text(text)
            partial.replace(target)
        finally:
            partial.unlink(missing_ok=True)
    wrote = "replaced" if replaced else "wrote"
    return Saved(summary, [f"{wrote} {folder / f'{name}.summary.json'}, also as {LATEST}", told])
