"""The log that `pivoting identify` learns from, out of a user's own table or out of a run of this package."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.learning.motion_log import OPEN, OTHER, SLIDES, STICKS, MotionLog, motion_log
from pivoting.controller.plane_and_space import space, tilt
from pivoting.controller.rotations import rotated
from pivoting.controller.validate import Array, InputError, fail
from pivoting.sim.fleet import Fleet
from pivoting.sim.identification.log_columns import ANGLE, DEGREES, PLANAR, SPATIAL, TIME
from pivoting.sim.identification.log_table import LogTable
from pivoting.sim.pipeline.stages import ANGULAR_VELOCITY, ORIENTATION
from pivoting.sim.run import Run
from pivoting.sim.saved_run import ARRAYS, SCENARIO, load

SAVED = ".nc"
ROUNDED = 1e-3  # what digits may have been left out of a quaternion


class BelievedLog(NamedTuple):
    """A log, and what the controller believed when it was made.

    Attributes:
        mass: [kg].  inertia: (3, 3) about the centre of mass, object axes [kg m^2].
        several: whether the contact force is the sum over several contacts.
    """

    log: MotionLog
    mass: float
    inertia: Array
    several: bool


def table_log(
    table: LogTable,
    lever: Array,
    gravity: float,
    *,
    table_tilt: float = 0.0,
    edge: Array | None = None,
    rates: bool = False,
) -> MotionLog:
    """The log of a user's own table: in the plane if it has a planar wrench.

    Args:
        lever: (d,) from the contact to the believed centre of mass, object axes [m].
        gravity: [m/s^2], along -z of the world.
        table_tilt: by which the table rises to the right, in the plane [rad].
        edge: (3,) direction, world axes, of an edge that is held at both ends; in space.
        rates: whether measured angular velocities are used.

    Raises:
        ValueError: a column is missing, or has a value that cannot be; it is named.
    """
    wrench = table.need(PLANAR["wrench"], SPATIAL["wrench"])
    planar = wrench is PLANAR["wrench"]
    if len(lever) != (2 if planar else 3):
        raise fail("lever", lever, "two numbers, along u and v, in the plane, and three in space")
    if edge is not None and planar:
        raise fail("edge", edge, "left out in the plane")
    if edge is not None and np.linalg.norm(edge) == 0.0:
        raise fail("edge", edge, "a direction, which is not 0")
    columns = PLANAR if planar else SPATIAL
    orientation = table.need(ANGLE, DEGREES) if planar else table.need(SPATIAL["orientation"])
    found = {}
    for name, gaps in (("angular_velocity", False), ("contact_force", True), ("position", False)):
        if table.has(columns[name]) and (rates or name != "angular_velocity"):
            last = table.rows - 1 if name == "contact_force" else table.rows
            found[name] = table.values(columns[name], rows=last, gaps=gaps)
    table.need(TIME)
    seen = table.values(orientation)
    if not planar:
        seen = _normalised(table, seen)
    elif "contact_force" in found:
        found["contact_force"] = found["contact_force"] @ _turn(table_tilt).T  # along the table: into world axes
    if rates and "angular_velocity" not in found:
        table.need(columns["angular_velocity"])
    return motion_log(
        table.values(TIME),
        seen,
        table.values(wrench, rows=table.rows - 1),
        lever,
        [0.0] * (len(lever) - 1) + [-gravity],
        here=space(2, tilt(table_tilt)) if planar else None,
        axes=None if edge is None else edge[None] / np.linalg.norm(edge),
        contact=table.contact(),
        **found,
    )


def saved_log(path: Path, world: int, *, rates: bool = False) -> BelievedLog:
    """The log of one world of a saved run: of its .nc file, beside which its scenario lies.

    Raises:
        ValueError: it is no such file, keeps no arrays, or is of an object that rolls or has more than two contacts.
    """
    name = SCENARIO if path.name == ARRAYS else f"{path.name.removesuffix(SAVED)}.{SCENARIO}"
    with path.open("rb"):
        pass
    run = load(path.with_name(name))
    if isinstance(run, Fleet):
        raise InputError(f"{path}: keeps only the measures of its worlds; must be a run that keeps all")
    return run_log(run, world, rates=rates)


def run_log(run: Run, world: int = 0, *, rates: bool = False) -> BelievedLog:
    """The log of one world of a run, as its controller could have kept it: what was measured, and what acted.

    Raises:
        ValueError: of an object that rolls, has more than two contacts or damped joints, or there is no such world.
    """
    if not 0 <= world < run.worlds:
        raise fail("world", world, f"0 to {run.worlds - 1}, of the run's worlds")
    belief = run.controller_of(world).belief
    held, unit = belief.contacts, run.unit
    if held.offsets.any() or len(held.points) > 2 or run.truth.drag is not None:
        allowed = "without a ball that rolls, without damped joints, and with one contact or an edge"
        raise fail("run", run.scenario.label, allowed)
    here = space(run.truth.dim, run.attached.body.table)
    used = [0, 2] if here.dim == 2 else [0, 1, 2]
    states = run.log.states[world] if run.log.measured is None else run.log.measured[world]
    last = len(states) - 1
    if run.stance is not None:
        last = min([last, *np.flatnonzero(run.stance[world] != 0)[:1].tolist()])
    wrench = run.wrench[world] if run.log.acting is None else run.log.acting[world]
    powers = np.where(np.any(here.wrench_map[:, :3] != 0.0, axis=1), 1, 2)
    forces = run.log.contacts.force[world][:last, run.stances[0].held].sum(axis=1)
    rate = states[: last + 1, ANGULAR_VELOCITY]
    seen = states[: last + 1, ORIENTATION]
    log = motion_log(
        run.time[: last + 1],
        here.angle(seen) if here.dim == 2 else seen,
        np.nan_to_num(wrench[:last]) * float(unit) ** powers,
        -unit * held.pivot[used],
        unit * belief.object.gravity,
        here=here,
        axes=_edge(held.points, seen[0]),
        angular_velocity=None if not rates else rate @ here.axial(1.0) if here.dim == 2 else rate,
        contact_force=unit * forces,
        contact=_contact(run, world)[:last],
    )
    return BelievedLog(log, belief.object.mass, unit**2 * belief.object.inertia, len(held.points) > 1)


def _edge(points: Array, orientation: Array) -> Array | None:
    """(1, 3) the direction of the edge between two contacts, world axes; None: there is one contact."""
    if len(points) == 1:
        return None
    along = rotated(orientation, points[1] - points[0])
    return along[None] / np.linalg.norm(along)


def _contact(run: Run, world: int) -> NDArray[np.int8]:
    """(N,) codes of what the contact does in each step."""
    contacts, held = run.log.contacts, run.stances[0].held
    slides = run.log.held.slides[world][:, held].any(axis=1)
    does = np.where(slides, SLIDES, STICKS)
    does = np.where(contacts.found[world] == 0.0, OPEN, does)
    return np.where(contacts.stray[world] > 0.0, OTHER, does).astype(np.int8)


def _normalised(table: LogTable, quaternions: Array) -> Array:
    """Unit quaternions of those of a table, which are rounded to some digits."""
    length = np.linalg.norm(quaternions, axis=1)
    bad = np.flatnonzero(np.abs(length - 1.0) > ROUNDED)
    if bad.size:
        allowed = f"within {ROUNDED:g} of 1"
        raise InputError(
            f"{table.path}: row {bad[0] + 1} of qw, qx, qy, qz has length {length[bad[0]]:.6g}; must be {allowed}"
        )
    return quaternions / length[:, None]


def _turn(angle: float) -> Array:
    """(2, 2) from axes along the table and its normal to the world's x and z."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])
