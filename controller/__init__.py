"""The mathematics: contacts, the wrench problem, its solvers, laws and references. Knows nothing of MuJoCo."""

from pathlib import Path

from pivoting.controller.kernels.kernel_cache import drop_stale_kernels

drop_stale_kernels(Path(__file__).parent)  # before any kernel is loaded

from pivoting.controller.contacts import Contact
from pivoting.controller.control_laws import Body, Law
from pivoting.controller.errors import PlanError, SolveError
from pivoting.controller.plane_and_space import Motion
from pivoting.controller.planning.horizon import BodyState, Horizon
from pivoting.controller.planning.receding_horizon import RecedingHorizon
from pivoting.controller.planning.sequential_convex import Plan, Planner
from pivoting.controller.references import Constant, MinimumJerk, Reference, Sampled, Sine
from pivoting.controller.solution import Solution
from pivoting.controller.solvers.clarabel_workspace import ClarabelWorkspace
from pivoting.controller.solvers.solve import methods, pyramid_excess, solve
from pivoting.controller.wrench_bounds import WrenchBounds
from pivoting.controller.wrench_controller import WrenchController
from pivoting.controller.wrench_problem import WrenchProblem, wrench_weight

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
