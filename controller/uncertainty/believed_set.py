"""What a controller makes of its uncertainty: arrays for the compiled step, and the cones that its contacts keep to."""

from collections.abc import Sequence

import numpy as np
from pivoting.controller.belief import BelievedSet
from pivoting.controller.contacts import Contact
from pivoting.controller.control_laws import Body
from pivoting.controller.mobility import free_axes
from pivoting.controller.plane_and_space import Space
from pivoting.controller.uncertainty.uncertainty import Uncertainty
from pivoting.controller.validate import Array, fail


def check_set(uncertainty: Uncertainty, body: Body, contacts: Sequence[Contact]) -> None:
    """Refuse a set that no guarantee can be given for.

    Raises:
        ValueError: it is of another dimension, does not hold what is believed, or the contacts roll.
    """
    if not isinstance(uncertainty, Uncertainty):
        raise fail("uncertainty", uncertainty, "an Uncertainty")
    if uncertainty.dim != contacts[0].dim:
        raise fail("uncertainty.com", uncertainty.com, f"of {contacts[0].dim} intervals, for these contacts")
    mass = uncertainty.mass
    if mass is not None and not mass.low <= body.mass <= mass.high:
        raise fail("uncertainty.mass", mass, f"such that the believed mass of {body.mass:g} kg is in it")
    if not uncertainty.inertia.low <= 1.0 <= uncertainty.inertia.high:
        raise fail("uncertainty.inertia", uncertainty.inertia, "such that 1, the believed inertia, is in it")
    if any(contact.radius > 0.0 for contact in contacts):
        raise fail("uncertainty", uncertainty, "left out: of contacts that roll nothing is guaranteed")


def believed_set(
    uncertainty: Uncertainty, body: Body, gravity: Array, points: Array, pivot: Array, space: Space
) -> BelievedSet:
    """The set as the compiled step takes it.

    Args:
        gravity: (3,) world axes.  points: (K, 3) contacts from the believed CoM.  pivot: (3,) their mean; object axes.
    """
    axes = np.ascontiguousarray(free_axes(points, pivot, space.wrench_map))
    return set_about(uncertainty, body, gravity, space, axes, _spread(points))


def set_about(
    uncertainty: Uncertainty, body: Body, gravity: Array, space: Space, axes: Array, spread: Array
) -> BelievedSet:
    """The same for contacts whose `axes` and `spread`, see `BelievedSet`, are known already.

    An error of the measured orientation tilts gravity against what is believed, like a push, and the contact's axes.
    """
    mass = (body.mass, body.mass) if uncertainty.mass is None else uncertainty.mass
    tilt = greatest(uncertainty.theta)
    shove = greatest(uncertainty.shove) / uncertainty.shove_seconds
    return BelievedSet(
        mass=np.array(mass, dtype=float),
        com=np.ascontiguousarray(space.lift(uncertainty.com.T).T),
        inertia=np.array(uncertainty.inertia),
        about_contact=uncertainty.about == "contact",
        push=shove + 2.0 * float(np.linalg.norm(gravity)) * np.sin(0.5 * tilt),
        spin=greatest(uncertainty.omega),
        axes=axes,
        spread=spread,
    )


def vertices(unknown: BelievedSet) -> int:
    """How many members the set has at the ends of its intervals, for each of which `state_cones` moves the cones."""
    widths = [np.ptp(unknown.mass), np.ptp(unknown.inertia), *np.ptp(unknown.com, axis=1)]
    return int(2 ** np.count_nonzero(widths))


def _spread(points: Array) -> Array:
    """(3 K, 6) the smallest contact forces that make a wrench; moments count in units of the contacts' lever."""
    size = float(np.linalg.norm(points, axis=1).max())
    x, y, z = points.T
    zero = np.zeros_like(x)
    wedge = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)  # r x f = wedge f
    grasp = np.concatenate([np.concatenate([np.eye(3), each / size]) for each in wedge], axis=1)
    return np.ascontiguousarray(np.linalg.pinv(grasp, rcond=1e-9) / np.array([1.0, 1.0, 1.0, size, size, size]))


def guarded_cones(uncertainty: Uncertainty, contacts: Sequence[Contact], margin: float) -> tuple[Array, Array]:
    """Friction (K,) that may be used and floors (K,) [N] of every member, however the contact's axes are tilted.

    Raises:
        ValueError: no friction is left.
    """
    low = [contact.mu if uncertainty.mu is None else uncertainty.mu.low for contact in contacts]
    tilt, floors = greatest(uncertainty.theta), np.array([contact.f_min for contact in contacts])
    mu = np.tan(np.arctan((1.0 - margin) * np.array(low)) - tilt)
    if not (mu > 0.0).all() or tilt > 0.25 * np.pi:
        raise fail("uncertainty.theta", uncertainty.theta, f"less than the cone's half-angle, of mu = {min(low):g}")
    return mu, floors / (np.cos(tilt) - mu * np.sin(tilt))


def greatest(interval: tuple[float, float]) -> float:
    """The greatest deviation from 0."""
    return max(-interval[0], interval[1])
