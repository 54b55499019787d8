"""Pivot with a weak actuator: a receding horizon plans with the force that there is, and never asks for more."""

import numpy as np
from pivoting import simulate

for bound in ("0.9w", "0.5w", "0.3w"):  # in weights of the object; 1 w is 10 N here
    run = simulate("mpc-2d", force_max=bound)
    force = np.linalg.norm(run.wrench[0, :, :2], axis=1).max()
    error = run.measures.angle_error_max_deg[0]
    print(f"|F| <= {bound}: {run.verdict}, {force:.2f} N at most, off the reference by up to {error:.2f} deg")
