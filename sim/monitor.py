"""The monitor: what a run's raw readings say about sticking, tracking and the contact force."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from pivoting.sim.fidelity import drift

if TYPE_CHECKING:
    from pivoting.sim.run import Run

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Measures:
    """One value for each world, (W,); slip over the whole run, everything else after the scenario's `settle_s`.

    Attributes:
        slip_max_m: greatest displacement of the material corner along the table from where it started.
        slip_floor_m: what the simulator's creep, rotation and penetration terms predict for it (`fidelity.drift`).
        angle_error_rms_deg, angle_error_max_deg: theta against the reference.
        contact_lost_s: time in which the contact sensor shows no push.
        friction_use_max: measured |f_t| / (mu f_n) with the world's mu; nan if there never was a push.
        force_mismatch_rel: RMS of measured minus predicted contact force over RMS of the predicted.
        residual_max: greatest KKT residual; inf where a step had no answer.
        unsolved_steps: steps without an answer within tolerance.
    """

    slip_max_m: Array
    slip_floor_m: Array
    angle_error_rms_deg: Array
    angle_error_max_deg: Array
    contact_lost_s: Array
    friction_use_max: Array
    force_mismatch_rel: Array
    residual_max: Array
    unsolved_steps: Array


@np.errstate(invalid="ignore", divide="ignore", over="ignore")  # a world that diverges fails, without noise
def measure(run: "Run") -> Measures:
    """Measure a run. Not-a-number anywhere in a world's readings ends up in its measures, and so in the verdict."""
    settled = run.time >= run.scenario.limits.settle_s - 1e-12
    error = np.rad2deg(run.angle_error[:, settled])
    steps = settled[:-1]
    measured, predicted = run.force_measured[:, steps, 0], run.force[:, steps, 0]
    use = run.friction_use[:, steps]
    pushed = ~np.isnan(use)
    mismatch = _rms(np.linalg.norm(measured - predicted, axis=-1)) / _rms(np.linalg.norm(predicted, axis=-1))
    return Measures(
        slip_max_m=np.abs(run.slip).max(axis=1),
        slip_floor_m=np.abs(predicted_slip(run)).max(axis=1),
        angle_error_rms_deg=_rms(error),
        angle_error_max_deg=np.abs(error).max(axis=1),
        contact_lost_s=np.count_nonzero(~pushed, axis=1) * run.dt,
        friction_use_max=np.where(pushed.any(axis=1), np.where(pushed, use, 0.0).max(axis=1), np.nan),
        force_mismatch_rel=mismatch,
        residual_max=np.where(np.isfinite(run.residual), run.residual, np.inf).max(axis=1),
        unsolved_steps=np.count_nonzero(run.status != 0, axis=1).astype(float),
    )


def predicted_slip(run: "Run") -> Array:
    """(W, N+1) the displacement [m] of the corner along the table that MuJoCo's contact model itself predicts."""
    rows = run.contact_rows
    if rows is None:
        return np.full(run.slip.shape, np.nan)
    r_t, r_n = np.moveaxis(run.lever[:, :-1], -1, 0)
    speed = drift(rows, r_t, r_n, run.omega[:, :-1], run.force[:, :, 0])
    return np.concatenate([np.zeros((run.worlds, 1)), np.cumsum(speed * run.dt, axis=1)], axis=1)


def _rms(values: Array) -> Array:
    return np.sqrt(np.mean(values**2, axis=1))
