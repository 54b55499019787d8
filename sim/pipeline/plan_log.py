"""What is kept of the plans of a run: their certificates, and what a user has to know of."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class PlanLog(NamedTuple):
    """Of P plans in W worlds; entries that were never reached are nan.

    step: (P,) at which they were made.  outcome: (W, P) indices of `receding_horizon.OUTCOMES`.
    residual: (W, P) of the last program solved.  change: (W, P) by its last pass, in weights, levers and radians.
    motion_defect, stick_defect: (W, P) of the equations themselves.  ms: (W, P) in all.
    """

    step: NDArray[np.int64]
    outcome: NDArray[np.int8]
    residual: Array
    change: Array
    motion_defect: Array
    stick_defect: Array
    ms: Array


def plan_figures(log: PlanLog) -> dict[str, float]:
    """What a run's summary says of its plans: how many, how many failed, the worst of their certificates, time."""
    made = log.outcome == 0
    return {
        "plans": float(log.outcome.size),
        "plans_failed": float(np.count_nonzero(log.outcome != 0)),
        "plan_residual_max": float(np.max(np.nan_to_num(log.residual, nan=np.inf)[made], initial=0.0)),
        "plan_change_max": float(np.max(log.change[made], initial=0.0)),
        "plan_motion_defect_max": float(np.max(log.motion_defect[made], initial=0.0)),
        "plan_ms_median": float(np.nanmedian(log.ms)),
        "plan_ms_p99": float(np.nanquantile(log.ms, 0.99)),
    }


class Event(NamedTuple):
    """Something that a user has to know of: in which world, when [s], what.

    state: of a world that goes over to a safe state from then on, the name of that, else "".
    """

    world: int
    time: float
    what: str
    state: str = ""
