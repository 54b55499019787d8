"""Sweeps that are killed at random moments and resumed: the rows are those of one that was not killed."""

import random
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter, sleep

import numpy as np
from harness import main
from pivoting import read_sweep
from rich.progress import track

WORDS = ["sweep", "pivot-2d", "--worlds", "60", "--chunk", "4", "--set", "seconds=0.25", "--set", "theta_end=15"]
WORDS += ["--vary", "mass=0.8:1.2", "--vary", "mu=0.25:0.8", "--vary", "com=-0.005:0.005"]
KILLS, FEW = 20, 2


def started(out: Path, *more: str) -> subprocess.Popen[bytes]:
    """A sweep into a file, in a process of its own."""
    command = [sys.executable, "-m", "pivoting", *WORDS, "--out", str(out), *more]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def same_rows(one: Path, other: Path) -> bool:
    """Whether two sweeps have the same rows, to the last bit and in the same order."""
    rows = [read_sweep(path).rows for path in (one, other)]
    return list(rows[0]) == list(rows[1]) and all(
        np.array_equal(values, rows[1][name], equal_nan=values.dtype.kind == "f") for name, values in rows[0].items()
    )


def kills(quick: bool) -> dict[str, float]:
    """How many of the sweeps that were killed gave the same rows, and how far they were when they were killed."""
    count = FEW if quick else KILLS
    draw, same, found = random.Random(2026), 0, []
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "whole.parquet"
        started(whole).wait()
        begun = perf_counter()
        started(whole).wait()
        takes = perf_counter() - begun
        for number in track(range(count), "kills", transient=True):
            out = Path(folder) / f"{number}.parquet"
            process = started(out)
            sleep(draw.uniform(0.0, 1.1 * takes))
            process.send_signal(signal.SIGKILL)
            process.wait()
            found.append(len(list((Path(folder) / f".{out.name}.parts").glob("part-*.parquet"))))
            started(out, "--resume").wait()
            same += same_rows(out, whole)
    return {
        "kills": count,
        "share with the same rows": same / count,
        "chunks there, least": min(found),
        "chunks there, most": max(found),
        "seconds of a sweep": takes,
    }


if __name__ == "__main__":
    main(__doc__ or "", kills, {}, floors={"share with the same rows": 1.0})
