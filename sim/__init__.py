"""The closed loop: worlds, monitor and verdict, recording, command line."""

from pathlib import Path

from pivoting.controller.stale import cache_folder, drop_stale_kernels

if (_cache := cache_folder(Path(__file__).parent)) is not None:  # before any kernel is loaded
    drop_stale_kernels(_cache, *(Path(__file__).parents[1] / room for room in ("controller", "models", "sim")))

from pivoting.sim.attach import Attached, ControlError, attach
from pivoting.sim.loop import simulate
from pivoting.sim.run import Run
from pivoting.sim.scenario import Scenario
from pivoting.sim.shipped import SCENARIOS, own_object, scenario
from pivoting.sim.verdict import Check, Limits, assert_sticking, assert_tracking

__all__ = [
    "SCENARIOS",
    "Attached",
    "Check",
    "ControlError",
    "Limits",
    "Run",
    "Scenario",
    "assert_sticking",
    "assert_tracking",
    "attach",
    "own_object",
    "scenario",
    "simulate",
]
