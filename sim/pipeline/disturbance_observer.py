"""Disturbance observer: the moment that the model does not explain is estimated, and taken away by the law."""

import numpy as np
from pivoting.controller.rotations import CONJUGATE, rotated
from pivoting.controller.validate import Array, fail
from pivoting.controller.wrench_controller import WrenchController
from pivoting.sim.pipeline.bounded_control import applied
from pivoting.sim.pipeline.stages import Desired, Setting, States


class DisturbanceObserver:
    """A momentum observer (De Luca and Mattone 2003) of the unknown moment D about the contact.

    The angular momentum L about the contact changes by the moments of the wrench, of gravity and D, and the estimate r
    follows D with a lag of 1 / rate: r' = rate (D - r). The law's acceleration is reduced by what r would make, so that
    a constant D, such as that of a mass or a centre of mass that are not as believed, leaves no steady error.

    A world whose state is no number keeps its estimate.

    There is nothing that winds up while bounds hold the wrench back: the observer counts the wrench that was given,
    within its bounds, and not the one that the law would have liked.

    Args:
        rate: at which the estimate follows [1/s].

    Raises:
        ValueError: the law asks for no acceleration, the rate is too high for the time step, or the object rolls or has
            more than two contacts.
    """

    slot = "observe"

    def __init__(self, rate: float, setting: Setting):
        if not setting.law.feedforward:
            raise fail(
                "disturbance",
                rate,
                f"0 with law={setting.law.formulation}, which follows no acceleration; or law=dynamic",
            )
        if rate * setting.dt >= 1.0:
            raise fail("disturbance", rate, f"< 1 / dt = {1.0 / setting.dt:g} 1/s")
        first = setting.controllers[0].belief
        if first.contacts.offsets.any() or len(first.contacts.points) > 2:
            raise fail("disturbance", rate, "0 where the object rolls, or has more than two contacts")
        self._rate, self._dt, self._map = rate, setting.dt, setting.controllers[0].space.wrench_map
        self._gravity = first.object.gravity
        self._levers = np.array([-each.belief.contacts.pivot for each in setting.controllers])
        self._masses = np.array([[each.belief.object.mass] for each in setting.controllers])
        self._inertias = np.array([_about_contact(each) for each in setting.controllers])
        self._axis = _only_axis(setting.controllers[0])
        self._before: Array | None = None
        self._expected = self._unexplained = np.zeros((setting.worlds, 3))

    def __call__(self, k: int, measured: States, applied_before: Array | None) -> States:
        """The states as they are, after the estimate has taken in what they say."""
        seen = np.isfinite(measured.values).all(axis=1, keepdims=True)
        q = np.array(measured.orientation)
        if self._before is not None:
            q = np.where(seen, q, self._before)
        momentum = rotated(q, _times(self._inertias, rotated(q * CONJUGATE, measured.angular_velocity)))
        given = applied(applied_before)
        if given is None or self._before is None:
            self._expected, self._unexplained = momentum, np.zeros_like(momentum)
        else:
            self._expected = self._expected + self._dt * (self._known(self._before, given) + self._unexplained)
            self._unexplained = np.where(seen, self._rate * (momentum - self._expected), self._unexplained)
        self._before = q
        return measured

    def correct(self, states: States, desired: Desired) -> Desired:
        """The reference with an acceleration that makes up for the unexplained moment."""
        q = states.orientation
        back = q * CONJUGATE
        moment = rotated(back, self._unexplained)
        if self._axis is None:
            made = np.linalg.solve(self._inertias, moment[..., None])[..., 0]
        else:
            made = (moment @ self._axis / (_times(self._inertias, self._axis) @ self._axis))[:, None] * self._axis
        corrected = Desired(np.broadcast_to(desired.values, (len(states.values), desired.values.shape[1])).copy())
        corrected.angular_acceleration[:] -= rotated(q, made)
        return corrected

    def _known(self, q: Array, wrench: Array) -> Array:
        """(W, 3) the moment about the contact of wrenches and of gravity, world axes."""
        acting = wrench @ self._map
        moment = acting[:, 3:] + np.cross(self._levers, acting[:, :3])
        return rotated(q, moment) + np.cross(rotated(q, self._masses * self._levers), self._gravity)


def _times(matrices: Array, vectors: Array) -> Array:
    """(W, 3) of matrices (W or 1, 3, 3) and vectors (W or 1, 3)."""
    return np.asarray((matrices @ vectors[..., None])[..., 0])


def _about_contact(controller: WrenchController) -> Array:
    """(3, 3) the believed inertia about the contact, object axes."""
    belief = controller.belief
    c = belief.contacts.pivot
    return belief.object.inertia + belief.object.mass * (c @ c * np.eye(3) - np.outer(c, c))


def _only_axis(controller: WrenchController) -> Array | None:
    """(3,) the object axis about which alone the contacts transmit no moment; None: they transmit none about any."""
    points = controller.belief.contacts.points
    if controller.space.dim == 2:
        return np.array([0.0, 1.0, 0.0])
    return None if len(points) == 1 else (points[1] - points[0]) / np.linalg.norm(points[1] - points[0])
