"""How the worlds start: the object on its contact, as deep in it as its load makes it, a little off the reference."""

from collections.abc import Sequence
from itertools import repeat

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray
from pivoting.controller.kernels.compilation import first_calls
from pivoting.controller.rotations import exponential, quaternion_product
from pivoting.controller.wrench_controller import WrenchController
from pivoting.models.frames import matrix
from pivoting.models.rigid_body import initial_data, place, turn
from pivoting.sim.judging.undeclared_contacts import contact_margin, refuse_strays
from pivoting.sim.pipeline.law_control import LawControl
from pivoting.sim.pipeline.stages import Answers, States
from pivoting.sim.world import World

Array = NDArray[np.float64]
Samples = tuple[Array, Array, Array]  # orientations, angular velocities and accelerations
START_DEPTH = 1e-6  # of the lever from contact to CoM: how deep it starts if its load does not say
DEEPEST = 1e-2  # likewise: how deep it may start


def resting_depths(world: World, controllers: Sequence[WrenchController], law: LawControl, told: Samples) -> Array:
    """(B,) how deep [m] the contacts are under the load with which the law of each of B controllers begins.

    Of W worlds that differ (W,). 0 if MuJoCo's rows do not say.
    """
    B = len(controllers)
    if world.contact_rows is None:
        return np.zeros(B)
    states = States.turning(told[0][:1].repeat(B, axis=0), told[1][:1].repeat(B, axis=0))
    nw, forces = controllers[0].widths
    out = Answers.empty((B,), nw, forces)
    with first_calls():
        law.prepare(states, out)
    load = out.force.reshape(B, -1, controllers[0].space.dim)[..., -1].sum(axis=1)
    return world.depths(np.broadcast_to(load, len(world.truths)) if B == 1 else load)


def start_worlds(batch: Batch, world: World, desired: Samples, errors: Array, depths: Array) -> None:
    """Put every world on its contact, off the reference by `errors` (W,) [rad].

    Everything else is where the model's first keyframe, or else qpos0, has it.

    Args:
        desired: at every step.
        depths: (W,), or (1,) for all, at which it rests under its load, 0 if that is not known [m]; one that has less
            to carry at first would slide, and one that has more is thrown up.

    Raises:
        ModelError: the object would touch something else there; it is named.
    """
    there, body, W = world.placement, world.truth, len(errors)
    models = repeat(world.model, W) if world.differing is None else world.differing.models()
    data, up, point = initial_data(world.model), matrix(body.table)[:, 2], there.contacts[0]
    known = np.where(depths > 0.0, depths, START_DEPTH * there.lever)
    each = np.broadcast_to(np.minimum(known, DEEPEST * there.lever), W)
    kind, floats = int(mujoco.mjtState.mjSTATE_INTEGRATION), 0.0
    state, begun = (np.empty(mujoco.mj_stateSize(world.model, kind)) for _ in range(2))
    mujoco.mj_getState(world.model, data, begun, kind)
    for row, error, depth, model in zip(batch.state, errors, each, models, strict=True):
        mujoco.mj_setState(model, data, begun, kind)  # whatever other worlds there are, to the last bit
        for _ in range(2):  # a contact with a margin holds the body above the table: how far, only MuJoCo knows
            at = there.at + (there.radius[0] + floats - depth) * up
            place(model, data, body, quaternion_product(exponential(error * there.axis), desired[0][0]), point, at)
            touching = point - there.radius[0] * up @ data.xmat[body.index].reshape(3, 3)
            turn(model, data, body, desired[1][0], touching)
            mujoco.mj_forward(model, data)
            if floats or not (floats := contact_margin(model, data, body)):
                break
        refuse_strays(model, data, body, world.unit)
        mujoco.mj_getState(model, data, state, kind)
        row[:] = state
