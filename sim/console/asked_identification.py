"""What `pivoting identify` is asked for: the log of its file, what was believed, and the bounds on what is wrong."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np
from pivoting.controller.learning.motion_log import MeasurementErrors, MotionLog
from pivoting.controller.learning.unknowns import Unknowns
from pivoting.controller.uncertainty.uncertainty import Uncertainty
from pivoting.controller.validate import Array, number, positive_definite
from pivoting.sim.identification.log_table import ENDINGS, LogTable
from pivoting.sim.identification.logged_motion import SAVED, saved_log, table_log

RATE = 1.5  # of the greatest rate that is measured, if none is given
SHARE = 0.01  # of the greatest contact force, likewise: its error
MASS, COM = 0.2, 0.1  # what is not known of a saved run's object, if nothing is given: of its mass, and of its lever
BELIEVED = ("lever", "inertia", "mass", "com")  # what a table does not say, and a saved run does
OWN = ("lever", "inertia", "edge")  # what a saved run says itself


class AskedLog(NamedTuple):
    """several: whether the contact force is the sum over several contacts."""

    log: MotionLog
    unknowns: Unknowns
    several: bool


def asked_log(file: Path, world: int, given: Mapping[str, Any]) -> AskedLog:
    """The log of a file and what is known beforehand, by the options of the command.

    Raises:
        click.ClickException: an option is missing, or does not go with the file.
        ValueError: something in the file cannot be used; see `table_log` and `saved_log`.
    """
    rates, kind = given["omega_error"] is not None, file.suffix.lower()
    if kind not in (*ENDINGS, SAVED):
        raise click.BadParameter(f"FILE {str(file)!r}: must end in {', '.join(ENDINGS)} or {SAVED}")
    if kind == SAVED:
        for name in OWN:
            if given[name] is not None:
                raise click.BadParameter(f"--{name}: must be left out: a saved run says it itself")
        saved = saved_log(file, world, rates=rates)
        log, several, inertia = saved.log, saved.several, saved.inertia
        reach = COM * float(np.linalg.norm(log.lever))
        mass = given["mass"] or (saved.mass * (1.0 - MASS), saved.mass * (1.0 + MASS))
        com = np.array([[-reach, reach]]) if given["com"] is None else given["com"]
    else:
        missing = [f"--{name}" for name in BELIEVED if given[name] is None]
        if missing:
            raise click.UsageError(
                f"Missing option{'s' * (len(missing) > 1)} {', '.join(missing)}, of a table of your own."
            )
        table, edge = LogTable(file), given["edge"]
        tilted = float(np.deg2rad(given["incline"]))
        log = table_log(table, given["lever"], given["gravity"], table_tilt=tilted, edge=edge, rates=rates)
        several, inertia = edge is not None, _inertia(given["inertia"], log.space.dim)
        mass, com = given["mass"], given["com"]
    dim = log.space.dim
    prior = Uncertainty(
        mass=mass,
        com=np.repeat(com, dim, axis=0) if len(com) == 1 else com,
        inertia=given["factor"],
        mu=given["mu"],
        shove=given["shove"],
        theta=float(np.deg2rad(given["theta_error"])),
        omega=given["omega_error"] or 0.0,
        dim=dim,
    )
    return AskedLog(log, Unknowns(log.space, log.lever, inertia, prior), several)


def asked_errors(log: MotionLog, given: Mapping[str, Any]) -> MeasurementErrors:
    """The bounds on what is wrong with a log, by the options of the command."""
    forces = np.linalg.norm(log.contact_force, axis=1)
    force, rate = given["force_error"], given["rate"]
    return MeasurementErrors(
        theta=float(np.deg2rad(given["theta_error"])),
        omega=given["omega_error"] or 0.0,
        shove=given["shove"],
        rate=RATE * log.measured_rate() if rate is None else rate,
        wrench=given["wrench_error"],
        contact_force=SHARE * float(np.max(forces, initial=0.0, where=np.isfinite(forces))) if force is None else force,
        position=given["position_error"],
    )


def _inertia(given: Array, dim: int) -> Array:
    """(3, 3) of the numbers of --inertia."""
    if dim == 2:
        if len(given) != 1:
            raise click.BadParameter("--inertia: must be one number in the plane, about its normal")
        return np.diag([0.0, number("inertia", float(given[0]), above=0.0, unit="kg m^2"), 0.0])
    if len(given) not in (3, 6):
        raise click.BadParameter("--inertia: must be Ixx,Iyy,Izz or Ixx,Iyy,Izz,Ixy,Ixz,Iyz in space")
    xx, yy, zz, xy, xz, yz = (*given, 0.0, 0.0, 0.0)[:6]
    return positive_definite("inertia", np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), 3)
