"""The mathematics: contacts, the wrench problem, its solvers, laws and references. Knows nothing of MuJoCo."""

from pathlib import Path

from pivoting.controller.stale import drop_stale_kernels

drop_stale_kernels(Path(__file__).parent)  # before any kernel is loaded

# ruff: noqa: E402
from pivoting.controller.contacts import Contact
from pivoting.controller.controller import WrenchController
from pivoting.controller.laws import Body, Law
from pivoting.controller.problem import WrenchProblem, wrench_weight
from pivoting.controller.references import Constant, MinimumJerk, Reference, Sampled, Sine
from pivoting.controller.solvers import Solution, SolveError, methods, solve
from pivoting.controller.space import Motion

__all__ = [
    "Body",
    "Constant",
    "Contact",
    "Law",
    "MinimumJerk",
    "Motion",
    "Reference",
    "Sampled",
    "Sine",
    "Solution",
    "SolveError",
    "WrenchController",
    "WrenchProblem",
    "methods",
    "solve",
    "wrench_weight",
]
