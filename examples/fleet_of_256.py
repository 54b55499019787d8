"""Run 256 worlds that start and measure a little differently, find the worst, and run that one again alone."""

import numpy as np
from pivoting import simulate

KEYS = {"seconds": 0.5, "spread": 0.5, "noise": 0.05}  # degrees off at the start, and in each measurement
LIMITS = {"angle_rms_deg": 0.3, "angle_max_deg": 1.0, "force_mismatch_rel": 1.0, "settle_s": 0.2}

fleet = simulate("pivot-2d", worlds=256, seed=7, limits=LIMITS, f_min="1w", **KEYS)
print(f"{fleet.verdict}: {256 - len(fleet.summary()['failed_worlds'])} of 256 worlds are within every limit")
for name in ("slip_max_m", "angle_error_rms_deg", "friction_use_max"):
    values = getattr(fleet.measures, name)
    print(f"{name:20} median {np.median(values):.3g}, worst {values.max():.3g} in world {values.argmax()}")

worst = fleet.worst_world
alone = simulate("pivot-2d", seed=7, first_world=worst, limits=LIMITS, f_min="1w", **KEYS)
same = np.array_equal(alone.wrench[0], fleet.wrench[worst])
print(f"world {worst} comes closest to a limit; run again alone it is the same, bit for bit: {same}")
