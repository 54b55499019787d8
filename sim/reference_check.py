"""Whether a scenario's reference can be followed at all, found out before anything is simulated.

At moments along the reference, the object is where it is to be and moves as it is to move. The wrench problem of that
state has an answer within the bounds, or a certificate says that it has none.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.bounded_solver import BoundedSolver
from pivoting.controller.motion import Motion
from pivoting.controller.solvers.solve import solve
from pivoting.controller.uncertainty.farkas_certificate import FarkasCertificate
from pivoting.controller.uncertainty.feasibility import NO, UNDECIDED, YES, Feasibility, feasibility
from pivoting.controller.uncertainty.feasible_scale import FeasibleScale, feasible_scale
from pivoting.controller.validate import InputError, fail, number
from pivoting.controller.wrench_bounds import WrenchBounds
from pivoting.controller.wrench_controller import WrenchController
from pivoting.controller.wrench_problem import WrenchProblem
from pivoting.sim.run_setup import Begun, set_up
from pivoting.sim.scenario_control import known_drag
from pivoting.sim.scenarios.intervals import spelled
from pivoting.sim.scenarios.scenario import Scenario
from pivoting.sim.scenarios.scenario_keys import LOWEST
from pivoting.sim.scenarios.shipped_scenarios import scenario as find

Array = NDArray[np.float64]
POINTS = 50  # along a reference
OVER = 1e-9  # of a bound: a wrench that exceeds it by more is not within it


class CheckedMoment(NamedTuple):
    """One moment of a reference.

    Attributes:
        time: [s].  theta: [rad] of the reference.
        answer: "yes", "no" or "undecided".  margin: [N], see `Feasibility`; nan without bounds.
        wrench: (nw,) the smallest that will do, object axes [N, N m]; None if there is none.
        share: the greatest share of a bound that it uses; 0 without bounds.
        certificate: that there is none.
    """

    time: float
    theta: float
    answer: str
    margin: float
    wrench: Array | None
    share: float
    certificate: FarkasCertificate | None


@dataclass(frozen=True, eq=False)
class ReferenceCheck:
    """What was found of a reference.

    Attributes:
        scenario: as it was asked for.
        moments: all that were checked, in their order.
        scale: the least `feasible_scale` of all moments, and `scale_at` which; None without a set.
        bounds: on the wrench, SI units.  left_out: how many moments were not checked, and `why`; 0 and "".
        stability: what the grip is guaranteed to be, see `Guarantee`; "" without a set.
    """

    scenario: Scenario
    moments: tuple[CheckedMoment, ...]
    scale: FeasibleScale | None
    scale_at: CheckedMoment | None
    bounds: WrenchBounds
    left_out: int
    why: str
    stability: str

    @property
    def bounded(self) -> bool:
        """Whether anything but a rate is bounded."""
        return self.bounds.without_rates.any

    @property
    def answer(self) -> str:
        """ "no" if there is one moment without any wrench, else "undecided" if there is one of these, else "yes"."""
        found = {moment.answer for moment in self.moments}
        return next((answer for answer in (NO, UNDECIDED) if answer in found), YES)

    @cached_property
    def first(self) -> CheckedMoment | None:
        """The first moment whose answer is not "yes"; one with "no" before one that is undecided."""
        return next((moment for moment in self.moments if moment.answer == self.answer != YES), None)

    @property
    def tightest(self) -> CheckedMoment:
        """The moment with the least margin; the first without bounds."""
        return min(self.moments, key=lambda moment: np.nan_to_num(moment.margin, nan=np.inf))

    def largest(self, part: str) -> CheckedMoment | None:
        """The moment whose wrench has the largest `part`, "force" or "moment"; None: none has a wrench."""
        held = [moment for moment in self.moments if moment.wrench is not None]
        return max(held, key=lambda moment: sizes(moment)[part], default=None)

    @property
    def fullest(self) -> CheckedMoment | None:
        """The moment whose wrench uses the greatest share of a bound."""
        held = [moment for moment in self.moments if moment.wrench is not None]
        return max(held, key=lambda moment: moment.share, default=None)

    def summary(self) -> dict[str, Any]:
        """The same in numbers, SI units in the keys; what `pivoting check --json` prints."""
        fullest, least = self.fullest, self.tightest
        return {
            "scenario": self.scenario.name,
            "changes": {key: spelled(value) for key, value in self.scenario.changes.items()},
            "answer": self.answer,
            "bounded": self.bounded,
            "set": self.scale is not None,
            "stability": self.stability or None,
            "moments_checked": len(self.moments),
            "moments_left_out": self.left_out,
            "left_out_because": self.why or None,
            "first": None if self.first is None else _said(self.first, certificate=True),
            "least_margin": _said(least) if self.bounded else None,
            "feasible_scale": None if self.scale is None else self._scaled(self.scale),
            "largest_force": _said(self.largest("force")),
            "largest_moment": _said(self.largest("moment")),
            "largest_share": _said(fullest) if self.bounded else None,
            "moments": [_said(moment) for moment in self.moments],
        }

    def _scaled(self, scale: FeasibleScale) -> dict[str, Any]:
        certificate = None if scale.certificate is None else scale.certificate.as_dict()
        said = {"scale": scale.scale, "above": scale.above, "ends": scale.ends, "certificate": certificate}
        if self.scale_at is not None:
            said |= {"time_s": self.scale_at.time, "theta_deg": float(np.rad2deg(self.scale_at.theta))}
        return said


def sizes(moment: CheckedMoment) -> dict[str, float]:
    """|force| [N] and |moment| [N m] of the moment's wrench."""
    assert moment.wrench is not None
    dim = 2 if len(moment.wrench) == 3 else 3
    parts = moment.wrench[:dim], moment.wrench[dim:]
    return {"force": float(np.linalg.norm(parts[0])), "moment": float(np.linalg.norm(parts[1]))}


def _said(moment: CheckedMoment | None, certificate: bool = False) -> dict[str, Any] | None:
    if moment is None:
        return None
    said = {
        "time_s": moment.time,
        "theta_deg": float(np.rad2deg(moment.theta)),
        "answer": moment.answer,
        "margin_N": moment.margin,
        "wrench": None if moment.wrench is None else moment.wrench.tolist(),
        "bounds_used": moment.share,
    }
    if certificate:
        said["certificate"] = None if moment.certificate is None else moment.certificate.as_dict()
    return said


def check_reference(name: str | Scenario, points: int = POINTS, **overrides: Any) -> ReferenceCheck:
    """Find out at which moments of a scenario's reference a wrench within its bounds holds all worlds of its set.

    Where nothing is told as an interval, it is the one world that the controller believes in; without bounds on the
    wrench the answer is always yes. Bounds on rates are not considered. The object is taken to be on its reference:
    errors of its angle, and whatever sensors and actuators do, are not part of it.

    Args:
        name: of a shipped scenario, or a `Scenario`.
        points: how many moments, evenly spread over the time of the reference, the first and the last among them.
        overrides: keys of the scenario.

    Raises:
        ValueError: an unknown scenario or key, a value out of range, or a scenario with a receding horizon, which does
            not follow its reference exactly.
    """
    if not isinstance(name, str | Scenario):
        raise fail("scenario", name, "a name or a Scenario")
    asked = (find(name) if isinstance(name, str) else name).change(**overrides)
    asked.refuse_without_effect(overrides, open_loop=False)
    if asked.plan_hz is not None:
        raise fail("plan_hz", asked.plan_hz, "left out (none): a receding horizon decides on its motion as it goes")
    if not isinstance(points, int) or isinstance(points, bool) or points < 2:
        raise fail("points", points, "a whole number >= 2")
    number("points", points, at_most=10**6)
    begun = set_up(asked, None, worlds=1, seed=0, first_world=0)
    steps = np.unique(np.linspace(0, begun.steps, points).round().astype(int))
    kept, why = steps, ""
    if len(begun.belief.stances) > 1:
        landed = np.flatnonzero(begun.reference[0] <= np.deg2rad(LOWEST))
        kept = steps[steps < landed[0]] if landed.size else steps
        why = "once it has landed, the object is held by other contacts" if len(kept) < len(steps) else ""
    if not len(kept):
        raise fail("points", points, "more: none is before the object lands on other contacts")
    check = _Check(begun)
    moments = [check.at(k) for k in kept.tolist()]
    scale = None if check.controller.uncertainty is None else check.least_scale
    at = None if check.least_at is None else moments[kept.tolist().index(check.least_at)]
    case = begun.case
    return ReferenceCheck(asked, tuple(moments), scale, at, case.bounds(), len(steps) - len(kept), why, check.stability)


class _Check:
    """The checks of one scenario.

    Attributes:
        controller: whose problems are checked.
        least_scale: of all moments so far, and the step `least_at` of which it is.
    """

    def __init__(self, begun: Begun):
        stance = begun.belief.stances[0]
        self.controller: WrenchController = stance.controllers[0]
        self._begun, self._unit, self._drag = begun, begun.world.unit, known_drag(begun, stance)
        self._bounds = begun.bounds.without_rates
        self._solver = BoundedSolver(self.controller, self._bounds, begun.world.dt)
        self.least_scale = FeasibleScale(np.inf, np.inf, "nothing", None)
        self.least_at: int | None = None
        self._above: WrenchController | None = None  # that believes in the least scale at which something failed
        self.stability = ""

    def at(self, k: int) -> CheckedMoment:
        """Step k."""
        begun, drag = self._begun, self._drag
        state, desired = self._motions(k)
        external = drag[k % len(drag), 0]
        problem = self.controller.problem(state, desired, external=external)
        found = Feasibility(YES, np.nan) if not self._bounds.any else feasibility(problem, self._bounds)
        if self.controller.uncertainty is not None:
            self.stability = self.stability or self.controller.guarantee(state, desired).stability
            if self._bounds.any:
                self._scale(k, state, desired, external)
        wrench = self._smallest(problem, found, state, external) if found.answer == YES else None
        share = 0.0 if wrench is None or not self._bounds.any else 1.0 + self._bounds.excess(wrench)
        certificate = None if found.certificate is None else self._in_si(found.certificate)
        return CheckedMoment(
            float(begun.time[k]),
            float(begun.reference[0][k]),
            found.answer,
            self._unit * found.margin,
            None if wrench is None else self._wrench_in_si(wrench),
            share,
            certificate,
        )

    def _motions(self, k: int) -> tuple[Motion, Motion]:
        """Where the object is to be at step k: without and with its acceleration."""
        q, omega, alpha = (values[k] for values in self._begun.told)
        here = self.controller.space
        if here.dim == 3:
            return Motion(q, omega), Motion(q, omega, alpha)
        normal = here.axial(1.0)
        angle, rate = float(here.angle(q)), float(omega @ normal)
        return Motion(angle, rate), Motion(angle, rate, float(alpha @ normal))

    def _smallest(self, problem: WrenchProblem, found: Feasibility, state: Motion, external: Array) -> Array:
        """The smallest wrench within the bounds."""
        smallest = solve(problem).wrench
        if self._bounds.excess(smallest) <= OVER:
            return smallest
        q, omega, _ = self.controller.space.lift_motion(state)
        answer = self._solver(q, problem.required, None, omega, external)
        if answer.exact and answer.guaranteed:
            return answer.wrench
        assert found.wrench is not None
        return found.wrench

    def _scale(self, k: int, state: Motion, desired: Motion, external: Array) -> None:
        """Lower the least scale if that of step k is less."""
        if self.least_scale.scale == 0.0:
            return
        if self._above is not None:
            problem = self._above.problem(state, desired, external=external)
            if feasibility(problem, self._bounds).answer == YES:
                return
        known = self.controller.uncertainty
        assert known is not None
        found = feasible_scale(self.controller, state, desired, bounds=self._bounds, external=external)
        if found.scale < self.least_scale.scale:
            proof = None if found.certificate is None else self._in_si(found.certificate)
            self.least_scale, self.least_at = found._replace(certificate=proof), k
            try:
                self._above = replace(self.controller, uncertainty=known.scaled(found.above))
            except InputError:  # beyond which there are no worlds
                self._above = None

    def _in_si(self, certificate: FarkasCertificate) -> FarkasCertificate:
        """With its units in newtons and metres."""
        force, length, limit = certificate.force, certificate.length, certificate.limit
        return replace(certificate, force=self._unit * force, length=self._unit * length, limit=self._unit * limit)

    def _wrench_in_si(self, wrench: Array) -> Array:
        dim = self.controller.space.dim
        return np.r_[self._unit * wrench[:dim], self._unit**2 * wrench[dim:]]
