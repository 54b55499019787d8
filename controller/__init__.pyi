from .solvers.clarabel_workspace import ClarabelWorkspace as ClarabelWorkspace
from .contacts import Contact as Contact
from .control_laws import Body as Body, Law as Law
from .learning.friction import friction_bounds as friction_bounds
from .learning.identification import Identification as Identification, identify as identify
from .learning.least_squares import RecursiveLeastSquares as RecursiveLeastSquares
from .learning.motion_log import (
    MeasurementErrors as MeasurementErrors,
    MotionLog as MotionLog,
    motion_log as motion_log,
)
from .learning.parameters import Parameter as Parameter
from .learning.set_membership import SetMembership as SetMembership
from .learning.unknowns import Unknowns as Unknowns
from .motion import Motion as Motion
from .planning.horizon import BodyState as BodyState, Horizon as Horizon
from .planning.receding_horizon import RecedingHorizon as RecedingHorizon
from .planning.sequential_convex import Plan as Plan, Planner as Planner
from .references import (
    Constant as Constant,
    MinimumJerk as MinimumJerk,
    Reference as Reference,
    Sampled as Sampled,
    Sine as Sine,
)
from .errors import PlanError as PlanError, SolveError as SolveError
from .solution import Solution as Solution
from .solvers.solve import methods as methods, pyramid_excess as pyramid_excess, solve as solve
from .wrench_bounds import WrenchBounds as WrenchBounds
from .wrench_controller import WrenchController as WrenchController
from .wrench_problem import WrenchProblem as WrenchProblem, wrench_weight as wrench_weight
from .uncertainty.farkas_certificate import FarkasCertificate as FarkasCertificate
from .uncertainty.feasibility import Feasibility as Feasibility, feasibility as feasibility
from .uncertainty.feasible_scale import FeasibleScale as FeasibleScale, feasible_scale as feasible_scale
from .uncertainty.guarantee import Guarantee as Guarantee
from .uncertainty.margins import FrictionalStability as FrictionalStability, Margins as Margins
from .uncertainty.price import Price as Price, price as price
from .uncertainty.uncertainty import Interval as Interval, Member as Member, Uncertainty as Uncertainty
from .uncertainty.slack_bounds import SlackBounds as SlackBounds, slack_bounds as slack_bounds
from .uncertainty.worst_case import PossibleWorld as PossibleWorld, WorstCase as WorstCase, worst_case as worst_case
