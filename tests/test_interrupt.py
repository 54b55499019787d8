"""Ctrl-C at any moment: one line, exit code 130, nothing half-written. Real signals, sent when a trace is seen."""

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import monotonic, sleep

import pytest
from pivoting.sim import Run
from pivoting.sim.console.output_files import save
from pivoting.sim.engine_log import engine_log

from tests.processes import started

LINE = "pivoting: interrupted"


def interrupted_when(seen: Callable[[], bool], process: subprocess.Popen[str], times: int = 1) -> list[str]:
    """Send SIGINT once something is seen, so many times in a row; the lines of stderr, if it ended as it should."""
    limit = monotonic() + 200.0
    while not seen():
        assert process.poll() is None, process.communicate()
        assert monotonic() < limit
        sleep(0.002)
    for _ in range(times):
        process.send_signal(signal.SIGINT)
        sleep(0.005 if times > 1 else 0.0)
    said, told = process.communicate(timeout=60)
    assert process.returncode == 130, (process.returncode, told)
    assert said == ""
    lines = told.splitlines()
    assert lines.count(LINE) == 1
    assert lines[-1] == LINE
    assert [line for line in lines if not line.startswith("pivoting: compiling")] == [LINE]
    return lines


@pytest.mark.skipif(sys.platform != "linux", reason="looks at /proc for what is loaded")
@pytest.mark.parametrize("library", ["_multiarray_umath", "llvmlite", "libmujoco", "scipy"])
def test_while_libraries_are_imported(library: str) -> None:
    process = started("run", "balance-2d")
    maps = Path(f"/proc/{process.pid}/maps")
    interrupted_when(lambda: library in maps.read_text(), process)


@pytest.mark.parametrize("later", [0.0, 2.0])
def test_while_kernels_are_compiled(tmp_path: Path, later: float) -> None:
    """After which the cache is whole: the same call goes on from it."""
    process = started("run", "balance-2d", "--json", env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)})
    assert process.stderr is not None
    assert process.stderr.readline().startswith("pivoting: compiling")
    sleep(later)
    interrupted_when(lambda: True, process)


@pytest.mark.parametrize(("times", "keep"), [(1, "all"), (3, "all"), (1, "measures")])
def test_in_the_loop(tmp_path: Path, times: int, keep: str) -> None:
    """Also if it is asked for three times at once: what was temporary is tidied up all the same."""
    temporary, out = tmp_path / "temporary", tmp_path / "out"
    temporary.mkdir()
    words = ("run", "balance-2d", "--worlds", "64", "--set", "seconds=100", "--out", str(out))
    process = started(*words, "--keep", keep, env={**os.environ, "TMPDIR": str(temporary)})
    interrupted_when(lambda: bool(list(temporary.glob("pivoting-*"))), process, times)
    assert list(temporary.iterdir()) == []
    assert list(out.iterdir()) == []


@pytest.mark.parametrize("moment", ["mkdtemp", "rmtree"])
def test_as_a_temporary_folder_is_made_or_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moment: str) -> None:
    """The moment in which it is there, and nothing that would remove it is known yet, or any longer."""
    module = {"mkdtemp": tempfile, "rmtree": tempfile.TemporaryDirectory}[moment]
    name = {"mkdtemp": "mkdtemp", "rmtree": "_rmtree"}[moment]
    real = getattr(module, name)

    def interrupted(*args: object, **options: object) -> object:
        if moment == "rmtree":
            signal.raise_signal(signal.SIGINT)
        done = real(*args, **options)
        signal.raise_signal(signal.SIGINT)
        return done

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(module, name, staticmethod(interrupted))
    with pytest.raises(KeyboardInterrupt), engine_log():
        pass
    assert list(tmp_path.iterdir()) == []


def test_while_results_are_written(tmp_path: Path) -> None:
    """None of the files, and nothing in their stead."""
    process = started("run", "balance-2d", "--out", str(tmp_path))
    interrupted_when(lambda: any(path.suffix == ".part" for path in tmp_path.iterdir()), process)
    assert list(tmp_path.iterdir()) == []


def test_while_frames_are_drawn(tmp_path: Path) -> None:
    """Neither the file nor what was written of it."""
    process = started("render", "balance-2d", "--size", "240x240", "--out", str(tmp_path / "a.gif"))
    interrupted_when(lambda: any(path.suffix == ".part" for path in tmp_path.iterdir()), process)
    assert list(tmp_path.iterdir()) == []


def test_results_appear_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shipped: Callable[[str], Run]
) -> None:
    """An interrupt between two of them comes when all are there."""
    replace = Path.replace

    def interrupted(part: Path, target: Path) -> Path:
        if target.suffix == ".json":
            signal.raise_signal(signal.SIGINT)
        return replace(part, target)

    monkeypatch.setattr(Path, "replace", interrupted)
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        save(shipped("snap-2d"), tmp_path)
    assert signal.getsignal(signal.SIGINT) is before
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "snap-2d.nc", "snap-2d.rrd", "snap-2d.scenario.json", "snap-2d.summary.json", "summary.json",
    ]  # fmt: skip


LIBRARY = """
import ctypes, signal, sys, time
from pivoting.__main__ import main

def lost():  # in a callback out of C, where nothing can be raised
    ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(signal.SIGINT))()
    time.sleep(100)

def renamed():  # as C extensions do whose imports fail
    try:
        signal.raise_signal(signal.SIGINT)
    except KeyboardInterrupt:
        raise ImportError("numpy.core.multiarray failed to import") from None

def twice():  # the second while what is open is tidied up
    try:
        signal.raise_signal(signal.SIGINT)
    finally:
        signal.raise_signal(signal.SIGINT)
        print("tidied up", file=sys.stderr)

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == "mujoco":
            {what}()

sys.meta_path.insert(0, Finder())
main()
"""


@pytest.mark.parametrize(("what", "first"), [("lost", []), ("renamed", []), ("twice", ["tidied up"])])
def test_whatever_a_library_makes_of_it(what: str, first: list[str]) -> None:
    call = [sys.executable, "-c", LIBRARY.replace("{what}", what), "run", "balance-2d"]
    done = subprocess.run(call, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout) == (130, "")
    told = [line for line in done.stderr.splitlines() if not line.startswith("pivoting: compiling")]
    assert told == [*first, LINE]


def test_a_job_in_the_background_is_left_alone() -> None:
    """Where a shell has SIGINT ignored, it stays ignored."""
    call = [sys.executable, "-m", "pivoting", "list"]
    with subprocess.Popen(
        call, stdout=subprocess.PIPE, text=True, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN)
    ) as process:
        sleep(0.5)
        process.send_signal(signal.SIGINT)
        told, _ = process.communicate(timeout=300)
    assert process.returncode == 0
    assert "pivot-2d" in told
