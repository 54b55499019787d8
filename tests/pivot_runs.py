"""Objects that turn about a point that stays where it is: their motion by integration, and logs of it with errors.

Nothing here is taken from what is tested: the equations of motion are Euler's about the contact, in object axes,
integrated by the method of Runge and Kutta, many runs at a time. The plane is space with everything in that of x and z.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from pivoting.controller.learning.motion_log import MeasurementErrors, MotionLog, motion_log
from pivoting.controller.learning.unknowns import Unknowns
from pivoting.controller.plane_and_space import space
from pivoting.controller.rotations import CONJUGATE, exponential, quaternion_product, rotated
from pivoting.controller.uncertainty.uncertainty import Member, Uncertainty

GRAVITY = np.array([0.0, 0.0, -9.81])
IN_PLANE = np.array([1.0, 0.0, 1.0])
STEPS = 400
SHOVE_SECONDS = 0.05
FORCE_ERROR = 0.01  # of a measured contact force, in weights
START, TURN = np.deg2rad(10.0), np.deg2rad(70.0)


class Drawn(NamedTuple):
    """W objects: what is known beforehand, the truth, and how they are moved.

    Attributes:
        unknowns, members: of each.  mass: (W,).  com: (W, 3) from the contact.  inertia: (W, 3, 3) about it.
        believed: mass, first moment and inertia about the contact as they are believed.
        lever: (W, 3) to the believed CoM.  dt: (W,).  axis: (W, 3) of the turn.
        pushed: (W, STEPS, 3) shoves at the true CoM.  fixed: (W,) whether a wrench turns with the object in a step.
        squeeze: (W, 3) force of the known wrench.
    """

    unknowns: list[Unknowns]
    members: list[Member]
    mass: np.ndarray
    com: np.ndarray
    inertia: np.ndarray
    believed: tuple[np.ndarray, np.ndarray, np.ndarray]
    lever: np.ndarray
    dt: np.ndarray
    axis: np.ndarray
    pushed: np.ndarray
    fixed: np.ndarray
    squeeze: np.ndarray


@dataclass(frozen=True, eq=False)
class PivotRun:
    """One run: what was measured, within which errors, what was known before, and the truth."""

    log: MotionLog
    errors: MeasurementErrors
    unknowns: Unknowns
    truth: np.ndarray
    member: Member


def pivot_runs(seed: int, count: int, dim: int, shove: float = 0.2, omega: float = 0.0) -> Iterator[PivotRun]:
    """Boxes turned from 10 to 80 deg about a corner: random sides, masses, truths, durations, errors and shoves.

    Half of the truths are vertices of the set, half of the errors are as large as they may be, a third a mere bias.

    Args:
        shove: greatest impulse [N s/kg].  omega: greatest error of a measured rate; 0: rates are not measured [rad/s].
    """
    rng = np.random.default_rng([seed, dim])
    drawn = _drawn(rng, count, dim, shove, omega)
    orientation, rates, wrenches = _motion(drawn)
    for i in range(count):
        yield _measured(rng, drawn, i, orientation[:, i], rates[:, i], wrenches[:, i])


def _drawn(rng: np.random.Generator, count: int, dim: int, shove: float, omega: float) -> Drawn:
    planar = dim == 2
    used = IN_PLANE if planar else np.ones(3)
    rows: list[Any] = []
    for _ in range(count):
        sides = 10.0 ** rng.uniform(-1.0, 0.0) * rng.uniform(0.5, 1.0, 3)
        mass = 500.0 * sides.prod() * rng.uniform(0.5, 2.0)
        tensor = mass / 12.0 * np.diag((sides**2).sum() - sides**2)
        tensor = np.diag([0.0, tensor[1, 1], 0.0]) if planar else tensor
        box = np.outer(0.05 * sides[used > 0.0], [-1.0, 1.0])
        prior = Uncertainty(
            mass=(0.8 * mass, 1.2 * mass), com=box, inertia=(0.8, 1.2), shove=shove, theta=np.deg2rad(0.1), omega=omega
        )
        member = prior.at(rng.integers(0, 2, 3 + dim) if rng.random() < 0.5 else rng.random(3 + dim))
        unknowns = Unknowns(space(dim), 0.5 * sides * used, tensor, prior)
        com = unknowns.lever + unknowns.space.lift(np.asarray(member.com))
        dt = np.sqrt(np.linalg.norm(unknowns.lever) / 9.81) * rng.uniform(6.0, 10.0) / STEPS
        azimuth = 0.0 if planar else rng.uniform(-np.pi, np.pi)
        pushed, lasting = np.zeros((STEPS, 3)), max(1, round(SHOVE_SECONDS / dt))
        push = rng.normal(size=3) * used
        begin = int(rng.integers(0, STEPS - lasting))
        impulse = member.mass * shove * rng.choice([0.5, 1.0])
        pushed[begin : begin + lasting] = impulse * push / np.linalg.norm(push) / (lasting * dt)
        J = _about(member.mass, com, member.inertia * tensor)
        believed = mass, mass * unknowns.lever, _about(mass, unknowns.lever, tensor)
        axis = np.array([np.sin(azimuth), -np.cos(azimuth), 0.0])
        squeeze = 9.81 * mass * rng.uniform(-0.5, 0.5, 3) * used
        rows.append(
            (
                unknowns,
                member,
                member.mass,
                com,
                J,
                believed,
                unknowns.lever,
                dt,
                axis,
                pushed,
                rng.random() < 0.5,
                squeeze,
            )
        )
    columns = list(zip(*rows, strict=True))
    known = tuple(np.array(each) for each in zip(*columns[5], strict=True))
    arrays = [np.array(each) for each in columns[2:5]]
    return Drawn(list(columns[0]), list(columns[1]), *arrays, known, *(np.array(each) for each in columns[6:]))


def _about(mass: float, c: np.ndarray, tensor: np.ndarray) -> np.ndarray:
    return tensor + mass * (c @ c * np.eye(3) - np.outer(c, c))


def _motion(drawn: Drawn) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Orientations and body rates (STEPS + 1, W, ...), and wrenches (STEPS, W, 6) at the believed CoM, object axes."""
    planar = drawn.unknowns[0].space.dim == 2
    solve = np.array([np.diag([0.0, 1.0 / J[1, 1], 0.0]) if planar else np.linalg.inv(J) for J in drawn.inertia])
    _, h0, J0 = drawn.believed
    seconds, axis, lever = STEPS * drawn.dt[:, None], drawn.axis, drawn.lever
    start = exponential(START * axis)
    gain = 5.0 * np.sqrt(9.81 / np.linalg.norm(lever, axis=1))[:, None]
    q, omega = start, np.zeros_like(axis)
    found: tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray]] = [q], [omega], []
    for k in range(STEPS):
        u = k / STEPS
        angle = TURN * u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
        rate = TURN * 30.0 * u**2 * (1.0 - u) ** 2 / seconds
        push = TURN * 60.0 * u * (1.0 - 3.0 * u + 2.0 * u * u) / seconds**2
        off = quaternion_product(quaternion_product(exponential(angle * axis), start), q * CONJUGATE)
        error = 2.0 * off[:, 1:] * np.sign(off[:, :1])
        alpha = push * axis + gain**2 * error + 2.0 * gain * (rate * axis - rotated(q, omega))
        moment = _times(J0, rotated(q * CONJUGATE, alpha)) + np.cross(omega, _times(J0, omega))
        moment -= np.cross(h0, rotated(q * CONJUGATE, GRAVITY))
        wrench = np.hstack([drawn.squeeze, moment - np.cross(lever, drawn.squeeze)])
        q, omega = _rk4(drawn, solve, q, omega, wrench, drawn.pushed[:, k])
        for values, value in zip(found, (q, omega, wrench), strict=True):
            values.append(value)
    return np.array(found[0]), np.array(found[1]), np.array(found[2])


def _times(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    return np.einsum("wij,wj->wi", matrices, vectors)


def _rk4(
    drawn: Drawn, solve: np.ndarray, q: np.ndarray, omega: np.ndarray, wrench: np.ndarray, push: np.ndarray
) -> Any:
    """One step with a wrench that is fixed to the objects or to the world."""
    F, M = rotated(q, wrench[:, :3]), rotated(q, wrench[:, 3:])
    first_moment = drawn.mass[:, None] * drawn.com

    def slopes(p: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        back = p * CONJUGATE
        force, moment = (
            np.where(drawn.fixed[:, None], own, rotated(back, world))
            for own, world in ((wrench[:, :3], F), (wrench[:, 3:], M))
        )
        total = moment + np.cross(drawn.lever, force) + np.cross(first_moment, rotated(back, GRAVITY))
        total += np.cross(drawn.com, rotated(back, push)) - np.cross(w, _times(drawn.inertia, w))
        spin = np.concatenate([np.zeros((len(w), 1)), w], axis=1)
        return 0.5 * quaternion_product(p, spin), _times(solve, total)

    dt = drawn.dt[:, None]
    a = slopes(q, omega)
    b = slopes(q + 0.5 * dt * a[0], omega + 0.5 * dt * a[1])
    c = slopes(q + 0.5 * dt * b[0], omega + 0.5 * dt * b[1])
    d = slopes(q + dt * c[0], omega + dt * c[1])
    p, w = (x + dt / 6.0 * (e + 2.0 * f + 2.0 * g + h) for x, e, f, g, h in zip((q, omega), a, b, c, d, strict=True))
    return p / np.linalg.norm(p, axis=1, keepdims=True), w


def _measured(
    rng: np.random.Generator, drawn: Drawn, i: int, orientation: np.ndarray, rates: np.ndarray, wrenches: np.ndarray
) -> PivotRun:
    unknowns, member = drawn.unknowns[i], drawn.members[i]
    prior, here, time = unknowns.prior, unknowns.space, drawn.dt[i] * np.arange(STEPS + 1)
    wrong = _wrong(rng, prior.theta.high, (STEPS + 1, 3))
    if rng.random() < 1.0 / 3.0:
        wrong = np.broadcast_to(wrong[0], wrong.shape)
    seen = quaternion_product(exponential(wrong), orientation)
    spin = rotated(orientation, rates)
    measured = spin + _wrong(rng, prior.omega.high, spin.shape)
    weight = member.mass * 9.81
    force = _contact_force(drawn, i, orientation, rates, wrenches)
    noisy = force + _wrong(rng, FORCE_ERROR * weight / np.sqrt(3.0), force.shape)
    planar = here.dim == 2
    log = motion_log(
        time,
        here.angle(orientation) + wrong[:, 0] if planar else seen / np.linalg.norm(seen, axis=1, keepdims=True),
        wrenches @ here.wrench_map.T,
        unknowns.lever[unknowns.axes],
        GRAVITY,
        angular_velocity=None if prior.omega.high == 0.0 else measured @ here.axial(1.0) if planar else measured,
        contact_force=noisy[:, unknowns.axes],
    )
    fastest = 1.01 * float(np.linalg.norm(rates, axis=1).max())
    errors = MeasurementErrors.of(prior, rate=fastest, contact_force=FORCE_ERROR * weight)
    return PivotRun(log, errors, unknowns, unknowns.of(member.mass, member.com, member.inertia), member)


def _contact_force(
    drawn: Drawn, i: int, orientation: np.ndarray, rates: np.ndarray, wrenches: np.ndarray
) -> np.ndarray:
    """(STEPS, 3) the mean in each step, by the change of momentum, world axes."""
    dt, mass = drawn.dt[i], drawn.mass[i]
    momentum = mass * np.cross(rotated(orientation, rates), rotated(orientation, drawn.com[i]))
    middle = quaternion_product(orientation[:-1], exponential(0.25 * dt * (rates[1:] + rates[:-1])))
    held = rotated(middle if drawn.fixed[i] else orientation[:-1], wrenches[:, :3])
    return np.diff(momentum, axis=0) / dt - mass * GRAVITY - held - drawn.pushed[i]


def _wrong(rng: np.random.Generator, size: float, shape: tuple[int, ...]) -> np.ndarray:
    """Errors of up to this size, half of the time all of this size."""
    drawn = rng.uniform(-size, size, shape)
    return drawn if rng.random() < 0.5 else size * np.sign(drawn)
