"""Bounds on the least slack of all worlds of a set for one wrench, by the Bernstein form and branch and bound.

The force at a contact is a rational function of what is not known: by the equations of motion about the contact,
f = N(x) / D(x), where D > 0 is the determinant of the inertia about the contact. On a box both have Bernstein
coefficients N_k and D_k, and where all D_k > 0 each f is a convex combination of the points N_k / D_k (Farouki 2012,
section 5). A slack is concave in the force, so that none is less than the least at these points. Boxes are halved until
this bound meets the least slack that was found at their corners.

It shares no formula with the guarantee, and unlike `worst_case`, which searches, it leaves no member out.
"""

from heapq import heappop, heappush
from itertools import count
from math import comb
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pivoting.controller.motion import Motion
from pivoting.controller.rotations import rotation_matrix
from pivoting.controller.uncertainty.uncertainty import Uncertainty
from pivoting.controller.validate import Array, array, fail
from pivoting.controller.wrench_controller import WrenchController

DEGREES = {2: (2, 1, 3, 3, 3), 3: (4, 3, 7, 7, 7)}  # of N and D in mass, factor of inertia, and com; by dimension
MOST = 200  # boxes


class SlackBounds(NamedTuple):
    """Between which two numbers the least slack of all worlds lies.

    Attributes:
        low: no world has less slack [N], rounding of about 1e-12 of the load aside; -inf if nothing can be said.
        high: some member has no more, with nothing that disturbs it and no error of its measured state [N].
        boxes: into which the set was divided.
    """

    low: float
    high: float
    boxes: int


def slack_bounds(
    controller: WrenchController, state: Motion, wrench: ArrayLike, *, tolerance: float = 1e-9, most: int = MOST
) -> SlackBounds:
    """Bounds on the least slack f_n - |f_t| / mu and f_n - f_min [N] of all worlds of a controller's set.

    Pushes and errors of the measured state are bounded by their norms, which `low` counts in full; where orientation
    may be off, slacks are those of the cones that this narrows, as in `Margins.slack`. A `low` of at least 0 proves
    that the contact holds in every world of the set; a `high` below 0, that there is one in which it does not.

    Args:
        state: as it is measured.  wrench: (nw,) object axes, at the believed CoM, such as that of the `Solution`.
        tolerance: of the load, to which the two are to agree, unless `low` is at least 0.
        most: boxes; then the bounds are as they are.

    Raises:
        ValueError: the controller has no set, or more than one contact.
    """
    known = controller.uncertainty
    if known is None:
        raise fail("controller", "one without uncertainty", "one with a set")
    if len(controller.contacts) != 1:
        raise fail("controller", f"one with {len(controller.contacts)} contacts", "one with a single contact")
    forces = _Forces(controller, known, state, array("wrench", wrench, (len(controller.Q_w),)))
    net = forces.net()
    enough, order = tolerance * controller.units.force, count()
    high, boxes, done = forces.attained(net), [(forces.least(net), next(order), net)], 1
    while boxes:
        low = boxes[0][0]
        if low >= min(0.0, high - enough) or done >= most or net.ndim == 1:
            return SlackBounds(low, high, done)
        net = heappop(boxes)[2]
        for part in _halves(net, _longest(net)):
            high = min(high, forces.attained(part))
            heappush(boxes, (forces.least(part), next(order), part))
        done += 1
    raise AssertionError("a box is always left")


class _Forces:
    """The contact force of every member for one wrench and state, as N and D, and its slack."""

    def __init__(self, controller: WrenchController, known: Uncertainty, state: Motion, wrench: Array):
        here, belief = controller.space, controller.belief
        held, self._dim = belief.contacts, here.dim
        q, omega, _ = here.lift_motion(state)
        R = rotation_matrix(q)
        mass, believed = belief.object.mass, held.pivot
        acting = wrench @ belief.source.map
        self._force = R @ acting[:3]
        self._moment = R @ (acting[3:] - np.cross(believed, acting[:3]))  # about the contact
        self._gravity, self._omega, self._R = belief.object.gravity, omega, R
        self._point = believed
        self._inertia = R @ belief.object.inertia @ R.T
        r = R @ believed
        self._whole = self._inertia + mass * (r @ r * np.eye(3) - np.outer(r, r))
        self._about, self._mass = known.about, mass
        self._normal = None if here.dim == 3 else np.abs(belief.source.map[:, 3:]).sum(axis=0)
        frame = R @ held.frames[0] if held.turning[0] else held.frames[0]
        self._axes = frame @ held.force_map
        self._mu, self._floor = float(held.mu[0]), float(held.f_min[0])
        assert belief.unknown is not None
        ends = np.vstack([belief.unknown.mass, belief.unknown.inertia, belief.unknown.com])
        self._low, self._width = ends[:, 0], np.ptp(ends, axis=1)
        self._wide = np.flatnonzero(self._width > 0.0)
        self._sizes = np.array([belief.unknown.push, belief.unknown.spin])  # of what disturbs it [N/kg, rad/s]
        self._rest = belief.unknown.spin**2 * self._most_per_square()

    def net(self) -> Array:
        """(n_1, ..., n_v, C) Bernstein coefficients, over the whole set, of the C numbers that `_values` gives."""
        degrees = [DEGREES[self._dim][i] for i in self._wide]
        nodes = [0.5 - 0.5 * np.cos(np.pi * np.arange(degree + 1) / degree) for degree in degrees]
        shares = np.stack(np.meshgrid(*nodes, indexing="ij"), axis=-1) if nodes else np.zeros((0,))
        x = np.broadcast_to(self._low, (*shares.shape[:-1], 5)).copy()
        x[..., self._wide] += self._width[self._wide] * shares
        net = self._values(x.reshape(-1, 5)).reshape(*shares.shape[:-1], -1)
        for axis, (degree, at) in enumerate(zip(degrees, nodes, strict=True)):
            basis = np.array(
                [[comb(degree, j) * t**j * (1.0 - t) ** (degree - j) for j in range(degree + 1)] for t in at]
            )
            net = np.moveaxis(np.tensordot(np.linalg.inv(basis), net, (1, axis)), 0, axis)
        return np.asarray(net)

    def least(self, net: Array) -> float:
        """No force of a box has less slack [N]."""
        flat = net.reshape(-1, net.shape[-1])
        if flat[:, -1].min() <= 0.0:
            return -np.inf
        points = flat[:, :-1] / flat[:, -1:]
        force, mass = points[:, : self._dim], points[:, self._dim]
        changes = points[:, self._dim + 1 :].reshape(len(points), 2, self._dim, 3)
        normal, along, rest = force[:, -1], force[:, :-1], mass * self._rest
        lifted = np.linalg.norm(changes[:, :, -1], axis=-1) @ self._sizes + rest
        floor = (normal - self._floor - lifted).min()
        if self._dim == 2:  # one edge of the cone after the other
            edges = [
                normal + side * along[:, 0]
                - np.linalg.norm(changes[:, :, 1] + side * changes[:, :, 0], axis=-1) @ self._sizes
                for side in (1.0 / self._mu, -1.0 / self._mu)
            ]  # fmt: skip
            cone = np.minimum(*edges) - rest * np.hypot(1.0, 1.0 / self._mu)
        else:
            swept = np.linalg.norm(changes[:, :, :2], axis=(-2, -1)) @ self._sizes + rest
            cone = normal - lifted - (np.linalg.norm(along, axis=1) + swept) / self._mu
        return float(min(cone.min(), floor))

    def attained(self, net: Array) -> float:
        """The least slack [N] at the corners of a box, which are members."""
        corners = net[np.ix_(*([0, -1] for _ in range(net.ndim - 1)))].reshape(-1, net.shape[-1])
        force = corners[:, : self._dim] / corners[:, -1:]
        cone = force[:, -1] - np.linalg.norm(force[:, :-1], axis=1) / self._mu
        return float(min(cone.min(), (force[:, -1] - self._floor).min()))

    def _values(self, x: Array) -> Array:
        """(P, C) of members (P, 5), all times D: f in contact axes, the mass, how f changes with a push [N/kg] and with
        an error of the rate [rad/s], (2, d, 3), and D itself."""
        m, factor = x[:, 0], x[:, 1]
        r = (x[:, 2:] - self._point) @ self._R.T  # from the contact to the true CoM
        if self._about == "com":
            inertia = factor[:, None, None] * self._inertia + m[:, None, None] * _steiner(r)
        else:
            scale = factor if self._dim == 3 else factor * m / self._mass
            inertia = scale[:, None, None] * self._whole
        D, inverse = self._inverse(inertia)  # the latter times D
        omega, arm, axes = self._omega, _cross_matrix(r), self._axes.T
        moment = self._moment + np.cross(r, m[:, None] * self._gravity) - np.cross(omega, inertia @ omega)
        turned = np.einsum("pij,pj->pi", inverse, moment)
        pulled = np.cross(omega, np.cross(omega, r)) - self._gravity
        force = m[:, None] * (np.cross(turned, r) + D[:, None] * pulled) - D[:, None] * self._force
        # with alpha x r = -[r] alpha:  df = -m (1 + m [r] I^-1 [r]) dg,  and likewise for omega
        by_push = m[:, None, None] * (D[:, None, None] * np.eye(3) + m[:, None, None] * (arm @ inverse @ arm))
        spinning = _cross_matrix(omega[None]) @ inertia - _cross_matrix(np.einsum("pij,j->pi", inertia, omega))
        swung = -_cross_matrix(np.cross(omega, r)) - _cross_matrix(omega[None]) @ arm
        by_spin = m[:, None, None] * (arm @ inverse @ spinning + D[:, None, None] * swung)
        if self._normal is not None:
            by_spin = by_spin @ np.outer(self._normal, self._normal)
        changes = np.stack([axes @ by_push, axes @ by_spin], axis=1).reshape(len(x), -1)
        return np.column_stack([force @ self._axes, D * m, changes, D])

    def _inverse(self, inertia: Array) -> tuple[Array, Array]:
        """D and D times the inverse (P, 3, 3) of the inertia; in the plane, of its part about the normal."""
        if self._normal is None:
            D = np.linalg.det(inertia)
            return D, D[:, None, None] * np.linalg.inv(inertia)
        D = inertia @ self._normal @ self._normal
        return D, np.broadcast_to(np.outer(self._normal, self._normal), inertia.shape)

    def _most_per_square(self) -> float:
        """By how much a force may be off for the square of an error of the rate, at most, per true mass [m]."""
        ends = self._low, self._low + self._width
        points = np.array(np.meshgrid(*zip(ends[0][2:], ends[1][2:], strict=True))).reshape(3, -1).T - self._point
        far = float(np.linalg.norm(points, axis=1).max())
        if self._dim == 2:
            return far
        least, most = np.linalg.eigvalsh(self._inertia if self._about == "com" else self._whole)[[0, -1]]
        more = ends[1][0] * far**2 if self._about == "com" else 0.0
        return far * (1.0 + (most * ends[1][1] + more) / (least * ends[0][1]))


def _longest(net: Array) -> int:
    """The axis along which the coefficients are farthest from a straight line."""
    bends = []
    for axis in range(net.ndim - 1):
        second = np.diff(net, 2, axis=axis)
        size = np.abs(net).reshape(-1, net.shape[-1]).max(axis=0)
        bends.append(float((np.abs(second) / np.maximum(size, 1e-300)).max()) if second.size else 0.0)
    return int(np.argmax(bends))


def _halves(net: Array, axis: int) -> tuple[Array, Array]:
    """The coefficients on the two halves of a box, by de Casteljau's algorithm."""
    degree = net.shape[axis] - 1
    first = np.array([[comb(i, j) / 2.0**i for j in range(degree + 1)] for i in range(degree + 1)])
    halves = (np.moveaxis(np.tensordot(each, net, (1, axis)), 0, axis) for each in (first, first[::-1, ::-1]))
    return next(halves), next(halves)


def _steiner(r: Array) -> Array:
    """(P, 3, 3) of arms (P, 3), for a mass of 1."""
    return np.einsum("pi,pi->p", r, r)[:, None, None] * np.eye(3) - r[:, :, None] * r[:, None, :]


def _cross_matrix(r: Array) -> Array:
    """(P, 3, 3) the matrices [r] with [r] v = r x v."""
    zero, (x, y, z) = np.zeros(len(r)), r.T
    return np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
