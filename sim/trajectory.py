"""A finished run as arrays: what every stage gave at every step, and how the object moved."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.plane_and_space import Space, space
from pivoting.controller.planning.sequential_convex import Plan
from pivoting.controller.rotations import CONJUGATE, quaternion_product, rotated
from pivoting.controller.validate import frozen
from pivoting.models.frames import matrix
from pivoting.sim.experiment import Experiment
from pivoting.sim.pipeline.log import Log
from pivoting.sim.pipeline.stages import ANGULAR_VELOCITY, ORIENTATION, POSITION, VELOCITY

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Trajectory(Experiment):
    """A closed-loop run, W worlds and N steps. States have N + 1 entries, answers N; all read-only.

    Attributes:
        start: qpos (W, nq) and qvel (W, nv) of the worlds at time 0, from which the applied wrenches replay the run.
        desired: the reference as orientations (N+1, 4), angular velocities and accelerations (N+1, 3), world axes.
        log: the output of every stage.
        plan: that was played in open loop, else None.
        stance: (W, N) the number of the stance that a world is in at each step; None, where there is one.
    """

    start: tuple[Array, Array]
    desired: tuple[Array, Array, Array]
    log: Log
    plan: Plan | None
    stance: NDArray[np.int8] | None

    @property
    def worlds(self) -> int:
        """W."""
        return self.log.states.shape[0]

    @property
    def open_loop(self) -> bool:
        """Whether a plan was played, whatever the object did."""
        return self.plan is not None

    @property
    def position(self) -> Array:
        """(W, N+1, 3) the point that the controller takes for the centre of mass, world axes [m]."""
        return self.log.states[..., POSITION]

    @property
    def quaternion(self) -> Array:
        """(W, N+1, 4) object axes to world."""
        return self.log.states[..., ORIENTATION]

    @property
    def velocity(self) -> Array:
        """(W, N+1, 3) of that point, world axes [m/s]."""
        return self.log.states[..., VELOCITY]

    @property
    def angular_velocity(self) -> Array:
        """(W, N+1, 3) world axes [rad/s]."""
        return self.log.states[..., ANGULAR_VELOCITY]

    @property
    def required(self) -> Array:
        """(W, N, nw) what the solved problem required, J f + w, object axes [N, N m]."""
        return self.log.answers.required

    @property
    def wrench(self) -> Array:
        """(W, N, 3 or 6) that was asked for, object axes, (F_u, F_v, M) in the plane [N, N m], at the point that
        `position` is of; nan where there was no answer, and then none is applied."""
        return self.log.answers.wrench

    @property
    def wrench_world(self) -> Array:
        """(W, N, 6) applied force and torque at the true centre of mass, world axes, as MuJoCo takes them."""
        return self.log.wrench_world

    @property
    def force(self) -> Array:
        """(W, N, K, d) contact forces (f_t, f_n) or (f_t, f_o, f_n) predicted by the solution, table axes [N]."""
        values = self.log.answers.force
        return values.reshape(*values.shape[:2], -1, self.truth.dim)

    @cached_property
    def force_measured(self) -> Array:
        """(W, N, K, d) by MuJoCo's contacts, likewise."""
        return frozen(self.log.contacts.force @ (self.table_axes @ self.space.force_map))

    @cached_property
    def standing(self) -> NDArray[np.bool_]:
        """(W, N, K) which contacts are to hold in each step."""
        held = np.array([stance.held for stance in self.stances])
        if self.stance is None:
            return np.broadcast_to(held[0], (*self.log.answers.status.shape, held.shape[1]))
        return held[self.stance]

    @property
    def residual(self) -> Array:
        """(W, N) relative KKT residuals."""
        return self.log.answers.residual

    @property
    def status(self) -> NDArray[np.int8]:
        """(W, N) codes of `solution.STATUS`; 0 is solved, 3 as far as the bounds allowed."""
        return self.log.answers.status

    @cached_property
    def control_us(self) -> Array:
        """(N,) time to sense, observe, state, solve and certify the problem of one world [microseconds]."""
        return frozen(self.log.control_ns / (1e3 * self.worlds))

    @cached_property
    def space(self) -> Space:
        """The plane of motion, with angles from the table that the world has, whatever the controller believes."""
        return space(self.truth.dim, self.truth.table)

    @cached_property
    def theta(self) -> Array:
        """(W, N+1) angle turned about the reference's axis [rad]; in the plane from the world's table."""
        axis, start = self.world.turn
        turned = quaternion_product(self.quaternion, start * CONJUGATE)
        half = np.arctan2(turned[..., 1:] @ axis, turned[..., 0])
        return frozen(np.arctan2(np.sin(2.0 * half), np.cos(2.0 * half)))

    @cached_property
    def omega(self) -> Array:
        """(W, N+1) rate of turn about the reference's axis [rad/s]."""
        return frozen(self.angular_velocity @ self.world.turn[0])

    @cached_property
    def angle_error(self) -> Array:
        """(W, N+1) angle from the desired orientation [rad], with its sign about the axis."""
        turned = quaternion_product(self.quaternion, self.desired[0] * CONJUGATE)
        turned *= np.where(turned[..., :1] < 0.0, -1.0, 1.0)  # the shorter way round
        size = 2.0 * np.arctan2(np.linalg.norm(turned[..., 1:], axis=-1), turned[..., 0])
        return frozen(np.copysign(size, turned[..., 1:] @ self.world.turn[0]))

    @cached_property
    def table_axes(self) -> Array:
        """(3, 3) the table's axes (t, o, n) as columns, world axes."""
        return matrix(self.truth.table)

    def from_com(self, points: Array) -> Array:
        """(W, N+1, P, 3) points (P, 3) of the object, turned from object to table axes."""
        return rotated(self.quaternion[..., None, :], points) @ self.table_axes
