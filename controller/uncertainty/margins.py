"""Margins of a wrench: by how much the world may differ from what is believed before a contact gives way."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pivoting.controller.belief import BelievedSet
from pivoting.controller.rotations import rotation_matrix
from pivoting.controller.uncertainty.first_loss import first_loss, last_held
from pivoting.controller.uncertainty.grip import HELD, Beliefs, GivenWrench
from pivoting.controller.uncertainty.uncertainty import Interval
from pivoting.controller.validate import Array, InputError

if TYPE_CHECKING:  # which has them as a method
    from pivoting.controller.wrench_controller import WrenchController

MOST_SCALE = 100.0  # of a set; beyond, `Margins.wrench_scale` is infinite
MOST = 10.0  # times the nominal value, the weight, or the natural speed or rate: farther no unknown is looked for
FARTHEST = 2.0  # levers that the centre of mass is looked for on either side
SCALE_TOLERANCE, TOLERANCE = 1e-7, 1e-9  # of the scale of a set, and of what is looked for on these lines
NOTHING = Interval(np.nan, np.nan)  # where not even the nominal member is held


class FrictionalStability(NamedTuple):
    """How much friction compensates for, in the sense of the frictional stability margin of Shirai, Jha, Raghunathan
    and Romeres ("Robust pivoting", 2022, arXiv 2203.11412).

    They pivot an object at rest with a finger, take its weight, or the place of its centre of mass, to be uncertain one
    at a time, keep the finger's force, and ask which deviations the contacts with the environment can balance within
    their friction cones. Here one contact sticks at P, and can balance no moment about it. Instead, the
    object begins to turn, and the contact also bears what that takes. With the symbols of `worst_planar_force`, of the
    nominal member under this wrench the contact force is affine in either deviation:

        f(e) = f(0) + e [kappa / m (r x g') r' - g'],   f(s) = f(0) + s kappa (t x g) r',   g' = g / |g|,

    and the margins are the ends of the interval of e or s in which it is in the cone, above the floor. In space the
    same is done with Euler's equations. The inertia does not deviate, other than for `Margins.mass` and `Margins.com`.

    Attributes:
        weight: deviations e of the weight [N], which acts at the believed place.
        com: (d - 1) deviations s [m], along the first contact's tangents, of the line on which the weight acts.
    """

    weight: Interval
    com: tuple[Interval, ...]


@dataclass(frozen=True, eq=False)
class Margins:
    """By how much a wrench, as it is applied at one state, holds the contacts of all members of a set.

    With the wrench the torque about the contact is given, whatever law it comes from, and so is the contact force of
    every member. All is counted with the arithmetic of the guarantee, see `WrenchController.guarantee`: where that
    bounds the set from outside, slack and scales are bounds from below. Of two contacts the best squeeze counts, for
    each member its own (weak stability).

    How far an unknown alone may move is an interval of its values, in which nothing is lost from the nominal value to
    both ends. An end is infinite, or 0 of what is positive, where nothing is lost as far as was looked: up to 10 times
    the nominal value; 2 levers for the centre of mass; 10 times the natural speed sqrt(g lever) or rate sqrt(g / lever)
    for disturbances. All ends are nan if not even the nominal member is held. Those of mass, com, inertia and mu are
    exact; in the plane those of shove and omega are, too, and the others are bounds from below.

    Attributes:
        slack: the least of f_n - |f_t| / mu and f_n - f_min over all members and contacts [N]; negative where one gives
            way. mu is what may be used of the least friction, (1 - margin) mu. With an error of theta in the set, the
            cones are those that it narrows.
        share: slack over the mean normal force that the controller reckons with; -inf where that presses nothing.
        wrench_scale: the greatest scale of the set for which this wrench, as it is, holds every member, to 1e-6; 0 if
            it does not even hold the nominal one, inf beyond 100 or beyond every set that there is, see
            `Uncertainty.widest`. For a wrench that was computed for the set it is >= 1, but for rounding. (The greatest
            scale for which there is any wrench is another number.) nan without a set, of which there is no scale.
        friction: the share by which all friction coefficients of the set may be less with every member still held;
            negative if more is needed, -inf if 10 times as much is not enough.
        mass: [kg].  com: for each axis, from the point that the controller takes for it, object axes [m].
        inertia: factor.  mu: of every contact.  shove: [N s/kg].  theta: [rad].  omega: [rad/s].
        stability: the frictional stability margin.
    """

    slack: float
    share: float
    wrench_scale: float
    friction: float
    mass: Interval
    com: tuple[Interval, ...]
    inertia: Interval
    mu: Interval
    shove: Interval
    theta: Interval
    omega: Interval
    stability: FrictionalStability


def margins(controller: "WrenchController", orientation: Array, omega: Array, wrench: ArrayLike) -> Margins:
    """See `WrenchController.margins`; the state is (4,) and (3,), as `Space.lift_motion` gives it."""
    beliefs, grip = Beliefs(controller), GivenWrench(controller, orientation, omega, wrench)
    slack, share = slack_and_share(beliefs, grip)
    scale = np.nan if controller.uncertainty is None else wrench_scale(beliefs, grip)
    alone, stability = _Alone(beliefs, grip), _stability(beliefs, grip, rotation_matrix(orientation))
    return Margins(slack, share, scale, _friction(beliefs, grip), *alone.intervals(), stability)


def slack_and_share(beliefs: Beliefs, grip: GivenWrench) -> tuple[float, float]:
    """`Margins.slack` and `Margins.share`."""
    slack = grip.slack(beliefs.whole)
    return slack, share_of(slack, grip.normal(beliefs.believed))


def share_of(slack: float, normal: float) -> float:
    """A slack as a share of a normal force [N]; -inf of one that presses nothing."""
    return slack / normal if normal > 0.0 else -np.inf


def wrench_scale(beliefs: Beliefs, grip: GivenWrench, near: float = 1.0) -> float:
    """`Margins.wrench_scale`, searched for from `near` on."""

    def slack(scale: float) -> float:
        try:
            return grip.slack(beliefs.of_set(beliefs.known.scaled(scale))) + _allowed(beliefs)
        except InputError:  # the error of theta leaves no friction
            return -np.inf

    if not slack(0.0) >= 0.0:
        return 0.0
    most = min(MOST_SCALE, (1.0 - SCALE_TOLERANCE) * beliefs.known.widest)
    held, tried = 0.0, min(near, most) if near > 0.0 else min(1.0, most)
    while slack(tried) >= 0.0:
        if tried >= most:
            return np.inf
        held, tried = tried, min(2.0 * tried, most)
    return last_held(slack, held, tried, SCALE_TOLERANCE)


def _allowed(beliefs: Beliefs) -> float:
    """What counts as rounding [N]."""
    return HELD * beliefs.controller.units.force


def _friction(beliefs: Beliefs, grip: GivenWrench) -> float:
    """`Margins.friction`."""

    def slack(factor: float) -> float:
        held = beliefs.whole.contacts
        belief = beliefs.whole._replace(contacts=held._replace(mu=factor * held.mu))
        return factor * (grip.slack(belief) + _allowed(beliefs))

    if slack(MOST) < 0.0:
        return -np.inf
    return 1.0 - (0.0 if slack(TOLERANCE) >= 0.0 else last_held(slack, MOST, TOLERANCE, TOLERANCE))


class _Alone:
    """How far each unknown alone may move."""

    def __init__(self, beliefs: Beliefs, grip: GivenWrench):
        self._beliefs, self._grip, self._allowed = beliefs, grip, _allowed(beliefs)
        units = beliefs.controller.units
        self._reach, pull = units.length, units.force / beliefs.controller.body.mass
        self._speed = MOST * float(np.sqrt(pull * units.length))
        self._rate = self._speed / units.length

    def intervals(self) -> tuple[Interval, tuple[Interval, ...], Interval, Interval, Interval, Interval, Interval]:
        """Of mass, com, inertia, mu, shove, theta and omega, as `Margins` has them."""
        beliefs, member = self._beliefs, self._beliefs.member
        dim = beliefs.controller.space.dim
        if not self._slack(member) >= 0.0:
            return NOTHING, (NOTHING,) * dim, NOTHING, NOTHING, NOTHING, NOTHING, NOTHING
        seconds, mass = beliefs.known.shove_seconds, float(member.mass[0])
        axes = beliefs.controller.space.lift(np.eye(dim))
        return (
            self._positive(lambda x: member._replace(mass=np.full(2, x)), mass),
            tuple(self._coordinate(member, axis) for axis in axes),
            self._positive(lambda x: member._replace(inertia=np.full(2, x)), 1.0),
            self._mu(),
            self._disturbance(lambda x: self._slack(member._replace(push=x / seconds)), self._speed),
            self._disturbance(self._tilted, 0.25 * np.pi),
            self._disturbance(lambda x: self._slack(member._replace(spin=x)), self._rate),
        )

    def _slack(self, member: BelievedSet) -> float:
        return self._grip.slack(self._beliefs.of_member(member)) + self._allowed

    def _positive(self, member: Callable[[float], BelievedSet], nominal: float) -> Interval:
        """Of what is positive."""

        def slack(x: float) -> float:
            return self._slack(member(x))

        low = first_loss(slack, nominal, TOLERANCE * nominal, TOLERANCE * nominal)
        high = first_loss(slack, nominal, MOST * nominal, TOLERANCE * nominal)
        return Interval(0.0 if low is None else low, np.inf if high is None else high)

    def _coordinate(self, member: BelievedSet, axis: Array) -> Interval:
        """Of the centre of mass along an axis (3,)."""
        middle = float(member.com[:, 0] @ axis)

        def slack(x: float) -> float:
            return self._slack(member._replace(com=member.com + ((x - middle) * axis)[:, None]))

        return _either_way(slack, middle, FARTHEST * self._reach)

    def _mu(self) -> Interval:
        """Of all friction coefficients, of which only what is missing matters."""

        def slack(mu: float) -> float:
            return mu * (self._grip.slack(self._beliefs.of_member(self._beliefs.member, mu)) + self._allowed)

        most = float(self._beliefs.mu.max())
        none = slack(TOLERANCE * most) >= 0.0
        return Interval(0.0 if none else last_held(slack, most, TOLERANCE * most, TOLERANCE * most), np.inf)

    def _disturbance(self, slack: Callable[[float], float], most: float) -> Interval:
        """Of what is bounded either way."""
        if slack(0.0) < 0.0:
            return NOTHING
        farthest = np.inf if slack(most) >= 0.0 else last_held(slack, 0.0, most, TOLERANCE * most)
        return Interval(-farthest, farthest)

    def _tilted(self, theta: float) -> float:
        try:
            return self._grip.slack(self._beliefs.tilted(theta)) + self._allowed
        except InputError:  # it leaves no friction
            return -np.inf


def _stability(beliefs: Beliefs, grip: GivenWrench, R: Array) -> FrictionalStability:
    """The margins of `FrictionalStability`."""
    controller, belief = beliefs.controller, beliefs.of_member(beliefs.member)
    held, allowed, gravity = belief.contacts, _allowed(beliefs), belief.object.gravity
    frame = held.frames[0] if held.turning[0] else R.T @ held.frames[0]
    tangents = (frame @ controller.space.force_map).T[:-1]
    weight = float(beliefs.member.mass[0]) * (R.T @ gravity)  # object axes
    size = float(np.linalg.norm(weight))
    if not grip.slack(belief) + allowed >= 0.0 or size == 0.0:
        return FrictionalStability(NOTHING, (NOTHING,) * len(tangents))

    def heavier(more: float) -> float:
        heavy = belief.object._replace(gravity=gravity * (1.0 + more / size))
        return grip.slack(belief._replace(object=heavy)) + allowed

    def shifted(tangent: Array, by: float) -> float:
        moment = np.cross(by * tangent, weight)
        return grip.slack(belief, grip.wrench + belief.source.map @ np.r_[np.zeros(3), moment]) + allowed

    return FrictionalStability(
        _either_way(heavier, 0.0, MOST * size),
        tuple(_either_way(partial(shifted, each), 0.0, FARTHEST * controller.units.length) for each in tangents),
    )


def _either_way(slack: Callable[[float], float], middle: float, reach: float) -> Interval:
    """The values on either side, as far as `reach`, up to which nothing is lost; infinite where nothing is."""
    ends = [first_loss(slack, middle, middle + way * reach, TOLERANCE * reach) for way in (-1.0, 1.0)]
    return Interval(-np.inf if ends[0] is None else ends[0], np.inf if ends[1] is None else ends[1])
