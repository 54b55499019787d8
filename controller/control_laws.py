"""Control laws, which choose the angular acceleration of the object from its state and its reference."""

from dataclasses import dataclass
from typing import Self

from numpy.typing import ArrayLike
from pivoting.controller.validate import dimensions, number, one_of, positive_definite

FASTEST = 1e150  # [1/s], whose square is a number
FORMULATIONS = ("static", "quasi-dynamic", "quasi-dynamic-velocity", "dynamic")


@dataclass(frozen=True, eq=False)
class Body:
    """The mass and the inertia of the object.

    Attributes:
        mass: [kg].
        inertia: about the CoM [kg m^2]; in the plane a number, in space (3, 3) in object axes.
    """

    mass: float
    inertia: float | ArrayLike

    def __post_init__(self) -> None:
        number("mass", self.mass, above=0.0, unit="kg")
        if dimensions(self.inertia) == 0:
            number("inertia", self.inertia, above=0.0, unit="kg m^2")  # type: ignore[arg-type]
        else:
            positive_definite("inertia", self.inertia, 3)


@dataclass(frozen=True)
class Law:
    """A control law: how the object is to accelerate, given its state and its reference, and which forces that takes.

    The angular acceleration about the contact is alpha = feedforward alpha_d + kp e + kd (omega_d - omega), where e is
    the error of the orientation. The wrench that contacts and actuator must make together is then
    (m (a - g), I alpha + c omega x I omega), with a = alpha x rho + c omega x (omega x rho) and rho from the contact to
    the CoM. The coefficient c is 1 if the law takes velocities into account, and otherwise 0. On a ball of radius s,
    which rolls, v = omega x (s n - R p), and the normal n does not turn: alpha acts on rho = s n - R p, and
    omega x (omega x .) only on the part of it that turns, -R p.
    The formulations of the notes are choices of these four coefficients:

    - static: all are zero. The wrench balances the object, J f + w + m g = 0, and corrects no errors.
    - quasi-dynamic: kp = 1/h^2, the others are zero: M (q_d - q)/h^2 = J f + w + m g. An object that keeps its velocity
      oscillates under this law (erratum 7), because the law assumes that the velocity is zero.
    - quasi-dynamic-velocity: kd = 1/h in addition: M (q_d(t + h) - q - h v)/h^2 = J f + w + m g, with q_d(t + h) to
      first order in h. The velocity counts where it moves the pose, but still not in the forces (c = 0).
    - dynamic: feedforward of the reference's acceleration, feedback of angle and rate, and the velocity terms.

    Attributes:
        formulation: one of `FORMULATIONS`.
        kp: gain of the angle [1/s^2].  kd: gain of the rate [1/s].  feedforward: 0 or 1.
        velocity_terms: c, 0 or 1.
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
        """The law that only balances the object where it is: the first program of the notes."""
        return cls("static", 0.0, 0.0, 0.0, 0.0)

    @classmethod
    def quasi_dynamic(cls, h: float, *, velocity: bool = False) -> Self:
        """The quasi-dynamic law of the notes, which assumes that every step starts from rest.

        Args:
            h: length of a step [s], at the end of which the object is to be on the reference.
            velocity: let the step start with the velocity that the object has, not from rest; see erratum 7.
        """
        kp = number("h", h, above=0.0, at_least=1.0 / FASTEST, unit="s") ** -2
        if velocity:
            return cls("quasi-dynamic-velocity", kp, 1.0 / h, 0.0, 0.0)
        return cls("quasi-dynamic", kp, 0.0, 0.0, 0.0)

    @classmethod
    def dynamic(cls, bandwidth: float = 40.0, damping: float = 1.0) -> Self:
        """Let errors decay like an oscillator of frequency `bandwidth` [rad/s] and damping ratio `damping`."""
        number("bandwidth", bandwidth, above=0.0, at_most=FASTEST, unit="rad/s")
        number("damping", damping, above=0.0)
        return cls("dynamic", bandwidth**2, 2.0 * damping * bandwidth, 1.0, 1.0)

    @property
    def coefficients(self) -> tuple[float, float, float, float]:
        """(feedforward, kp, kd, velocity_terms), the order that the compiled law expects."""
        return float(self.feedforward), float(self.kp), float(self.kd), float(self.velocity_terms)
