from .attachment import Attached as Attached, ControlError as ControlError, attach as attach
from .experiment import Experiment as Experiment
from .fleet import Fleet as Fleet, ReplayError as ReplayError, WorldSamples as WorldSamples
from .judging.assertions import assert_sticking as assert_sticking, assert_tracking as assert_tracking
from .judging.verdict import Check as Check, Limits as Limits
from .reference_check import (
    CheckedMoment as CheckedMoment,
    ReferenceCheck as ReferenceCheck,
    check_reference as check_reference,
)
from .run import Run as Run
from .judging.margins_over_time import MarginsOverTime as MarginsOverTime
from .saved_run import load as load
from .scenarios.scenario import Scenario as Scenario
from .scenarios.shipped_scenarios import SCENARIOS as SCENARIOS, own_object as own_object, scenario as scenario
from .simulation import simulate as simulate
from .sweeping.sweep import SweepProgress as SweepProgress, read_sweep as read_sweep, sweep as sweep
from .sweeping.swept import Swept as Swept
