"""The wrench of a body's own joint damping and dry friction while it turns about its contacts as it is to turn."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pivoting.controller.rotations import CONJUGATE, rotated
from pivoting.controller.wrench_controller import WrenchController
from pivoting.models.frames import matrix
from pivoting.models.rigid_body import RigidBody

Array = NDArray[np.float64]


def drag_wrench(
    body: RigidBody, controller: WrenchController, orientation: ArrayLike, omega: ArrayLike, alpha: ArrayLike
) -> Array:
    """(N, nw) the drag on the body, object axes [N, N m], of N motions.

    A free joint's dampers act on the velocity of the body's origin along the world's axes, and on its angular velocity
    along its own; a planar body's on the velocities of its slides, which are those of its hinge along their axes, and
    on that of the hinge. The object turns about what touches. Dry friction is as soft as MuJoCo makes it, see
    `JointDrag`. Where MuJoCo integrates damping implicitly, it acts on the velocity that the step leads to.

    Args:
        orientation: (N, 4).  omega, alpha: (N, 3) angular velocities and accelerations, world axes.
    """
    q, w, bend = (np.atleast_2d(np.asarray(values, dtype=float)) for values in (orientation, omega, alpha))
    if body.drag is None:
        return np.zeros((1, len(controller.Q_w)))
    belief, drag = controller.belief, body.drag
    axes = matrix(body.axes)
    anchor = axes.T @ (drag.anchor - body.com)  # object axes
    turned = rotated(q, anchor - belief.contacts.pivot)
    ahead = np.cross(bend, turned - belief.contacts.offset) + np.cross(w, np.cross(w, turned))  # of what rolls, too
    velocity = np.cross(w, turned - belief.contacts.offset)

    def resist(speed: Array, change: Array, dofs: slice) -> Array:
        dry = (drag.rate[dofs] * speed + change) / drag.give[dofs]
        damped = drag.damping[dofs] * (speed + drag.ahead * change)
        return -damped - np.clip(dry, -drag.friction[dofs], drag.friction[dofs])

    if len(drag.slides):
        force = resist(velocity @ drag.slides.T, ahead @ drag.slides.T, slice(0, 2)) @ drag.slides
        normal = np.cross(*drag.slides)
        turning = resist((w @ normal)[:, None], (bend @ normal)[:, None], slice(2, 3)) * normal
        moment = rotated(q * CONJUGATE, turning)
    else:
        force = resist(velocity, ahead, slice(0, 3))
        moment = resist(rotated(q * CONJUGATE, w), rotated(q * CONJUGATE, bend), slice(3, 6))
    local = rotated(q * CONJUGATE, force)
    return np.concatenate([local, moment + np.cross(anchor, local)], axis=1) @ belief.source.map.T
