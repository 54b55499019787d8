"""A camera that has all of some points in view, from a given direction, as near as it can be."""

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FOV = np.deg2rad(30.0)  # across the shorter side of the picture
ROOM = 0.94  # share of the picture that the points may fill


class Camera(NamedTuple):
    """eye: (3,) where it is [m].  forward, up: (3,) unit vectors.  high: tangent of half its vertical angle."""

    eye: Array
    forward: Array
    up: Array
    high: float

    def depth(self, points: Array) -> Array:
        """(...,) how far points (..., 3) are in front of it [m]."""
        return (points - self.eye) @ self.forward

    def aim(self, scene: mujoco.MjvScene, near: float, far: float) -> None:
        """Look at a scene with it, which is seen from `near` to `far` [m] in front of it."""
        for camera in scene.camera:  # left and right eye
            camera.pos[:], camera.forward[:], camera.up[:] = self.eye, self.forward, self.up
            camera.orthographic, camera.frustum_center, camera.frustum_width = 0, 0.0, 0.0
            camera.frustum_near, camera.frustum_far = near, far
            camera.frustum_top = self.high * near
            camera.frustum_bottom = -camera.frustum_top


def fitted(points: Array, towards: Array, up: Array, aspect: float) -> Camera:
    """The nearest camera that has all points (P, 3) in view.

    A point p is left of the right edge if (p - eye) . right <= wide (p - eye) . forward, and so on; of each pair of
    edges that gives how far forward the eye may be, and there where it is across.

    Args:
        points: world axes [m].
        towards: (3,) from what is seen to the eye.  up: (3,) which way is up.
        aspect: width of the picture by its height.
    """
    forward = -towards / np.linalg.norm(towards)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    across = np.cross(right, forward)
    high = float(np.tan(0.5 * FOV)) / min(aspect, 1.0)
    along, reach, middle = points @ forward, [], []
    for axis, slope in ((right, ROOM * high * aspect), (across, ROOM * high)):
        most, least = (points @ axis - slope * along).max(), (points @ axis + slope * along).min()
        reach.append((least - most) / (2.0 * slope))
        middle.append(0.5 * (least + most))
    eye = min(reach) * forward + middle[0] * right + middle[1] * across
    return Camera(eye, forward, across, high)
