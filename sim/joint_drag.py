"""The wrench of a body's own joint damping and dry friction while it turns about its contacts as it is to turn."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pivoting.controller.controller import WrenchController
from pivoting.controller.so3 import rotated
from pivoting.controller.space import CONJUGATE
from pivoting.models.frames import matrix
from pivoting.models.reading import RigidBody

Array = NDArray[np.float64]
STILL = 1e-9  # of the lever or a radian, in a second: a joint that moves more slowly is at rest


def drag_wrench(
    body: RigidBody, controller: WrenchController, orientation: ArrayLike, omega: ArrayLike, alpha: ArrayLike
) -> Array:
    """(N, nw) the drag on the body, object axes [N, N m], of N motions.

    A free joint's dampers act on the velocity of the body's origin along the world's axes, and on its angular velocity
    along its own; a planar body's on the velocities of its slides, which are those of its hinge along their axes, and
    on that of the hinge. The object turns about what touches. Dry friction at rest may be anything up to its limit, and
    is left out. Where MuJoCo integrates damping implicitly, it acts on the velocity that the step leads to.

    Args:
        orientation: (N, 4).  omega, alpha: (N, 3) angular velocities and accelerations, world axes.
    """
    q, w, bend = (np.atleast_2d(np.asarray(values, dtype=float)) for values in (orientation, omega, alpha))
    if body.drag is None:
        return np.zeros((1, len(controller.Q_w)))
    belief, drag = controller.belief, body.drag
    axes = matrix(body.axes)
    anchor = axes.T @ (drag.anchor - body.com)  # object axes
    turned = rotated(q, anchor - belief.pivot)
    ahead = np.cross(bend, turned - belief.offset) + np.cross(w, np.cross(w, turned))  # of what rolls, too
    velocity = np.cross(w, turned - belief.offset) + drag.ahead * ahead
    w = w + drag.ahead * bend
    size = float(np.linalg.norm(anchor - belief.pivot) + np.linalg.norm(belief.offset))

    def resist(speed: Array, dofs: slice, still: float) -> Array:
        moving = np.where(np.abs(speed) > still, np.sign(speed), 0.0)
        return -drag.damping[dofs] * speed - drag.friction[dofs] * moving

    if len(drag.slides):
        force = resist(velocity @ drag.slides.T, slice(0, 2), STILL * size) @ drag.slides
        normal = np.cross(*drag.slides)
        turning = resist((w @ normal)[:, None], slice(2, 3), STILL) * normal
        moment = rotated(q * CONJUGATE, turning)
    else:
        force = resist(velocity, slice(0, 3), STILL * size)
        moment = resist(rotated(q * CONJUGATE, w), slice(3, 6), STILL)
    local = rotated(q * CONJUGATE, force)
    return np.concatenate([local, moment + np.cross(anchor, local)], axis=1) @ belief.wrench_map.T
