"""What tells runs apart: a digest of the world's model, the contacts, and what the controller believes and follows."""

import hashlib
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

if TYPE_CHECKING:
    from pivoting.sim.experiment import Experiment


def digest(run: "Experiment") -> str:
    """Twelve hexadecimal digits; the same for equal runs on any day, whatever was measured in them."""
    model = np.zeros(mujoco.mj_sizeModel(run.model), np.uint8)
    mujoco.mj_saveModel(run.model, None, model)
    beliefs = tuple(controller.belief for stance in run.stances for controller in stance.controllers)
    given = (model, run.points, run.world.radius, run.world.turn, run.reference, beliefs)
    case = run.scenario.absolute(run.load)
    own = () if run.world.values is None else tuple(run.world.values)
    words = (
        case.bounds(),
        case.limits,
        case.plan_hz,
        case.plan_steps,
        case.plan_step,
        case.integrator,
        case.track,
        case.stages,
    )
    out = hashlib.blake2b(digest_size=6)
    _add(out, (*given, *own, repr(words), run.controller, run.open_loop))
    return out.hexdigest()


def _add(out: Any, value: Any) -> None:
    """Of tuples each part, of all else type, shape and content."""
    if isinstance(value, tuple):
        for part in value:
            _add(out, part)
    elif value is None or isinstance(value, str):
        out.update(str(value).encode())
    else:
        array = np.ascontiguousarray(value)
        out.update(f"{array.dtype.str}{array.shape}".encode() + array.tobytes())
