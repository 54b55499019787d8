"""The monitor: what a run's raw readings say about sticking, tracking and the contact force."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.solution import FAILED, INACCURATE, REPEATED, SAFE
from pivoting.models.contact_softness import ContactRows
from pivoting.sim.judging.expected_force import expected_force
from pivoting.sim.judging.implicit_step import unseen
from pivoting.sim.judging.predicted_slip import RowEffects, drift, why_unknown

if TYPE_CHECKING:
    from pivoting.sim.slip import ContactMotion

Array = NDArray[np.float64]
LIFTED = 1e-4  # of the lever: a contact that has risen by more has left the table


@dataclass(frozen=True, eq=False)
class Measures:
    """One value for each world, (W,); angles, lost contact, friction and forces after `settle_s`, all else over all.

    In the unit that the name ends with, whatever the model's unit of length is.

    Attributes:
        slip_max_m: greatest displacement of a contact along the table since it is to hold, less what it rolled.
        slip_floor_m: what the simulator's creep, rotation and penetration terms predict for it, see
            `predicted_slip.drift`; nan where they cannot, see `slip_floor_unknown`.
        angle_error_rms_deg, angle_error_max_deg: orientation against the reference.
        contact_lost_s: time in which nothing pushes on the contacts, or one of them has left the table.
        undeclared_contact_s: time in which the object touches something anywhere else.
        penetration_rel: greatest depth beyond what the soft contact explains under the predicted load, in levers.
        contacts_missing: how many fewer contacts there are at the end than the scenario asks for.
        bounce_m: height that the landed face regains after the first moment with all these contacts.
        friction_use_max: measured |f_t| / (mu f_n) with the world's mu; nan if there never was a push.
        force_mismatch_rel: RMS of measured minus predicted contact force over RMS of the predicted; of a set of objects
            that predicted of each world's own, see `expected_force`.
        residual_max: greatest KKT residual of an answer; inf where a step that was to have one had none.
        unsolved_steps: steps without an answer within tolerance; within bounds is one. The last answer again, and the
            action of a safe state, are none, but are counted for themselves.
        repeated_steps: steps in which the last answer was used again.
        safe_s: time in a safe state, which lasts until the end.
    """

    slip_max_m: Array
    slip_floor_m: Array
    angle_error_rms_deg: Array
    angle_error_max_deg: Array
    contact_lost_s: Array
    undeclared_contact_s: Array
    penetration_rel: Array
    contacts_missing: Array
    bounce_m: Array
    friction_use_max: Array
    force_mismatch_rel: Array
    residual_max: Array
    unsolved_steps: Array
    repeated_steps: Array
    safe_s: Array


@np.errstate(invalid="ignore", divide="ignore", over="ignore")  # a world that diverges fails, without noise
def measure(run: "ContactMotion") -> Measures:
    """Measure a run. Not-a-number anywhere in a world's readings ends up in its measures, and so in the verdict."""
    settled = run.time >= run.scenario.limits.settle_s - 1e-12
    error = np.rad2deg(run.angle_error[:, settled])
    steps = settled[:-1]
    use = run.friction_use[:, steps]
    pushed = ~np.isnan(use)
    began = np.maximum(run.when_held(run.corner)[..., 2], 0.0)  # one with a margin is held above the table
    risen = (run.corner[..., 2] - began > LIFTED * run.size)[:, 1:] & run.standing
    lost = ~pushed.any(axis=2) | risen[:, steps].any(axis=2)
    ever = pushed.any(axis=(1, 2))
    return Measures(
        slip_max_m=run.unit * np.linalg.norm(run.slip, axis=-1).max(axis=(1, 2)),
        slip_floor_m=run.unit * np.linalg.norm(predicted_slip(run), axis=-1).max(axis=(1, 2)),
        angle_error_rms_deg=_rms(error),
        angle_error_max_deg=np.abs(error).max(axis=1),
        contact_lost_s=np.count_nonzero(lost, axis=1) * run.dt,
        undeclared_contact_s=np.count_nonzero(run.log.contacts.strays > 0.0, axis=1) * run.dt,
        penetration_rel=_penetration(run) / run.size,
        contacts_missing=np.maximum(run.scenario.limits.contacts_end - run.contacts_found[:, -1], 0.0),
        bounce_m=run.unit * _bounce(run),
        friction_use_max=np.where(ever, np.where(pushed, use, 0.0).max(axis=(1, 2)), np.nan),
        force_mismatch_rel=_mismatch(run, steps),
        residual_max=_residual(run).max(axis=1),
        unsolved_steps=np.isin(run.status, (INACCURATE, FAILED)).sum(axis=1).astype(float),
        repeated_steps=(run.status == REPEATED).sum(axis=1).astype(float),
        safe_s=(run.status == SAFE).sum(axis=1) * run.dt,
    )


def _residual(run: "ContactMotion") -> Array:
    """(W, N) KKT residuals, 0 in steps that have no answer of their own."""
    own = np.where(np.isfinite(run.residual), run.residual, np.inf)
    return np.where(np.isin(run.status, (REPEATED, SAFE)), 0.0, own)


def _mismatch(run: "ContactMotion", steps: NDArray[np.bool_]) -> Array:
    """(W,) RMS of measured less predicted contact force over that of the predicted, over these steps (N,).

    But for those in which a body has landed on contacts that no stance holds: it shares the load with them.
    """
    force = expected_force(run) if run.scenario.uncertain and run.certified else run.force
    off = np.linalg.norm(run.force_measured - force, axis=-1)
    size = np.linalg.norm(force, axis=-1)
    if not run.scenario.limits.contacts_end or run.stance is not None:
        return _rms(off[:, steps]) / _rms(size[:, steps])
    each = [steps & ~landed for landed in run.landed]
    return np.array([_rms(off[i : i + 1, own])[0] / _rms(size[i : i + 1, own])[0] for i, own in enumerate(each)])


def _penetration(run: "ContactMotion") -> Array:
    """(W,) greatest depth [m] beyond that at which the soft contact balances the load."""
    predicted = run.certified and not run.scenario.uncertain  # of a set each member has another load
    load = (run.force if predicted else run.force_measured)[..., -1].sum(axis=-1)
    return np.maximum(run.log.contacts.depth - run.world.depths(np.nan_to_num(load)), 0.0).max(axis=1)


def _bounce(run: "ContactMotion") -> Array:
    """(W,) greatest clearance [m] of the landed face; 0 where nothing is to land, or has landed."""
    if not run.scenario.limits.contacts_end:
        return np.zeros(run.worlds)
    after = np.logical_or.accumulate(run.landed, axis=1)
    return np.where(after, run.clearance[:, 1:], 0.0).max(axis=1)


def predicted_slip(run: "ContactMotion") -> Array:
    """(W, N+1, K, 2) the displacement [m] of each point along the table that MuJoCo's contact model itself predicts.

    Not-a-number from where it cannot.
    """
    rows, point = [each.rows for each in run.world.truths], run.stepped[..., None, :]
    given = {
        "of": _held(run),
        "turning": run.turning - point,
        "touching": run.lever - point,
        "velocity": run.stepped_velocity,
        "omega": run.angular_velocity @ run.table_axes,
        "unseen": unseen(run),
    }
    if len(rows) == 1:
        return run.since_held(_drift(rows[0], given, run))
    path = np.empty(run.slip.shape)
    for first, worlds in _alike(rows):
        path[worlds] = _drift(first, {name: _of_worlds(each, worlds) for name, each in given.items()}, run)
    return run.since_held(path)


def _drift(rows: ContactRows | None, given: Mapping[str, Any], run: "ContactMotion") -> Array:
    """Of worlds with the same law of the contact rows."""
    if rows is None:
        return np.full((len(given["turning"]), *run.slip.shape[1:]), np.nan)
    return drift(rows, **given, settle=_settle(run))


def _alike(rows: Sequence[ContactRows | None]) -> Iterator[tuple[ContactRows | None, NDArray[np.intp]]]:
    """The worlds whose drift follows from the same numbers of their rows, and the rows of the first of them."""
    laws = [None if each is None else (each.b, each.h, each.unknown) for each in rows]
    for law in dict.fromkeys(laws):
        worlds = np.flatnonzero([each == law for each in laws])
        yield rows[worlds[0]], worlds


def _of_worlds(values: Any, worlds: NDArray[np.intp]) -> Any:
    """Those of some worlds, of an array or of all arrays of a named tuple."""
    if values is None:
        return None
    return type(values)(*(each[worlds] for each in values)) if isinstance(values, tuple) else values[worlds]


def _held(run: "ContactMotion") -> RowEffects:
    """What the rows do at the contacts; of one that is not to hold yet, nothing has to be known."""
    held = run.log.held
    give = np.where(run.standing[..., None], held.give, held.give[..., :1, :])  # the first is held in every stance
    return held._replace(give=give, slides=held.slides & run.standing)


def slip_floor_unknown(run: "ContactMotion", first: int = 0, of: int | None = None) -> str:
    """Why that cannot be predicted, in the first world where it cannot; "" where it can in all.

    Args:
        first: index of the run's first world, where it is part of a fleet.  of: how many that has.
    """
    found = why_unknown(run.world.contact_rows, _held(run), run.time, _settle(run))
    several = (run.worlds if of is None else of) > 1
    told = [f"{why}{f' in world {first + world}' * several}" for world, why in enumerate(found) if why]
    return told[0] if told else ""


def _settle(run: "ContactMotion") -> int:
    """Steps that the start may take."""
    return int(np.count_nonzero(run.time[:-1] < run.scenario.limits.settle_s - 1e-12))


def _rms(values: Array) -> Array:
    """Over steps, and over contacts where there are any; summed in one order, however many other worlds there are."""
    return np.sqrt(np.mean(np.ascontiguousarray(values**2).reshape(len(values), -1), axis=1))
