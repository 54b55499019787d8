"""The keys of a scenario, each declared once, by its field: what it means, what it may be, and who may know it."""

from dataclasses import dataclass

from pivoting.controller.control_laws import FORMULATIONS
from pivoting.controller.planning.integrators import INTEGRATORS
from pivoting.controller.references import REFERENCES, Reference
from pivoting.sim.scenarios.key_declaration import Needs, declared_keys, key
from pivoting.sim.scenarios.loop_keys import LoopKeys
from pivoting.sim.scenarios.object_keys import OBJECT, SCENE, ObjectKeys

LOWEST = 0.1  # [deg] from a face: closer, the next corner touches the table too
ANY_ANGLE = {"at_least": -360.0, "at_most": 360.0}  # [deg] of an object whose plan knows what its shape allows
LARGEST = 1e30  # [N] so that squares of forces are finite

# What the keys are of. Those of the object may be believed to be other than they are, see `Scenario.world`.
REFERENCE = "the reference"
CONTROLLER = "the controller"
BOUNDS = "the bounds on the wrench, in object axes"
HORIZON = "the receding horizon"
STAGES = "the stages before and after the controller"
SIMULATOR = "the simulator"
UNCERTAINTY = "what the controller does not know exactly, beside the object's keys that are intervals"


def _made_of(key: str) -> tuple[str, ...]:
    """The names of the references that are made of a key."""
    return tuple(name for name, reference in REFERENCES.items() if key in reference.keys)


_MADE_OF = Needs("reference", _made_of)
_PLANS, _PLANS_OR_PLAYS = Needs("plan_hz"), Needs("plan_hz", open_loop=True)


@dataclass(frozen=True, kw_only=True)
class IdealKeys(ObjectKeys):
    """The values of a scenario that `--set` changes, as far as they belong to a loop in which nothing fails."""

    reference: str | Reference = key(
        "constant", "motion that the object is to follow", group=REFERENCE, words=REFERENCES
    )
    theta: float = key(
        30.0,
        "angle at which the motion starts; for an object of your own, within what its shape allows",
        group=REFERENCE,
        unit="deg",
        at_least=LOWEST,
        at_most=90.0 - LOWEST,
        needs=_MADE_OF,
    )
    theta_end: float = key(
        80.0,
        "angle to which an arc leads; for an object of your own, within what its shape allows",
        group=REFERENCE,
        unit="deg",
        at_least=LOWEST,
        at_most=90.0 - LOWEST,
        needs=_MADE_OF,
    )
    seconds: float | str = key(
        10.0,
        "duration of each arc, or of the run if the reference never ends",
        group=REFERENCE,
        unit="s",
        above=0.0,
        at_most=3600.0,
        relative="T",
    )
    hold: float | str = key(
        0.25,
        "rest before and after each arc",
        group=REFERENCE,
        unit="s",
        at_least=0.0,
        at_most=3600.0,
        relative="T",
        needs=_MADE_OF,
    )
    amplitude: float = key(
        5.0, "amplitude of the swing", group=REFERENCE, unit="deg", at_least=0.0, below=45.0, needs=_MADE_OF
    )
    period: float | str = key(
        2.0,
        "period of the swing",
        group=REFERENCE,
        unit="s",
        above=0.0,
        at_most=3600.0,
        relative="T",
        needs=_MADE_OF,
    )
    spread: float = key(
        0.01,
        "greatest angle by which a world starts off the reference, drawn from the seed",
        group=REFERENCE,
        unit="deg",
        at_least=0.0,
        at_most=10.0,
    )

    law: str = key(
        "dynamic",
        "control law, from the reference and the pose's error to the wrench that the motion requires",
        group=CONTROLLER,
        words=dict.fromkeys(FORMULATIONS, ""),
    )
    bandwidth: float = key(
        40.0,
        "bandwidth of the law; a quasi-dynamic law takes its inverse as the step h",
        group=CONTROLLER,
        unit="rad/s",
        above=0.0,
        at_most=1e5,
        needs=Needs("law", tuple(law for law in FORMULATIONS if law != "static")),
    )
    damping: float = key(
        1.0, "damping ratio of the law", group=CONTROLLER, above=0.0, at_most=100.0, needs=Needs("law", ("dynamic",))
    )
    margin: float = key(
        1.0 / 6.0, "share of the friction that is kept unused", group=CONTROLLER, at_least=0.0, below=1.0
    )
    guarantee: str = key(
        "set",
        "for which worlds the contact is to stick, where something is told as an interval",
        group=CONTROLLER,
        words={"set": "every world of the set", "none": "the nominal one alone"},
    )
    landing: str = key(
        "ignored",
        "what follows once the object lies on its face",
        group=REFERENCE,
        words={"ignored": "nothing", "held": "all corners of the face are held, as a second stance"},
    )
    f_min: float | str | None = key(
        0.0,
        "least normal force of each contact; for an object of your own, by default what keeps the contact closed",
        group=CONTROLLER,
        unit="N",
        at_least=0.0,
        at_most=LARGEST,
        relative="w",
        none="what keeps the contact closed as the object turns",
    )
    length: float | None = key(
        None,
        "characteristic length of the cost: the lever at which a moment costs as much as a force",
        group=CONTROLLER,
        unit="m",
        above=0.0,
        at_most=1e6,
        none="from the contact to the centre of mass",
    )

    force_max: float | str | None = key(
        None, "greatest force", group=BOUNDS, unit="N", above=0.0, none="none", relative="w"
    )
    moment_max: float | str | None = key(
        None, "greatest moment", group=BOUNDS, unit="N m", above=0.0, none="none", relative="w"
    )
    force_rate: float | str | None = key(
        None, "greatest rate of change of the force", group=BOUNDS, unit="N/s", above=0.0, none="none", relative="w"
    )
    moment_rate: float | str | None = key(
        None, "greatest rate of change of the moment", group=BOUNDS, unit="N m/s", above=0.0, none="none", relative="w"
    )

    plan_hz: float | None = key(
        None,
        "how often a plan is made, which the control law then follows in place of the reference",
        group=HORIZON,
        unit="Hz",
        above=0.0,
        at_most=1e4,
        none="never",
    )
    plan_steps: int = key(20, "number of steps of a plan", group=HORIZON, at_least=1, at_most=1000, needs=_PLANS)
    plan_step: float | str = key(
        0.02,
        "duration of a step of a plan",
        group=HORIZON,
        unit="s",
        above=0.0,
        at_most=10.0,
        relative="T",
        needs=_PLANS_OR_PLAYS,
    )
    integrator: str = key(
        "semi-implicit",
        "how a plan integrates the motion over a step",
        group=HORIZON,
        words=dict.fromkeys(INTEGRATORS, ""),
        needs=_PLANS_OR_PLAYS,
    )
    track: float = key(
        1e4,
        "cost, in a step of a plan, of an error of one radian or one lever, in squares of the weight",
        group=HORIZON,
        above=0.0,
        at_most=1e12,
        needs=_PLANS_OR_PLAYS,
    )

    shove_bound: float = key(
        0.0,
        "greatest impulse of a shove that the controller reckons with, in any direction, for each kg",
        group=UNCERTAINTY,
        unit="N s/kg",
        at_least=0.0,
        at_most=1e3,
    )
    theta_error: float = key(
        0.0,
        "greatest error of the measured orientation about any axis",
        group=UNCERTAINTY,
        unit="deg",
        at_least=0.0,
        at_most=90.0,
    )
    omega_error: float = key(
        0.0,
        "greatest error of the measured angular velocity about any axis",
        group=UNCERTAINTY,
        unit="deg/s",
        at_least=0.0,
        at_most=1e5,
    )
    worlds_at: str = key(
        "drawn",
        "which members of the set of intervals the worlds are",
        group=UNCERTAINTY,
        words={"drawn": "at random, each by its number and the seed", "vertices": "each vertex in turn"},
        needs=Needs("differing", said="a key of the object is an interval"),
    )

    integral: float = key(
        0.0,
        "rate at which integral action removes a steady error of the angle",
        group=STAGES,
        unit="1/s",
        at_least=0.0,
        at_most=1e5,
        needs=Needs("law", ("dynamic",)),
        stage="pivoting.sim.pipeline.integral_action:IntegralAction",
    )

    disturbance: float = key(
        0.0,
        "rate at which a disturbance observer removes a steady error of the angle, without winding up within bounds",
        group=STAGES,
        unit="1/s",
        at_least=0.0,
        at_most=1e5,
        needs=Needs("law", ("dynamic",)),
        stage="pivoting.sim.pipeline.disturbance_observer:DisturbanceObserver",
    )

    dt: float | None = key(
        None,
        "time step",
        group=SIMULATOR,
        unit="s",
        above=0.0,
        at_most=0.1,
        none="as the scene has it, or finer for a large object of your own",
    )
    timeconst: float | None = key(
        None,
        "time constant of the contact (solref)",
        group=SIMULATOR,
        unit="s",
        above=0.0,
        at_most=1.0,
        none="2.1 dt, or with --as-modelled as the file has it",
    )
    impedance: float | None = key(
        None, "impedance of the contact (solimp)", group=SIMULATOR, above=0.0, below=1.0, none=SCENE
    )
    impratio: float | None = key(
        None, "ratio of the contact's impedance along the support to that across it",
        group=SIMULATOR, above=0.0, at_most=1e9, none=SCENE,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class ScenarioKeys(LoopKeys, IdealKeys):
    """The values of a scenario that `--set` changes. Angles are in degrees here and in radians everywhere else."""


KEYS = declared_keys(ScenarioKeys)


def _of(*groups: str) -> tuple[str, ...]:
    return tuple(name for name, declared in KEYS.items() if declared.group in groups)


SCENE_KEYS = tuple(name for name in _of(OBJECT, SIMULATOR) if name != "com")  # the changes of `models.scene_changes`
HIDDEN_KEYS = _of(OBJECT)  # that the world may have and no one know
CONTROL_KEYS = _of(CONTROLLER)  # of the controller alone
BOUND_KEYS = _of(BOUNDS)
