"""Whether two runs are the same, to the last bit of every array, and in how these lie in memory."""

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from pivoting.controller.planning.sequential_convex import Plan
from pivoting.controller.wrench_controller import WrenchController
from pivoting.sim import Run
from pivoting.sim.console.json_values import jsonable
from pivoting.sim.drawing.recording_id import digest

SET_UP = ("scenario", "attached", "load", "world")  # which the digest tells apart


def assert_same(run: Run, other: Run) -> None:
    """Arrays, events, measures, verdict and summary; of the model's path only the file's name."""
    for each in fields(Run):
        if each.name not in SET_UP:
            assert_equal(getattr(run, each.name), getattr(other, each.name), each.name)
    assert digest(run) == digest(other)
    assert run.load == other.load
    assert run.scenario.label == other.scenario.label
    assert_equal(tuple(vars(run.measures).values()), tuple(vars(other.measures).values()), "measures", False)
    assert (run.verdict, run.worst_world) == (other.verdict, other.worst_world)
    told, again = jsonable(run.summary()), jsonable(other.summary())
    assert Path(told.pop("model")).name == Path(again.pop("model")).name
    assert told == again


def assert_equal(a: Any, b: Any, name: str, read_only: bool = True) -> None:
    """Of arrays, tuples of them, plans, and values."""
    assert type(a) is type(b), name
    if isinstance(a, np.ndarray):
        assert (a.dtype, a.shape, a.strides) == (b.dtype, b.shape, b.strides), name
        assert a.tobytes() == b.tobytes(), name
        assert not (read_only and b.flags.writeable), name
    elif isinstance(a, tuple):
        assert len(a) == len(b), name
        for i, (one, other) in enumerate(zip(a, b, strict=True)):
            assert_equal(one, other, f"{name}.{getattr(a, '_fields', range(len(a)))[i]}", read_only)
    elif isinstance(a, WrenchController):
        assert_equal(a.belief, b.belief, name, read_only=False)
    elif isinstance(a, Plan):
        for each in fields(Plan):
            if each.name != "program":
                assert_equal(getattr(a, each.name), getattr(b, each.name), f"{name}.{each.name}")
        assert a.objective == b.objective
    else:
        assert a == b, name
