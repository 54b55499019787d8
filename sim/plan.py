"""Where a scenario's object stands and about what it turns: contacts, axis, and the orientation at angle 0."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from pivoting.controller.so3 import exponential
from pivoting.controller.space import quaternion_product
from pivoting.models.candidates import Stance, planar_stance, stance, support_points
from pivoting.models.reading import ModelError, RigidBody, matrix, quaternion, read_body
from pivoting.sim.keys import LOWEST
from pivoting.sim.relative import Load, load
from pivoting.sim.scenario import Scenario

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Plan:
    """A scenario on a model.

    Attributes:
        body: as the model has it.
        contacts: (K, 3) the points that are to stick, or the centres of what is to roll, body frame [m].
        radius: (K,) of what rolls, else 0 [m].
        at: (3,) where the first of them touches the table, world axes [m].
        axis: (3,) unit vector that the object turns about, through the contacts, world axes.
        start: (4,) orientation at angle 0, object axes to world.
        range: the angles [rad] at which nothing else touches the support.
        face: (P, 3) the corners that touch as well at angle 0, body frame [m].
    """

    body: RigidBody
    contacts: Array
    radius: Array
    at: Array
    axis: Array
    start: Array
    range: tuple[float, float]
    face: Array

    @property
    def load(self) -> Load:
        """What values of the scenario may be relative to."""
        points = np.array([self.body.point(contact) for contact in self.contacts])
        return load(self.body.mass, self.body.gravity, points, self.radius)


def planned(case: Scenario, model: mujoco.MjModel) -> Plan:
    """The scenario's plan on its compiled model.

    Raises:
        ModelError: the model cannot be served, or the object cannot be pivoted on that contact; with the reason.
    """
    body = read_body(model, case.body, case.support)
    table = matrix(body.table)
    gap = np.deg2rad(LOWEST)
    if body.dim == 2:
        return _planar(case, model, body)
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_kinematics(model, data)
    now = data.xmat[body.index].reshape(3, 3)
    found = stance(model, body.index, case.contact, quaternion(now), body.table)
    if not isinstance(case.contact, str):
        _refuse_above(model, body, found, table.T @ now)
    start, axis = table @ found.rotation, table @ found.axis
    low, high = found.range
    lands = case.limits.contacts_end > 0
    limits = (low if lands else low + gap, high - gap)
    if case.about == "yaw":
        start, axis = matrix(quaternion_product(exponential(found.balance * axis), quaternion(start))), table[:, 2]
        limits = (-2.0 * np.pi, 2.0 * np.pi)
    # the object starts where its file has it: the first contact is put under the place that it has there
    there = data.xpos[body.index] + now @ found.points[0] - body.origin
    at = body.origin + there - (there @ table[:, 2]) * table[:, 2]
    face = support_points(model, body.index, -found.rotation[2])
    return Plan(body, found.points, found.radius, at, axis, quaternion(start), limits, face)


def _planar(case: Scenario, model: mujoco.MjModel, body: RigidBody) -> Plan:
    """In the plane the contact is the left end of the face that is down at theta = 0, unless it is given."""
    axes, table, gap = matrix(body.axes), matrix(body.table), np.deg2rad(LOWEST)
    point, radius, most = planar_stance(model, body.index, case.contact, axes)
    face = point - radius * axes[:, 2]
    limits = (gap, most - gap)
    return Plan(body, point[None], np.array([radius]), body.origin, -table[:, 1], body.table, limits, face[None])


def _refuse_above(model: mujoco.MjModel, body: RigidBody, found: Stance, now: Array) -> None:
    """Points that are given have to be the lowest of the body as its file has it, body to table axes `now` (3, 3)."""
    lowest = support_points(model, body.index, -now[2])[0] @ now[2]
    height = (found.points @ now[2] - found.radius).max() - lowest
    if height > 1e-3 * (np.linalg.norm(found.points - body.com, axis=-1) + found.radius).max():
        raise ModelError(
            f"contact = {found.points.tolist()}: as the file has the body, this is {height:.3g} m above the table that "
            'its lowest point could stand on; must be among its lowest, or "vertex", "edge", "lowest"'
        )
