"""What MuJoCo itself has to say of a run, which it would write to a MUJOCO_LOG.TXT in the working folder."""

import re
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from math import isnan
from pathlib import Path

import mujoco
from pivoting.sim.interrupts import uninterrupted

_ENTRY = re.compile(r"^(?:WARNING|ERROR) .*? \d{4}: (.*?)\s*(?:Time = (\S+)\.)?$", flags=re.MULTILINE)


@contextmanager
def engine_log() -> Iterator[list[str]]:
    """MuJoCo's warnings while this is open, in the list when it is closed: each once, with the time that it names [s].

    They are neither printed nor left in a file; only where not even a temporary one can be made does MuJoCo print them.
    A handler of the user's own (`mujoco.set_mju_user_warning`) gets them instead, as ever. No Python of ours runs as
    they come, in the batch's threads: an exception there, of Ctrl-C, would abort the process.
    """
    said: list[str] = []
    before, now = mujoco.MjLogConfig.get(), mujoco.MjLogConfig.get()
    with ExitStack() as stack:
        log: Path | None = None
        with suppress(OSError), uninterrupted():  # or a folder that is made might not be known yet
            folder = tempfile.TemporaryDirectory(prefix="pivoting-")
            stack.callback(_remove, folder)
            log = Path(folder.name) / "log"
        now.logto_console, now.logto_file = log is None, log is not None
        now.logfile = str(log)
        stack.callback(mujoco.MjLogConfig.set, before)
        mujoco.MjLogConfig.set(now)
        yield said
        if log is not None and log.exists():
            said += _distinct(log.read_text(errors="replace"))


def _remove(folder: tempfile.TemporaryDirectory[str]) -> None:
    with uninterrupted():
        folder.cleanup()


def _distinct(text: str) -> list[str]:
    """Each message once, at its first time, with how often it came."""
    times: dict[str, list[float]] = {}
    for message, time in _ENTRY.findall(text):
        times.setdefault(message, []).append(float(time or "nan"))
    return [
        message + ("" if isnan(at[0]) else f" t = {min(at):g} s") + (f", {len(at)} times" if len(at) > 1 else "")
        for message, at in times.items()
    ]
