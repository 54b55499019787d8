"""1,024 worlds in closed loop against an open-loop `Batch.step` of the same motion, alternating in one run.

The open loop plays a run's own wrenches back from its own start, which ends in the same states to the last bit. The
share is that of the open loop's world-steps which the closed loop makes in the same time: the median over pairs.
"""

from functools import partial
from typing import Any

import numpy as np
from bench_loop import replay
from harness import main
from pivoting.sim import simulate

WORLDS = 1024
SET = {"mass": "0.8:1.2", "inertia": "0.8:1.2", "com": "-0.05:0.05", "mu": "0.25:0.8"}
TRUTH = {"world.mass": 1.0, "world.inertia": 1.0, "world.com": 0.0, "world.mu": 0.5}  # the same model in all worlds
SHORT = {"seconds": 0.2, "hold": 0.05}
FLEETS: dict[str, tuple[str, dict[str, Any], float]] = {  # scenario, keys, and the share that is asked for
    "plane, one contact": ("pivot-2d", SHORT, 0.8),
    "space, one contact": ("spin-3d", SHORT, 0.8),
    "plane, one contact, guaranteed": ("pivot-2d", {**SHORT, **SET, **TRUTH}, 0.5),
    "space, four contacts": ("settle-3d", {"theta": 0.5, "seconds": 0.05, "hold": 0.25}, 0.2),
}


def measure(quick: bool) -> dict[str, float]:
    """The figures; see the head of this file."""
    figures = {}
    for name, (scenario, keys, _) in FLEETS.items():
        again = partial(simulate, scenario, WORLDS, **keys)
        again()  # compiled and warm before anything is timed
        pairs = []
        for _ in range(3 if quick else 9):
            run = again()
            pairs.append((run.wall_s / (run.time.size - 1), replay(run)))
        closed, opened = np.array(pairs).T
        figures[f"{name}: share of the open loop's world-steps"] = float(np.median(opened / closed))
        figures[f"{name}: closed, us a step and world"] = 1e6 / WORLDS * float(np.median(closed))
        figures[f"{name}: open, us a step and world"] = 1e6 / WORLDS * float(np.median(opened))
    return figures


if __name__ == "__main__":
    asked = {f"{name}: share of the open loop's world-steps": share for name, (_, _, share) in FLEETS.items()}
    main(__doc__ or "", measure, {}, floors=asked)
