"""The command in a process of its own, as people run it."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

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
