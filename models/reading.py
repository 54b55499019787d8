"""Reading a compiled model: mass, inertia, centre of mass and plane of a body, its support and its friction."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
PLANAR_JOINTS = "two perpendicular slides and then a hinge about their normal"
JOINTS = f"a free joint, or {PLANAR_JOINTS}"


class ModelError(ValueError):
    """A model, or a body in it, that cannot be served; the message says why and what would be."""


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
        axes: (4,) quaternion, object axes to body frame.
        support: id of the geom it stands on.
        table: (4,) quaternion of the table's frame (t, o, n) in the world; t is to the right, n the support's normal.
        origin: (3,) a point of the support's surface in the world [m].
        gravity: (3,) world axes [m/s^2].
    """

    name: str
    index: int
    dim: int
    mass: float
    inertia: float | Array
    com: Array
    axes: Array
    support: int
    table: Array
    origin: Array
    gravity: Array

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


def matrix(quaternion: Array) -> Array:
    """(3, 3) rotation matrix of a quaternion (4,)."""
    out = np.empty(9)
    mujoco.mju_quat2Mat(out, np.asarray(quaternion, dtype=float))
    return out.reshape(3, 3)


def quaternion(rotation: Array) -> Array:
    """(4,) quaternion of a rotation matrix (3, 3)."""
    out = np.empty(4)
    mujoco.mju_mat2Quat(out, np.ascontiguousarray(rotation).ravel())
    return out


def read_body(model: mujoco.MjModel, name: str, support: str | None = None) -> RigidBody:
    """What the controller needs to know about a body of `model`.

    Args:
        model: any compiled model.
        name: a body at the top level, moving freely or by two slides and a hinge, and nothing hanging on it.
        support: name of the plane or box geom it stands on; by default the only plane of the world body.

    Raises:
        ModelError: there is no such body, or it cannot be served.
    """
    bodies = [model.body(i).name for i in range(1, model.nbody)]
    if name not in bodies:
        raise ModelError(f"body = {name!r}: must be one of {', '.join(bodies) or '(the model has none)'}")
    index = model.body(name).id
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
    if (model.body_parentid[1:] == index).any():
        raise ModelError(f"body = {name!r}: other bodies hang on it; their mass would not be counted")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    dim = 3 if kinds == [free] else 2
    normal = None
    if dim == 2:
        first, second, normal = (data.xaxis[j] for j in joints)
        if abs(first @ second) > 1e-6 or max(abs(first @ normal), abs(second @ normal)) > 1e-6:
            raise ModelError(f"body = {name!r}: its joint axes are not perpendicular; needs {PLANAR_JOINTS}")
    _refuse_other_forces(model, name, index, joints)
    ground = read_support(model, support)
    if model.body_weldid[model.geom_bodyid[ground]] != 0:
        raise ModelError(f"support = {model.geom(ground).name!r}: it can move; must be fixed to the world")
    weightless = bool(model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    gravity = np.zeros(3) if weightless else np.array(model.opt.gravity)
    surface = data.geom_xmat[ground].reshape(3, 3)
    height = model.geom_size[ground, 2] if model.geom_type[ground] == int(mujoco.mjtGeom.mjGEOM_BOX) else 0.0
    table = surface if normal is None else _table_axes(surface[:, 2], normal, gravity)
    axes = np.eye(3) if normal is None else _object_axes(data.xmat[index].reshape(3, 3).T @ table[:, 1])
    inertial = matrix(model.body_iquat[index])
    tensor = inertial @ np.diag(model.body_inertia[index]) @ inertial.T
    return RigidBody(
        name=name,
        index=index,
        dim=dim,
        mass=float(model.body_mass[index]),
        inertia=float(axes[:, 1] @ tensor @ axes[:, 1]) if dim == 2 else tensor,
        com=np.array(model.body_ipos[index]),
        axes=quaternion(axes),
        support=ground,
        table=quaternion(table),
        origin=data.geom_xpos[ground] + height * surface[:, 2],
        gravity=gravity,
    )


def _refuse_other_forces(model: mujoco.MjModel, name: str, index: int, joints: range) -> None:
    """The controller knows of gravity, contact and its own wrench; a model that adds other forces is refused."""
    if model.body_gravcomp[index] != 0.0:
        raise ModelError(f"body = {name!r}: it has gravcomp = {model.body_gravcomp[index]:g}; must have none")
    for joint in joints:
        dofs = slice(model.jnt_dofadr[joint], model.body_dofadr[index] + model.body_dofnum[index])
        found = {
            "stiffness": np.abs(np.ravel(model.jnt_stiffness[joint])).max(),
            "limited": float(model.jnt_limited[joint]),
            "damping": np.abs(np.ravel(model.dof_damping[dofs])).max(),
            "frictionloss": np.abs(np.ravel(model.dof_frictionloss[dofs])).max(),
            "armature": np.abs(np.ravel(model.dof_armature[dofs])).max(),
        }
        for attribute, value in found.items():
            if value != 0.0:
                raise ModelError(f"body = {name!r}: a joint of it has {attribute} = {value:g}; must have none")


def read_support(model: mujoco.MjModel, support: str | None = None) -> int:
    """Id of the geom that the body stands on: `support`, or else the only plane of the model."""
    if support is not None:
        if support not in [model.geom(i).name for i in range(model.ngeom)]:
            raise ModelError(f"support = {support!r}: the model has no geom of that name")
        found = int(model.geom(support).id)
        if int(model.geom_type[found]) not in (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_BOX)):
            raise ModelError(f"support = {support!r}: must be a plane or a box")
        return found
    planes = np.flatnonzero(model.geom_type == int(mujoco.mjtGeom.mjGEOM_PLANE))
    if len(planes) != 1:
        raise ModelError(f"support = None: the model has {len(planes)} planes; name the geom that the body stands on")
    return int(planes[0])


def read_friction(model: mujoco.MjModel, body: int, support: int) -> float:
    """Sliding friction between the body's geoms and `support`, as MuJoCo combines it: the larger, or by priority.

    Raises:
        ModelError: the body's geoms differ in it; give mu.
    """
    geoms = range(model.body_geomadr[body], model.body_geomadr[body] + model.body_geomnum[body])
    ends = zip(model.pair_geom1, model.pair_geom2, strict=True)
    pairs = {frozenset((int(a), int(b))): i for i, (a, b) in enumerate(ends)}
    other = int(model.geom_bodyid[support])
    excluded = {(body << 16) + other, (other << 16) + body} & {int(pair) for pair in model.exclude_signature}
    found = set()
    for geom in geoms:
        pair = pairs.get(frozenset((geom, support)))
        if pair is not None:
            if model.pair_dim[pair] < 3:
                raise ModelError("mu = None: a contact pair without friction (condim 1)")
            found.add(float(model.pair_friction[pair, 0]))
            continue
        meet = (model.geom_contype[geom] & model.geom_conaffinity[support]) or (
            model.geom_contype[support] & model.geom_conaffinity[geom]
        )
        if excluded or not meet:
            continue
        if max(model.geom_condim[geom], model.geom_condim[support]) < 3:
            raise ModelError("mu = None: contact without friction (condim 1)")
        own, table = model.geom_friction[geom, 0], model.geom_friction[support, 0]
        order = int(model.geom_priority[geom]) - int(model.geom_priority[support])
        found.add(float(max(own, table) if order == 0 else own if order > 0 else table))
    if not found:
        raise ModelError("support: it and the body never touch (contype, conaffinity or exclude)")
    if len(found) != 1:
        raise ModelError(f"mu = None: the body's geoms give {sorted(found)}; give mu")
    return found.pop()


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
