"""The grip at one state under one wrench: the least slack of the contact forces of all members of a set.

The guarantee chooses the wrench, and counts a member's force as f + d, where f is the force that the controller reckons
with; d depends not on the wrench, but on the torque that the law requires. Here the wrench is given, whatever law,
bounds or actuators have made of it, and with it the torque about the contact. So the members' forces are counted from
f = 0, with the applied wrench in place of the required one: the same arithmetic gives d, which is then all of it.

Two contacts can also squeeze each other along the line between them, as hard as they like. Of every member's squeezes
that with the greatest slack counts: it is enough that an admissible force exists (weak stability).
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from pivoting.controller.belief import Belief, BelievedSet
from pivoting.controller.kernels.compiled_step import state_cones
from pivoting.controller.kernels.workspace import guard
from pivoting.controller.rotations import rotation_matrix
from pivoting.controller.uncertainty.believed_set import believed_set, guarded_cones, set_about
from pivoting.controller.uncertainty.uncertainty import Uncertainty
from pivoting.controller.validate import Array, array, fail

if TYPE_CHECKING:  # which has these margins as a method
    from pivoting.controller.wrench_controller import WrenchController

HELD = 1e-10  # of the weight: a slack that is less by no more than this is counted as none, not as lost
WIDE, FINER = 16, 10  # intervals of a search for the best squeeze, and how often it is made finer


class Beliefs:
    """What a controller may believe instead: one member alone, or another set.

    Args:
        controller: with at most two contacts, none of which rolls; with a set or without.

    Attributes:
        controller, known: the controller and its set; without one, that of what it believes alone.
        member: the nominal member of the set, alone, as a set.  mu: (K,) nominal friction coefficients.
        believed: a belief in the object as it is believed, alone.  whole: in the whole set.

    Raises:
        ValueError: the contacts roll, or are more than two, whose squeezes are not searched.
    """

    def __init__(self, controller: "WrenchController"):
        K = len(controller.contacts)
        if any(contact.radius > 0.0 for contact in controller.contacts):
            raise fail("controller", "one with contacts that roll", "one with contacts that do not")
        if K > 2:
            raise fail("controller", f"one with {K} contacts", "one with one contact or two")
        self.controller, belief = controller, controller.belief
        self.known = controller.uncertainty or Uncertainty(dim=controller.space.dim)
        held, gravity = belief.contacts, belief.object.gravity
        alone = Uncertainty(about=self.known.about, dim=controller.space.dim)
        own = believed_set(alone, controller.body, gravity, held.points, held.pivot, controller.space)
        self._axes, self._spread = own.axes, own.spread
        member = self.known.nominal
        self.member = own
        if member.mass is not None:
            self.member = self.member._replace(mass=np.full(2, member.mass))
        self.member = self.member._replace(com=np.repeat(controller.space.lift(member.com)[:, None], 2, axis=1))
        self.mu = np.array([contact.mu if member.mu is None else member.mu for contact in controller.contacts])
        self.believed, self.whole = self.of_member(own), self.of_set(self.known)

    def of_set(self, known: Uncertainty) -> Belief:
        """In another set.

        Raises:
            ValueError: its error of theta leaves no friction.
        """
        c, held = self.controller, self.controller.belief.contacts
        mu, f_min = guarded_cones(known, c.contacts, c.margin)
        unknown = set_about(known, c.body, c.belief.object.gravity, c.space, self._axes, self._spread)
        return c.belief._replace(contacts=held._replace(mu=mu, f_min=f_min), unknown=unknown)

    def of_member(self, member: BelievedSet, mu: ArrayLike | None = None) -> Belief:
        """In one member, with another friction coefficient (K,) than the nominal one."""
        c, held = self.controller, self.controller.belief.contacts
        friction = (1.0 - c.margin) * np.broadcast_to(self.mu if mu is None else mu, self.mu.shape)
        floors = np.array([contact.f_min for contact in c.contacts])
        return c.belief._replace(contacts=held._replace(mu=friction, f_min=floors), unknown=member)

    def tilted(self, theta: float) -> Belief:
        """In the nominal member, whose measured orientation is off by at most an angle [rad].

        Raises:
            ValueError: this leaves no friction.
        """
        mu = self.known.nominal.mu
        belief = self.of_set(Uncertainty(theta=theta, mu=mu, about=self.known.about, dim=self.known.dim))
        assert belief.unknown is not None
        return belief._replace(unknown=self.member._replace(push=belief.unknown.push))


class GivenWrench:
    """The contacts of an object at one state under one wrench.

    Args:
        controller: as for `Beliefs`.
        orientation: (4,) object axes to world.  omega: (3,) world axes [rad/s]; both as they are measured.
        wrench: (nw,) all that is applied besides gravity, about the believed CoM, object axes [N, N m].
    """

    def __init__(self, controller: "WrenchController", orientation: Array, omega: Array, wrench: ArrayLike):
        nw, K, dim = len(controller.Q_w), len(controller.contacts), controller.space.dim
        self.wrench = np.array(array("wrench", wrench, (nw,)))
        self._q, self._omega, self._R = np.array(orientation), np.array(omega), np.empty((3, 3))
        self._guard, self._planar = guard(nw, K, dim), True if K * dim == 2 else None
        self._apart = None if K == 1 else _apart(controller, rotation_matrix(self._q))

    def slack(self, belief: Belief, wrench: Array | None = None) -> float:
        """The least of f_n - |f_t| / mu and f_n - f_min of all members of a belief [N], see `Beliefs`.

        Where orientation is uncertain, mu and f_min are those of the narrowed cones.

        Args:
            wrench: (nw,) in place of that of the grip.
        """
        forces, floors = self._forces(belief, wrench)
        mu = belief.contacts.mu
        if self._apart is None:
            return float(min(_above(forces, mu).min(), floors.min()))
        middle, width = np.zeros(len(forces)), 2.0 * float(np.abs(forces).max()) + 1e-300
        for _ in range(FINER):
            tried = middle + np.linspace(-width, width, 2 * WIDE + 1)[:, None]
            squeezed = tried[:, :, None, None] * self._apart
            least = _above(forces + squeezed, mu).min(axis=-1)
            least = np.minimum(least, (floors + squeezed[..., -1]).min(axis=-1))
            middle, width = tried[least.argmax(axis=0), np.arange(len(middle))], width / WIDE
        return float(least.max(axis=0).min())

    def normal(self, belief: Belief) -> float:
        """The mean normal force [N] of the contacts of a belief in one member."""
        return float(self._forces(belief, None)[0][..., -1].mean())

    def _forces(self, belief: Belief, wrench: Array | None) -> tuple[Array, Array]:
        """(V, K, d) of the members, and by how much the normal forces are above their floors, (K,) [N]."""
        w, scratch = self.wrench if wrench is None else wrench, self._guard
        members, _ = state_cones(belief, self._q, self._omega, self._R, w, scratch, self._planar)
        return -scratch.apex[:members], -scratch.floor


def _above(forces: Array, mu: Array) -> Array:
    """f_n - |f_t| / mu [N] of forces (..., K, d)."""
    along = np.abs(forces[..., 0]) if forces.shape[-1] == 2 else np.hypot(forces[..., 0], forces[..., 1])
    return np.asarray(forces[..., -1] - along / mu)


def _apart(controller: "WrenchController", R: Array) -> Array:
    """(2, d) contact forces, contact axes, of two contacts that push each other apart with 1 N."""
    held = controller.belief.contacts
    between = held.points[1] - held.points[0]
    between /= np.linalg.norm(between)
    axes = [frame if turns else R.T @ frame for frame, turns in zip(held.frames, held.turning, strict=True)]
    return np.stack([between @ axes[0], -between @ axes[1]]) @ held.force_map
