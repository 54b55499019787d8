"""The keys of a real loop: what its sensors, its actuator and its computer do, what disturbs it, and what it does then.

All of them are 0 or None by default, and then cost nothing: the state is measured exactly, the wrench acts as it is
asked for, at every step, and nothing fails.
"""

from dataclasses import dataclass

from pivoting.controller.uncertainty.uncertainty import SHOVE_SECONDS
from pivoting.models.mujoco_constants import LEAST_FRICTION
from pivoting.sim.scenarios.key_declaration import Needs, key

MEASURED = "what is measured"
ESTIMATED = "what is made of the measurements"
COMPUTED = "when there are answers, and the safe state"
ACTUATED = "the actuator, of which the controller does not know"
DISTURBED = "what disturbs the object"

DISTRIBUTIONS = {
    "uniform": "",
    "normal": "then the greatest errors are standard deviations",
}
_PIPELINE = "pivoting.sim.pipeline"
_NOISE = Needs("noise", instead=("noise_position",))
_FAULTS = Needs("repeated", instead=("dropped", "broken", "solver_failure"))
_CHECK = f"{_PIPELINE}.measurement_check:MeasurementCheck"
_FREE = f"{_PIPELINE}.free_reference:FreeReference"
_RESOLUTION = f"{_PIPELINE}.wrench_resolution:WrenchResolution"
_ACTUATOR = f"{_PIPELINE}.limited_actuator:LimitedActuator"


@dataclass(frozen=True, kw_only=True)
class LoopKeys:
    """The values of a scenario that `--set` changes, as far as they belong to a real loop."""

    noise: float = key(
        0.0,
        "greatest error of the measured orientation about each axis, drawn anew in each step",
        group=MEASURED,
        unit="deg",
        at_least=0.0,
        at_most=10.0,
        stage=f"{_PIPELINE}.measurement_noise:MeasurementNoise",
    )
    noise_position: float = key(
        0.0,
        "greatest error of the measured position along each axis, drawn anew in each step",
        group=MEASURED,
        unit="m",
        at_least=0.0,
        at_most=1e3,
        stage=f"{_PIPELINE}.position_noise:PositionNoise",
    )
    noise_distribution: str = key("uniform", "distribution of both", group=MEASURED, words=DISTRIBUTIONS, needs=_NOISE)
    bias: float = key(
        0.0,
        "error of the measured orientation that stays the same, its direction drawn for each world",
        group=MEASURED,
        unit="deg",
        at_least=0.0,
        at_most=10.0,
        stage=f"{_PIPELINE}.measurement_bias:OrientationBias",
    )
    bias_position: float = key(
        0.0,
        "error of the measured position that stays the same, its direction drawn for each world",
        group=MEASURED,
        unit="m",
        at_least=0.0,
        at_most=1e3,
        stage=f"{_PIPELINE}.measurement_bias:PositionBias",
    )
    resolution: float = key(
        0.0,
        "step to a multiple of which the measured orientation is rounded",
        group=MEASURED,
        unit="deg",
        at_least=0.0,
        at_most=10.0,
        stage=f"{_PIPELINE}.measurement_resolution:OrientationResolution",
    )
    resolution_position: float = key(
        0.0,
        "step to a multiple of which the measured position is rounded",
        group=MEASURED,
        unit="m",
        at_least=0.0,
        at_most=1e3,
        stage=f"{_PIPELINE}.measurement_resolution:PositionResolution",
    )
    measure_hz: float | None = key(
        None,
        "how often there is a measurement; in between the last one stays",
        group=MEASURED,
        unit="Hz",
        above=0.0,
        at_most=1e6,
        none="at every step",
        stage=f"{_PIPELINE}.slower_measurement:SlowerMeasurement",
    )
    delay: float = key(
        0.0,
        "age of a measurement when it arrives",
        group=MEASURED,
        unit="s",
        at_least=0.0,
        at_most=10.0,
        stage=f"{_PIPELINE}.measurement_delay:MeasurementDelay",
    )
    repeated: float = key(
        0.0,
        "share of the steps in which the last measurement comes again as a new one",
        group=MEASURED,
        at_least=0.0,
        at_most=1.0,
        stage=f"{_PIPELINE}.measurement_faults:RepeatedMeasurement",
    )
    dropped: float = key(
        0.0,
        "share of the steps in which no measurement arrives",
        group=MEASURED,
        at_least=0.0,
        at_most=1.0,
        stage=f"{_PIPELINE}.measurement_faults:DroppedMeasurement",
    )
    broken: float = key(
        0.0,
        "share of the steps in which the measurement is not a number",
        group=MEASURED,
        at_least=0.0,
        at_most=1.0,
        stage=f"{_PIPELINE}.measurement_faults:BrokenMeasurement",
    )

    observer: float = key(
        0.0,
        "bandwidth of an observer that estimates pose and rates from measured poses, the wrench and the model",
        group=ESTIMATED,
        unit="rad/s",
        at_least=0.0,
        at_most=1e5,
        stage=(_CHECK, f"{_PIPELINE}.model_observer:ModelObserver", _FREE),
    )
    differentiator: float = key(
        0.0,
        "bandwidth of a filter that makes rates of differences of measured poses",
        group=ESTIMATED,
        unit="rad/s",
        at_least=0.0,
        at_most=1e5,
        stage=(_CHECK, f"{_PIPELINE}.differentiator:Differentiator"),
    )

    solver_failure: float = key(
        0.0,
        "share of the steps in which the solver gives no answer",
        group=COMPUTED,
        at_least=0.0,
        at_most=1.0,
        stage=f"{_PIPELINE}.solver_failure:SolverFailure",
    )
    control_hz: float | None = key(
        None,
        "how often the control is asked; in between its last wrench is held, fixed to the object",
        group=COMPUTED,
        unit="Hz",
        above=0.0,
        at_most=1e6,
        none="at every step",
        stage=f"{_PIPELINE}.slower_control:SlowerControl",
    )
    fault_start: float = key(
        0.0,
        "time from which on measurements are repeated, dropped or broken, and the solver fails",
        group=COMPUTED,
        unit="s",
        at_least=0.0,
        at_most=3600.0,
        needs=_FAULTS,
    )
    safe_after: float = key(
        0.0,
        "time without a valid measurement, an answer or a contact after which the object is lowered; 0: never",
        group=COMPUTED,
        unit="s",
        at_least=0.0,
        at_most=10.0,
        stage=(_CHECK, f"{_PIPELINE}.safe_state:SafeState"),
    )
    safe_angle: float = key(
        2.0,
        "error of the angle beyond which the object is lowered, too",
        group=COMPUTED,
        unit="deg",
        above=0.0,
        at_most=180.0,
        needs=Needs("safe_after"),
    )
    safe_press: float | str | None = key(
        None,
        "force with which it is pressed on its contacts meanwhile",
        group=COMPUTED,
        unit="N",
        at_least=0.0,
        relative="w",
        none="twice its weight",
        needs=Needs("safe_after"),
    )

    actuator_force: float | str | None = key(
        None,
        "greatest force that the actuator makes",
        group=ACTUATED,
        unit="N",
        above=0.0,
        none="any",
        relative="w",
        stage=_ACTUATOR,
    )
    actuator_moment: float | str | None = key(
        None,
        "greatest moment that it makes",
        group=ACTUATED,
        unit="N m",
        above=0.0,
        none="any",
        relative="w",
        stage=_ACTUATOR,
    )
    actuator_force_rate: float | str | None = key(
        None,
        "greatest rate of change of its force",
        group=ACTUATED,
        unit="N/s",
        above=0.0,
        none="any",
        relative="w",
        stage=_ACTUATOR,
    )
    actuator_moment_rate: float | str | None = key(
        None,
        "greatest rate of change of its moment",
        group=ACTUATED,
        unit="N m/s",
        above=0.0,
        none="any",
        relative="w",
        stage=_ACTUATOR,
    )
    force_resolution: float | str = key(
        0.0,
        "step to a multiple of which each component of its force is rounded",
        group=ACTUATED,
        unit="N",
        at_least=0.0,
        relative="w",
        stage=_RESOLUTION,
    )
    moment_resolution: float | str = key(
        0.0,
        "step to a multiple of which each component of its moment is rounded",
        group=ACTUATED,
        unit="N m",
        at_least=0.0,
        relative="w",
        stage=_RESOLUTION,
    )

    shove: float = key(
        0.0,
        "impulse of a shove at the true centre of mass, for each true kg, once at a random time in a random direction",
        group=DISTURBED,
        unit="N s/kg",
        at_least=0.0,
        at_most=1e3,
        stage=f"{_PIPELINE}.shove:Shove",
    )
    shove_seconds: float = key(
        SHOVE_SECONDS,
        "time over which it is spread",
        group=DISTURBED,
        unit="s",
        above=0.0,
        at_most=10.0,
        needs=Needs("shove"),
    )
    mu_falls_to: float | None = key(
        None,
        "friction coefficient of the world from some time on, which the controller does not know of",
        group=DISTURBED,
        above=LEAST_FRICTION,
        at_most=10.0,
        none="it stays",
        stage=f"{_PIPELINE}.falling_friction:FallingFriction",
    )
    mu_falls_at: float | None = key(
        None,
        "that time",
        group=DISTURBED,
        unit="s",
        at_least=0.0,
        at_most=3600.0,
        none="half of the run",
        needs=Needs("mu_falls_to"),
    )
