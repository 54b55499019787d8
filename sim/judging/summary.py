"""The run in numbers: what `summary.json` and `--json` say."""

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from pivoting.models.frames import matrix
from pivoting.models.names import geom_name
from pivoting.models.rigid_body import file_frame, laid_over
from pivoting.sim.pipeline.plan_log import plan_figures
from pivoting.sim.scenarios.intervals import spelled

if TYPE_CHECKING:
    from pivoting.sim.experiment import Experiment
    from pivoting.sim.world import World

Array = NDArray[np.float64]
_CHOSEN = ("contacts", "coupling", "reason")  # of the contact settings, what the model itself does not say


def summary(run: "Experiment") -> dict[str, Any]:
    """A run or a fleet in numbers, of the worst world, SI units in the keys; what `--json` prints."""
    found = run.findings
    worst = {key: float(np.max(value)) for key, value in vars(run.measures).items()}
    return {
        "scenario": run.scenario.name,
        "model": str(run.scenario.path),
        "body": run.scenario.body,
        "length_unit_m": run.unit,
        "contacts": (run.unit * run.points).tolist(),
        "radius": (run.unit * run.world.radius).tolist(),
        "changes": {key: spelled(value) for key, value in run.scenario.changes.items()},
        "resolved": run.scenario.resolved(run.load),
        "limits": asdict(run.limits),
        "controller": run.controller,
        "seed": run.seed,
        "worlds": run.worlds,
        "verdict": run.verdict,
        "failed_worlds": run.failed_worlds.tolist(),
        "worst_world": run.worst_world,
        **worst,
        "slip_floor_unknown": found.slip_floor_unknown or None,
        "solve_us_median": float(np.median(run.control_us)),
        "solve_us_p99": float(np.quantile(run.control_us, 0.99)),
        "sim_s": float(run.time[-1]),
        "wall_s": run.wall_s,
        "real_time_factor": run.worlds * float(run.time[-1]) / run.wall_s,
        "bounded_steps": found.bounded_steps,
        "unguaranteed_steps": found.unguaranteed_steps,
        "reasons": found.reasons,
        "remedies": found.remedies,
        "undeclared_contacts": found.strays,
        "support": geom_name(run.model, run.truth.support),
        "contact": "; ".join(",".join(f"{x:.9g}" for x in point) for point in _in_file(run)),
        "object": object_figures(run),
        "contact_settings": contact_figures(run),
        "events": [event._asdict() for event in run.events],
        "engine_warnings": list(run.engine_warnings),
        **({} if run.plans is None else plan_figures(run.plans)),
        **({} if run.world.values is None else {"worst_world_values": run.values_of(run.worst_world)}),
    }


def _in_file(run: "Experiment") -> Array:
    """The first stance's contacts as --contact takes them, in the frame and unit of length of the body in its file."""
    origin, axes = file_frame(run.model, run.truth.index)
    return (run.world.applied_at + run.points[run.stances[0].held] @ matrix(run.truth.axes).T - origin) @ axes


def object_figures(run: "Experiment") -> dict[str, Any]:
    """What was read of the object, as the worst world has it, in the frame that its file gives the body."""
    world = _worst(run)
    origin, axes = file_frame(world.model, world.truth.index)
    return {
        "support": geom_name(run.model, run.truth.support),
        "mass_kg": world.truth.mass,
        "inertia_kg_m2": (run.unit**2 * np.asarray(world.truth.inertia)).tolist(),
        "com_m": (run.unit * (world.truth.com - origin) @ axes).tolist(),
        "mu": world.mu,
        "contacts_m": (run.unit * _in_file(run)).tolist(),
        "radius_m": (run.unit * run.world.radius).tolist(),
        "damping": 0.0 if run.truth.drag is None else float(run.truth.drag.damping.max()),
        "frictionloss": 0.0 if run.truth.drag is None else float(run.truth.drag.friction.max()),
        "laid_over_deg": laid_over(run.model, run.truth, run.world.turn[1]),
    }


def contact_figures(run: "Experiment") -> dict[str, Any]:
    """The support's contact parameters in the worst world, and what they replaced of the file."""
    world = _worst(run)
    opt, geom = world.model.opt, world.truth.support
    return {
        "dt_s": float(opt.timestep),
        "solref": world.model.geom_solref[geom].tolist(),
        "solimp": world.model.geom_solimp[geom].tolist(),
        "impratio": float(opt.impratio),
        "cone": mujoco.mjtCone(int(opt.cone)).name.removeprefix("mjCONE_").lower(),
        "replaced": dict(run.world.replaced),
        "f_min_N": run.unit * float(run.attached.controller.belief.contacts.f_min.max()),
        **({} if world.settings is None else {key: getattr(world.settings, key) for key in _CHOSEN}),
    }


def _worst(run: "Experiment") -> "World":
    """The worst world, as it is alone; where they are alike none has to be found."""
    return run.world if run.world.differing is None else run.world.of(run.worst_world)
