from .controller.control_laws import Body as Body, Law as Law
from .controller.contacts import Contact as Contact
from .controller.uncertainty.uncertainty import Uncertainty as Uncertainty
from .controller.solution import Solution as Solution
from .controller.solvers.solve import solve as solve
from .controller.wrench_controller import WrenchController as WrenchController
from .controller.wrench_problem import WrenchProblem as WrenchProblem
from .errors import PivotingError as PivotingError
from .sim.attachment import attach as attach
from .sim.fleet import Fleet as Fleet
from .sim.judging.assertions import assert_sticking as assert_sticking, assert_tracking as assert_tracking
from .sim.reference_check import check_reference as check_reference
from .sim.run import Run as Run
from .sim.saved_run import load as load
from .sim.scenarios.scenario import Scenario as Scenario
from .sim.scenarios.shipped_scenarios import own_object as own_object, scenario as scenario
from .sim.simulation import simulate as simulate
from .sim.sweeping.sweep import read_sweep as read_sweep, sweep as sweep

__version__: str
