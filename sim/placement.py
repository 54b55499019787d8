"""Where a scenario's object stands and about what it turns: contacts, axis, and the orientation at angle 0."""

from dataclasses import dataclass, replace
from functools import partial

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray
from pivoting.controller.rotations import exponential, quaternion_product
from pivoting.controller.validate import dimensions, fail
from pivoting.models.errors import ModelError
from pivoting.models.frames import matrix, quaternion
from pivoting.models.names import label
from pivoting.models.placement.contact_candidates import find_pivot, find_planar_pivot
from pivoting.models.placement.convex_hull import body_size
from pivoting.models.placement.edge_grip import grip
from pivoting.models.placement.given_contacts import NEAR
from pivoting.models.placement.tilt_range import Arc, Pivot
from pivoting.models.rigid_body import RigidBody, file_frame, initial_data, place, read_body
from pivoting.sim.judging.predicted_slip import stepped_point
from pivoting.sim.judging.undeclared_contacts import refuse_strays
from pivoting.sim.scenarios.relative_values import Load, load
from pivoting.sim.scenarios.scenario import PACE, Scenario
from pivoting.sim.scenarios.scenario_keys import LOWEST

Array = NDArray[np.float64]
WAY = 9  # angles of an arc at which the object may touch nothing else
ANY = Load(1e-6, 1.0, 1e-6)  # so small that nothing that is relative to it is too large


@dataclass(frozen=True, eq=False)
class Placement:
    """Where an object is placed and about what it turns.

    Attributes:
        body: as the model has it.
        contacts: (K, 3) the points that are to stick, or the centres of what is to roll, body frame [m].
        radius: (K,) of what rolls, else 0 [m].
        at: (3,) where the first of them touches the table, world axes [m].
        axis: (3,) unit vector that the object turns about, through the contacts, world axes.
        start: (4,) orientation at angle 0, object axes to world.
        range: the angles [rad] at which nothing else touches the support.
        face: (P, 3) the corners that touch as well at angle 0, body frame [m].
        arm: from the point of the object whose velocity MuJoCo steps to the farthest contact [m].
        unit: of the model's lengths [m]; all the above is in it.
    """

    body: RigidBody
    contacts: Array
    radius: Array
    at: Array
    axis: Array
    start: Array
    range: tuple[float, float]
    face: Array
    arm: float = 0.0
    unit: float = 1.0

    @property
    def lever(self) -> float:
        """From where the first contact touches to the CoM [m]."""
        return float(np.linalg.norm(self.body.com - self.contacts[0]) + self.radius[0])

    @property
    def landing(self) -> Array:
        """(L, 3) the corners of that face that are none of the contacts, body frame [m]."""
        apart = np.linalg.norm(self.face[:, None] - self.contacts, axis=-1).min(axis=1, initial=np.inf)
        return self.face[apart > NEAR * np.linalg.norm(np.ptp(self.face, axis=0))]

    @property
    def load(self) -> Load:
        """What values of the scenario may be relative to, in N, m and s."""
        points = np.array([self.body.point(contact) for contact in self.contacts])
        return load(self.body.mass, self.unit * self.body.gravity, self.unit * points, self.unit * self.radius)


def placed(case: Scenario, model: mujoco.MjModel, unit: float = 1.0) -> Placement:
    """The scenario's object placed in its compiled model, whose lengths are in `unit` [m].

    Raises:
        ModelError: the model cannot be served, or the object cannot be pivoted on that contact; with the reason.
    """
    body = read_body(model, case.body, case.support)
    size = body_size(model, body.index)
    _refuse_beside(model, body, initial_data(model).xipos[body.index], size, "its centre of mass", unit)
    near = NEAR * size
    found = _planar(case, model, body) if body.dim == 2 else _spatial(case, model, body, near, unit)
    _refuse_contacts_beside(model, body, found.at, found.contacts, found.start, near, unit)
    away = np.linalg.norm(found.contacts - stepped_point(model, body.index), axis=1) + found.radius
    return replace(found, arm=float(away.max()), unit=unit)


def _refuse_beside(model: mujoco.MjModel, body: RigidBody, at: Array, allowed: float, what: str, unit: float) -> None:
    """A point (3,) of the body has to be above the face that it stands on."""
    over = float(body.surface.beyond(at).max())
    if over > allowed:
        told = f"{what} would be {over * unit:.3g} m beside its upper face"
        raise ModelError(f"support = {label(model, body.support)}: {told}; must be under the body")


def _refuse_contacts_beside(
    model: mujoco.MjModel, body: RigidBody, at: Array, contacts: Array, start: Array, near: float, unit: float
) -> None:
    """Contacts (K, 3), of which the first is `at` (3,) where the object has the orientation `start` (4,) likewise."""
    held = (contacts - contacts[0]) @ (matrix(start) @ matrix(body.axes).T).T
    _refuse_beside(model, body, at + held, near, "the contact", unit)


def transplanted(placed: Placement, model: mujoco.MjModel, body: RigidBody, grown: float) -> Placement:
    """A placement in a world that is not as believed: the same contacts, of an object that may be larger, on a table
    that may be inclined otherwise.

    Args:
        placed: as believed.  model, body: the world.
        grown: how many times as large the object is there.
    """
    turned = matrix(body.table) @ matrix(placed.body.table).T
    middle = model.geom_pos[model.body_geomadr[body.index]]  # of the one box that a size may change
    return replace(
        placed,
        body=body,
        contacts=middle + grown * (placed.contacts - middle) if grown != 1.0 else placed.contacts,
        face=middle + grown * (placed.face - middle) if grown != 1.0 else placed.face,
        at=body.origin + turned @ (placed.at - placed.body.origin),
        axis=turned @ placed.axis,
        start=quaternion(turned @ matrix(placed.start)),
    )


def _spatial(case: Scenario, model: mujoco.MjModel, body: RigidBody, near: float, unit: float) -> Placement:
    """In space the contacts are found on the object, as `contact_candidates.find_pivot` does."""
    table, gap = matrix(body.table), np.deg2rad(LOWEST)
    data = initial_data(model)
    now = data.xmat[body.index].reshape(3, 3)
    origin, axes = file_frame(model, body.index)
    contact = case.contact if isinstance(case.contact, str) else _in_body_frame(case.contact, (origin, axes))
    arc = None if case.about == "yaw" else _arc(case)
    found = find_pivot(
        model,
        body.index,
        contact,
        quaternion(now),
        body.table,
        arc=arc,
        height=float(table[:, 2] @ (data.xpos[body.index] - body.origin)),
        gripped=None if case.about == "yaw" else grip(model, body, arc),
        misfit=(lambda one: "") if arc is None else partial(_misfit, model, initial_data(model), body, near, unit, arc),
        shown=lambda points: (points - origin) @ axes,
    )
    start, axis = table @ found.rotation, table @ found.axis
    low, high = found.range
    lands = case.limits.contacts_end > 0
    limits = (low if lands else low + gap, high - gap)
    if case.about == "yaw":
        start, axis = matrix(quaternion_product(exponential(found.balance * axis), quaternion(start))), table[:, 2]
        limits = (-2.0 * np.pi, 2.0 * np.pi)
    at = _below(model, body, found.points[0])  # the object starts where its file has it
    return Placement(body, found.points, found.radius, at, axis, quaternion(start), limits, found.face)


def _misfit(
    model: mujoco.MjModel, data: mujoco.MjData, body: RigidBody, near: float, unit: float, arc: Arc, one: Pivot
) -> str:
    """Why a contact cannot be had where the object stands, on the way of an arc about it, or nothing."""
    table, at = matrix(body.table), _below(model, body, one.points[0])
    start = quaternion(table @ one.rotation)
    try:
        _refuse_contacts_beside(model, body, at, one.points, start, near, unit)
        for theta in np.linspace(arc.theta, arc.theta_end, WAY):
            turned = quaternion_product(exponential(theta * (table @ one.axis)), start)
            place(model, data, body, turned, one.points[0], at + one.radius[0] * table[:, 2])
            mujoco.mj_fwdPosition(model, data)
            refuse_strays(model, data, body, unit, f"at {np.rad2deg(theta):.3g} deg")
    except ModelError as error:
        return str(error)
    return ""


def _arc(case: Scenario) -> Arc | None:
    """The angles of the scenario's motion, first that at which it begins; None if it gives no angles.

    How long it takes may be relative to where it turns, which is not yet known: that changes no angle.
    """
    if not isinstance(case.reference, str) and isinstance(case.seconds, str):
        return None
    case = case.absolute(ANY)
    time = np.linspace(0.0, case.duration, PACE)
    angle = np.array(case.motion(time)[0], dtype=float)
    if angle.shape != time.shape or not np.isfinite(angle).all():
        return None
    low, high = float(angle.min()), float(angle.max())
    ends = (low, high) if angle[0] - low <= high - angle[0] else (high, low)
    return Arc(*ends, np.deg2rad(LOWEST), case.limits.contacts_end > 0)


def _in_body_frame(points: ArrayLike, frame: tuple[Array, Array]) -> ArrayLike:
    """Points (..., 3) that are given in the frame that the file gives the body; anything else as it is."""
    if dimensions(points) < 0:
        raise fail("contact", points, "points of three numbers each, in the body frame")
    given = np.asarray(points)
    if given.dtype.kind not in "iuf" or given.shape[-1:] != (3,):
        return points
    origin, axes = frame
    return origin + given @ axes.T


def _planar(case: Scenario, model: mujoco.MjModel, body: RigidBody) -> Placement:
    """In the plane the contact is the left end of the face that is down at theta = 0, unless it is given."""
    axes, table, gap = matrix(body.axes), matrix(body.table), np.deg2rad(LOWEST)
    point, radius, most = find_planar_pivot(model, body.index, case.contact, axes, arc=_arc(case))
    face = point - radius * axes[:, 2]
    limits = (gap, most - gap)
    at = _below(model, body, point)
    return Placement(body, point[None], np.array([radius]), at, -table[:, 1], body.table, limits, face[None])


def _below(model: mujoco.MjModel, body: RigidBody, point: Array) -> Array:
    """(3,) where on the table, world axes, it is under the place that the file gives a point (3,) of the body frame."""
    data, up = initial_data(model), body.surface.axes[:, 2]
    there = data.xpos[body.index] + data.xmat[body.index].reshape(3, 3) @ point - body.origin
    return body.origin + there - (there @ up) * up
