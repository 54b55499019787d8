"""The controller: what it believes about object, contacts and gravity, its law and its weights make wrench problems.

`problem`, which makes one problem for one state, and `step_worlds`, the loop over many worlds, use the same compiled
functions.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pivoting.controller.belief import Belief, BelievedObject, HeldContacts, WrenchSource
from pivoting.controller.contacts import Contact
from pivoting.controller.control_laws import Body, Law
from pivoting.controller.kernels.compiled_step import state_cones, state_problem
from pivoting.controller.kernels.workspace import MEMBERS, Guard, guard, several_workspace, workspace
from pivoting.controller.motion import Motion
from pivoting.controller.plane_and_space import Space, space
from pivoting.controller.rotations import IDENTITY, rotation_matrix
from pivoting.controller.solution import Solution
from pivoting.controller.uncertainty.believed_set import believed_set, check_set, guarded_cones
from pivoting.controller.uncertainty.guarantee import Guarantee
from pivoting.controller.uncertainty.margins import Margins, margins
from pivoting.controller.uncertainty.uncertainty import Uncertainty
from pivoting.controller.units import Units, lever, units
from pivoting.controller.validate import Array, array, dimensions, fail, number, positive_definite
from pivoting.controller.wrench_problem import WrenchProblem, wrench_weight


@dataclass(frozen=True, eq=False)
class WrenchController:
    """The controller: for each state of the object it makes the problem of the smallest wrench that the law requires.

    Attributes:
        body: mass and inertia as believed.
        contacts: the contacts that are to stick, all planar or all spatial.
        law: static, quasi-dynamic (with the velocity or as in the notes) or dynamic.
        gravity: (d,) in world axes [m/s^2]; in the plane (x, z), or (3,) for a plane that is not x-z.
        base: (4,) quaternion of the table in the world. In the plane theta is measured from it; in space only a
            `Horizon` uses it, for the axes of the table.
        margin: share of mu that is kept in reserve.
        uncertainty: what is not known of the world: contact forces are to be in their cones for every member of this
            set, in which `body` is one; None: all is as believed.
        Q_w, Q_f: weights of wrench (object axes) and contact forces. By default Q_w is `wrench_weight` with the
            distance from the CoM to the contacts as its length, plus the radius if the object rolls.
    """

    body: Body
    contacts: tuple[Contact, ...]
    law: Law
    gravity: Array
    base: Array
    margin: float
    uncertainty: Uncertainty | None
    Q_w: Array
    Q_f: Array

    def __init__(
        self,
        body: Body,
        contacts: Sequence[Contact],
        law: Law,
        gravity: ArrayLike,
        *,
        base: ArrayLike = IDENTITY,
        margin: float = 0.0,
        uncertainty: Uncertainty | None = None,
        Q_w: ArrayLike | None = None,
        Q_f: ArrayLike | None = None,
    ):
        for name, value, kind in (("body", body, Body), ("law", law, Law)):
            if not isinstance(value, kind):
                raise fail(name, value, f"a {kind.__name__}")
        held = tuple(contacts)
        if not held or len({contact.dim for contact in held}) != 1:
            raise fail("contacts", held, "at least one contact, all planar or all spatial")
        dim, n = held[0].dim, len(held) * held[0].dim
        reach = lever(np.array([contact.point for contact in held]))
        reach += float(np.mean([contact.radius for contact in held]))
        if Q_w is None and reach == 0.0:
            raise fail("contacts", held, "away from the centre of mass, or Q_w given")
        put = object.__setattr__
        put(self, "body", body)
        put(self, "contacts", held)
        put(self, "law", law)
        lifted = dimensions(gravity) == 1 and np.size(gravity) == 3
        put(self, "gravity", array("gravity", gravity, (3,) if lifted else (dim,)))
        put(self, "base", space(dim, base).base)
        put(self, "margin", number("margin", margin, at_least=0.0, below=1.0))
        weight = wrench_weight(dim, reach) if Q_w is None else Q_w
        put(self, "Q_w", positive_definite("Q_w", weight, 3 * dim - 3))
        put(self, "Q_f", positive_definite("Q_f", np.eye(n) if Q_f is None else Q_f, n))
        put(self, "uncertainty", uncertainty)
        if uncertainty is not None:
            check_set(uncertainty, body, held)

    @cached_property
    def space(self) -> Space:
        """The space in which the object moves: the plane, with angles from this table, or space."""
        return space(self.contacts[0].dim, self.base)

    @cached_property
    def belief(self) -> Belief:
        """What the controller believes, as the arrays that the compiled loop needs."""
        here = self.space
        table = rotation_matrix(here.base)
        points = np.array([here.lift(contact.point) for contact in self.contacts])
        frames = np.array([_lifted_frame(contact, here, table) for contact in self.contacts])
        offsets = -frames[:, :, 2] * np.array([[contact.radius] for contact in self.contacts])
        mu = np.array([(1.0 - self.margin) * contact.mu for contact in self.contacts])
        f_min, unknown = np.array([contact.f_min for contact in self.contacts]), None
        gravity = self.gravity if self.gravity.size == 3 else here.lift(self.gravity)
        if self.uncertainty is not None:
            mu, f_min = guarded_cones(self.uncertainty, self.contacts, self.margin)
            unknown = believed_set(self.uncertainty, self.body, gravity, points, points.mean(axis=0), here)
        held = HeldContacts(
            points=points,
            offsets=offsets,
            frames=frames,
            turning=np.array([contact.fixed_to == "object" for contact in self.contacts]),
            pivot=points.mean(axis=0),
            offset=offsets.mean(axis=0),
            mu=mu,
            f_min=f_min,
            force_map=np.ascontiguousarray(here.force_map),
            Q_f=np.array(self.Q_f),
        )
        # arrays of one kind, whatever they were given as: numba compiles for read-only ones anew
        moved = BelievedObject(float(self.body.mass), np.array(here.lift_inertia(self.body.inertia)), np.array(gravity))
        source = WrenchSource(here.wrench_map, np.array(self.Q_w))
        return Belief(moved, held, source, self.law.coefficients, unknown)

    @cached_property
    def units(self) -> Units:
        """The units of force and length that suit this object and its contacts."""
        belief = self.belief
        return units(belief.object.mass, belief.object.gravity, belief.contacts.points, self.space.dim)

    @property
    def widths(self) -> tuple[int, int]:
        """The sizes of a wrench (nw) and of all contact forces together (K d)."""
        return len(self.Q_w), len(self.Q_f)

    def workspace(self) -> tuple[tuple[Any, ...] | None, ...]:
        """Scratch of the compiled loop, one for each thread."""
        nw, n = len(self.Q_w), len(self.Q_f)
        K, dim, scratch = len(self.contacts), self.space.dim, None
        planar, several = workspace(nw, K, dim)
        if self.uncertainty is not None:
            scratch = guard(nw, K, dim)
            several = None if several is None else several_workspace(nw, K, dim, MEMBERS)
        own = np.empty((3, 3)), np.empty((nw, n)), np.empty((nw, nw)), np.empty(6), scratch
        return own, planar, several

    def jacobian(self, orientation: Array) -> Array:
        """The contact Jacobian (nw, K d), in object axes, at an orientation (4,), object axes to world."""
        still = np.zeros(3)
        return self._stated((orientation, still), (orientation, still, still))[0]

    def problem(
        self, state: Motion, desired: Motion | None = None, *, external: ArrayLike | None = None
    ) -> WrenchProblem:
        """The wrench problem, in object axes, for an object at `state` that should be at `desired`.

        Args:
            state: the measured state; its acceleration is not used.
            desired: the reference; by default the object is to stay where it is.
            external: (nw,) known wrench on the object besides gravity, contacts and the controller's own, such as that
                of damped joints, about the CoM, object axes [N, N m].
        """
        J, required, measured = self._at(state, desired)
        held, floors, apex = self.belief.contacts, self.belief.contacts.f_min, None
        if self.uncertainty is not None:
            apex, floors = self.moved_cones(*measured, required)
        if external is not None:
            required -= array("external", external, required.shape)
        # as it was given, where it is: (1 - margin) mu is to be the same to the last bit
        mu = held.mu / (1.0 - self.margin) if self.uncertainty else [contact.mu for contact in self.contacts]
        return WrenchProblem(
            J, required, mu, f_min=floors, margin=self.margin, Q_w=self.Q_w, Q_f=self.Q_f, apex=apex
        )  # fmt: skip

    def moved_cones(self, orientation: Array, omega: Array, required: Array) -> tuple[Array, Array]:
        """The apexes (V, K, d) and floors (K,) [N] that all members of the controller's set ask for.

        Args:
            orientation: (4,), object axes to world.  omega: (3,) world axes [rad/s].  required: (nw,) the wrench that
                contacts and all others make together, object axes.
        """
        cones, members, _ = self._moved((orientation, omega), np.array(required))
        return cones.apex[:members], np.maximum(cones.floor, 0.0)

    def guarantee(self, state: Motion, desired: Motion | None = None) -> Guarantee:
        """What the answer to `problem` guarantees for the worlds of the controller's set; arguments as there.

        Raises:
            ValueError: the controller has no set.
        """
        if self.uncertainty is None:
            raise fail("uncertainty", None, "an Uncertainty: without one there is nothing to guarantee")
        _, required, measured = self._at(state, desired)
        *_, excess = self._moved(measured, required)
        return Guarantee("strong" if len(self.contacts) == 1 else "weak", float(excess), proved=len(self.Q_f) == 2)

    def margins(self, state: Motion, wrench: ArrayLike | Solution, *, external: ArrayLike | None = None) -> Margins:
        """By how much a wrench holds the contacts in the worlds of the controller's set, or in what it believes.

        Whatever law, bounds or actuators the wrench comes from, the contact forces follow from it and from the state;
        a reference is not needed.

        Args:
            state: the measured state; its acceleration is not used.
            wrench: (nw,) as it is applied, object axes [N, N m], or the `Solution` that has it.
            external: (nw,) known wrench on the object besides, as for `problem`.

        Raises:
            ValueError: there are more than two contacts, or one that rolls.
        """
        applied = array("wrench", wrench.wrench if isinstance(wrench, Solution) else wrench, (len(self.Q_w),))
        if external is not None:
            applied = applied + array("external", external, applied.shape)
        return margins(self, *self.space.lift_motion(state)[:2], applied)

    def _at(self, state: Motion, desired: Motion | None) -> tuple[Array, Array, tuple[Array, Array]]:
        """J, the required wrench, and orientation and angular velocity (world axes) as they are measured."""
        target = Motion(state.orientation) if desired is None else desired
        measured = self.space.lift_motion(state)[:2]
        return *self._stated(measured, self.space.lift_motion(target)), measured

    def _moved(self, measured: tuple[Array, ...], required: Array) -> tuple[Guard, int, float]:
        """The cones that the members ask for, how many members there are, and the excess [N]."""
        scratch = guard(len(required), len(self.contacts), self.space.dim)
        seen = [np.array(values) for values in measured]
        planar = True if len(self.Q_f) == 2 else None
        return scratch, *state_cones(self.belief, *seen, np.empty((3, 3)), required, scratch, planar)

    def _stated(self, measured: tuple[Array, ...], desired: tuple[Array, ...]) -> tuple[Array, Array]:
        """J (nw, K d) and the required wrench (nw,) at q, omega for q_d, omega_d, alpha_d, all in world axes."""
        J, required = np.empty((len(self.Q_w), len(self.Q_f))), np.empty(len(self.Q_w))
        # copies that may be written, as in the compiled step: of read-only arrays numba would compile a second variant
        seen, wanted = [np.array(values) for values in measured], [np.array(values) for values in desired]
        state_problem(self.belief[:4], *seen, *wanted, np.empty((3, 3)), J, required)
        return J, required


def _lifted_frame(contact: Contact, here: Space, table: Array) -> Array:
    """(3, 3) contact axes (t, o, n) as columns in world axes."""
    if contact.frame is None:
        return table
    if here.dim == 3:
        return contact.frame
    t, n = here.lift(contact.frame.T)
    return np.column_stack([t, np.cross(n, t), n])
