"""What a run leaves in a folder: its recording and its summary, named after the scenario, or the object and contact."""

import json
import re
import shlex
import signal
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from threading import current_thread, main_thread
from typing import Any, NamedTuple

import numpy as np
from pivoting.sim.console.json_values import jsonable
from pivoting.sim.drawing.rerun_recording import RecordingOffError, record
from pivoting.sim.drawing.whole_file import part
from pivoting.sim.run import Run
from pivoting.sim.scenarios.scenario import Scenario

LATEST = "summary.json"


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


def save(run: Run, folder: Path, world: int | None = None, *, also: Mapping[str, Any] | None = None) -> Saved:
    """Write NAME.rrd and NAME.summary.json, which is also the folder's summary.json: all of them, whole, or none.

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
    parts: dict[Path, Path] = {}
    try:
        try:
            parts[recording] = part(recording)
            record(run, parts[recording], world=chosen)
            which = (
                f"world {chosen} of {run.worlds}" + (", the worst," if world is None else "")
                if run.worlds > 1
                else "it"
            )
            told = f"{which} is in {recording}, see it with: rerun {shlex.quote(str(recording))}"
        except RecordingOffError as off:
            parts.clear()
            recording, told = None, f"nothing is recorded: {off}"
        summary = {
            **jsonable(run.summary()),
            **jsonable(dict(also or {})),
            "recording": None if recording is None else recording.name,
            "recorded_world": None if recording is None else chosen,
        }
        text = json.dumps(summary, allow_nan=False, indent=1) + "\n"
        for target in (folder / f"{name}.summary.json", folder / LATEST):
            parts[target] = part(target)
            parts[target].write_text(text)
        with _uninterrupted():
            for target, file in parts.items():
                file.replace(target)
    finally:
        for file in parts.values():
            file.unlink(missing_ok=True)
    wrote = "replaced" if replaced else "wrote"
    return Saved(summary, [f"{wrote} {folder / f'{name}.summary.json'}, also as {LATEST}", told])


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """A SIGINT that comes meanwhile is sent again when this is over."""
    if current_thread() is not main_thread():  # an interrupt is raised in that one alone
        yield
        return
    came: list[int] = []
    handler = signal.signal(signal.SIGINT, lambda number, frame: came.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        for number in came[:1]:
            signal.raise_signal(number)
