"""What an integrator adds to a step beside the contact rows: forces that it takes with the velocities at its end.

MuJoCo's rows hold for the acceleration that the forces at the start of a step make. Its Euler integrator then takes the
joints' damping at the end of the step, and the implicit ones the gyroscopic forces, too, linear in the change of the
velocity. The difference between start and end is a wrench that moves a contact and that its rows do not see.
"""

from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray
from pivoting.controller.rotations import CONJUGATE, rotated
from pivoting.models.external_forces import JointDrag

if TYPE_CHECKING:
    from pivoting.sim.slip import ContactMotion

Array = NDArray[np.float64]
IMPLICIT, FAST = (int(getattr(mujoco.mjtIntegrator, f"mjINT_{name}")) for name in ("IMPLICIT", "IMPLICITFAST"))


def unseen(run: "ContactMotion") -> Array | None:
    """(W, N, K, 2) acceleration along the table (t, o) of what touches, beside its rows [m/s^2]; None for none."""
    body, opt = run.truth, run.model.opt
    gyroscopic = int(opt.integrator) == IMPLICIT or (int(opt.integrator) == FAST and body.dim == 3)
    euler = int(opt.integrator) not in (IMPLICIT, FAST)
    damped = body.drag is not None and not (euler and opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP))
    if not (gyroscopic or damped):
        return None
    to_world, to_object = run.quaternion, run.quaternion * CONJUGATE
    truths = run.world.truths
    offset, mass = np.array([each.offset for each in truths])[:, None], np.array([each.mass for each in truths])
    # from the point that is stepped; object axes
    com = rotated(to_object, -run.stepped @ run.table_axes.T)[:, :-1] - offset
    omega = rotated(to_object, run.angular_velocity)
    dv = np.diff(run.stepped_velocity @ run.table_axes.T, axis=1)
    w, dw = omega[:, :-1], np.diff(omega, axis=1)
    inertia = np.array([each.inertia for each in truths])
    force, moment = np.zeros_like(dw), np.zeros_like(dw)
    if gyroscopic:
        force -= mass[:, None, None] * (np.cross(dw, np.cross(w, com)) + np.cross(w, np.cross(dw, com)))
        moment -= np.cross(dw, w @ inertia) + np.cross(w, dw @ inertia)
    if damped:
        assert body.drag is not None
        pull, twist = _damping(body.drag, dv, rotated(to_world[:, :-1], dw) if body.dim == 2 else dw)
        pull = rotated(to_object[:, :-1], pull)
        force += pull
        moment += (rotated(to_object[:, :-1], twist) if body.dim == 2 else twist) - np.cross(com, pull)
    linear = rotated(to_world[:, :-1], force / mass[:, None, None]) @ run.table_axes
    angular = rotated(to_world[:, :-1], moment @ np.linalg.pinv(inertia)) @ run.table_axes
    away = rotated(to_world[:, :-1], offset) @ run.table_axes  # of a world whose CoM is elsewhere than it is believed
    return (linear[..., None, :] + np.cross(angular[..., None, :], run.lever[:, :-1] + away[..., None, :]))[..., :2]


def _damping(drag: JointDrag, dv: Array, dw: Array) -> tuple[Array, Array]:
    """Force and moment of the dampers as the velocity of the stepped point and the angular velocity change.

    dv and the force along the world's axes; dw and the moment along a free body's own axes, else along the world's.
    """
    if not len(drag.slides):
        return -drag.damping[:3] * dv, -drag.damping[3:] * dw
    normal = np.cross(*drag.slides)
    return -drag.damping[:2] * (dv @ drag.slides.T) @ drag.slides, -drag.damping[2] * (dw @ normal)[..., None] * normal
