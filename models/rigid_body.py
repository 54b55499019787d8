"""Reading a compiled model: mass, inertia, centre of mass and plane of a body, and what it stands on; placing it."""

from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import ArrayLike
from pivoting.models.errors import ModelError
from pivoting.models.external_forces import JointDrag, read_drag, refuse_unknown_forces
from pivoting.models.frames import Array, matrix, quaternion
from pivoting.models.names import body_id, body_name
from pivoting.models.support_surfaces import Surface, find_support, support_surface

PLANAR_JOINTS = "two perpendicular slides and then a hinge about their normal"
JOINTS = f"a free joint, or {PLANAR_JOINTS}"
FILE_FRAME = "pivoting/file"  # a site at the frame that the file gives the body


@dataclass(frozen=True, eq=False)
class RigidBody:
    """A body that moves in a plane or in space, as its model describes it.

    Object axes sit at the CoM. In the plane they are (u, o, v): u the in-plane body axis that lies along the table at
    theta = 0, o the plane's normal; in space they are the body frame's.

    Attributes:
        name: of the body.  index: its id.
        dim: 2 (two slides and a hinge) or 3 (a free joint).
        mass: [kg].  inertia: about the CoM [kg m^2]; in the plane a number, in space (3, 3) in object axes.
        com: (3,) CoM in the body frame [m].
        axes: (4,) quaternion, object axes to body frame.  normal: (3,) the second of them, in the plane its normal.
        surface: what it stands on.
        table: (4,) quaternion of the table's frame (t, o, n) in the world; t is to the right, n the support's normal.
        gravity: (3,) world axes [m/s^2].
        drag: damping and friction of its joints, if there is any.
    """

    name: str
    index: int
    dim: int
    mass: float
    inertia: float | Array
    com: Array
    axes: Array
    normal: Array
    surface: Surface
    table: Array
    gravity: Array
    drag: JointDrag | None

    @property
    def support(self) -> int:
        """Id of the geom it stands on."""
        return self.surface.geom

    @property
    def origin(self) -> Array:
        """(3,) a point of the support's surface, world axes [m]."""
        return self.surface.origin

    def point(self, contact: ArrayLike) -> Array:
        """(d,) from the CoM in object axes, in the plane along (u, v), of a point given in the body frame.

        Args:
            contact: (3,) in the body frame; in the plane also (2,) along (u, v) from the body's origin [m].
        """
        given = np.asarray(contact)
        allowed = "2 in-plane or 3 body-frame coordinates [m]" if self.dim == 2 else "3 body-frame coordinates [m]"
        if given.dtype.kind not in "iuf":
            raise ModelError(f"contact = {contact!r}: must be {allowed}")
        R = matrix(self.axes)
        used = [0, 2] if self.dim == 2 else [0, 1, 2]
        if given.shape == (3,) and np.isfinite(given).all():
            return (R.T @ (given - self.com))[used]
        if self.dim == 2 and given.shape == (2,) and np.isfinite(given).all():
            return given - (R.T @ self.com)[used]
        raise ModelError(f"contact = {given.tolist()}: must be {allowed}, finite")


def initial_data(model: mujoco.MjModel) -> mujoco.MjData:
    """The state that the file begins with: its first keyframe, or else qpos0; kinematics are computed."""
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_kinematics(model, data)
    return data


def read_body(model: mujoco.MjModel, name: str, support: str | None = None) -> RigidBody:
    """What the controller needs to know about a body of `model`.

    Args:
        model: any compiled model.
        name: a body at the top level, moving freely or by two slides and a hinge, and nothing hanging on it; '#id' of
            one without a name.
        support: name (or '#id') of the plane, box or upright cylinder it stands on; by default what is under it in the
            first keyframe, or at qpos0.

    Raises:
        ModelError: there is no such body, or it cannot be served.
    """
    index = body_id(model, name)
    dim = degrees_of_freedom(model, index)
    if (model.body_parentid[1:] == index).any():
        raise ModelError(f"body = {name!r}: other bodies hang on it; their mass would not be counted")
    _refuse_flags(model)
    data = initial_data(model)
    joints = range(model.body_jntadr[index], model.body_jntadr[index] + model.body_jntnum[index])
    normal = None
    if dim == 2:
        first, second, normal = (data.xaxis[j] for j in joints)
        if abs(first @ second) > 1e-6 or max(abs(first @ normal), abs(second @ normal)) > 1e-6:
            raise ModelError(f"body = {name!r}: its joint axes are not perpendicular; needs {PLANAR_JOINTS}")
    surface = support_surface(model, data, find_support(model, data, index, support))
    refuse_unknown_forces(model, index, surface.geom)
    weightless = bool(model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    gravity = np.zeros(3) if weightless else np.array(model.opt.gravity)
    table = surface.axes if normal is None else _table_axes(surface.axes[:, 2], normal, gravity)
    axes = np.eye(3) if normal is None else _object_axes(data.xmat[index].reshape(3, 3).T @ table[:, 1])
    return RigidBody(
        name=body_name(model, index),
        index=index,
        dim=dim,
        mass=float(model.body_mass[index]),
        inertia=_inertia(model, index, dim, axes[:, 1]),
        com=np.array(model.body_ipos[index]),
        axes=quaternion(axes),
        normal=axes[:, 1],
        surface=surface,
        table=quaternion(table),
        gravity=gravity,
        drag=read_drag(model, data, index),
    )


def with_inertia_of(body: RigidBody, model: mujoco.MjModel) -> RigidBody:
    """The body with the mass, the inertia and the CoM that it has in another model of the same scene."""
    return replace(
        body,
        mass=float(model.body_mass[body.index]),
        inertia=_inertia(model, body.index, body.dim, body.normal),
        com=np.array(model.body_ipos[body.index]),
    )


def _inertia(model: mujoco.MjModel, index: int, dim: int, normal: Array) -> float | Array:
    """About the CoM; in the plane about its normal (3,), body frame, in space (3, 3)."""
    inertial = matrix(model.body_iquat[index])
    tensor = inertial @ np.diag(model.body_inertia[index]) @ inertial.T
    return float(normal @ tensor @ normal) if dim == 2 else tensor


def in_plane_axes(body: RigidBody) -> Array:
    """(3, 3) object axes as columns, body frame; 0 in place of the one across the plane that the body moves in."""
    axes = matrix(body.axes)
    if body.dim == 2:
        axes[:, 1] = 0.0
    return axes


def file_frame(model: mujoco.MjModel, body: int) -> tuple[Array, Array]:
    """Origin (3,) and axes (3, 3) of the frame that the MJCF file gives a body of a `Scene`, in the body frame.

    They differ where the compiler moves the frame to the body's inertia: `align` of a free joint.
    """
    for site in np.flatnonzero(model.site_bodyid == body):
        if model.site(int(site)).name == FILE_FRAME:
            return np.array(model.site_pos[site]), matrix(model.site_quat[site])
    return np.zeros(3), np.eye(3)


def degrees_of_freedom(model: mujoco.MjModel, index: int) -> int:
    """2 of a body that moves in a plane, 3 of one that moves freely.

    Raises:
        ModelError: it moves otherwise, or hangs on another.
    """
    name = body_name(model, index)
    joints = range(model.body_jntadr[index], model.body_jntadr[index] + model.body_jntnum[index])
    kinds = [int(model.jnt_type[j]) for j in joints]
    slide, hinge, free = (int(getattr(mujoco.mjtJoint, f"mjJNT_{kind}")) for kind in ("SLIDE", "HINGE", "FREE"))
    if not kinds:
        raise ModelError(f"body = {name!r}: it has no joint, so no free motion; needs {JOINTS}")
    if model.body_parentid[index] != 0:
        raise ModelError(f"body = {name!r}: it hangs on another body; must be a child of the world")
    if kinds not in ([slide, slide, hinge], [free]):
        words = ", ".join(mujoco.mjtJoint(kind).name.removeprefix("mjJNT_").lower() for kind in kinds)
        raise ModelError(f"body = {name!r}: its joints are {words}; needs {JOINTS}")
    return 3 if kinds == [free] else 2


def _refuse_flags(model: mujoco.MjModel) -> None:
    """A model in which nothing can touch cannot be served."""
    for flag in ("CONTACT", "CONSTRAINT"):
        if model.opt.disableflags & int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}")):
            raise ModelError(
                f'option: <flag {flag.lower()}="disable"/>: nothing sticks without contact; must be enabled'
            )


def place(
    model: mujoco.MjModel, data: mujoco.MjData, body: RigidBody, orientation: ArrayLike, point: ArrayLike, at: ArrayLike
) -> None:
    """Set qpos so that the body is at an orientation with its `point` (3,) (body frame) `at` (3,) in the world.

    Args:
        orientation: (4,) quaternion, object axes to world; in the plane a turn in the plane.

    The joints' order (slides, then hinge) makes this exact. Velocities are left alone; kinematics are computed.
    """
    start = int(model.body_jntadr[body.index])
    body_to_world = matrix(np.asarray(orientation)) @ matrix(body.axes).T
    first = int(model.jnt_qposadr[start])
    if body.dim == 3:
        data.qpos[first + 3 : first + 7] = quaternion(body_to_world)
        data.qpos[first : first + 3] = np.asarray(at, dtype=float) - body_to_world @ np.asarray(point, dtype=float)
        mujoco.mj_kinematics(model, data)
        return
    slots = model.jnt_qposadr[start : start + 3]
    mujoco.mj_kinematics(model, data)
    turn = body_to_world @ data.xmat[body.index].reshape(3, 3).T
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    along = data.xaxis[start + 2]
    data.qpos[slots[2]] += np.arctan2(axis @ along, np.trace(turn) - 1.0)
    mujoco.mj_kinematics(model, data)
    corner = data.xpos[body.index] + data.xmat[body.index].reshape(3, 3) @ np.asarray(point, dtype=float)
    for slot, slide in zip(slots[:2], (start, start + 1), strict=True):
        data.qpos[slot] += data.xaxis[slide] @ (np.asarray(at, dtype=float) - corner)
    mujoco.mj_kinematics(model, data)


def turn(model: mujoco.MjModel, data: mujoco.MjData, body: RigidBody, omega: ArrayLike, point: ArrayLike) -> None:
    """Set qvel so that the body turns at `omega` (3,) [rad/s, world axes] about its `point` (3,) (body frame).

    Positions are as in `data`; other bodies' velocities are left alone.
    """
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    at = data.xpos[body.index] + data.xmat[body.index].reshape(3, 3) @ np.asarray(point, dtype=float)
    translation, rotation = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, translation, rotation, at, body.index)
    first = int(model.body_dofadr[body.index])
    dofs = slice(first, first + int(model.body_dofnum[body.index]))
    wanted = np.concatenate([np.zeros(3), np.asarray(omega, dtype=float)])
    data.qvel[dofs] = np.linalg.lstsq(np.vstack([translation, rotation])[:, dofs], wanted, rcond=None)[0]


def _table_axes(n: Array, plane_normal: Array, gravity: Array) -> Array:
    """(3, 3) columns (t, o, n) in the world: n the support's normal, t to the right, o = n x t.

    Right is seen with gravity down (or n up, without), towards the positive side of the axis that it is closest to.
    """
    if abs(n @ plane_normal) > 1e-6:
        raise ModelError("support: its normal is not in the plane of the body's motion")
    fall = gravity - (gravity @ plane_normal) * plane_normal
    up = n if np.linalg.norm(fall) < 1e-9 else -fall / np.linalg.norm(fall)
    right = np.cross(plane_normal, up)
    right = right * np.sign(right[np.argmax(np.abs(right))])
    o = np.cross(up, right)
    return np.column_stack([np.cross(o, n), o, n])


def _object_axes(o: Array) -> Array:
    """(3, 3) columns (u, o, v) in the body frame: u the first body axis that lies in the plane."""
    for axis in np.eye(3):
        if abs(axis @ o) < 1e-6:
            return np.column_stack([axis, o, np.cross(axis, o)])
    raise ModelError("body: none of its axes lies in the plane of its motion, so theta = 0 is not defined")


def laid_over(model: mujoco.MjModel, body: RigidBody, orientation: Array) -> float:
    """[deg] between the table's normal seen from a body as the file has it and as it is at an orientation (4,).

    Up to a tenth of a degree, which a file may have without meaning it, it is 0.

    Args:
        orientation: object axes to world.
    """
    up, turned = matrix(body.table)[:, 2], matrix(orientation) @ matrix(body.axes).T
    cosine = float((up @ initial_data(model).xmat[body.index].reshape(3, 3)) @ (up @ turned))
    angle = float(np.rad2deg(np.arccos(np.clip(cosine, -1.0, 1.0))))
    return angle if angle > 0.1 else 0.0
