"""Laws: which wrench the object needs, from its state and where it should be; one law, chosen by its coefficients."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from pivoting.controller.kernels.compilation import subroutine
from pivoting.controller.plane_and_space import component
from pivoting.controller.rotations import cross, into, rotation_error
from pivoting.controller.validate import number, one_of, positive_definite

FORMULATIONS = ("static", "quasi-dynamic", "quasi-dynamic-velocity", "dynamic")


@dataclass(frozen=True, eq=False)
class Body:
    """Mass [kg] and inertia about the CoM [kg m^2]: a number in the plane, (3, 3) in object axes in space."""

    mass: float
    inertia: float | ArrayLike

    def __post_init__(self) -> None:
        number("mass", self.mass, above=0.0, unit="kg")
        if np.ndim(self.inertia) == 0:
            number("inertia", self.inertia, above=0.0, unit="kg m^2")  # type: ignore[arg-type]
        else:
            positive_definite("inertia", self.inertia, 3)


@dataclass(frozen=True)
class Law:
    """Commanded angular acceleration and which inertial terms are kept.

    alpha = feedforward alpha_d + kp e + kd (omega_d - omega), about the contact, and the wrench required is
    (m (a - g), I alpha + c omega x I omega) with a = alpha x rho + c omega x (omega x rho), rho from contact to CoM and
    c = 1 where velocities count. On a ball of radius s, which rolls, v = omega x (s n - R p) with the normal n at rest:
    alpha acts on rho = s n - R p and omega x (omega x .) on the part of it that turns, -R p.
    The formulations of the notes are choices of these four coefficients:

    - static: all zero. What balances, J f + w + m g = 0; it does not correct errors.
    - quasi-dynamic: kp = 1/h^2, all else zero: M (q_d - q)/h^2 = J f + w + m g. On a second-order plant it oscillates
      (erratum 7), because the velocity that it assumes to be zero is not.
    - quasi-dynamic-velocity: kd = 1/h besides. M (q_d(t + h) - q - h v)/h^2 = J f + w + m g, with q_d(t + h) to first
      order in h: the velocity counts where it moves the pose, and still not in the forces (c = 0).
    - dynamic: the reference's acceleration, feedback on angle and rate, and the velocity terms.

    Attributes:
        formulation: one of `FORMULATIONS`.
        kp: [1/s^2].  kd: [1/s].  feedforward: 0 or 1.  velocity_terms: c, 0 or 1.
    """

    formulation: str
    kp: float
    kd: float
    feedforward: float
    velocity_terms: float

    def __post_init__(self) -> None:
        one_of("formulation", self.formulation, FORMULATIONS)
        for name in ("kp", "kd", "feedforward", "velocity_terms"):
            number(name, getattr(self, name), at_least=0.0)

    @classmethod
    def static(cls) -> Self:
        """Balance: the notes' first program."""
        return cls("static", 0.0, 0.0, 0.0, 0.0)

    @classmethod
    def quasi_dynamic(cls, h: float, *, velocity: bool = False) -> Self:
        """The notes' quasi-dynamic motion with step `h` [s], tracking met exactly (dead beat) rather than weighed.

        Args:
            velocity: the step starts with the velocity that the object has, not from rest; see erratum 7.
        """
        kp = number("h", h, above=0.0, unit="s") ** -2
        if velocity:
            return cls("quasi-dynamic-velocity", kp, 1.0 / h, 0.0, 0.0)
        return cls("quasi-dynamic", kp, 0.0, 0.0, 0.0)

    @classmethod
    def dynamic(cls, bandwidth: float = 40.0, damping: float = 1.0) -> Self:
        """Errors decay as a second-order system of natural frequency `bandwidth` [rad/s] and ratio `damping`."""
        number("bandwidth", bandwidth, above=0.0, unit="rad/s")
        number("damping", damping, above=0.0)
        return cls("dynamic", bandwidth**2, 2.0 * damping * bandwidth, 1.0, 1.0)

    @property
    def coefficients(self) -> tuple[float, float, float, float]:
        """(feedforward, kp, kd, velocity_terms), as the compiled law takes them."""
        return float(self.feedforward), float(self.kp), float(self.kd), float(self.velocity_terms)


@subroutine
def fill_required(R, q, omega, q_d, omega_d, alpha_d, belief, out):  # type: ignore[no-untyped-def]
    """Write the required wrench (nw,) in object axes: what contact and applied wrench must make together.

    Args:
        R, q: (3, 3), (4,) orientation, object to world; omega: (3,) angular velocity, world axes [rad/s].
        q_d, omega_d, alpha_d: the reference's orientation, angular velocity and acceleration, likewise.
        belief: the object, the law and the contacts' mean, see `compiled_step.Belief`.
    """
    feedforward, kp, kd, c = belief.law
    mass, inertia, gravity = belief.mass, belief.inertia, belief.gravity
    pivot, offset, wrench_map = belief.pivot, belief.offset, belief.wrench_map
    e0, e1, e2 = rotation_error(q, q_d)
    w0, w1, w2 = into(R, omega[0], omega[1], omega[2])
    v0, v1, v2 = into(R, omega_d[0], omega_d[1], omega_d[2])
    a0, a1, a2 = into(R, alpha_d[0], alpha_d[1], alpha_d[2])
    a0 = feedforward * a0 + kp * e0 + kd * (v0 - w0)
    a1 = feedforward * a1 + kp * e1 + kd * (v1 - w1)
    a2 = feedforward * a2 + kp * e2 + kd * (v2 - w2)
    # acceleration of the CoM on its arc about the pivot; of rho the turning part is -pivot
    r0, r1, r2 = -pivot[0], -pivot[1], -pivot[2]
    o0, o1, o2 = into(R, offset[0], offset[1], offset[2])
    t0, t1, t2 = cross(a0, a1, a2, r0 - o0, r1 - o1, r2 - o2)
    u0, u1, u2 = cross(w0, w1, w2, r0, r1, r2)
    n0, n1, n2 = cross(w0, w1, w2, u0, u1, u2)
    g0, g1, g2 = into(R, gravity[0], gravity[1], gravity[2])
    F0 = mass * (t0 + c * n0 - g0)
    F1 = mass * (t1 + c * n1 - g1)
    F2 = mass * (t2 + c * n2 - g2)
    L0 = inertia[0, 0] * w0 + inertia[0, 1] * w1 + inertia[0, 2] * w2
    L1 = inertia[1, 0] * w0 + inertia[1, 1] * w1 + inertia[1, 2] * w2
    L2 = inertia[2, 0] * w0 + inertia[2, 1] * w1 + inertia[2, 2] * w2
    k0, k1, k2 = cross(w0, w1, w2, L0, L1, L2)
    M0 = inertia[0, 0] * a0 + inertia[0, 1] * a1 + inertia[0, 2] * a2 + c * k0
    M1 = inertia[1, 0] * a0 + inertia[1, 1] * a1 + inertia[1, 2] * a2 + c * k1
    M2 = inertia[2, 0] * a0 + inertia[2, 1] * a1 + inertia[2, 2] * a2 + c * k2
    for row in range(wrench_map.shape[0]):
        out[row] = component(wrench_map, row, F0, F1, F2, M0, M1, M2)
