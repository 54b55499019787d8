"""The arrays of a run under the names that they have in its file, with their dimensions, units and meanings.

Dimensions: world (W); state (N+1), at `time`; step (N), which begins at `step_time`; contact (K); plan (P), of a
receding horizon; plan_pose and plan_step, of a plan that is played in open loop. The components of vectors have
dimensions whose coordinates are their names. The unit of length is the model's: where that is not the metre, the units
are "0.001 m", "0.001 N" and so on.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.planning.equations_of_motion import Path
from pivoting.controller.planning.horizon_program import Guess
from pivoting.controller.planning.receding_horizon import OUTCOMES
from pivoting.controller.solution import STATUS
from pivoting.controller.validate import frozen
from pivoting.models.length_unit import POWERS
from pivoting.sim.contact_sensing import ContactReadings
from pivoting.sim.judging.predicted_slip import RowEffects
from pivoting.sim.netcdf import Variable
from pivoting.sim.pipeline.log import Log, worlds_first
from pivoting.sim.pipeline.plan_log import Event, PlanLog
from pivoting.sim.pipeline.stages import ANGULAR_VELOCITY, ORIENTATION, POSITION, VELOCITY, Answers
from pivoting.sim.scenarios.scenario_keys import KEYS

if TYPE_CHECKING:
    from pivoting.sim.experiment import Experiment
    from pivoting.sim.run import Run

Array = NDArray[Any]
Arrays = Mapping[str, Array]
Meaning = tuple[str, str, str]  # dimensions, unit, what it is
STATES = {"position": POSITION, "quaternion": ORIENTATION, "velocity": VELOCITY, "angular_velocity": ANGULAR_VELOCITY}
WRENCH = {2: ("F_u", "F_v", "M"), 3: ("F_x", "F_y", "F_z", "M_x", "M_y", "M_z")}  # by dimension, object axes
CONTACT_AXES = {2: ("t", "n"), 3: ("t", "o", "n")}
_POWERS = {**POWERS, "m/s": 1}  # of the model's unit of length in a unit
_NAMES = {"xyz": ("x", "y", "z"), "wxyz": ("w", "x", "y", "z"), "table_axis": ("t", "o"), "wrench_axis": WRENCH[3]}
_MEANINGS = {  # name: dimensions, unit, what it is
    "time": ("state", "s", "time"),
    "step_time": ("step", "s", "time at which the step begins"),
    "world": ("world", "", "number of the world, from 0"),
    "reference_angle": ("state", "rad", "desired angle about the reference's axis"),
    "reference_rate": ("state", "rad/s", "desired rate of turn"),
    "reference_acceleration": ("state", "rad/s^2", "desired angular acceleration"),
    "theta": ("world state", "rad", "angle turned about the reference's axis"),
    "slip": (
        "world state contact table_axis",
        "m",
        "displacement of contacts along the table since they are to hold",
    ),
    "position": ("world state xyz", "m", "what is taken for the centre of mass, world axes"),
    "quaternion": ("world state wxyz", "", "orientation, object axes to world"),
    "velocity": ("world state xyz", "m/s", "velocity of what is taken for the centre of mass, world axes"),
    "angular_velocity": ("world state xyz", "rad/s", "angular velocity, world axes"),
    "required": ("world step component", "N, N m", "what contacts and wrench have to make together, object axes"),
    "wrench": ("world step component", "N, N m", "wrench that was asked for, object axes"),
    "force": ("world step contact contact_axis", "N", "contact forces predicted by the solution, table axes"),
    "residual": ("world step", "", "relative KKT residual"),
    "status": ("world step", "", "status of the answer"),
    "stance": ("world step", "", "number of the stance, the set of contacts that are to hold"),
    "acting": ("world step component", "N, N m", "wrench that acted, object axes"),
    "disturbance": (
        "world step wrench_axis",
        "N, N m",
        "force and torque on the object besides, at the centre of mass, world axes",
    ),
    "wrench_world": (
        "world step wrench_axis",
        "N, N m",
        "applied force and torque at the true centre of mass",
    ),
    "contact_force": ("world step contact xyz", "N", "contact forces on the object by MuJoCo, world axes"),
    "contact_found": ("world step", "", "contacts between the object and its support"),
    "contact_stray": ("world step", "N", "force of contacts that are not declared"),
    "contact_strays": ("world step", "", "contacts that are not declared"),
    "contact_depth": ("world step", "m", "depth of the deepest contact with the support"),
    "held_give": ("world step contact table_axis", "m/s^2", "R f of the friction rows, along the table"),
    "held_above": ("world step contact", "m", "height of what the contact rows hold above what touches"),
    "held_slides": ("world step contact", "", "whether a contact is at the limit of its friction"),
    "control_ns": ("step", "ns", "time to sense, observe, state, solve and certify, all worlds together"),
    "start_qpos": ("world qpos", "", "joint positions of the model at time 0"),
    "start_qvel": ("world qvel", "", "joint velocities of the model at time 0"),
    "plans_step": ("plan", "", "step at which the plan was made"),
    "plans_outcome": ("world plan", "", "what is followed since"),
    "plans_residual": ("world plan", "", "relative KKT residual of the last program"),
    "plans_change": ("world plan", "", "change by the last pass, in weights, levers and radians"),
    "plans_motion_defect": ("world plan", "", "defect of the equations of motion, over the weight"),
    "plans_stick_defect": ("world plan", "", "defect of the contacts staying put, over the lever"),
    "plans_ms": ("world plan", "ms", "time that the plan took"),
    "plan_position": ("plan_pose xyz", "m", "planned centre of mass, table axes"),
    "plan_orientation": ("plan_pose wxyz", "", "planned orientation, object axes to table"),
    "plan_before": ("plan_before_entry", "", "pose at which a forward step's forces act first, table axes"),
    "plan_arriving": ("plan_arriving_entry", "", "step times the velocity with which the first pose is reached"),
    "plan_wrench": ("plan_step component", "N, N m", "planned wrench, object axes"),
    "plan_force": ("plan_step plan_forces", "N", "planned contact forces, contact axes"),
    "plan_desired_position": ("plan_step xyz", "m", "desired centre of mass, table axes"),
    "plan_desired_orientation": ("plan_step wxyz", "", "desired orientation, object axes to table"),
}
for _name in STATES:
    _dims, _unit, _what = _MEANINGS[_name]
    for _seen in ("measured", "estimated"):
        _MEANINGS[f"{_seen}_{_name}"] = (_dims.replace("state", "step"), _unit, f"{_what}, as it is {_seen}")
_ANSWERS = ("required", "wrench", "force", "residual", "status")  # as `Answers.values` has them
_WORDS = {"status": STATUS, "plans_outcome": OUTCOMES}  # what their numbers stand for


@np.errstate(invalid="ignore", over="ignore")  # of a world that diverges
def named_arrays(run: "Run") -> dict[str, Array]:
    """All arrays of a run's file, by name."""
    log = run.log
    found: dict[str, Any] = {"time": run.time, "step_time": run.time[:-1], "world": np.arange(run.worlds)}
    found |= dict(zip(("reference_angle", "reference_rate", "reference_acceleration"), run.reference, strict=True))
    found |= {"theta": run.theta, "slip": run.slip}
    found |= (
        _of_states("", log.states) | _of_states("measured_", log.measured) | _of_states("estimated_", log.estimated)
    )
    found |= {name: getattr(log.answers, name) for name in _ANSWERS}
    found |= {"force": run.force, "acting": log.acting, "disturbance": log.disturbance}
    found |= {"wrench_world": log.wrench_world}
    found |= _of_fields("contact_", log.contacts) | _of_fields("held_", log.held) | {"control_ns": log.control_ns}
    found |= dict(zip(("start_qpos", "start_qvel"), run.start, strict=True))
    found |= {"stance": run.stance} | own_values(run)
    if run.plans is not None:
        found |= _of_fields("plans_", run.plans)
    if run.plan is not None:
        guess, desired = run.plan.guess, run.plan.desired
        found |= _of_fields("plan_", guess.path) | {"plan_wrench": guess.wrench, "plan_force": guess.force}
        found |= {"plan_desired_position": desired[0], "plan_desired_orientation": desired[1]}
    return {name: values for name, values in found.items() if values is not None}


def described(run: "Run") -> dict[str, Variable]:
    """The same with dimensions, units and meanings, as `write_netcdf` takes them; and the names of components."""
    dim, arrays = run.truth.dim, named_arrays(run)
    arrays |= {name: np.array(names) for name, names in _NAMES.items()}
    arrays |= {"component": np.array(WRENCH[dim]), "contact_axis": np.array(CONTACT_AXES[dim])}
    own = {name: own_variable(name, arrays.pop(name)) for name in own_values(run)}
    return {name: variable(name, values, run.unit) for name, values in arrays.items()} | own


def own_values(run: "Experiment") -> dict[str, Array]:
    """What each world has of its own, (W,) by "world.KEY"; nothing where they are alike."""
    values = run.world.values
    return {} if values is None else {f"world.{key}": column for key, column in values.columns.items()}


def own_variable(name: str, values: Array) -> Variable:
    """One of them as a file has it."""
    key = KEYS[name.removeprefix("world.")]
    return variable(name, values, meaning=("world", key.unit, key.help))


def meaning_of(name: str) -> Meaning:
    """Of an array of a run's file; of what is not listed, as the names of components, only its own dimension."""
    return _MEANINGS.get(name, (name, "", ""))


def variable(name: str, values: Array, unit: float = 1.0, meaning: Meaning | None = None) -> Variable:
    """An array as a file has it, of a model whose unit of length is `unit` [m]; its meaning by its name, or another."""
    dims, units, what = meaning or meaning_of(name)
    attributes: dict[str, Any] = {"long_name": what, "units": in_unit(units, unit)}
    if name in _WORDS:
        words = [word.replace(" ", "_") for word in _WORDS[name]]
        attributes |= {"flag_values": np.arange(len(words), dtype=np.int8), "flag_meanings": " ".join(words)}
    return Variable(tuple(dims.split()), values, {key: value for key, value in attributes.items() if len(value)})


def in_unit(units: str, unit: float) -> str:
    """Units such as "N, N m" of numbers of a model whose unit of length is `unit` [m]: "0.001 N, 1e-06 N m"."""
    factors = {each: unit ** _POWERS.get(each, 0) for each in units.split(", ")}
    return ", ".join(each if factor == 1.0 else f"{factor:g} {each}" for each, factor in factors.items())


def log_of(arrays: Arrays) -> Log:
    """The log of a run, bit for bit and as it lies in memory, on which the last digit of a sum depends.

    Raises:
        KeyError: an array is missing.
    """
    stepped = {name: np.moveaxis(values, 1, 0).copy() for name, values in arrays.items() if values.ndim > 1}
    flat = {name: stepped[name].reshape(*stepped[name].shape[:2], -1) for name in _ANSWERS if name != "status"}
    return worlds_first(
        Log(
            states=_joined("", stepped),
            measured=_joined("measured_", stepped) if "measured_position" in stepped else None,
            estimated=_joined("estimated_", stepped) if "estimated_position" in stepped else None,
            answers=Answers(
                np.concatenate(list(flat.values()), axis=-1), stepped["status"], stepped["wrench"].shape[-1]
            ),
            acting=stepped.get("acting"),
            disturbance=stepped.get("disturbance"),
            wrench_world=stepped["wrench_world"],
            contacts=ContactReadings(**{name: stepped[f"contact_{name}"] for name in ContactReadings._fields}),
            held=RowEffects(**{name: stepped[f"held_{name}"] for name in RowEffects._fields}),
            control_ns=arrays["control_ns"],
        )
    )


def plans_of(arrays: Arrays) -> PlanLog | None:
    """Of a receding horizon, if the run had one."""
    if "plans_step" not in arrays:
        return None
    kept = {name: arrays[f"plans_{name}"] for name in PlanLog._fields}
    return PlanLog(**{**kept, "step": frozen(kept["step"].astype(np.int64))})  # a file has 32 bits for it


def outcome_words(run: "Experiment") -> dict[str, Any]:
    """What came of a run or a fleet beside its arrays, for a file."""
    return {"wall_s": run.wall_s, "events": run.events, "engine_warnings": run.engine_warnings}


def outcome_of(arrays: Arrays, words: Mapping[str, Any]) -> dict[str, Any]:
    """What came of a run or a fleet out of its file, by field of `Experiment`; `words` are those of `outcome_words`."""
    return {
        "wall_s": words["wall_s"],
        "plans": plans_of(arrays),
        "events": tuple(Event(*event) for event in words["events"]),
        "engine_warnings": tuple(words["engine_warnings"]),
    }


def plan_of(arrays: Arrays) -> tuple[tuple[Array, Array], Guess] | None:
    """Desired poses and answer of the plan that was played in open loop, if one was; see `Plan`."""
    if "plan_wrench" not in arrays:
        return None
    path = Path(**{name: arrays[f"plan_{name}"] for name in Path._fields})
    desired = arrays["plan_desired_position"], arrays["plan_desired_orientation"]
    return desired, Guess(path, arrays["plan_wrench"], arrays["plan_force"])


def _of_states(prefix: str, values: Array | None) -> dict[str, Array]:
    return {} if values is None else {prefix + name: values[..., columns] for name, columns in STATES.items()}


def _joined(prefix: str, arrays: Arrays) -> Array:
    """What `_of_states` took apart."""
    return np.concatenate([arrays[prefix + name] for name in STATES], axis=-1)


def _of_fields(prefix: str, values: Any) -> dict[str, Array]:
    return {prefix + name: value for name, value in values._asdict().items()}
