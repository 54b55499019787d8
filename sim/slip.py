"""Slip: where the contacts are, how far they roll, and how far they are displaced along the table."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.validate import frozen
from pivoting.models.frames import matrix
from pivoting.sim.judging.predicted_slip import stepped_point
from pivoting.sim.pipeline.falling_friction import friction_at
from pivoting.sim.trajectory import Trajectory

Array = NDArray[np.float64]


class ContactMotion(Trajectory):
    """How the contacts of a run move; the material points of the object, for what sticks is they."""

    @property
    def contacts_found(self) -> Array:
        """(W, N) contacts between the body and its support, as MuJoCo counts them."""
        return self.log.contacts.found

    @cached_property
    def turning(self) -> Array:
        """(W, N+1, K, 3) from `position` to the material contact points, or centres of what rolls, table axes [m]."""
        return frozen(self.from_com(self.points))

    @cached_property
    def lever(self) -> Array:
        """(W, N+1, K, 3) from `position` to where the contacts touch, table axes [m]."""
        return frozen(self.turning - self._up)

    @cached_property
    def stepped(self) -> Array:
        """(W, N+1, 3) from `position` to the point of the body whose velocity MuJoCo steps, table axes [m]."""
        point = stepped_point(self.model, self.truth.index) - self.world.applied_at
        return frozen(self.from_com(point[None] @ matrix(self.truth.axes))[..., 0, :])

    @cached_property
    def stepped_velocity(self) -> Array:
        """(W, N+1, 3) of that point, table axes [m/s]."""
        omega = self.angular_velocity @ self.table_axes
        return frozen(self.velocity @ self.table_axes + np.cross(omega, self.stepped))

    @cached_property
    def corner(self) -> Array:
        """(W, N+1, K, 3) where the contacts touch, from the table's origin, table axes [m]."""
        return frozen(self._com[..., None, :] + self.lever)

    @cached_property
    def rolled(self) -> Array:
        """(W, N+1, K, 2) how far along the table (t, o) the contacts have rolled since the start [m].

        The sum of omega x (radius n) dt, omega at the end of each step: with that velocity MuJoCo moves the body.
        """
        speed = np.cross((self.angular_velocity @ self.table_axes)[..., None, :], self._up)[..., :2]
        speed[:, 0] = 0.0
        return frozen(np.cumsum(speed * self.dt, axis=1))

    @property
    def _up(self) -> Array:
        """(K, 3) from where the contacts touch to their points, table axes [m]."""
        return self.world.radius[:, None] * np.array([0.0, 0.0, 1.0])

    @cached_property
    def clearance(self) -> Array:
        """(W, N+1) height above the table of the highest corner of the face that the object lies on at angle 0 [m]."""
        return frozen((self._com[..., None, :] + self.from_com(self.world.face))[..., 2].max(axis=-1))

    @property
    def _com(self) -> Array:
        """(W, N+1, 3) `position` from the table's origin, table axes."""
        return (self.position - self.truth.origin) @ self.table_axes

    @cached_property
    def slip(self) -> Array:
        """(W, N+1, K, 2) displacement of the contacts along the table (t, o), less `rolled` [m].

        Since the start, or since the first step in which a contact is to hold; 0 until then.
        """
        return frozen(self.since_held(self.corner[..., :2] - self.rolled))

    def since_held(self, path: Array) -> Array:
        """What has been added to a path (W, N+1, K, ...) of each contact since it is to hold; 0 until then."""
        held = np.logical_or.accumulate(self.standing, axis=1)
        return np.where(np.concatenate([held[:, :1], held], axis=1)[..., None], path - self.when_held(path), 0.0)

    def when_held(self, path: Array) -> Array:
        """(W, 1, K, ...) a path (W, N+1, K, ...) of each contact at the first moment at which it is to hold."""
        first = self.standing.argmax(axis=1)[:, None]
        return np.take_along_axis(path, first[..., None], axis=1)

    @cached_property
    def friction_use(self) -> Array:
        """(W, N, K) measured |f_t| / (mu f_n) with the world's mu at that time, at 1 a contact slides; nan without a
        push and where none is meant to hold."""
        tangential = np.linalg.norm(self.force_measured[..., :-1], axis=-1)
        normal = self.force_measured[..., -1]
        pushed = (normal > 0.0) & self.standing
        return frozen(np.where(pushed, tangential, np.nan) / np.where(pushed, self.friction * normal, 1.0))

    @property
    def friction(self) -> Array:
        """(W, N, 1) each world's friction coefficient in each step."""
        case = self.scenario.absolute(self.load)
        each = [friction_at(case, truth.mu, self.time[:-1], self.dt) for truth in self.world.truths]
        return frozen(np.array(each)[..., None])

    @cached_property
    def landed(self) -> NDArray[np.bool_]:
        """(W, N) whether there are all the contacts that the scenario is to end with."""
        return self.contacts_found >= max(1, self.scenario.limits.contacts_end)
