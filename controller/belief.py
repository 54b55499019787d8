"""What a controller believes, as arrays: the object, the contacts that hold it, and what makes the wrench.

The three are apart, because they change apart: an estimator learns the object, a new stance has other contacts, and
fingers make the wrench in another way than a free hand does.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.validate import Array, fail


class BelievedObject(NamedTuple):
    """The object that is moved.

    Attributes:
        mass: [kg].  inertia: (3, 3) about the centre of mass, object axes [kg m^2].
        gravity: (3,) world axes [m/s^2].
    """

    mass: float
    inertia: Array
    gravity: Array


class HeldContacts(NamedTuple):
    """The K contacts with the environment that are to stick: one stance.

    Attributes:
        points, offsets, frames, turning: (K, 3), (K, 3), (K, 3, 3) and (K,) of the contacts, see `fill_jacobian`.
        pivot: (3,) from the CoM to the point that stays put (the contacts' mean), or rolls, object axes [m].
        offset: (3,) from there to where it touches (the contacts' mean), world axes [m].
        mu: (K,) that may be used.  f_min: (K,) floors of the normal forces [N].
        force_map: (3, d), see `Space`.  Q_f: (K d, K d) weight of the contact forces, see `WrenchProblem`.
    """

    points: Array
    offsets: Array
    frames: Array
    turning: NDArray[np.bool_]
    pivot: Array
    offset: Array
    mu: Array
    f_min: Array
    force_map: Array
    Q_f: Array


class WrenchSource(NamedTuple):
    """What makes the wrench; today a free wrench, whose components act as they are.

    Attributes:
        map: (nw, 6) the components among force and moment about the CoM, object axes, see `Space`.
        Q_w: (nw, nw) weight of the wrench, see `WrenchProblem`.
    """

    map: Array
    Q_w: Array


class BelievedSet(NamedTuple):
    """What the controller does not know, see `Uncertainty`; of friction and of errors of theta the contacts tell.

    Attributes:
        mass: (2,) [kg].  com: (3, 2) from the believed CoM, object axes [m].  inertia: (2,) factors.
        about_contact: whether these are on the inertia about the contact.
        push: greatest disturbance, in any direction, at the true CoM, per true mass [N/kg].
        spin: greatest error of the measured angular velocity [rad/s].
        axes: (A, 3) about which the object can turn, object axes, see `free_axes`.
        spread: (3 K, 6) contact forces of a wrench on the object, all in object axes, that do not squeeze each other.
    """

    mass: Array
    com: Array
    inertia: Array
    about_contact: bool
    push: float
    spin: float
    axes: Array
    spread: Array


class Belief(NamedTuple):
    """All that the compiled step has to know.

    Attributes:
        law: (feedforward, kp, kd, velocity_terms), see `Law`.
        unknown: None where all is believed to be known.
    """

    object: BelievedObject
    contacts: HeldContacts
    source: WrenchSource
    law: tuple[float, float, float, float]
    unknown: BelievedSet | None = None


SHARED = ("turning", "force_map", "map", "about_contact")  # arrays that are the same for all worlds


def for_worlds(beliefs: Sequence[Belief]) -> tuple[tuple[object, ...], tuple[object, ...] | None]:
    """The beliefs of W worlds, or one that they share, as `step_worlds` takes them.

    Returns:
        The values of `Belief` and of its parts in plain tuples, all but the `SHARED` with a leading axis of W or 1; and
        those of the sets apart from them, because what is None is left out by the compiler if it is an argument.

    Raises:
        ValueError: they are not of one law and of as many contacts of the same kind; the first that differs is named.
    """
    first = beliefs[0]
    for i, other in enumerate(beliefs):
        if other.law != first.law or _kind(other) != _kind(first):
            raise fail(
                f"controller[{i}]",
                "one of another law or other contacts",
                "one with the law of controller[0], and as many contacts of the same kind",
            )
    stacked = (_stacked(parts) for parts in ([belief[part] for belief in beliefs] for part in range(3)))
    unknown = None if first.unknown is None else _stacked([belief.unknown for belief in beliefs])
    return (*stacked, first.law), unknown


def _kind(belief: Belief) -> list[object]:
    """What the beliefs of one fleet have in common: the shapes of all arrays, which contacts turn, of what set."""
    unknown = () if belief.unknown is None else belief.unknown
    shapes = [np.shape(value) for part in (*belief[:3], unknown) for value in part]
    return [*shapes, *belief.contacts.turning.tolist(), belief.unknown is not None and belief.unknown.about_contact]


def _stacked(parts: Sequence[Any]) -> tuple[object, ...]:
    """One part of the beliefs of all worlds."""
    return tuple(
        getattr(parts[0], name) if name in SHARED else np.stack([np.asarray(getattr(part, name)) for part in parts])
        for name in parts[0]._fields
    )
