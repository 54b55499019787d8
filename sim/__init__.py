"""The closed loop: worlds, monitor and verdict, recording, command line."""

from pathlib import Path

from pivoting.controller.kernels.kernel_cache import drop_stale_kernels

_here = Path(__file__).parent
drop_stale_kernels(_here, _here.parent / "controller", _here.parent / "models")  # before any kernel is loaded

from pivoting.sim.attach import Attached, ControlError, attach
from pivoting.sim.judging.assertions import assert_sticking, assert_tracking
from pivoting.sim.judging.verdict import Check, Limits
from pivoting.sim.run import Run
from pivoting.sim.scenarios.scenario import Scenario
from pivoting.sim.scenarios.shipped_scenarios import SCENARIOS, own_object, scenario
from pivoting.sim.simulate import simulate

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
