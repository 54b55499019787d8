"""Laws: which wrench the object needs, from its state and where it should be; one law, chosen by its coefficients."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
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
