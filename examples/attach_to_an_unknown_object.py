"""A MuJoCo loop of your own with an object that is not the one the controller knows: only intervals are known of it."""

import mujoco
import numpy as np
from pivoting import attach
from pivoting.controller import MinimumJerk, Uncertainty
from pivoting.models import scene_path

CORNER = np.array([-0.5, 0.0, -0.5])
KNOWN = Uncertainty(mass=(0.8, 1.2), com=0.05, inertia=(0.8, 1.2), dim=2)  # about what the model says: kg, m, factors
HIDDEN = {"size": [0.01, 0.0, 0.0], "mass": 0.2, "contype": 0, "conaffinity": 0}

spec = mujoco.MjSpec.from_file(str(scene_path("pivot-2d")))  # or any file of yours
for geom in spec.geoms:
    geom.friction[0] = 0.25
model = spec.compile()  # what is believed
spec.body("block").add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, pos=[0.3, 0.0, -0.3], **HIDDEN)
true = spec.compile()  # what is there: a weight is hidden in the block, 20 % of its mass, 5 cm off both ways
block = model.body("block").id
arc = MinimumJerk(tuple(np.deg2rad([10.0, 45.0])), seconds=1.0)


def slip(known: Uncertainty | None) -> float:
    """How far the corner moves along the table while the block is turned [m]."""
    data = mujoco.MjData(true)
    mujoco.mj_resetDataKeyframe(true, data, 0)  # on its corner, at 10 deg
    control = attach(model, body="block", contacts=[CORNER], uncertainty=known)
    mujoco.mj_forward(true, data)
    places = [(data.xpos[block] + data.xmat[block].reshape(3, 3) @ CORNER)[0]]
    while data.time < 1.2:
        data.xfrc_applied[block] = control.wrench(data, arc(data.time), simulated=true)
        mujoco.mj_step(true, data)
        places.append((data.xpos[block] + data.xmat[block].reshape(3, 3) @ CORNER)[0])
    return float(np.ptp(places))


for words, known in (("as if it were known", None), ("for all of the set", KNOWN)):
    print(f"{words}: the corner moves by {1e3 * slip(known):.3f} mm")
