"""Identification: what a whole log tells of each parameter, by which measurement, and what it cannot tell, and why."""

from dataclasses import dataclass

import numpy as np
from pivoting.controller.learning.balances import Balances, Cuts
from pivoting.controller.learning.friction import FrictionBounds, friction_bounds
from pivoting.controller.learning.isolating_windows import isolating_windows
from pivoting.controller.learning.least_squares import RecursiveLeastSquares
from pivoting.controller.learning.motion_log import SLIDES, MeasurementErrors, MotionLog
from pivoting.controller.learning.parameters import Parameter, Seen, com_of, narrower, parameters
from pivoting.controller.learning.polytope import Polytope
from pivoting.controller.learning.set_membership import SetMembership
from pivoting.controller.learning.unknowns import Unknowns
from pivoting.controller.learning.windows import windows
from pivoting.controller.rotations import rotation_matrix
from pivoting.controller.uncertainty.uncertainty import Interval, Uncertainty
from pivoting.controller.validate import Array, fail, frozen

ANY = Interval(0.0, np.inf)  # friction coefficient of which nothing is known


@dataclass(frozen=True, eq=False)
class Identification:
    """What a log tells of the object.

    Attributes:
        parameters: each with its interval before and after.
        uncertainty: the set for the controller, once it takes the centre of mass to be `shift` from where it did. It is
            made of independent intervals, and larger than `set`: in that, mass and centre of mass hang together by
            their product, which is known better than either, and the inertia with both of them.
        shift: (d,) to the middle of where the centre of mass may be, object axes [m].
        set: all values of the `unknowns` that no measurement excludes.
        resets: how often measurements contradicted each other, the prior, or their bounds: some bound is wrong then,
            and nothing is guaranteed.
        cuts: how many pairs of half-spaces the set was intersected with.
    """

    parameters: tuple[Parameter, ...]
    uncertainty: Uncertainty
    shift: Array
    unknowns: Unknowns
    set: Polytope
    resets: int
    cuts: int

    @property
    def consistent(self) -> bool:
        """Whether the measurements agree with the prior and with the bounds on their errors."""
        return self.resets == 0


def identify(log: MotionLog, errors: MeasurementErrors, unknowns: Unknowns, *, several: bool = False) -> Identification:
    """Learn from a log by both estimators, first from its motion and then from its contact forces, if it has any.

    Args:
        several: whether the contact force is a sum over several contacts, see `friction_bounds`.

    Raises:
        ValueError: there is too little in the log to learn from.
    """
    estimator, squares = SetMembership(unknowns), RecursiveLeastSquares(unknowns)
    stages, seen, count = [estimator.set], [], 0
    for make in (moment_cuts, force_cuts):
        cuts = make(log, errors, unknowns)
        count += len(cuts.values)
        seen.append(_visible(unknowns, cuts, estimator.prior))
        squares.update(cuts)
        estimator.update(cuts)
        stages.append(estimator.set)
    if count == 0:
        raise fail("log", f"{log.steps} steps", "at least 16 steps on end in which the contact sticks")
    friction, contradicted = _friction(log, errors, unknowns, several)
    found = parameters(unknowns, (stages[0], stages[1], stages[2]), squares.mean, Seen(*seen))
    uncertainty, shift = _for_the_controller(unknowns, found, friction)
    resets = estimator.resets + contradicted
    return Identification((*found, friction), uncertainty, shift, unknowns, estimator.set, resets, count)


def moment_cuts(log: MotionLog, errors: MeasurementErrors, unknowns: Unknowns) -> Cuts:
    """The cuts of all windows in which the contact sticks."""
    balances, prior = Balances(log, errors, unknowns), unknowns.polytope
    found = windows(log.sticking) + isolating_windows(balances, log.sticking, prior.low, prior.high)
    cuts = [balances.moments(window) for window in found]
    if log.angular_velocity is not None:
        spans = {(window.first, window.last): window for window in found}  # of which the shape does not matter here
        cuts += [balances.rates(window) for window in spans.values()]
    return Cuts.together(cuts)


def force_cuts(log: MotionLog, errors: MeasurementErrors, unknowns: Unknowns) -> Cuts:
    """The cuts of all windows in which all forces are known."""
    balances = Balances(log, errors, unknowns)
    return Cuts.together([balances.forces(window) for window in windows(log.weighed)])


def _visible(unknowns: Unknowns, cuts: Cuts, prior: Polytope) -> Array:
    """(n,) by how much each unknown could change a balance, over its error, at most; see `Seen`."""
    middle = 0.5 * (prior.low + prior.high)
    if not len(cuts.values):
        return np.zeros(len(middle))
    error = unknowns.select(cuts.spreads) @ middle + cuts.errors
    changes = np.abs(unknowns.select(cuts.rows)) * (prior.high - prior.low)
    return (changes / np.maximum(error, 1e-12 * changes.max() + 1e-300)[:, None]).max(axis=0)


def _friction(log: MotionLog, errors: MeasurementErrors, unknowns: Unknowns, several: bool) -> tuple[Parameter, int]:
    """The friction coefficient, and 1 where its bounds contradict the prior, else 0."""
    before = unknowns.prior.mu or ANY
    normal = rotation_matrix(log.space.base)[:, 2]
    bounds = friction_bounds(log, normal, errors.contact_force, several=several)
    after = bounds.within(before)
    if after is None:
        told = f"at least {bounds.used:.3g} was used without a slip, and at most {bounds.slipped:.3g} in one"
        return Parameter("mu", "", before, before, None, f"contradicts the prior: {told}", False), 1
    why = _why_friction(log, bounds, before, several)
    return Parameter("mu", "", before, after, None, why, narrower(before, after)), 0


def _why_friction(log: MotionLog, bounds: FrictionBounds, before: Interval, several: bool) -> str:
    said = []
    if bounds.used > before.low:
        said.append("friction that was used without a slip")
    if bounds.slipped < before.high:
        said.append("a slip")
    if said:
        return " and ".join(said)
    if np.isnan(log.contact_force).all():
        return "needs a measured contact force"
    if several and (log.contact == SLIDES).any():
        return "several contacts may slip in different directions"
    return "no slip, and no more friction was used than was known to be there"


def _for_the_controller(
    unknowns: Unknowns, found: tuple[Parameter, ...], friction: Parameter
) -> tuple[Uncertainty, Array]:
    """The intervals as a set, about the middle of where the centre of mass may be, and that middle."""
    prior, after = unknowns.prior, {each.name: each.after for each in found}
    coms = np.array([after[com_of(name)] for name in unknowns.moments])
    shift = coms.mean(axis=1)
    set_ = Uncertainty(
        mass=after["mass"],
        com=coms - shift[:, None],
        inertia=after["inertia"],
        mu=None if prior.mu is None and friction.after == ANY else _finite(friction.after),
        shove=prior.shove,
        shove_seconds=prior.shove_seconds,
        theta=prior.theta,
        omega=prior.omega,
    )
    return set_, frozen(shift)


def _finite(mu: Interval) -> Interval | None:
    """Of a set only the lower bound of the friction matters: without an upper one it stands for both."""
    if mu.low == 0.0:
        return None
    return mu if np.isfinite(mu.high) else Interval(mu.low, mu.low)
