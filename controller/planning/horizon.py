"""The horizon: the notes' program for the wrenches, contact forces and poses of N steps.

    min  sum_t  1/2 w_t'Q_w w_t + 1/2 f_t'Q_f f_t + 1/2 e_t'Q e_t,    e_t from pose t to the desired pose t
    s.t. motion (see `equations_of_motion`), friction cones, bounds on the wrench, and, with `stick`, contacts at rest

The contact Jacobian, which depends on the poses, multiplies forces, so the program is bilinear. It is therefore
linearised about a path, with corrections of the poses as unknowns, and `Planner.plan` repeats this about its own answer
until the answer no longer changes.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pivoting.controller.friction_pyramid import polygon
from pivoting.controller.planning.equations_of_motion import Path, fill_start
from pivoting.controller.planning.integrators import INTEGRATORS
from pivoting.controller.rotations import CONJUGATE, quaternion_product, rotated, rotation_matrix
from pivoting.controller.validate import Array, array, fail, number, one_of, positive_definite, unit_quaternions
from pivoting.controller.wrench_bounds import WrenchBounds
from pivoting.controller.wrench_controller import WrenchController

EDGES = 16  # of the polygon in which a QP keeps a planar force: up to 1 - cos(pi / 16) = 2 % of a bound is unused
OFF_PLANE = np.deg2rad(1.0)  # by which a measured state may be out of the plane


class BodyState(NamedTuple):
    """The state of an object: its pose and its velocity.

    The pose is the CoM (3,) [m] and the orientation (4,), object axes to world; the velocities (3,) of both are in
    world axes [m/s, rad/s].
    """

    position: Array
    orientation: Array
    velocity: Array
    angular_velocity: Array


@dataclass(frozen=True, eq=False)
class Horizon:
    """A planning problem: the object and its contacts, the number of steps, the weights and the bounds.

    Attributes:
        controller: what it believes about object, contacts, friction (with its margin) and gravity counts, and its
            weights Q_w, Q_f.
        steps: N.  h: length of a step [s].
        integrator: "quasi-dynamic" (as in the notes), "implicit", "semi-implicit" or "forward"; see
            `equations_of_motion`.
        Q: (N, nq, nq) weights on pose errors: (x, z, theta) in the plane, (translation in table axes, rotation
            vector in object axes) in space. One (nq, nq) applies to every step. The default is the notes' identity.
        bounds: on the wrench.
        stick: whether the contact points have to stay where they are; otherwise the desired arc merely suggests it.
        clear: (P, 3) points of the object, from the CoM in object axes, that have to stay on or above the table;
            without any, a plan may turn the object into the table.
        edges: number of edges of the inscribed polygon that replaces the disc of a bound on |force| in the plane; 0
            for the disc itself, which only "clarabel" accepts.
    """

    controller: WrenchController
    steps: int
    h: float
    integrator: str
    Q: Array
    bounds: WrenchBounds
    stick: bool
    clear: Array
    edges: int

    def __init__(
        self,
        controller: WrenchController,
        steps: int,
        h: float,
        *,
        integrator: str = "quasi-dynamic",
        Q: ArrayLike | None = None,
        bounds: WrenchBounds | None = None,
        stick: bool = False,
        clear: ArrayLike | None = None,
        edges: int = EDGES,
    ):
        if not isinstance(controller, WrenchController):
            raise fail("controller", controller, "a WrenchController")
        if any(contact.radius for contact in controller.contacts):
            raise fail("controller", "one whose contact rolls", "one whose contacts are points of the object")
        if any(contact.fixed_to == "object" for contact in controller.contacts):
            raise fail("controller", "one with a contact on the object", "one whose contacts are on the environment")
        if isinstance(steps, bool) or not isinstance(steps, int | np.integer) or not 1 <= steps <= 10_000:
            raise fail("steps", steps, "a whole number from 1 to 10000")
        one_of("integrator", integrator, tuple(INTEGRATORS))
        if bounds is not None and not isinstance(bounds, WrenchBounds):
            raise fail("bounds", bounds, "WrenchBounds")
        if not isinstance(stick, bool | np.bool_):
            raise fail("stick", stick, "True or False")
        nw = len(controller.Q_w)
        disc = edges == 0 and not isinstance(edges, bool)
        put = object.__setattr__
        put(self, "controller", controller)
        put(self, "steps", int(steps))
        put(self, "h", number("h", h, above=0.0, unit="s"))
        put(self, "integrator", integrator)
        put(self, "Q", _weights(np.eye(nw) if Q is None else Q, int(steps), nw))
        put(self, "bounds", WrenchBounds() if bounds is None else bounds)
        put(self, "stick", bool(stick))
        put(self, "clear", array("clear", np.zeros((0, 3)) if clear is None else clear, (None, 3)))
        put(self, "edges", 0 if disc or controller.space.dim == 3 else len(polygon(edges).facets))
        self.bounds.balls(nw)  # says what is wrong with them

    @cached_property
    def table(self) -> Array:
        """The table's axes as columns (3, 3), world axes."""
        return rotation_matrix(self.controller.base)

    @property
    def times(self) -> Array:
        """The times (N,) at which poses 1 to N are reached [s]; pose 0 is now or, for "forward", one step ahead."""
        first = 2 if INTEGRATORS[self.integrator][1] == 2 else 1
        return self.h * np.arange(first, first + self.steps, dtype=float)

    def start(self, state: BodyState) -> Path:
        """Pose 0 alone, in table axes, and how it is reached; see `Path`."""
        where, at = array("position", state.position, (3,)), unit_quaternions("orientation", state.orientation, (4,))
        velocity, omega = (array(name, getattr(state, name), (3,)) for name in ("velocity", "angular_velocity"))
        ahead = INTEGRATORS[self.integrator][1] == 2
        path, R = Path(np.empty((1, 3)), np.empty((1, 4)), np.empty(7), np.empty(6)), np.empty((3, 3))
        fill_start(self.table, self._to_table, self._kept, self.h, ahead, where, at, velocity, omega, R, path)
        self._refuse_off_plane("orientation", path.before[3:])
        return path

    @cached_property
    def _kept(self) -> Array:
        """(6,) 1 for the directions, translations and rotations, in which the object can move; else 0."""
        return np.abs(self.controller.belief.source.map).sum(axis=0)

    @cached_property
    def _to_table(self) -> Array:
        """(4,) the world in table axes."""
        return self.controller.base * CONJUGATE

    def _refuse_off_plane(self, name: str, orientation: Array) -> None:
        """Raise unless orientations (..., 4) in table axes turn in its plane alone."""
        if self.controller.space.dim == 2 and np.abs(orientation[..., 1::2]).max() > 1e-6:
            shown = quaternion_product(self.controller.base, orientation)
            raise fail(name, shown, "in the controller's plane, which its base gives")

    def in_plane(self, state: BodyState) -> BodyState:
        """A measured state; if the problem is planar, turned into the plane, as the per-step law sees it.

        Raises:
            ValueError: the state is more than `OFF_PLANE` out of the plane.
        """
        space = self.controller.space
        if space.dim == 3:
            return state
        q = unit_quaternions("orientation", state.orientation, (4,))
        off = 2.0 * float(np.linalg.norm(quaternion_product(self._to_table, q)[1::2]))
        if off > OFF_PLANE:
            raise fail("orientation", q, f"within {np.rad2deg(OFF_PLANE):g} deg of the controller's plane")
        return state._replace(orientation=space.orientation(space.angle(q)))

    def height(self, state: BodyState) -> float:
        """How far the lowest of the `clear` points is above the lowest contact, over the lever; inf without any."""
        points = np.concatenate([self.controller.belief.contacts.points, self.clear])
        heights = rotated(np.asarray(state.orientation), points) @ self.table[:, 2]
        contacts, others = np.split(heights, [len(self.controller.contacts)])
        return float((others - contacts.min()).min(initial=np.inf)) / self.controller.units.length

    def arc(self, orientations: ArrayLike, state: BodyState) -> tuple[Array, Array]:
        """Desired poses that turn about the contacts where they are now: CoMs (N, 3), orientations (N, 4), world axes.

        Args:
            orientations: (N, 4) quaternions object to world, at `times`.
        """
        q = unit_quaternions("orientations", orientations, (self.steps, 4))
        pivot = self.controller.belief.contacts.pivot
        there = np.asarray(state.position) + rotated(np.asarray(state.orientation), pivot)
        return there - rotated(q, pivot), q

    def desired(self, positions: ArrayLike, orientations: ArrayLike) -> tuple[Array, Array]:
        """Desired poses in table axes, from (N, 3) and (N, 4) in world axes."""
        c = array("positions", positions, (self.steps, 3))
        q = unit_quaternions("orientations", orientations, (self.steps, 4))
        orientation = quaternion_product(self._to_table, q)
        self._refuse_off_plane("orientations", orientation)
        return np.ascontiguousarray(c @ self.table), orientation


def _weights(Q: ArrayLike, steps: int, nq: int) -> Array:
    """(N, nq, nq) from one weight for all steps or one for each."""
    if np.ndim(Q) != 3:
        return np.broadcast_to(positive_definite("Q", Q, nq), (steps, nq, nq))
    each = array("Q", Q, (steps, nq, nq))
    for t in range(steps):
        positive_definite(f"Q[{t}]", each[t], nq)
    return each
