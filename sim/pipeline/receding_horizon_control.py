"""The control by receding horizons, one for each world; the law of every step follows their plans."""

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.orientation_references import Turn
from pivoting.controller.planning.horizon import BodyState
from pivoting.controller.planning.receding_horizon import OUTCOMES, Followed, RecedingHorizon, followed_motion
from pivoting.sim.pipeline.bounded_control import applied
from pivoting.sim.pipeline.law_control import LawSolver
from pivoting.sim.pipeline.plan_log import Event, PlanLog
from pivoting.sim.pipeline.stages import Answers, Desired, States, desired_values

Array = NDArray[np.float64]


def body_state(states: States, world: int) -> BodyState:
    """That of one world, as a plan begins with it."""
    motion = states.position, states.orientation, states.velocity, states.angular_velocity
    return BodyState(*(np.array(values[world]) for values in motion))


class RecedingHorizonControl:
    """A receding horizon for each world; the per-step law follows its plans.

    Args:
        horizons: one for each world.  law: which follows their plans.
        reference: of the orientation, as the controller believes it.
        dt: time step [s].  every: steps from plan to plan.  steps: of the run.
    """

    def __init__(
        self,
        horizons: list[RecedingHorizon],
        law: LawSolver,
        reference: Turn,
        dt: float,
        every: int,
        steps: int,
    ):
        self._horizons, self._dt, self._every = horizons, dt, every
        self._law = law
        W, P = len(horizons), -(-steps // every)
        times = every * dt * np.arange(P)[:, None] + horizons[0].planner.horizon.times
        wanted = np.asarray(reference(times.ravel()).orientation)
        self._wanted = wanted.reshape(*times.shape, 4)  # (P, N, 4) desired orientations over each plan's horizon
        self._followed: list[Followed | None] = [None] * W
        self._released: list[int] = []
        self._motions = np.empty((every, W, 10))  # the values of `Desired` until the next plan
        self._times: Array = dt * np.arange(every, dtype=float)
        self.log = PlanLog(
            every * np.arange(P), np.zeros((W, P), np.int8), *(np.full((W, P), np.nan) for _ in range(5))
        )
        self.events: list[Event] = []

    def __call__(self, k: int, states: States, before: Array | None, out: Answers) -> None:
        if k % self._every == 0:
            last = applied(before)
            for i in range(len(out.wrench)):
                self._plan(i, k, states, None if last is None else last[i])
        self._follow(k, states, out)

    def prepare(self, states: States, out: Answers) -> None:
        """Compile, and set the first world's solver up."""
        state = body_state(states, 0)
        for _ in range(2):
            now = self._horizons[0].replan(state, self._wanted[0], None)
        followed_motion(now, state, self._times)
        self._motions[:] = desired_values(state.orientation, np.zeros(3), np.zeros(3))
        self._law.solve(states, self._desired(0), out)

    def _desired(self, k: int) -> Desired:
        return Desired(self._motions[k % self._every])

    def _follow(self, k: int, states: States, out: Answers) -> None:
        """The per-step law; nothing, where the object was let go."""
        self._law(states, self._desired(k), out)
        for i in self._released:
            out.values[i] = out.status[i] = 0

    def _plan(self, i: int, k: int, states: States, applied: Array | None) -> None:
        state = body_state(states, i)
        if not np.isfinite(np.concatenate(state)).all():
            return  # the world has diverged: its law will say so
        last, p = self._followed[i], k // self._every
        now = self._horizons[i].replan(state, self._wanted[p], last, applied)
        self._followed[i] = now
        self.log.outcome[i, p] = OUTCOMES.index(now.outcome)
        if now is last:  # let go: there was no plan
            return
        if now.outcome == "released":
            self._released.append(i)
        self._motions[:, i] = desired_values(*followed_motion(now, state, self._times))
        tried = now.attempt
        change = tried.changes[-1] if tried.changes else np.nan
        self.log.residual[i, p], self.log.change[i, p], self.log.ms[i, p] = tried.residual, change, 1e3 * tried.seconds
        self.log.motion_defect[i, p], self.log.stick_defect[i, p] = tried.motion_defect, tried.stick_defect
        if now.outcome != ("planned" if last is None else last.outcome):
            why = f"plan {tried.status} ({tried.said}, KKT residual {tried.residual:.1g}): "
            said = {
                "planned": "planning again",
                "shifted": why + "following the last plan",
                "holding": why + "no plan to follow, holding or lowering within bounds",
                "released": "set down and let go",
            }
            self.events.append(Event(i, k * self._dt, said[now.outcome]))
