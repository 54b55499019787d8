"""Stdout under --json is one object, whatever libraries print there and at whatever level; else it is for people."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from pivoting.controller import WrenchProblem, solve

from tests.processes import COMMAND, pivoting

# A backend of qpsolvers that prints as solvers do, and libraries that do so as they are imported: past Python, through
# C, which holds it back until the process ends, and in Python.
NOISE = """
import ctypes, os, subprocess, sys, qpsolvers
from pivoting.__main__ import main

def noise(where):
    os.write(1, f"NOISE {where}: descriptor\\n".encode())
    ctypes.CDLL(None).puts(f"NOISE {where}: C".encode())
    print(f"NOISE {where}: Python")
    subprocess.run(["echo", f"NOISE {where}: child"])

quiet = qpsolvers.solvers.solve_function["daqp"]

def loud(problem, **options):
    noise("solve")
    return quiet(problem, **options)

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == "numba":
            noise("import")

qpsolvers.solvers.solve_function["loud"] = loud
qpsolvers.available_solvers.append("loud")
qpsolvers.dense_solvers.append("loud")
sys.meta_path.insert(0, Finder())
main()
"""


def noisy(*words: str) -> subprocess.CompletedProcess[str]:
    call = [sys.executable, "-c", NOISE, *words]
    return subprocess.run(call, capture_output=True, text=True, timeout=300, check=False)


LEVELS = ("descriptor", "C", "Python", "child")


def test_nothing_that_is_printed_gets_between_the_object_and_its_reader() -> None:
    done = noisy("example", "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert "qp:loud" in {row["method"] for row in told["results"]}
    for where in ("import", "solve"):
        for level in LEVELS:
            assert f"NOISE {where}: {level}\n" in done.stderr


def test_without_json_people_are_told_on_stdout() -> None:
    done = noisy("example")
    assert done.returncode == 0, done.stderr
    assert "1.39789" in done.stdout
    assert "qp:loud" in done.stdout
    assert "1.39789" not in done.stderr


def test_what_is_written_under_json_is_told_on_stderr(tmp_path: Path) -> None:
    done = pivoting("run", "balance-2d", "--set", "seconds=1", "--out", str(tmp_path), "--json")
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("\n") == 1
    assert json.loads(done.stdout)["verdict"] == "pass"
    assert "balance-2d.rrd" in done.stderr


def test_wrong_calls_under_json_leave_stdout_empty() -> None:
    done = pivoting("run", "fly-2d", "--json")
    assert (done.returncode, done.stdout) == (2, "")


@pytest.mark.parametrize("words", [["list"], ["example", "--json"]])
def test_a_reader_that_goes_ends_it_quietly_as_other_tools(words: list[str]) -> None:
    """By SIGPIPE, which shells show as 141."""
    with subprocess.Popen([*COMMAND, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        told = process.stderr.read()
        assert process.wait(timeout=300) == -13
    for word in ("Traceback", "ignored", "pipe"):
        assert word not in told


@pytest.mark.parametrize("closed", ["1>&-", "2>&-", "1>&- 2>&-"])
def test_where_a_stream_is_closed(closed: str) -> None:
    call = f"'{sys.executable}' -m pivoting example --json {closed}"
    done = subprocess.run(["bash", "-c", call], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0
    assert "Traceback" not in done.stderr
    assert done.stdout == "" or json.loads(done.stdout)["agrees"]


def test_only_the_backend_that_is_named_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each that is tried may print, or look for a licence."""
    import qpsolvers

    tried: list[str] = []
    for name, function in qpsolvers.solvers.solve_function.items():
        monkeypatch.setitem(
            qpsolvers.solvers.solve_function,
            name,
            lambda problem, name=name, function=function, **options: tried.append(name) or function(problem, **options),
        )
    problem = WrenchProblem([[1.0, 0.0], [0.0, 1.0], [0.5, -0.5]], [1.0, 9.0, 2.0], 0.3)
    solve(problem, "qp:daqp")
    with pytest.raises(ValueError, match=r"nope.*quadprog"):
        solve(problem, "qp:nope")
    assert set(tried) == {"daqp"}
