"""The controller: a belief about object, contacts and gravity, a law, and weights; it states and solves the problem.

The same compiled functions serve `problem` (one state, for people) and `step_worlds` (the loop, many worlds).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pivoting.controller.contacts import Contact, fill_jacobian
from pivoting.controller.control_laws import Body, Law, fill_required
from pivoting.controller.kernels.compilation import kernel
from pivoting.controller.kernels.interior_point import contact_wrench
from pivoting.controller.kernels.planar_closed_form import planar_wrench
from pivoting.controller.kernels.workspace import workspace
from pivoting.controller.plane_and_space import Motion, Space, space
from pivoting.controller.rotations import IDENTITY, fill_rotation, rotation_matrix, turned
from pivoting.controller.units import Units, lever, units
from pivoting.controller.validate import Array, array, fail, number, positive_definite
from pivoting.controller.wrench_bounds import (
    Stacked,
    begin_multiplier,
    farthest_exceeded,
    fill_heavier,
    next_multiplier,
    size_over,
)
from pivoting.controller.wrench_problem import WrenchProblem, wrench_weight

SOLVED, INACCURATE, FAILED = 0, 1, 2  # codes of `solution.STATUS`
ATTEMPTS, HELD = 30, 1e-10  # solves in which a bound is to be held, relative to it
HEAVIEST = 30.0  # of the weight: a bound that needs more is left to `BoundedSolver`


class Belief(NamedTuple):
    """What the compiled loop needs to know, as arrays; see `fill_jacobian` and `fill_required` for their meaning."""

    points: Array
    offsets: Array
    frames: Array
    pivot: Array
    offset: Array
    mu: Array
    f_min: Array
    mass: float
    inertia: Array
    gravity: Array
    law: tuple[float, float, float, float]
    Q_w: Array
    Q_f: Array
    wrench_map: Array
    force_map: Array


@dataclass(frozen=True, eq=False)
class WrenchController:
    """At each state, the problem whose answer is the smallest wrench that moves the object as the law wants.

    Attributes:
        body: mass and inertia as believed.
        contacts: the contacts that are to stick, all planar or all spatial.
        law: static, quasi-dynamic (with the velocity or as in the notes) or dynamic.
        gravity: (d,) in world axes [m/s^2]; in the plane (x, z), or (3,) for a plane that is not x-z.
        base: (4,) quaternion of the table in the world; in the plane theta is measured from it, in space a `Horizon`
            takes the table's axes from it.
        margin: share of mu kept unused.
        Q_w, Q_f: weights in object axes; Q_w defaults to a characteristic length of |pivot|, and the radius if it
            rolls (see `wrench_weight`).
    """

    body: Body
    contacts: tuple[Contact, ...]
    law: Law
    gravity: Array
    base: Array
    margin: float
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
        put(self, "gravity", array("gravity", gravity, (3,) if np.size(gravity) == 3 else (dim,)))
        put(self, "base", space(dim, base).base)
        put(self, "margin", number("margin", margin, at_least=0.0, below=1.0))
        weight = wrench_weight(dim, reach) if Q_w is None else Q_w
        put(self, "Q_w", positive_definite("Q_w", weight, 3 * dim - 3))
        put(self, "Q_f", positive_definite("Q_f", np.eye(n) if Q_f is None else Q_f, n))

    @cached_property
    def space(self) -> Space:
        """The plane on this table, or space."""
        return space(self.contacts[0].dim, self.base)

    @cached_property
    def belief(self) -> Belief:
        """The arrays of the compiled loop."""
        here = self.space
        table = rotation_matrix(here.base)
        points = np.array([here.lift(contact.point) for contact in self.contacts])
        frames = np.array([_lifted_frame(contact, here, table) for contact in self.contacts])
        offsets = -frames[:, :, 2] * np.array([[contact.radius] for contact in self.contacts])
        return Belief(
            points=points,
            offsets=offsets,
            frames=frames,
            pivot=points.mean(axis=0),
            offset=offsets.mean(axis=0),
            mu=np.array([(1.0 - self.margin) * contact.mu for contact in self.contacts]),
            f_min=np.array([contact.f_min for contact in self.contacts]),
            mass=float(self.body.mass),
            inertia=here.lift_inertia(self.body.inertia),
            gravity=self.gravity if self.gravity.size == 3 else here.lift(self.gravity),
            law=self.law.coefficients,
            Q_w=np.array(self.Q_w),
            Q_f=np.array(self.Q_f),
            wrench_map=here.wrench_map,
            force_map=np.ascontiguousarray(here.force_map),
        )

    @cached_property
    def units(self) -> Units:
        """In which its programs are stated."""
        belief = self.belief
        return units(belief.mass, belief.gravity, belief.points, self.space.dim)

    def workspace(self) -> tuple[tuple[Any, ...] | None, ...]:
        """Scratch of the compiled loop, one for each thread."""
        nw, n = len(self.Q_w), len(self.Q_f)
        own = np.empty((3, 3)), np.empty((nw, n)), np.empty((nw, nw)), np.empty(6)
        return own, *workspace(nw, len(self.contacts), self.space.dim)

    def jacobian(self, orientation: Array) -> Array:
        """(nw, K d) contact Jacobian in object axes at an orientation (4,), object axes to world."""
        still = np.zeros(3)
        return self._stated((orientation, still), (orientation, still, still))[0]

    def problem(
        self, state: Motion, desired: Motion | None = None, *, external: ArrayLike | None = None
    ) -> WrenchProblem:
        """The wrench problem, in object axes, at `state` (acceleration not used), reference at `desired`.

        Args:
            state: measured.
            desired: left out, the object is to stay where it is.
            external: (nw,) known wrench on the object besides gravity, contacts and the controller's own, such as that
                of damped joints, about the CoM, object axes [N, N m].
        """
        target = Motion(state.orientation) if desired is None else desired
        J, required = self._stated(self.space.lift_motion(state)[:2], self.space.lift_motion(target))
        if external is not None:
            required -= array("external", external, required.shape)
        return WrenchProblem(
            J,
            required,
            [contact.mu for contact in self.contacts],
            f_min=self.belief.f_min,
            margin=self.margin,
            Q_w=self.Q_w,
            Q_f=self.Q_f,
        )

    def _stated(self, measured: tuple[Array, ...], desired: tuple[Array, ...]) -> tuple[Array, Array]:
        """J (nw, K d) and the required wrench (nw,) at q, omega for q_d, omega_d, alpha_d, all in world axes."""
        J, required = np.empty((len(self.Q_w), len(self.Q_f))), np.empty(len(self.Q_w))
        # writable or read-only as in the loop, so that numba need not compile a second variant
        seen, wanted = [np.array(values) for values in measured], [np.array(values) for values in desired]
        for values in seen:
            values.flags.writeable = False
        state_problem(self.belief, *seen, *wanted, np.empty((3, 3)), J, required)
        return J, required


def _lifted_frame(contact: Contact, here: Space, table: Array) -> Array:
    """(3, 3) contact axes (t, o, n) as columns in world axes."""
    if contact.frame is None:
        return table
    if here.dim == 3:
        return contact.frame
    t, n = here.lift(contact.frame.T)
    return np.column_stack([t, np.cross(n, t), n])


@kernel
def state_problem(belief, q, omega, q_d, omega_d, alpha_d, R, J, b):  # type: ignore[no-untyped-def]
    """Write R (3, 3), J (nw, K d) and the required wrench b (nw,) at one state."""
    fill_rotation(q, R)
    fill_jacobian(R, belief.points, belief.offsets, belief.frames, belief.wrench_map, belief.force_map, J)
    fill_required(
        R, q, omega, q_d, omega_d, alpha_d, belief.law, belief.mass, belief.inertia, belief.gravity, belief.pivot,
        belief.offset, belief.wrench_map, b,
    )  # fmt: skip


@kernel
def step_worlds(  # type: ignore[no-untyped-def]
    belief, bounds, own, planar, several, tolerance, q, omega, q_d, omega_d, alpha_d, external, required, wrench,
    force, residual, status,
):  # fmt: skip
    """State, solve and certify the problem of every world; answers are written into the last five arrays.

    Args:
        belief: the values of `Belief`, shared by the worlds.
        bounds: the values of `WrenchBounds.stacked`, or None. One that is not on a rate is kept, as a heavier weight;
            where that needs more than `HEAVIEST` times the weight, or a second bound, the answer is that without any.
        own, planar, several: `WrenchController.workspace()`.
        tolerance: largest relative KKT residual of status 0 (solved).
        q: (W, 4) and omega: (W, 3), the measured orientations and angular velocities, world axes.
        q_d, omega_d, alpha_d: (W, 4), (W, 3), (W, 3), the reference now; (1, ...) is the same for all worlds.
        external: (W, nw) or (1, nw), known wrenches on the object besides gravity, contacts and the controller's own,
            object axes.
        required: (W, nw) out, the right-hand side J f + w of the problem, `external` taken off, object axes.
        wrench: (W, nw) out, in object axes; nan where the status is 2 (failed: no finite answer).
        force: (W, K d) out, in contact axes.
        residual: (W,) out.  status: (W,) out, int8: 0 solved, 1 inaccurate, 2 failed.
    """
    belief = Belief(*belief)
    nw = belief.wrench_map.shape[0]
    R, J, heavier, root = own
    Q_w, Q_f, mu, f_min = belief.Q_w, belief.Q_f, belief.mu, belief.f_min  # taken out once: it shows in the plane
    for i in range(q.shape[0]):
        j, b = i % q_d.shape[0], required[i]
        state_problem(belief, q[i], omega[i], q_d[j], omega_d[j], alpha_d[j], R, J, b)
        for row in range(nw):
            b[row] -= external[i % external.shape[0], row]
        ball, multiplier, Q = -1, 0.0, Q_w
        for attempt in range(ATTEMPTS + 1):
            if bounds is not None:
                fill_heavier(Stacked(*bounds), ball, multiplier, Q_w, heavier)
                Q = heavier
            # Of what is None the compiler leaves the branch out, and all kernels that it calls.
            if planar is not None:
                residual[i] = planar_wrench(J, b, Q, Q_f, mu, f_min, force[i], wrench[i], planar)
            if several is not None:
                residual[i] = contact_wrench(J, b, Q, Q_f, mu, f_min, force[i], wrench[i], several)
            if bounds is None:
                break
            if attempt == 0:
                ball = farthest_exceeded(Stacked(*bounds), wrench[i])
                if ball >= 0:
                    begin_multiplier(Stacked(*bounds), ball, Q_w, root)
            if ball < 0 or not np.isfinite(residual[i]):
                break
            size = size_over(Stacked(*bounds), ball, wrench[i], wrench[i], 1.0)
            if abs(size - 1.0) <= HELD:
                residual[i] = max(residual[i], abs(size - 1.0))
                break
            next_multiplier(root, size)
            multiplier = root[0]
            if attempt >= ATTEMPTS - 1 or not multiplier <= HEAVIEST * root[5]:  # out of reach: as without bounds
                ball = -1
        if not np.isfinite(residual[i]):
            status[i] = FAILED
            for row in range(nw):
                wrench[i, row] = np.nan
        else:
            status[i] = SOLVED if residual[i] <= tolerance else INACCURATE


@kernel
def world_wrench(wrench_map, q, wrench, out):  # type: ignore[no-untyped-def]
    """Turn wrenches in object axes into (force, torque) at the CoM in WORLD axes, as `xfrc_applied` wants them.

    Args:
        wrench_map: (nw, 6), see `Space`.  q: (W, 4) object to world.  wrench: (W, nw).
        out: (W, 6), written; zero where the wrench is not finite: without an answer nothing is applied.
    """
    for i in range(q.shape[0]):
        for half in (0, 3):
            a = b = c = 0.0
            for j in range(wrench.shape[1]):
                a += wrench_map[j, half] * wrench[i, j]
                b += wrench_map[j, half + 1] * wrench[i, j]
                c += wrench_map[j, half + 2] * wrench[i, j]
            a, b, c = turned(q[i, 0], q[i, 1], q[i, 2], q[i, 3], a, b, c)
            finite = np.isfinite(a + b + c)
            out[i, half], out[i, half + 1], out[i, half + 2] = (a, b, c) if finite else (0.0, 0.0, 0.0)
