"""The mathematics: contacts, the wrench problem, its solvers, laws and references. Knows nothing of MuJoCo."""

from pathlib import Path

from pivoting.controller.kernel import CACHE
from pivoting.controller.stale import drop_stale_kernels

if CACHE is not None:
    drop_stale_kernels(CACHE, Path(__file__).parent)  # before any kernel is loaded

from pivoting.controller.bounds import WrenchBounds
from pivoting.controller.conic import ClarabelWorkspace
from pivoting.controller.contacts import Contact
from pivoting.controller.controller import WrenchController
from pivoting.controller.horizon import BodyState, Horizon
from pivoting.controller.laws import Body, Law
from pivoting.controller.plan import Plan, PlanError, Planner
from pivoting.controller.problem import WrenchProblem, wrench_weight
from pivoting.controller.receding import RecedingHorizon
from pivoting.controller.references import Constant, MinimumJerk, Reference, Sampled, Sine
from pivoting.controller.solution import Solution, SolveError
from pivoting.controller.solvers import methods, pyramid_excess, solve
from pivoting.controller.space import Motion

__all__ = [
    "Body",
    "BodyState",
    "ClarabelWorkspace",
    "Constant",
    "Contact",
    "Horizon",
    "Law",
    "MinimumJerk",
    "Motion",
    "Plan",
    "PlanError",
    "Planner",
    "RecedingHorizon",
    "Reference",
    "Sampled",
    "Sine",
    "Solution",
    "SolveError",
    "WrenchBounds",
    "WrenchController",
    "WrenchProblem",
    "methods",
    "pyramid_excess",
    "solve",
    "wrench_weight",
]
