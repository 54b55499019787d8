"""Attach the controller to a body of anyone's MuJoCo model; the closed loop of this package uses nothing else."""

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray
from pivoting.controller.contacts import Contact
from pivoting.controller.control_laws import Body, Law
from pivoting.controller.kernels.compiled_step import world_wrench
from pivoting.controller.motion import Motion
from pivoting.controller.rotations import quaternion_product
from pivoting.controller.solution import Solution
from pivoting.controller.solvers.solve import solve
from pivoting.controller.uncertainty.uncertainty import Uncertainty
from pivoting.controller.validate import fail, for_each
from pivoting.controller.wrench_controller import WrenchController
from pivoting.errors import PivotingError
from pivoting.models.errors import ModelError
from pivoting.models.frames import matrix
from pivoting.models.friction_coefficient import read_friction
from pivoting.models.placement.points_on_body import refuse_off_body
from pivoting.models.rigid_body import RigidBody, read_body
from pivoting.sim.joint_drag import drag_wrench

Array = NDArray[np.float64]


class ControlError(PivotingError, RuntimeError):
    """The state of the simulation cannot be controlled; it carries `time` [s] and `qpos`."""

    def __init__(self, message: str, data: mujoco.MjData):
        self.time = float(data.time)
        self.qpos = np.array(data.qpos)
        super().__init__(f"{message} at time {self.time:g} s, qpos = {self.qpos.tolist()}")


class Attached:
    """A controller bound to a body of one model. `wrench` is all that a loop needs.

    Attributes:
        model: the one it was read from.  body: what was read.
        controller: the `WrenchController` made from it.
    """

    def __init__(self, model: mujoco.MjModel, body: RigidBody, controller: WrenchController):
        self.body = body
        self.controller = controller
        self.model = model

    def state(self, data: mujoco.MjData) -> Motion:
        """Orientation and rate of the body, from `data.qpos` and `data.qvel` as they are now.

        In the plane the angle [rad] from its table and its rate [rad/s], in space the quaternion (4,) object to world
        and the angular velocity (3,) in world axes. The kinematics of `data` are recomputed: after `mj_step` they
        describe the state one step back.
        """
        if data.qpos.size != self.model.nq:
            raise fail("data", f"MjData with {data.qpos.size} positions", f"of the attached model ({self.model.nq})")
        if not (np.isfinite(data.qpos).all() and np.isfinite(data.qvel).all()):
            raise ControlError("the state is not finite", data)
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_comPos(self.model, data)
        mujoco.mj_comVel(self.model, data)
        q, omega = self._orientation(data), np.array(data.cvel[self.body.index, :3])
        if self.body.dim == 3:
            return Motion(q, omega)
        space = self.controller.space
        return Motion(float(space.angle(q)), float(omega @ space.axial(1.0)))

    def _orientation(self, data: mujoco.MjData) -> Array:
        """(4,) object axes to world, of the kinematics as they are."""
        return quaternion_product(np.array(data.xquat[self.body.index]), self.body.axes)

    def solution(self, data: mujoco.MjData, reference: ArrayLike | Motion) -> Solution:
        """The certified answer at the state of `data`: wrench in object axes, contact forces (K, d) in table axes.

        Args:
            data: of the attached model.
            reference: where the body should be now: an angle [rad] or, in space, a quaternion (4,) object to world; or
                a `Motion`, with rate and acceleration.

        Raises:
            ControlError: the state is not finite.
            SolveError: no answer within tolerance.
            ValueError: `reference` is not finite.
        """
        target = reference if isinstance(reference, Motion) else Motion(reference)
        state, turning = self.state(data), self.controller.space.lift_motion(target)[1:]
        known = drag_wrench(self.body, self.controller, self._orientation(data), *turning)[0]
        return solve(self.controller.problem(state, target, external=known))

    def wrench(
        self, data: mujoco.MjData, reference: ArrayLike | Motion, simulated: mujoco.MjModel | None = None
    ) -> Array:
        """(6,) force [N] and torque [N m] at the CoM in world axes: assign it to `data.xfrc_applied[body]`.

        The wrench acts at the point of the body that the attached model has for its CoM. MuJoCo counts the torque about
        the CoM of the model that it simulates, which is to be given if it is another.

        Args:
            data, reference: as for `solution`, and so are the errors.
            simulated: the model that is stepped, with the same joints, whose object may be another.
        """
        answer = self.solution(data, reference)
        out = np.empty(6)
        world_wrench(self.controller.belief.source.map, self._orientation(data), answer.wrench, out)
        if simulated is not None:
            away = self.body.com - simulated.body_ipos[self.body.index]
            out[3:] += np.cross(data.xmat[self.body.index].reshape(3, 3) @ away, out[:3])
        return out


def attach(
    model: mujoco.MjModel,
    *,
    body: str,
    contacts: Sequence[ArrayLike],
    radius: ArrayLike = 0.0,
    law: Law | None = None,
    mu: float | None = None,
    margin: float = 0.1,
    f_min: float = 0.0,
    Q_w: ArrayLike | None = None,
    Q_f: ArrayLike | None = None,
    support: str | None = None,
    uncertainty: Uncertainty | None = None,
) -> Attached:
    """Make a controller for a body of `model`: mass, inertia, CoM, gravity, friction and table are read from it.

    In the plane theta = 0 is where the body's first in-plane axis lies along the table, and grows counter-clockwise
    seen with the table's tangent to the right and its normal up. In space orientations are those of the body frame.

    Args:
        model: any compiled model.
        body: name of a top-level body that moves freely, or by two slides and a hinge.
        contacts: the points that stick, on the hull of the body's colliding geoms, in the body frame: [(x, y, z), ...];
            one point in the plane, where [(u, v)] along the in-plane axes will do as well [m]. Of what rolls, such as
            the end of a capsule, the centre.
        radius: of the round end that rolls, 0 of a point; one number, or one for each contact [m].
        law: default `Law.dynamic()`.  mu: friction to plan with; default what MuJoCo combines from the geoms.
        margin: share of mu kept unused; exactly on its edge nothing sticks.
        f_min: floor of the normal force [N].  Q_w, Q_f: weights, see `WrenchController`.
        support: name of the geom that the body stands on; default what is under it in the first keyframe, or at qpos0.
        uncertainty: what is not known of the body, about what is read of the model.

    Raises:
        ModelError: the model cannot be served, with the reason.
        ValueError: an argument is out of range.
    """
    if not isinstance(model, mujoco.MjModel):
        raise fail("model", model, "a mujoco.MjModel")
    found = read_body(model, body, support)
    points, radii = _contact_points(found, contacts, radius)
    refuse_off_body(model, found, contacts, radii)
    there = None if any(np.size(contact) == 2 for contact in contacts) else np.array(contacts, dtype=float)
    friction = read_friction(model, found.index, found.support, there) if mu is None else mu
    frame = None if found.dim == 2 else matrix(found.table)
    stuck = [
        Contact(at, friction, f_min, frame=frame, radius=float(rho)) for at, rho in zip(points, radii, strict=True)
    ]
    controller = WrenchController(
        Body(found.mass, found.inertia),
        stuck,
        Law.dynamic() if law is None else law,
        found.gravity,
        base=found.table,
        margin=margin,
        uncertainty=uncertainty,
        Q_w=Q_w,
        Q_f=Q_f,
    )
    return Attached(model, found, controller)


def _contact_points(found: RigidBody, contacts: Sequence[ArrayLike], radius: ArrayLike) -> tuple[list[Array], Array]:
    """Contacts from the CoM in object axes, and the radius of each."""
    if not isinstance(contacts, Sequence | np.ndarray) or len(contacts) == 0:
        raise fail("contacts", contacts, "a list of at least one point")
    points = [found.point(contact) for contact in contacts]
    radii = for_each("radius", radius, len(points))
    if found.dim == 2 and len(points) != 1:
        raise ModelError(f"contacts = {[p.tolist() for p in points]}: must be one point for a planar body")
    return points, radii
