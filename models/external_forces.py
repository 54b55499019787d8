"""Forces on a body that the controller does not know of, which are refused; and those of its joints, which it knows."""

from collections.abc import Iterator
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray
from pivoting.models.errors import ModelError
from pivoting.models.names import body_name, label

Array = NDArray[np.float64]
OBJ = mujoco.mjtObj


class JointDrag(NamedTuple):
    """Viscous damping and dry friction of a body's own joints, in the order of its degrees of freedom.

    Attributes:
        damping: (n,) [N s/m] of translations, [N m s/rad] of rotations.
        friction: (n,) greatest dry friction [N, N m].
        rate, give: (n,) b [1/s] and R [1/kg, 1/(kg m^2)] of its rows: at a velocity v and an acceleration a it is
            -(b v + a) / R, up to the greatest.
        anchor: (3,) the point of the body whose velocity the translations are, body frame [m].
        slides: (2, 3) axes of the two slides of a planar body, world axes; (0, 3) for a free joint.
        ahead: of the time to which the velocity belongs that MuJoCo damps: a time step where it integrates damping
            implicitly, else 0 [s].
    """

    damping: Array
    friction: Array
    rate: Array
    give: Array
    anchor: Array
    slides: Array
    ahead: float


def refuse_unknown_forces(model: mujoco.MjModel, body: int, support: int) -> None:
    """The controller knows of gravity, the contact, its own wrench, and damping and friction of the body's joints.

    Raises:
        ModelError: something else acts on the body; it is named.
    """
    name = body_name(model, body)
    what = "; ".join(unknown_forces(model, body, support))
    if what:
        raise ModelError(f"body = {name!r}: {what}; the controller does not know of it: must be taken out of the model")


def unknown_forces(model: mujoco.MjModel, body: int, support: int) -> Iterator[str]:
    """In words, what acts on the body that the controller does not know of."""
    yield from _of_the_surroundings(model, body, support)
    first = int(model.body_jntadr[body])
    joints = set(range(first, first + int(model.body_jntnum[body])))
    yield from _of_its_joints(model, joints)
    tendons = _tendons(model, body, joints)
    if not _off(model, "EQUALITY"):
        yield from _constraints(model, body, joints, tendons)
    if not _off(model, "ACTUATION"):
        yield from _actuators(model, body, support, joints, tendons)
    for tendon in sorted(tendons):
        attributes = ("stiffness", "stiffnesspoly", "damping", "dampingpoly", "frictionloss", "limited", "armature")
        pulls = [key for key in attributes if np.any(getattr(model, f"tendon_{key}")[tendon])]
        if pulls:
            yield f"tendon {_called(model, OBJ.mjOBJ_TENDON, tendon)} pulls on it ({', '.join(pulls)})"


def _of_the_surroundings(model: mujoco.MjModel, body: int, support: int) -> Iterator[str]:
    opt = model.opt
    if opt.density > 0.0 or opt.viscosity > 0.0:
        wind = f", wind = {np.array(opt.wind).tolist()}" if np.any(opt.wind) else ""
        out = '<option density="0" viscosity="0"/> takes it away'
        yield f"a fluid acts on it (density = {opt.density:g}, viscosity = {opt.viscosity:g}{wind}; {out})"
    if model.body_gravcomp[body] != 0.0:
        yield f"it has gravcomp = {model.body_gravcomp[body]:g}"
    own = range(int(model.body_geomadr[body]), int(model.body_geomadr[body] + model.body_geomnum[body]))
    for geom in (support, *own):
        if np.any(model.geom_surfacevel[geom]):
            yield f"the surface of geom {label(model, geom)} moves (surfacevel)"
        if np.any(model.geom_adhesion[geom]):
            yield f"geom {label(model, geom)} is sticky (adhesion)"
    for pair in range(model.npair):
        ends = int(model.pair_geom1[pair]), int(model.pair_geom2[pair])
        if np.any(model.pair_adhesion[pair]) and set(ends) & set(own):
            yield f"the contact pair of {label(model, ends[0])} and {label(model, ends[1])} is sticky (adhesion)"
    if model.body_plugin[body] >= 0:
        yield "a plugin acts on it"
    if model.nflex and body in model.flex_vertbodyid:
        yield "a flexible body hangs on it"


def _of_its_joints(model: mujoco.MjModel, joints: set[int]) -> Iterator[str]:
    for joint in sorted(joints):
        dof = int(model.jnt_dofadr[joint])
        dofs = slice(dof, dof + (6 if int(model.jnt_type[joint]) == int(mujoco.mjtJoint.mjJNT_FREE) else 1))
        found = {
            "stiffness": np.concatenate(
                [np.ravel(model.jnt_stiffness[joint]), np.ravel(model.jnt_stiffnesspoly[joint])]
            ),
            "limited": np.ravel(model.jnt_limited[joint]),
            "armature": model.dof_armature[dofs],
            "dampingpoly": np.ravel(model.dof_dampingpoly[dofs]),
        }
        for attribute, values in found.items():
            if np.any(values):
                value = float(np.abs(np.asarray(values, dtype=float)).max())
                yield f"its joint {_called(model, OBJ.mjOBJ_JOINT, joint)} has {attribute} = {value:g}"


def _constraints(model: mujoco.MjModel, body: int, joints: set[int], tendons: set[int]) -> Iterator[str]:
    kinds = {
        int(OBJ.mjOBJ_BODY): {body},
        int(OBJ.mjOBJ_SITE): set(np.flatnonzero(model.site_bodyid == body).tolist()),
        int(OBJ.mjOBJ_JOINT): joints,
        int(OBJ.mjOBJ_TENDON): tendons,
        int(OBJ.mjOBJ_GEOM): set(np.flatnonzero(model.geom_bodyid == body).tolist()),
    }
    for eq in range(model.neq):
        kind = mujoco.mjtEq(int(model.eq_type[eq])).name.removeprefix("mjEQ_").lower()
        objects = {int(model.eq_obj1id[eq]), int(model.eq_obj2id[eq])}
        of = {"joint": int(OBJ.mjOBJ_JOINT), "tendon": int(OBJ.mjOBJ_TENDON)}.get(kind, int(model.eq_objtype[eq]))
        if model.eq_active0[eq] and objects & kinds.get(of, set()):
            yield f"the equality constraint {_called(model, OBJ.mjOBJ_EQUALITY, eq)} ({kind}) holds it"


def _actuators(model: mujoco.MjModel, body: int, support: int, joints: set[int], tendons: set[int]) -> Iterator[str]:
    kinds = mujoco.mjtTrn
    sites = set(np.flatnonzero(model.site_bodyid == body).tolist())
    what = {
        int(kinds.mjTRN_JOINT): joints,
        int(kinds.mjTRN_JOINTINPARENT): joints,
        int(kinds.mjTRN_TENDON): tendons,
        int(kinds.mjTRN_SITE): sites,
        int(kinds.mjTRN_SLIDERCRANK): sites,
        int(kinds.mjTRN_BODY): {body, int(model.geom_bodyid[support])},  # adhesion, of either
    }
    for actuator in range(len(model.actuator_trntype)):
        ends = {int(end) for end in np.ravel(model.actuator_trnid[actuator])}
        if ends & what.get(int(model.actuator_trntype[actuator]), set()):
            yield f"the actuator {_called(model, OBJ.mjOBJ_ACTUATOR, actuator)} drives it"


def _tendons(model: mujoco.MjModel, body: int, joints: set[int]) -> set[int]:
    """Those that run through a site or around a geom of the body, or over one of its joints."""
    wraps, out = mujoco.mjtWrap, set()
    for tendon in range(model.ntendon):
        start = int(model.tendon_adr[tendon])
        for wrap in range(start, start + int(model.tendon_num[tendon])):
            kind, which = int(model.wrap_type[wrap]), int(model.wrap_objid[wrap])
            on = {
                int(wraps.mjWRAP_JOINT): which in joints,
                int(wraps.mjWRAP_SITE): kind == int(wraps.mjWRAP_SITE) and int(model.site_bodyid[which]) == body,
            }
            around = kind in (int(wraps.mjWRAP_SPHERE), int(wraps.mjWRAP_CYLINDER))
            if on.get(kind, around and int(model.geom_bodyid[which]) == body):
                out.add(tendon)
    return out


def _off(model: mujoco.MjModel, flag: str) -> bool:
    return bool(model.opt.disableflags & int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{flag}")))


def _called(model: mujoco.MjModel, kind: mujoco.mjtObj, index: int) -> str:
    return repr(mujoco.mj_id2name(model, int(kind), index) or f"#{index}")


def read_drag(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> JointDrag | None:
    """Damping and friction of a body's joints; None where there is neither, or the model has them switched off."""
    dof, count = int(model.body_dofadr[body]), int(model.body_dofnum[body])
    damping = np.array(model.dof_damping[dof : dof + count]) * (not _off(model, "DAMPER"))
    friction = np.array(model.dof_frictionloss[dof : dof + count]) * (not _off(model, "FRICTIONLOSS"))
    if not (damping.any() or friction.any()):
        return None
    joint, kinds = int(model.body_jntadr[body]), mujoco.mjtIntegrator
    rows = slice(dof, dof + count)
    rate, give = _friction_rows(model, rows)
    explicit = {int(kinds.mjINT_RK4): True, int(kinds.mjINT_EULER): _off(model, "EULERDAMP")}
    ahead = 0.0 if explicit.get(int(model.opt.integrator), False) else float(model.opt.timestep)
    if count == 6:
        return JointDrag(damping, friction, rate, give, np.zeros(3), np.zeros((0, 3)), ahead)
    slides = np.array(data.xaxis[joint : joint + 2])
    return JointDrag(damping, friction, rate, give, np.array(model.jnt_pos[joint + 2]), slides, ahead)


def _friction_rows(model: mujoco.MjModel, dofs: slice) -> tuple[Array, Array]:
    """b [1/s] and R of MuJoCo's rows of dry friction, which are at no distance: without stiffness, impedance dmin."""
    (timeconst, dampratio), (dmin, dmax) = model.dof_solref[dofs].T, model.dof_solimp[dofs, :2].T
    safe = timeconst if _off(model, "REFSAFE") else np.maximum(timeconst, 2.0 * model.opt.timestep)
    rate = np.where(timeconst > 0.0, 2.0 / (dmax * np.where(timeconst > 0.0, safe, 1.0)), -dampratio / dmax)
    return rate, (1.0 - dmin) / dmin * np.array(model.dof_invweight0[dofs])
