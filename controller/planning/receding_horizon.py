"""The receding horizon: plans made again and again from where the object is, and the motion between two of them."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from pivoting.controller.kernels.compilation import kernel
from pivoting.controller.planning.horizon import BodyState
from pivoting.controller.planning.integrators import INTEGRATORS
from pivoting.controller.planning.sequential_convex import Plan, Planner
from pivoting.controller.rotations import fill_rotation, into, quaternion_product, turn
from pivoting.controller.validate import Array, fail

OUTCOMES = ("planned", "shifted", "holding", "released")  # what is followed, see `RecedingHorizon`
FOUND = ("solved", "not converged")
LANDED = 1e-3  # of the lever: a watched point this close to the table has come down on it


class Followed(NamedTuple):
    """The plan that is followed until the next one is made.

    Attributes:
        plan: the last plan that succeeded, or None.
        since: time since it was made [s].
        outcome: one of `OUTCOMES`.
        attempt: the plan that was tried last, successful or not.
    """

    plan: Plan | None
    since: float
    outcome: str
    attempt: Plan


@dataclass(frozen=True, eq=False)
class RecedingHorizon:
    """A planner that makes a new plan every `period` seconds, from where the object is.

    It has no memory: what `replan` returns is passed to it again at the next call. If a plan fails, the last one that
    succeeded takes its place, shifted by the time that has passed. When that plan has come to its end, the object is to
    stay as it is ("holding"): the per-step law then holds it or, where the bounds do not allow that, lowers it as
    gently as they allow. Once it has come down on another of its points, it is let go for good ("released").

    Attributes:
        planner: of the horizon.  period: [s].
        passes: number of programs solved for each plan. They are linearised about the desired poses and the last plan's
            wrenches and forces, shifted by whole steps; without such a plan three times as many are solved.
    """

    planner: Planner
    period: float
    passes: int = 1

    def __post_init__(self) -> None:
        if not 0.0 < self.period <= self.planner.horizon.steps * self.planner.horizon.h:
            raise fail("period", self.period, "> 0 and not longer than the horizon [s]")

    def replan(
        self, state: BodyState, orientations: Array, last: Followed | None, applied: Array | None = None
    ) -> Followed:
        """Plan from `state`, along orientations (N, 4) about the contacts where they are now.

        Args:
            last: what was followed until now; None at first.
            applied: (nw,) the wrench applied until now, for bounds on its rate.

        Raises:
            ValueError: the problem is planar, and the state is more than a degree out of the plane.
        """
        if last is not None and last.outcome == "released":
            return last
        horizon = self.planner.horizon
        state = horizon.in_plane(state)
        desired = horizon.arc(orientations, state)
        attempt = None
        if last is not None and last.plan is not None and last.outcome == "planned":
            forces = _shifted(last.plan, (last.since + self.period) / horizon.h)
            attempt = self.planner.plan(state, desired, forces=forces, applied=applied, passes=self.passes)
        if attempt is None or attempt.status not in FOUND:
            attempt = self.planner.plan(state, desired, applied=applied, passes=3 * self.passes)
        if attempt.status in FOUND:
            return Followed(attempt, 0.0, "planned", attempt)
        since = horizon.steps * horizon.h if last is None or last.plan is None else last.since + self.period
        if last is None or since + self.period > horizon.steps * horizon.h + 1e-9:
            return Followed(None, 0.0, "released" if horizon.height(state) < LANDED else "holding", attempt)
        return Followed(last.plan, since, "shifted", attempt)


def _shifted(plan: Plan, steps: float) -> tuple[Array, Array]:
    """Wrenches (N, nw) and forces (N, K d) of a plan from `steps` on, the last ones repeated."""
    N = len(plan.wrench)
    index = np.minimum(np.arange(N) + round(steps), N - 1)
    return plan.guess.wrench[index], plan.guess.force[index]


def followed_motion(followed: Followed, state: BodyState, times: Array) -> tuple[Array, Array, Array]:
    """The motion to follow at `times` (T,) [s] after the last call of `replan`, world axes.

    It consists of orientations (T, 4), angular velocities (T, 3) and accelerations (T, 3). The accelerations of a plan
    are constant over its steps and are integrated exactly here; the poses of the plan itself are those of its
    integrator. A quasi-dynamic plan has velocities and no accelerations. "Holding" means that the object stays where it
    is.

    Args:
        state: the one with which `replan` was called last.
    """
    plan = followed.plan
    if plan is None:
        still = np.zeros((len(times), 3))
        return np.tile(state.orientation, (len(times), 1)), still, still.copy()
    begun = quaternion_product(plan.horizon.controller.base, plan.guess.path.before[3:])
    accelerated = INTEGRATORS[plan.horizon.integrator][0] == 2
    out = np.empty((len(times), 4)), np.empty((len(times), 3)), np.empty((len(times), 3))
    scratch, at = (np.empty((3, 3)), np.empty(3)), followed.since + times
    _follow(begun, plan.angular_velocity, accelerated, plan.horizon.h, at, *scratch, *out)
    return out


@kernel
def _follow(begun, rates, accelerated, h, times, R, turning, orientation, rate, acceleration):  # type: ignore[no-untyped-def]
    """Write the motion (T, 4), (T, 3), (T, 3) from `begun` (4,), with rates (N + 1, 3) in world axes every h [s].

    R: (3, 3) and turning: (3,) are scratch.
    """
    N = rates.shape[0] - 1
    for i in range(times.shape[0]):
        at = min(max(times[i], 0.0), N * h)
        last = min(int(at / h + 1e-9), N - 1)
        for j in range(4):
            orientation[i, j] = begun[j]
        for step in range(last + 1):
            tau = h if step < last else at - last * h
            begin = rates[step] if accelerated else rates[step + 1]
            fill_rotation(orientation[i], R)
            for j in range(3):
                growth = (rates[step + 1, j] - begin[j]) / h
                rate[i, j], acceleration[i, j] = begin[j] + growth * tau, growth
                turning[j] = (begin[j] + 0.5 * growth * tau) * tau  # about an axis that hardly turns within a step
            turning[0], turning[1], turning[2] = into(R, turning[0], turning[1], turning[2])
            turn(orientation[i], turning, orientation[i])
