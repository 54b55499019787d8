"""The columns of a user's own log: their names, which end in the unit, and what they are."""

from typing import NamedTuple


class Column(NamedTuple):
    """A quantity in a log, in one or more columns.

    Attributes:
        names: of its columns; (..., ...) of components.  what: it is.  needed: whether a log has to have it.
        scale: of the numbers, to SI units.
    """

    names: tuple[str, ...]
    what: str
    needed: bool = False
    scale: float = 1.0


DEGREE = 0.017453292519943295
TIME = Column(("time_s",), "time of the row", True)
CONTACT = Column(("contact",), "what the contact does from this row to the next: sticks (the default), slides or open")
ANGLE = Column(("theta_rad",), "measured angle from the table, counter-clockwise; or theta_deg")
DEGREES = Column(("theta_deg",), ANGLE.what, scale=DEGREE)
PLANAR = {
    "wrench": Column(
        ("wrench_Fu_N", "wrench_Fv_N", "wrench_M_N_m"),
        "known wrench from this row to the next, at the believed centre of mass, object axes u and v",
        True,
    ),
    "angular_velocity": Column(("omega_rad_s",), "measured rate of turn"),
    "contact_force": Column(("force_t_N", "force_n_N"), "measured contact force, along the table and its normal"),
    "position": Column(("x_m", "z_m"), "measured position of the believed centre of mass, world axes"),
}
SPATIAL = {
    "orientation": Column(
        ("qw", "qx", "qy", "qz"), "measured orientation, object axes to world, as a quaternion", True
    ),
    "wrench": Column(
        tuple(f"wrench_F{axis}_N" for axis in "xyz") + tuple(f"wrench_M{axis}_N_m" for axis in "xyz"),
        "known wrench from this row to the next, at the believed centre of mass, object axes",
        True,
    ),
    "angular_velocity": Column(tuple(f"w{axis}_rad_s" for axis in "xyz"), "measured angular velocity, world axes"),
    "contact_force": Column(
        ("force_t_N", "force_o_N", "force_n_N"), "measured sum of the contact forces, along the world's x, y and z"
    ),
    "position": Column(("x_m", "y_m", "z_m"), "measured position of the believed centre of mass, world axes"),
}


def column_help() -> list[tuple[str, list[tuple[str, str]]]]:
    """The columns by the kind of log, each with what it is, as `--help` shows them."""
    planar = [TIME, ANGLE._replace(needed=True), *PLANAR.values(), CONTACT]
    spatial = [TIME, *SPATIAL.values(), CONTACT]
    return [
        (
            f"Columns of FILE, {kind} (of its last row, which ends the log, only what is measured counts)",
            _lines(columns),
        )
        for kind, columns in (("in the plane", planar), ("in space", spatial))
    ]


def _lines(columns: list[Column]) -> list[tuple[str, str]]:
    return [(", ".join(each.names), each.what + (" [needed]" if each.needed else "")) for each in columns]
