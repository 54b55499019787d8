"""Objects that turn about a point that stays where it is: their motion by integration, and a log of it with errors.

Nothing here is taken from what is tested: the equations of motion are Euler's about the contact, in object axes,
integrated by the method of Runge and Kutta. The plane is space with everything in the plane of x and z.
"""

from dataclasses import dataclass

import numpy as np
from pivoting.controller.learning.motion_log import MeasurementErrors, MotionLog, motion_log
from pivoting.controller.learning.unknowns import Unknowns
from pivoting.controller.plane_and_space import space
from pivoting.controller.rotations import CONJUGATE, exponential, quaternion_product, rotated
from pivoting.controller.uncertainty.uncertainty import Member, Uncertainty

GRAVITY = np.array([0.0, 0.0, -9.81])
BANDWIDTH = 15.0  # of the law that makes the motion, times the natural frequency's inverse
FORCE_ERROR = 0.01  # of a measured contact force, in weights


@dataclass(frozen=True, eq=False)
class PivotRun:
    """One run: what was measured, within which errors, what was known before, and the truth."""

    log: MotionLog
    errors: MeasurementErrors
    unknowns: Unknowns
    truth: np.ndarray
    member: Member


def pivot_run(rng: np.random.Generator, dim: int, shove: float = 0.2, omega: float = 0.0) -> PivotRun:
    """A box turned from 10 to 80 deg about its corner, of random sides, mass, truth, duration, errors and shove."""
    sides = 10.0 ** rng.uniform(-1.0, 0.0) * rng.uniform(0.5, 1.0, 3)
    mass = 500.0 * sides.prod() * rng.uniform(0.5, 2.0)
    tensor = mass / 12.0 * np.diag((sides**2).sum() - sides**2)
    used = [0, 2] if dim == 2 else [0, 1, 2]
    prior = Uncertainty(
        mass=(0.8 * mass, 1.2 * mass),
        com=np.outer(0.05 * sides[used], [-1.0, 1.0]),
        inertia=(0.8, 1.2),
        mu=(0.25, 0.8),
        shove=shove,
        theta=np.deg2rad(0.1),
        omega=omega,
    )
    ends = rng.random() < 0.5
    member = prior.at(rng.integers(0, 2, 3 + dim) if ends else rng.random(3 + dim))
    if dim == 2:
        tensor = np.diag([0.0, tensor[1, 1], 0.0])
    lever = 0.5 * sides * (1.0 if dim == 3 else np.array([1.0, 0.0, 1.0]))
    unknowns = Unknowns(space(dim), lever, tensor, prior)
    offset = space(dim).lift(np.asarray(member.com))
    motion = _motion(rng, unknowns, member, offset, shove)
    return _measured(rng, unknowns, member, motion)


def _motion(rng, unknowns, member, offset, shove):
    """Time, orientation, body rate and the wrench of each step, which acts at the believed CoM."""
    J, h = _tensor(unknowns, member.mass, offset, member.inertia)
    J0, h0 = _tensor(unknowns, unknowns.prior.nominal.mass, np.zeros(3), 1.0)
    planar, lever = unknowns.space.dim == 2, unknowns.lever
    natural = np.sqrt(np.linalg.norm(lever) / 9.81)
    seconds, steps = natural * rng.uniform(6.0, 10.0), int(rng.integers(300, 700))
    dt = seconds / steps
    azimuth = 0.0 if planar else rng.uniform(-np.pi, np.pi)
    axis = np.array([np.sin(azimuth), -np.cos(azimuth), 0.0])
    start = exponential(np.deg2rad(10.0) * axis)
    gain = BANDWIDTH / natural / 3.0
    pushed = rng.normal(size=3) * (np.array([1.0, 0.0, 1.0]) if planar else 1.0)
    lasting, begin = max(1, round(0.05 / dt)), int(rng.integers(0, steps // 2))  # [steps]
    pushed *= member.mass * shove * rng.choice([0.5, 1.0]) / np.linalg.norm(pushed) / (lasting * dt)
    q, omega, squeeze = start, np.zeros(3), rng.normal(size=3) * (np.array([1.0, 0.0, 1.0]) if planar else 1.0)
    orientation, rates, wrenches = [q], [omega], []
    fixed = rng.random() < 0.5  # to the object, else to the world

    def turning(q, omega, F, M, R0, k):
        """Of body rates, by the moments about the contact, all in object axes."""
        if not fixed:
            F, M = (rotated(q * CONJUGATE, rotated(R0, each)) for each in (F, M))
        moment = M + np.cross(lever, F) + np.cross(h, rotated(q * CONJUGATE, GRAVITY))
        if begin <= k < begin + lasting:
            moment += np.cross(lever + offset, rotated(q * CONJUGATE, pushed))
        moment -= np.cross(omega, J @ omega)
        return np.array([0.0, moment[1] / J[1, 1], 0.0]) if planar else np.linalg.solve(J, moment)

    for k in range(steps):
        t = k * dt
        u = t / seconds
        angle = np.deg2rad(70.0) * u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
        rate = np.deg2rad(70.0) * 30.0 * u**2 * (1.0 - u) ** 2 / seconds
        push = np.deg2rad(70.0) * 60.0 * u * (1.0 - 3.0 * u + 2.0 * u * u) / seconds**2
        wanted = quaternion_product(exponential(angle * axis), start)
        off = quaternion_product(wanted, q * CONJUGATE)
        error = 2.0 * off[1:] * np.sign(off[0])
        alpha = push * axis + gain**2 * error + 2.0 * gain * (rate * axis - rotated(q, omega))
        moment = J0 @ rotated(q * CONJUGATE, alpha) + np.cross(omega, J0 @ omega)
        moment -= np.cross(h0, rotated(q * CONJUGATE, GRAVITY))
        F = unknowns.prior.nominal.mass * 3.0 * squeeze
        M = moment - np.cross(lever, F)
        wrenches.append(np.concatenate([F, M]))
        q, omega = _rk4(turning, q, omega, F, M, k, dt)
        orientation.append(q)
        rates.append(omega)
    acting = (np.arange(steps) >= begin) & (np.arange(steps) < begin + lasting)
    found = np.array(orientation), np.array(rates), np.array(wrenches)
    return dt * np.arange(steps + 1), *found, (lever + offset, fixed, np.outer(acting, pushed))


def _tensor(unknowns, mass, offset, factor):
    c = unknowns.lever + offset
    J = factor * unknowns.inertia + mass * (c @ c * np.eye(3) - np.outer(c, c))
    return J, mass * c


def _rk4(turning, q, omega, F, M, k, dt):
    def slopes(p, w):
        return 0.5 * quaternion_product(p, np.append(0.0, w)), turning(p, w, F, M, q, k)

    a = slopes(q, omega)
    b = slopes(q + 0.5 * dt * a[0], omega + 0.5 * dt * a[1])
    c = slopes(q + 0.5 * dt * b[0], omega + 0.5 * dt * b[1])
    d = slopes(q + dt * c[0], omega + dt * c[1])
    p, w = (x + dt / 6.0 * (e + 2.0 * f + 2.0 * g + h) for x, e, f, g, h in zip((q, omega), a, b, c, d, strict=True))
    return p / np.linalg.norm(p), w


def _measured(rng, unknowns, member, motion) -> PivotRun:
    time, orientation, rates, wrenches, (com, fixed, push) = motion
    prior, here = unknowns.prior, unknowns.space
    planar = here.dim == 2
    eps = prior.theta.high
    wrong = _wrong(rng, eps, (len(time), 3))
    if rng.random() < 0.3:
        wrong = np.broadcast_to(wrong[0], wrong.shape)  # a bias
    seen = quaternion_product(exponential(wrong), orientation)
    seen = here.angle(orientation) + wrong[:, 0] if planar else seen / np.linalg.norm(seen, axis=1, keepdims=True)
    spin = rotated(orientation, rates)
    rate_error = prior.omega.high
    measured = spin + _wrong(rng, rate_error, spin.shape)
    # the mean contact force of each step, by the change of momentum
    weight = member.mass * 9.81
    change = np.diff(member.mass * np.cross(spin, rotated(orientation, com)), axis=0) / np.diff(time)[:, None]
    held = rotated(orientation[:-1], wrenches[:, :3])
    if fixed:
        half = quaternion_product(orientation[:-1], exponential(0.25 * np.diff(time)[:, None] * (rates[1:] + rates[:-1])))
        held = rotated(half, wrenches[:, :3])
    force = change - member.mass * GRAVITY - held - push
    error = FORCE_ERROR * weight
    noisy = force + _wrong(rng, error / np.sqrt(3.0), force.shape)
    log = motion_log(
        time,
        seen,
        wrenches @ here.wrench_map.T,
        unknowns.lever[unknowns.axes],
        GRAVITY,
        angular_velocity=None if rate_error == 0.0 else measured @ here.axial(1.0) if planar else measured,
        contact_force=noisy[:, unknowns.axes],
    )
    fastest = float(np.linalg.norm(rates, axis=1).max()) * 1.01
    errors = MeasurementErrors.of(prior, rate=fastest, contact_force=error)
    return PivotRun(log, errors, unknowns, unknowns.of(member.mass, member.com, member.inertia), member)


def _wrong(rng, size, shape):
    """Errors of up to this size, half of the time all of this size."""
    drawn = rng.uniform(-size, size, shape)
    return drawn if rng.random() < 0.5 else size * np.sign(drawn)
