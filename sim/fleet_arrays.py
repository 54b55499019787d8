"""The arrays of a fleet under the names that they have in its file, and the fleet that is made of them again.

Dimensions: world (W); sample (S), at `time`; plan (P), of a receding horizon; step (N). Measures are in the units that
their names end with; samples are in the model's unit of length, as in the file of a run.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from pivoting.sim.belief import Controllers
from pivoting.sim.experiment import freeze
from pivoting.sim.fleet import Fleet, Handed, WorldSamples
from pivoting.sim.judging.findings import Findings
from pivoting.sim.judging.measures import Measures
from pivoting.sim.netcdf import Variable
from pivoting.sim.run_arrays import (
    WRENCH,
    Arrays,
    Meaning,
    meaning_of,
    outcome_of,
    outcome_words,
    own_values,
    own_variable,
    variable,
)
from pivoting.sim.run_setup import Begun

_MEASURES = {  # what they are; dimension and unit follow from the name
    "slip_max_m": "greatest displacement of a contact along the table",
    "slip_floor_m": "what the simulator itself is predicted to contribute to it",
    "angle_error_rms_deg": "error of the angle, RMS",
    "angle_error_max_deg": "error of the angle, greatest",
    "contact_lost_s": "time without contact",
    "undeclared_contact_s": "time with an undeclared contact",
    "penetration_rel": "depth of the contact beyond what the soft contact explains, in levers",
    "contacts_missing": "contacts missing at the end",
    "bounce_m": "height regained after landing",
    "friction_use_max": "greatest measured |f_t| / (mu f_n)",
    "force_mismatch_rel": "RMS of the measured minus the predicted contact force, over the RMS of the predicted",
    "residual_max": "greatest relative KKT residual",
    "unsolved_steps": "steps without a certified answer",
    "repeated_steps": "steps in which the last answer was used again",
    "safe_s": "time in a safe state",
}
_OTHERS: dict[str, Meaning] = {
    "angle_error": ("world state", "rad", "angle from the desired orientation"),
    "friction_use": ("world step contact", "", "measured |f_t| / (mu f_n)"),
    "control_us": ("step", "us", "time to sense, observe, state, solve and certify, a world"),
}


def fleet_described(fleet: Fleet) -> dict[str, Variable]:
    """All arrays of a fleet's file, by name, with dimensions, units and meanings."""
    found = {"world": variable("world", np.arange(fleet.worlds))}
    found |= {name: own_variable(name, values) for name, values in own_values(fleet).items()}
    for name, values in vars(fleet.measures).items():
        unit = next((unit for unit in ("m", "deg", "s") if name.endswith(f"_{unit}")), "")
        found[name] = variable(name, values, meaning=("world", unit, _MEASURES[name]))
    found["control_us"] = variable("control_us", fleet.control_us, meaning=_OTHERS["control_us"])
    if fleet.samples is not None:
        found["component"] = variable("component", np.array(WRENCH[fleet.truth.dim]))
        found["table_axis"] = variable("table_axis", np.array(("t", "o")))
        for name, values in fleet.samples._asdict().items():
            dims, unit, what = _OTHERS.get(name) or meaning_of(name)
            sampled = dims.replace("state", "sample").replace("step", "sample")
            found[name] = variable(name, values, fleet.unit, (sampled, unit, what))
    if fleet.plans is not None:
        found |= {f"plans_{name}": variable(f"plans_{name}", each) for name, each in fleet.plans._asdict().items()}
    return found


def fleet_outcome(fleet: Fleet) -> dict[str, Any]:
    """What came of a fleet beside its arrays."""
    return {
        **outcome_words(fleet),
        "events_left_out": fleet.events_left_out,
        "findings": fleet.findings._asdict(),
    }


def fleet_of(
    begun: Begun,
    arrays: Arrays,
    outcome: Mapping[str, Any],
    python_objects: tuple[str, ...],
    controller: Controllers,
) -> Fleet:
    """The fleet again.

    Args:
        controller: that was handed to `simulate`, if one was.

    Raises:
        KeyError: an array is missing.
    """
    kept = {name: arrays[name] for name in WorldSamples._fields} if "theta" in arrays else None
    fleet = Fleet(
        **begun.experiment,
        **outcome_of(arrays, outcome),
        python_objects=python_objects,
        measures=Measures(**{name: arrays[name] for name in _MEASURES}),
        samples=None if kept is None else WorldSamples(**kept),
        findings=Findings(**outcome["findings"]),
        control_us=arrays["control_us"],
        events_left_out=outcome["events_left_out"],
        handed=Handed(controller=controller),
    )
    freeze(tuple(vars(fleet).values()))
    return fleet
