"""The closed loop: worlds, monitor and verdict, recording, command line."""

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
