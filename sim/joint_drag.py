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


def drag_wrench(body: RigidBody, controller: WrenchController, orientation: ArrayLike, omega: ArrayLike) -> Array:
    """(N, nw) the drag on the body, object axes [N, N m], at N orientations (N, 4) and angular velocities (N, 3).

    A free joint's dampers act on the velocity of the body's origin along the world's axes, and on its angular velocity
    along its own; a planar body's on the velocities of its slides, which are those of its hinge along their axes, and
    on that of the hinge. The object turns about what touches. Dry friction at rest may be anything up to its limit, and
    is left out.
    """
    q, w = np.atleast_2d(np.asarray(orientation, dtype=float)), np.atleast_2d(np.asarray(omega, dtype=float))
    if body.drag is None:
        return np.zeros((1, len(controller.Q_w)))
    belief, drag = controller.belief, body.drag
    axes = matrix(body.axes)
    anchor = axes.T @ (drag.anchor - body.com)  # object axes
    velocity = np.cross(w, rotated(q, anchor - belief.pivot) - belief.offset)
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
