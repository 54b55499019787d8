"""The command in a process of its own, as people run it; or in this one, where a process of its own proves no more."""

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import chdir, contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import IO, Any

from pivoting.sim.console.command_line import main

COMMAND = [sys.executable, "-m", "pivoting"]


def pivoting(*words: str, cwd: Path | None = None, **changes: str) -> subprocess.CompletedProcess[str]:
    """Run to the end; `changes` of the environment."""
    return subprocess.run(
        [*COMMAND, *words],
        capture_output=True,
        text=True,
        cwd=cwd,
        env={**os.environ, **changes},
        timeout=300,
        check=False,
    )


def called(*words: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """The same without a process, which takes seconds to start; what is compiled is shared with the other tests."""
    kept, sys.argv = sys.argv, ["pivoting", *words]
    try:
        with _into_a_file(1) as out, _into_a_file(2) as err, chdir(cwd or Path.cwd()):
            stdout, stderr = (open(each, "w", closefd=False) for each in (1, 2))  # noqa: SIM115
            with stdout, stderr, redirect_stdout(stdout), redirect_stderr(stderr):
                code = main()
            told = [each.read().decode() for each in (out, err) if each.seek(0) == 0]
    finally:
        sys.argv = kept
    return subprocess.CompletedProcess(words, code, *told)


@contextmanager
def _into_a_file(descriptor: int) -> Iterator[IO[bytes]]:
    """What is written to it, at whatever level, goes into a file, as --json moves descriptors."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept = os.dup(descriptor)
    with tempfile.TemporaryFile() as file:
        os.dup2(file.fileno(), descriptor)
        try:
            yield file
        finally:
            os.dup2(kept, descriptor)
            os.close(kept)


def started(*words: str, **options: Any) -> subprocess.Popen[str]:
    """Started, with an interrupt that reaches it even where the tests run in the background."""
    return subprocess.Popen(
        [*COMMAND, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        **options,
    )
