"""Whether the simulator holds an edge by contacts along it, or by one at a time, which jumps between its ends.

Of a mesh on a plane MuJoCo makes few contacts and leaves out those that are close to another, by rules that change with
its version: 3.12 kept three, 0.3 of the geom's bounding radius from the deepest, 4.0 keeps four. Therefore it is asked,
with the edge pressed a little into the table.
"""

import copy
from collections.abc import Callable

import mujoco
import numpy as np
from pivoting.models.frames import Array, matrix, quaternion
from pivoting.models.reading import RigidBody, initial_data, place
from pivoting.models.tilt import Stance

DEPTH = 1e-5  # of the lever to the CoM, that an edge's middle is pressed in
LEANING = 0.3  # share of that by which one end is deeper and the other less deep
APART = 0.3  # of an edge's length: closer contacts do not hold it


def holds(model: mujoco.MjModel, body: RigidBody) -> Callable[[Stance], bool]:
    """What says of a stance whether two contacts hold its edge when one end is the deeper one; one point always holds.

    Args:
        model: of the body; it is not changed.
        body: that moves freely.
    """
    model, data, table = copy.copy(model), initial_data(model), matrix(body.table)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE  # it misses contacts of less than 1e-6 m
    turned, origin = data.xmat[body.index].reshape(3, 3).copy(), data.xpos[body.index].copy()

    def held(stance: Stance) -> bool:
        middle, along = stance.points.mean(axis=0), stance.points[-1] - stance.points[0]
        length, depth = float(np.linalg.norm(along)), DEPTH * float(np.linalg.norm(body.com - middle))
        if length == 0.0:
            return True
        away = origin + turned @ middle - body.origin  # where the file has it, as far as the table goes
        at = body.origin + away - (away @ table[:, 2] + depth) * table[:, 2]
        level = _rotation(stance.axis, 0.5 * stance.range[1]) @ stance.rotation
        across = np.cross([0.0, 0.0, 1.0], level @ along / length)
        for leaning in (-LEANING, LEANING):
            leant = _rotation(across, np.arctan(2.0 * leaning * depth / length)) @ level
            place(model, data, body, quaternion(table @ leant), middle, at)
            mujoco.mj_collision(model, data)
            at_edge = _touching(model, data, body) @ along
            if len(at_edge) > 1 and at_edge.max() - at_edge.min() >= APART * length**2:
                return True
        return False

    return held


def _touching(model: mujoco.MjModel, data: mujoco.MjData, body: RigidBody) -> Array:
    """(C, 3) where the body touches its support, body frame [m]."""
    found = [c.pos for c in data.contact if body.support in c.geom and body.index in model.geom_bodyid[c.geom]]
    return (np.reshape(found, (-1, 3)) - data.xpos[body.index]) @ data.xmat[body.index].reshape(3, 3)


def _rotation(axis: Array, angle: float) -> Array:
    """(3, 3) by an angle [rad] about a unit vector (3,)."""
    out = np.empty(4)
    mujoco.mju_axisAngle2Quat(out, axis, angle)
    return matrix(out)
