"""Use the controller in a MuJoCo loop of your own: read the model once, ask for a wrench at every step."""

import mujoco
import numpy as np
from pivoting import attach
from pivoting.controller import MinimumJerk
from pivoting.models import scene_path

model = mujoco.MjModel.from_xml_path(str(scene_path("pivot-2d")))  # or any file of yours
data = mujoco.MjData(model)
mujoco.mj_resetDataKeyframe(model, data, 0)  # on its corner, at 10 deg

block = attach(model, body="block", contacts=[(-0.5, -0.5)], margin=1 / 6)
arc = MinimumJerk(tuple(np.deg2rad([10.0, 45.0])), seconds=1.0)

worst = 0.0
while data.time < 1.2:
    goal = arc(data.time)
    data.xfrc_applied[block.body.index] = block.wrench(data, goal)
    mujoco.mj_step(model, data)
    worst = max(worst, abs(block.state(data).orientation - arc(data.time).orientation))

print(f"at {np.rad2deg(block.state(data).orientation):.2f} deg; never off by more than {np.rad2deg(worst):.3f} deg")
