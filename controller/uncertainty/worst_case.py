"""The worst member of a set for one wrench, searched for: rigid-body equations, and the searches of SciPy.

It shares no formula with the guarantee, which it is there to attack.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pivoting.controller.motion import Motion
from pivoting.controller.rotations import exponential, rotation_matrix
from pivoting.controller.uncertainty.uncertainty import Member, Uncertainty
from pivoting.controller.validate import Array, array, fail
from pivoting.controller.wrench_controller import WrenchController
from scipy.optimize import differential_evolution, minimize, minimize_scalar

STEPS = 25  # of a local search


class PossibleWorld(NamedTuple):
    """What the world may be and do at one moment.

    Attributes:
        member: of the set.  push: (3,) [N/kg] at the true CoM, world axes.
        tilt: (3,) rotation by which the measured orientation is off, world axes [rad].
        spin: (3,) by which the measured angular velocity is off, world axes [rad/s].
    """

    member: Member
    push: Array
    tilt: Array
    spin: Array


class WorstCase(NamedTuple):
    """The world in which the contact is closest to giving way.

    Attributes:
        world: that was found.  force: (K, d) its contact forces, contact axes [N].
        slack: of the closest of all conditions, f_n - |f_t| / mu and f_n - f_min [N]; negative where one is violated.
    """

    world: PossibleWorld
    force: Array
    slack: float


def contact_forces(controller: WrenchController, state: Motion, wrench: ArrayLike, world: PossibleWorld) -> Array:
    """The contact forces (K, d) [N] if all contacts stick, by the equations of motion of the true object.

    Of several contacts they are the smallest that satisfy the equations.

    Args:
        state: as it is measured.  wrench: (nw,) as it is applied, object axes, at the believed CoM.
    """
    here, belief, known = controller.space, controller.belief, _known(controller)
    q, omega, _ = here.lift_motion(state)
    R = rotation_matrix(exponential(world.tilt)) @ rotation_matrix(q)
    omega = omega + world.spin
    mass = controller.body.mass if world.member.mass is None else world.member.mass
    com = here.lift(world.member.com)
    believed, inertia, factor = belief.contacts.pivot, belief.object.inertia, world.member.inertia
    if known.about == "com":
        about = factor * inertia
    else:  # about the contact, from which the part of the point mass is taken again
        whole = factor * (inertia + controller.body.mass * _steiner(believed))
        about = whole * (mass / controller.body.mass if here.dim == 2 else 1.0) - mass * _steiner(believed - com)
    I, w = R @ about @ R.T, np.asarray(wrench) @ belief.source.map  # noqa: E741
    F, M = R @ w[:3], R @ (w[3:] + np.cross(-com, w[:3]))
    arms = [R @ (point - com) for point in belief.contacts.points]
    K, gravity = len(arms), belief.object.gravity + world.push
    frames = np.array([R @ f if t else f for f, t in zip(belief.contacts.frames, belief.contacts.turning, strict=True)])
    # m a - sum f = F + m g;  I alpha - sum r x f = M - omega x I omega;  a + alpha x r = -omega x (omega x r)
    A, b = np.zeros((6 + 3 * K, 6 + 3 * K)), np.zeros(6 + 3 * K)
    A[:3, :3], A[3:6, 3:6] = mass * np.eye(3), I
    b[:3], b[3:6] = F + mass * gravity, M - np.cross(omega, I @ omega)
    for k, r in enumerate(arms):
        rows = slice(6 + 3 * k, 9 + 3 * k)
        A[:3, rows], A[3:6, rows] = -np.eye(3), -_hat(r)
        A[rows, :3], A[rows, 3:6] = np.eye(3), -_hat(r)
        b[rows] = -np.cross(omega, np.cross(omega, r))
    if here.dim == 2:  # it turns about the plane's normal alone
        normal = np.abs(belief.source.map[:, 3:]).sum(axis=0)
        A[3:6, 3:6] += (np.eye(3) - np.outer(normal, normal)) * np.trace(I)
    scale = np.r_[np.ones(6), np.full(3 * K, mass)]  # so that forces and accelerations are alike
    x = scale * np.linalg.lstsq(A * scale, b, rcond=1e-11)[0]
    force = np.einsum("kij,ki->kj", frames, x[6:].reshape(K, 3))
    return force @ belief.contacts.force_map


def worst_case(
    controller: WrenchController, state: Motion, wrench: ArrayLike, *, thorough: bool = False, seed: int = 0
) -> WorstCase:
    """The worst world of a controller's set for one wrench, by local searches from vertices and random members.

    Args:
        state: as it is measured.  wrench: (nw,) object axes, such as that of the `Solution`.
        thorough: search globally as well, by differential evolution.

    Raises:
        ValueError: the controller has no set; or it has more contacts than two, whose squeezes are not searched.
    """
    known, K = _known(controller), len(controller.contacts)
    if K > 2:
        raise fail("controller", f"one with {K} contacts", "one with one contact or two")
    w, rng = array("wrench", wrench, (len(controller.Q_w),)), np.random.default_rng(seed)
    size, q = known.unknowns + 9, controller.space.lift_motion(state)[0]

    def slack(shares: Array) -> float:
        world = world_at(controller, shares)
        return _slack(controller, contact_forces(controller, state, w, world), q, world)

    starts = [rng.random(size) for _ in range(60)]
    starts += [np.r_[(number >> np.arange(known.unknowns)) & 1, rng.random(9)] for number in range(2**known.unknowns)]
    best = sorted(starts, key=slack)[:3]
    options = {"method": "L-BFGS-B", "bounds": [(0.0, 1.0)] * size, "options": {"maxiter": STEPS}}
    found = [minimize(slack, start, **options) for start in best]
    if thorough:
        found.append(differential_evolution(slack, [(0.0, 1.0)] * size, seed=seed, x0=best[0], maxiter=60, polish=True))
    at = min([*best, *(each.x for each in found)], key=slack)
    world = world_at(controller, at)
    force = contact_forces(controller, state, w, world)
    return WorstCase(world, force, _slack(controller, force, q, world))


def world_at(controller: WrenchController, shares: Array) -> PossibleWorld:
    """The world at shares in [0, 1] of all that is unknown: of a member, and (3,) each of push, tilt and spin."""
    known, dim = _known(controller), controller.space.dim
    unknown = known.unknowns
    most = max(map(abs, known.shove)) / known.shove_seconds, max(map(abs, known.theta)), max(map(abs, known.omega))
    push, tilt, spin = (
        _in_ball(2.0 * shares[unknown + 3 * i : unknown + 3 * i + 3] - 1.0, radius) for i, radius in enumerate(most)
    )
    if dim == 2:
        table = rotation_matrix(controller.base)
        push -= table[:, 1] * (table[:, 1] @ push)
        tilt, spin = (table[:, 1] * (table[:, 1] @ each) for each in (tilt, spin))
    return PossibleWorld(known.at(np.clip(shares[:unknown], 0.0, 1.0)), push, tilt, spin)


def _slack(controller: WrenchController, force: Array, q: Array, world: PossibleWorld) -> float:
    """Of the forces (K, d), and of two of those that also squeeze each other, the greatest that can be had."""
    mu = _known(controller).mu
    low = np.array([(1.0 - controller.margin) * (each.mu if mu is None else mu.low) for each in controller.contacts])
    floors = np.array([each.f_min for each in controller.contacts])

    def least(forces: Array) -> float:
        along = np.linalg.norm(forces[:, :-1], axis=1)
        return float(min((forces[:, -1] - along / low).min(), (forces[:, -1] - floors).min()))

    if len(force) == 1:
        return least(force)
    points, frames = controller.belief.contacts.points, controller.belief.contacts.frames  # that do not turn with it
    between = rotation_matrix(exponential(world.tilt)) @ rotation_matrix(q) @ (points[1] - points[0])
    apart = np.stack([between @ frames[0], -(between @ frames[1])]) @ controller.belief.contacts.force_map
    size = float(np.linalg.norm(force)) / float(np.linalg.norm(between))
    best = minimize_scalar(lambda squeeze: -least(force + squeeze * apart), bracket=(-0.1 * size, 0.1 * size))
    return max(-float(best.fun), least(force))


def _known(controller: WrenchController) -> Uncertainty:
    if controller.uncertainty is None:
        raise fail("controller", "one without uncertainty", "one with a set")
    return controller.uncertainty


def _in_ball(vector: Array, radius: float) -> Array:
    return radius * vector / max(1.0, float(np.linalg.norm(vector)))


def _hat(r: Array) -> Array:
    return np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])


def _steiner(r: Array) -> Array:
    return float(r @ r) * np.eye(3) - np.outer(r, r)
