"""Put a control of your own on the test bench: here one that keeps the contact force constant, at 4 N straight up."""

import numpy as np
from pivoting import simulate
from pivoting.sim.pipeline.own_control import Moment

MASS, INERTIA, GRAVITY, SIDE = 1.0, 1 / 6, 10.0, 1.0  # of the block in the shipped scenes
f_x, f_z = 0.0, 4.0  # the contact force that this control counts on [N]


def constant_contact_force(now: Moment) -> np.ndarray:
    """(W, 3) wrenches in object axes: computed torque about the corner, and whatever force is then missing."""
    (theta, rate, _), (goal, goal_rate, feedforward) = in_plane(now.states), in_plane(now.desired)
    alpha = feedforward + 1600.0 * (goal - theta) + 80.0 * (goal_rate - rate)
    c, s = np.cos(theta), np.sin(theta)
    x, z = 0.5 * SIDE * (c - s), 0.5 * SIDE * (s + c)  # from the corner to the centre of mass, world axes
    F_x = MASS * (-alpha * z - rate**2 * x) - f_x
    F_z = MASS * (alpha * x - rate**2 * z + GRAVITY) - f_z
    moment = INERTIA * alpha + x * f_z - z * f_x
    return np.stack([c * F_x + s * F_z, -s * F_x + c * F_z, moment], axis=1)


def in_plane(motion) -> tuple[np.ndarray, np.ndarray, np.ndarray | float]:
    """Angle, rate and acceleration (of a reference): the plane's normal is the world's -y."""
    acceleration = getattr(motion, "angular_acceleration", np.zeros((1, 3)))
    q = motion.orientation
    return -2.0 * np.arctan2(q[:, 2], q[:, 0]), -motion.angular_velocity[:, 1], -acceleration[:, 1]


mine, smallest = simulate("pivot-2d", control=constant_contact_force), simulate("pivot-2d")
for name, run in (("constant contact force", mine), ("smallest wrench", smallest)):
    effort = float(np.mean(np.sum(run.wrench[0] ** 2, axis=-1)))
    print(f"{name:23} {run.verdict}, slip {1e3 * run.measures.slip_max_m[0]:.4f} mm, mean |w|^2 = {effort:.2f}")
