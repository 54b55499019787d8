"""A camera that looks in a given direction and is as close as it can be with a set of points in view."""

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FOV = np.deg2rad(30.0)  # across the shorter side of the picture
ROOM = 0.94  # share of the picture that the points may fill


class Camera(NamedTuple):
    """eye: (3,) its position [m].  forward, up: (3,) unit vectors.  high: tangent of half the vertical view angle."""

    eye: Array
    forward: Array
    up: Array
    high: float

    def depth(self, points: Array) -> Array:
        """(...,) how far points (..., 3) are in front of it [m]."""
        return (points - self.eye) @ self.forward

    def aim(self, scene: mujoco.MjvScene, near: float, far: float) -> None:
        """Make it the camera of a scene, with clipping planes `near` and `far` [m] in front of it."""
        for camera in scene.camera:  # left and right eye
            camera.pos[:], camera.forward[:], camera.up[:] = self.eye, self.forward, self.up
            camera.orthographic, camera.frustum_center, camera.frustum_width = 0, 0.0, 0.0
            camera.frustum_near, camera.frustum_far = near, far
            camera.frustum_top = self.high * near
            camera.frustum_bottom = -camera.frustum_top


def fitted(points: Array, towards: Array, up: Array, aspect: float) -> Camera:
    """The closest camera that has all points (P, 3) in view.

    A point p is inside the right edge if (p - eye) . right <= slope (p - eye) . forward, and likewise for the other
    edges. Each pair of opposite edges bounds how far forward the eye can be, and says where it is sideways then.

    Args:
        points: world axes [m].
        towards: (3,) from the points to the eye.  up: (3,) the upward direction.
        aspect: width of the picture divided by its height.
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
