"""What was measured while an object turned about a contact that sticks, and how wrong the measurements may be."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pivoting.controller.plane_and_space import Space, space
from pivoting.controller.rotations import rotated
from pivoting.controller.uncertainty.uncertainty import Interval, Uncertainty
from pivoting.controller.validate import Array, array, fail, frozen, number, unit_quaternions

CONTACT = ("sticks", "slides", "open", "other")  # "other": more touches than is known, and nothing can be learned
STICKS, SLIDES, OPEN, OTHER = range(len(CONTACT))
SHORT_SPAN = 0.05  # [s] over which a rate of turn is taken from orientations


@dataclass(frozen=True)
class MeasurementErrors:
    """Bounds on whatever makes a log differ from the truth; each of them is zero unless it is given.

    Attributes:
        theta: of each measured orientation, about each axis that the object can turn about [rad].
        omega: of each measured angular velocity, likewise [rad/s].
        shove: impulse of unknown forces at the true centre of mass over the whole log, per true kg [N s/kg]: the
            integral of their magnitude.
        rate: greatest rate of turn [rad/s], which bounds how far the object turns between two measurements.
        wrench: of the moment and of the force that are known, as a share of each.
        contact_force: of each measured contact force, in any direction [N].
        position: of each measured position, in any direction [m].
    """

    theta: float = 0.0
    omega: float = 0.0
    shove: float = 0.0
    rate: float = 0.0
    wrench: float = 0.0
    contact_force: float = 0.0
    position: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            number(name, value, at_least=0.0)

    @classmethod
    def of(cls, uncertainty: Uncertainty, **others: float) -> Self:
        """The bounds that belong to a set of worlds, and `others`, which do not."""
        most = {name: _greatest(getattr(uncertainty, name)) for name in ("theta", "omega", "shove")}
        return cls(**{**most, **others})


def _greatest(interval: Interval) -> float:
    return max(-interval.low, interval.high)


@dataclass(frozen=True, eq=False)
class MotionLog:
    """Measurements of an object that turns about a contact at rest, at N + 1 times, and what acted in the N steps.

    Everything is in 3-D; `motion_log` makes it of planar values, too. Where positions were measured, the balance of
    forces also holds while the contact moves.

    Attributes:
        space: the plane or space.
        time: (N+1,) [s].
        orientation: (N+1, 4) measured quaternions, object axes to world.
        force, moment: (N, 3) known wrench at `lever`, object axes when its step begins [N, N m]. Its impulse acts
            within its step, spread over it or at once, and turns with the object or stays as it is in the world.
        lever: (3,) from the contact to the point at which the wrench acts, the believed CoM, object axes [m].
        gravity: (3,) world axes [m/s^2].
        axes: (A, 3) unit vectors, world axes, about which the contact transmits no moment.
        angular_velocity: (N+1, 3) measured, world axes [rad/s]; None: not measured.
        contact_force: (N, 3) sum of the contact forces on the object, world axes, the mean of each step [N]; nan: not
            measured in that step.
        position: (N+1, 3) measured, of the point at which the wrench acts, world axes [m]; None: not measured.
        contact: (N,) what the contact does in each step: one of `CONTACT`, by number.
    """

    space: Space
    time: Array
    orientation: Array
    force: Array
    moment: Array
    lever: Array
    gravity: Array
    axes: Array
    angular_velocity: Array | None
    contact_force: Array
    position: Array | None
    contact: NDArray[np.int8]

    @property
    def sticking(self) -> NDArray[np.bool_]:
        """(N,) in which steps the contact stays where it is."""
        return self.contact == STICKS

    @property
    def weighed(self) -> NDArray[np.bool_]:
        """(N,) in which steps all forces are known, and where the contact is."""
        known = np.isfinite(self.contact_force).all(axis=1)
        return known & (self.sticking if self.position is None else self.contact != OTHER)

    @property
    def steps(self) -> int:
        """N."""
        return len(self.force)

    def measured_rate(self) -> float:
        """The greatest rate of turn [rad/s] that is measured, or found between orientations `SHORT_SPAN` apart."""
        if self.angular_velocity is not None:
            return float(np.linalg.norm(self.angular_velocity, axis=1).max())
        apart = np.minimum(np.searchsorted(self.time, self.time + SHORT_SPAN), self.steps)
        whole = apart < self.steps if (apart < self.steps).any() else np.arange(self.steps + 1) < self.steps
        cosine = np.abs(np.sum(self.orientation * self.orientation[apart], axis=1))
        angle = 2.0 * np.arccos(np.minimum(cosine, 1.0))
        span = self.time[apart] - self.time
        return float((angle[whole] / span[whole]).max())


def motion_log(
    time: ArrayLike,
    orientation: ArrayLike,
    wrench: ArrayLike,
    lever: ArrayLike,
    gravity: ArrayLike,
    *,
    here: Space | None = None,
    axes: ArrayLike | None = None,
    angular_velocity: ArrayLike | None = None,
    contact_force: ArrayLike | None = None,
    position: ArrayLike | None = None,
    contact: ArrayLike | None = None,
) -> MotionLog:
    """A log in the plane or in space, as the length of `lever` says; what is left out was not measured.

    Args:
        time: (N+1,) rising [s].
        orientation: angles (N+1,) [rad] in the plane, quaternions (N+1, 4) in space.
        wrench: (N, 3) force along u and v and moment, or (N, 6) force and moment; see `MotionLog` [N, N m].
        lever: (d,) see `MotionLog` [m].  gravity: (d,) or (3,) world axes [m/s^2].
        here: the plane with its table, or space; by default the plane of x and z.
        axes: (A, 3) by default all that the object can turn about; of an edge with a contact at both ends, the edge.
        angular_velocity: (N+1,) or (N+1, 3).  contact_force: (N, d) or (N, 3).  position: (N+1, d) or (N+1, 3).
        contact: (N,) by default the contact sticks all the time.

    Raises:
        ValueError: an array that does not fit the others; it is named.
    """
    at = array("time", time, (None,))
    if len(at) < 3 or not (np.diff(at) > 0.0).all():
        raise fail("time", at, "at least three times that rise")
    states, steps = len(at), len(at) - 1
    arm = array("lever", lever, (None,))
    where = space(arm.size) if here is None and arm.size in (2, 3) else here
    if where is None or arm.size != where.dim:
        raise fail("lever", arm, "of length 2 (u, v) in the plane or 3 (x, y, z) in space")
    planar, dim = where.dim == 2, where.dim
    acting = array("wrench", wrench, (steps, 3 * dim - 3)) @ where.wrench_map
    down = array("gravity", gravity, (None,))
    around = where.axial(1.0)[None] if planar else np.eye(3)
    does = np.zeros(steps, np.int8) if contact is None else array("contact", contact, (steps,)).astype(np.int8)
    if not np.isin(does, range(len(CONTACT))).all():
        raise fail("contact", does, "0 (sticks), 1 (slides), 2 (open) or 3 (other) in each step")
    return MotionLog(
        space=where,
        time=at,
        orientation=where.orientation(array("orientation", orientation, (states,)))
        if planar
        else unit_quaternions("orientation", orientation, (states, 4)),
        force=acting[:, :3],
        moment=acting[:, 3:],
        lever=where.lift(arm),
        gravity=down if down.size == 3 else where.lift(array("gravity", down, (dim,))),
        axes=around if axes is None else array("axes", axes, (None, 3)),
        angular_velocity=_rates(where, angular_velocity, states),
        contact_force=_contact_forces(where, contact_force, does),
        position=None if position is None else _lifted(where, "position", position, states),
        contact=frozen(does),
    )


def _rates(here: Space, given: ArrayLike | None, rows: int) -> Array | None:
    """(rows, 3) angular velocities, world axes, of planar rates (rows,) or of such; None of none."""
    if given is None:
        return None
    if here.dim == 2:
        return here.axial(array("angular_velocity", given, (rows,)))
    return array("angular_velocity", given, (rows, 3))


def _lifted(here: Space, name: str, value: ArrayLike, rows: int) -> Array:
    """(rows, 3) world axes, of vectors that may be planar."""
    if np.ndim(value) == 2 and np.shape(value)[1] == 3:
        return array(name, value, (rows, 3))
    return frozen(here.lift(array(name, value, (rows, here.dim))))


def _contact_forces(here: Space, given: ArrayLike | None, does: NDArray[np.int8]) -> Array:
    """(N, 3) as of `MotionLog`; an open contact exerts none, measured or not."""
    forces = np.full((len(does), 3), np.nan)
    if given is not None:
        known = np.isfinite(np.asarray(given, dtype=float)).all(axis=-1)
        filled = np.where(known[:, None], given, 0.0)
        forces[known] = _lifted(here, "contact_force", filled, len(does))[known]
    forces[does == OPEN] = 0.0
    return frozen(forces)


def world_force(log: MotionLog) -> Array:
    """(N, 3) the known force at the measured orientation in which each step begins, world axes [N]."""
    return rotated(log.orientation[:-1], log.force)


def world_moment(log: MotionLog) -> Array:
    """(N, 3) the moment of the known wrench about the contact, likewise [N m]."""
    return rotated(log.orientation[:-1], log.moment + np.cross(log.lever, log.force))
