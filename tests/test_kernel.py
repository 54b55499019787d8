"""What makes compiling slow is not written: see `pivoting.controller.kernels.compilation`."""

import ast
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numba import typeof
from numba.core.errors import NumbaError
from pivoting.controller import WrenchController
from pivoting.controller.kernels.compilation import kernel

from tests.test_guarantee import planar, spatial

COMPILED = ("kernel", "subroutine")
BLOCK = """<mujoco><worldbody><geom type="plane" size="2 2 .1"/><body name="block" pos="0 0 .1"><freejoint/>
<geom type="box" size=".1 .07 .1" mass="1"/></body></worldbody></mujoco>"""
PLAIN = {"sqrt", "hypot", "isfinite", "isnan", "inf", "nan", "sin", "cos", "tan", "arctan2"}  # of NumPy


def compiled(source: str) -> Iterator[ast.FunctionDef]:
    """Its functions that numba compiles."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef):
            names = {decorator.id for decorator in node.decorator_list if isinstance(decorator, ast.Name)}
            if names & set(COMPILED):
                yield node


def slow(function: ast.FunctionDef) -> list[str]:
    """What of it brings much else along: whole arrays made, copied, or computed with."""
    found = []
    for node in ast.walk(function):
        if isinstance(node, ast.Subscript) and isinstance(node.ctx, ast.Store):
            parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
            if any(isinstance(part, ast.Slice) for part in parts):
                found.append(f"{function.name}, line {node.lineno}: a slice is assigned to")
        of_numpy = isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "np"
        if of_numpy and node.attr not in PLAIN:
            found.append(f"{function.name}, line {node.lineno}: np.{node.attr}")
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in ("sum", "copy"):
            found.append(f"{function.name}, line {node.lineno}: .{node.func.attr}()")
    return found


ROOMS = [Path(__file__).parents[1] / room for room in ("controller", "sim")]


@pytest.mark.parametrize(
    "path", [path for room in ROOMS for path in sorted(room.rglob("*.py"))], ids=lambda at: at.stem
)
def test_kernels_allocate_nothing_and_copy_in_loops(path: Path) -> None:
    assert [said for function in compiled(path.read_text()) for said in slow(function)] == []


def test_what_is_looked_for_is_found() -> None:
    text = "@kernel\ndef f(a, b):\n    a[:] = b\n    a[1, 2:] = b.sum()\n    return np.empty(3) + np.sqrt(2.0)"
    (function,) = compiled(text)
    assert len(slow(function)) == 4


def test_a_kernel_that_allocates_is_refused() -> None:
    with pytest.raises(NumbaError, match="NRT required"):
        kernel(lambda: np.empty(3)[0])()


LOOPS = """
from pivoting.controller.kernels.compiled_step import step_worlds
from pivoting.sim import own_object, simulate
from pivoting.sim.contact_sensing import sort_contacts
simulate("spin-3d")
simulate(own_object({path!r}, "block", "vertex"))
simulate("spin-3d", worlds=600, seconds=0.02, hold=0.02, limits={{"settle_s": 0.01}})  # sorted step by step
print(len(step_worlds.signatures), len(sort_contacts.signatures))
"""


def test_one_compiled_loop_serves_a_scenario_and_an_object_of_ones_own(tmp_path: Path) -> None:
    """Arrays of another layout, or read-only ones, would have everything compiled again."""
    (path := tmp_path / "block.xml").write_text(BLOCK)
    done = subprocess.run(
        [sys.executable, "-c", LOOPS.format(path=str(path))], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["1", "1"]


def test_beliefs_are_of_one_type_in_the_plane_and_in_space_with_a_set_and_without() -> None:
    """Or a kernel that takes one is compiled for each."""
    rng, blocks = np.random.default_rng(0), []
    for controller, *_ in (planar(rng, "com"), spatial(rng, 1), spatial(rng, 2)):
        plain = WrenchController(controller.body, controller.contacts, controller.law, controller.gravity)
        blocks += [controller.belief, plain.belief]
    assert len({typeof(belief[:4]) for belief in blocks}) == 1
    assert len({typeof(belief.unknown) for belief in blocks}) == 2


BESIDE = """
import sys
import numpy as np
from pivoting.controller.kernels.second_compiler import compiled_beside
from pivoting.controller.rotations import fill_rotation
sys.executable = {executable!r}
q, R = np.array([1.0, 0.0, 0.0, 0.0]), np.empty((3, 3))
with compiled_beside(fill_rotation, q, R):
    pass
fill_rotation(q, R)
print(sum(fill_rotation.stats.cache_hits.values()), sum(fill_rotation.stats.cache_misses.values()), np.trace(R))
"""


@pytest.mark.parametrize(
    ("executable", "told"),
    [(sys.executable, "1 0 3.0"), (f"{sys.executable}-missing", "0 1 3.0"), ("/bin/false", "0 1 3.0")],
)
def test_what_a_second_process_has_compiled_is_taken_from_the_cache(tmp_path: Path, executable: str, told: str) -> None:
    """And where there is no second process it is compiled here."""
    done = subprocess.run(
        [sys.executable, "-c", BESIDE.format(executable=executable)],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
    )
    assert done.stdout.strip() == told
