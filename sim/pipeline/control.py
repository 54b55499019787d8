"""What decides on the wrenches of a step, for all worlds: a law on a reference, a receding horizon, a plan played."""

from typing import NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.bounded_solver import BoundedSolver
from pivoting.controller.errors import PlanError
from pivoting.controller.orientation_references import Turn
from pivoting.controller.planning.horizon import BodyState
from pivoting.controller.planning.receding_horizon import OUTCOMES, Followed, RecedingHorizon, followed_motion
from pivoting.controller.planning.sequential_convex import Plan, Planner
from pivoting.controller.solution import STATUS
from pivoting.controller.solvers.conic_program import USABLE
from pivoting.controller.wrench_bounds import WrenchBounds, fill_excess
from pivoting.controller.wrench_controller import WrenchController, step_worlds

Array = NDArray[np.float64]
TOLERANCE = 1e-9  # relative KKT residual of an answer that counts as solved
OVER = 1e-9  # of a bound: a wrench that exceeds it by more is solved for again, within bounds
BETTER_THAN_NONE = 1e-3  # relative KKT residual within bounds
BOUNDED, INACCURATE, FAILED = (STATUS.index(word) for word in ("bounded", "inaccurate", "failed"))


class States(NamedTuple):
    """(W, 3), (W, 4), (W, 3), (W, 3): CoM, orientation and their velocities, world axes; the CoM's of the world."""

    position: Array
    orientation: Array
    velocity: Array
    angular_velocity: Array

    @classmethod
    def turning(cls, orientation: Array, angular_velocity: Array) -> Self:
        """States of which only the rotation matters, read-only as MuJoCo's are: for writable arrays numba would compile
        the loop again."""
        still = np.zeros((len(orientation), 3))
        states = cls(still, orientation.copy(), still, angular_velocity.copy())
        for values in states:
            values.flags.writeable = False
        return states


class Answers(NamedTuple):
    """Where the answers of one step are written.

    required: (W, nw), what the problems were stated with.  wrench: (W, nw).  force: (W, K d).  residual, status: (W,).
    """

    required: Array
    wrench: Array
    force: Array
    residual: Array
    status: NDArray[np.int8]


class Control(Protocol):
    """Writes the answers of step k."""

    def __call__(self, k: int, states: States, before: Array | None, out: Answers) -> None:
        """`before`: (W, nw) the wrenches of step k - 1, None at first."""
        ...

    def prepare(self, states: States, out: Answers) -> None:
        """Do once what takes long, such as compiling; what is written does not count."""
        ...


class _Law:
    """The controller's law for all worlds, as far as the compiled loop keeps bounds."""

    def __init__(self, controller: WrenchController, bounds: WrenchBounds):
        self._belief, self._work = tuple(controller.belief), controller.workspace()
        self._bounds = tuple(bounds.stacked(len(controller.Q_w))) if bounds.any else None
        self._none = np.zeros((1, len(controller.Q_w)))

    def __call__(self, states: States, desired: list[Array], out: Answers, external: Array | None = None) -> None:
        """`desired`: orientations, angular velocities, accelerations; `external`: see `step_worlds`, None for none."""
        measured = states.orientation, states.angular_velocity
        known = self._none if external is None else external
        step_worlds(self._belief, self._bounds, *self._work, TOLERANCE, *measured, *desired, known, *out)


class LawControl:
    """The per-step law on a reference, the same for all worlds.

    Args:
        desired: (N+1, 4), (N+1, 3), (N+1, 3), the reference at every step.
        bounds: on the wrench.
        external: (N+1, nw) known wrenches on the object at every step, object axes; or (1, nw), always the same.
    """

    def __init__(
        self,
        controller: WrenchController,
        desired: tuple[Array, Array, Array],
        bounds: WrenchBounds,
        external: Array,
    ):
        self._law, self._external = _Law(controller, bounds), external[:, None]
        self._desired = [values[:, None] for values in desired]

    def __call__(self, k: int, states: States, before: Array | None, out: Answers) -> None:
        j = min(k, len(self._external) - 1)
        self._law(states, [values[k] for values in self._desired], out, self._external[j])

    def prepare(self, states: States, out: Answers) -> None:
        """Compile."""
        self(0, states, None, out)


class BoundedControl:
    """Another control within bounds: a wrench that still exceeds one is solved for again, see `BoundedSolver`.

    Args:
        dt: time step [s].
    """

    def __init__(self, inner: Control, controller: WrenchController, bounds: WrenchBounds, dt: float):
        self._inner, self._dt = inner, dt
        self._bounds = bounds.stacked(len(controller.Q_w))
        self._rated = bounds.rated
        self._solve = BoundedSolver(controller, bounds, dt)

    def __call__(self, k: int, states: States, before: Array | None, out: Answers) -> None:
        self._inner(k, states, before, out)
        last = _applied(before) if self._rated else None
        excess = np.empty(len(out.wrench))
        most = fill_excess(self._bounds, out.wrench, out.wrench if last is None else last, self._dt, excess)
        if not most > OVER:
            return
        for i in np.flatnonzero(excess > OVER):
            answer = self._solve(states.orientation[i], out.required[i], None if last is None else last[i])
            if not answer.residual <= BETTER_THAN_NONE:
                out.wrench[i], out.status[i] = np.nan, FAILED
                continue
            out.wrench[i], out.force[i], out.residual[i] = answer.wrench, answer.force.ravel(), answer.residual
            if answer.residual > USABLE:
                out.status[i] = INACCURATE
            elif not answer.exact:
                out.status[i] = BOUNDED

    def prepare(self, states: States, out: Answers) -> None:
        """Compile, and set the solver up."""
        self._inner.prepare(states, out)
        fill_excess(self._bounds, out.wrench, out.wrench, self._dt, np.empty(len(out.wrench)))
        for _ in range(2):  # set up, then in place
            self._solve(states.orientation[0], out.required[0])


def _applied(wrench: Array | None) -> Array | None:
    """Wrenches (W, nw) as they were applied: none where there was no answer."""
    return None if wrench is None else np.where(np.isfinite(wrench), wrench, 0.0)


class PlanLog(NamedTuple):
    """Of P plans in W worlds; entries that were never reached are nan.

    step: (P,) at which they were made.  outcome: (W, P) indices of `receding_horizon.OUTCOMES`.
    residual: (W, P) of the last program solved.  change: (W, P) by its last pass, in weights, levers and radians.
    motion_defect, stick_defect: (W, P) of the equations themselves.  ms: (W, P) in all.
    """

    step: NDArray[np.int64]
    outcome: NDArray[np.int8]
    residual: Array
    change: Array
    motion_defect: Array
    stick_defect: Array
    ms: Array


def plan_figures(log: PlanLog) -> dict[str, float]:
    """What a run's summary says of its plans: how many, how many failed, the worst of their certificates, time."""
    made = log.outcome == 0
    return {
        "plans": float(log.outcome.size),
        "plans_failed": float(np.count_nonzero(log.outcome != 0)),
        "plan_residual_max": float(np.max(np.nan_to_num(log.residual, nan=np.inf)[made], initial=0.0)),
        "plan_change_max": float(np.max(log.change[made], initial=0.0)),
        "plan_motion_defect_max": float(np.max(log.motion_defect[made], initial=0.0)),
        "plan_ms_median": float(np.nanmedian(log.ms)),
        "plan_ms_p99": float(np.nanquantile(log.ms, 0.99)),
    }


class Event(NamedTuple):
    """Something that a user has to know of: in which world, when [s], what."""

    world: int
    time: float
    what: str


class HorizonControl:
    """A receding horizon for each world; the per-step law follows its plans.

    Args:
        horizons: one for each world.
        reference: of the orientation, as the controller believes it.
        dt: time step [s].  every: steps from plan to plan.  steps: of the run.
    """

    def __init__(
        self,
        horizons: list[RecedingHorizon],
        controller: WrenchController,
        reference: Turn,
        dt: float,
        every: int,
        steps: int,
    ):
        self._horizons, self._dt, self._every = horizons, dt, every
        self._law = _Law(controller, horizons[0].planner.horizon.bounds)
        W, P = len(horizons), -(-steps // every)
        times = every * dt * np.arange(P)[:, None] + horizons[0].planner.horizon.times
        wanted = np.asarray(reference(times.ravel()).orientation)
        self._wanted = wanted.reshape(*times.shape, 4)  # (P, N, 4) desired orientations over each plan's horizon
        self._followed: list[Followed | None] = [None] * W
        self._released: list[int] = []
        self._motions = np.empty((every, W, 4)), np.empty((every, W, 3)), np.empty((every, W, 3))
        self._times: Array = dt * np.arange(every, dtype=float)
        self.log = PlanLog(
            every * np.arange(P), np.zeros((W, P), np.int8), *(np.full((W, P), np.nan) for _ in range(5))
        )
        self.events: list[Event] = []

    def __call__(self, k: int, states: States, before: Array | None, out: Answers) -> None:
        if k % self._every == 0:
            applied = _applied(before)
            for i in range(len(out.wrench)):
                self._plan(i, k, states, None if applied is None else applied[i])
        self._follow(k, states, out)

    def prepare(self, states: States, out: Answers) -> None:
        """Compile, and set the first world's solver up."""
        state = BodyState(*(np.array(values[0]) for values in states))
        for _ in range(2):
            now = self._horizons[0].replan(state, self._wanted[0], None)
        followed_motion(now, state, self._times)
        for values, still in zip(self._motions, (state.orientation, np.zeros(3), np.zeros(3)), strict=True):
            values[:] = still
        self._follow(0, states, out)

    def _follow(self, k: int, states: States, out: Answers) -> None:
        """The per-step law; nothing, where the object was let go."""
        self._law(states, [values[k % self._every] for values in self._motions], out)
        for i in self._released:
            for values in out:
                values[i] = 0

    def _plan(self, i: int, k: int, states: States, applied: Array | None) -> None:
        state = BodyState(*(np.array(values[i]) for values in states))
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
        for values, motion in zip(self._motions, followed_motion(now, state, self._times), strict=True):
            values[:, i] = motion
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


class PlayControl:
    """Open loop: one plan of the whole motion, its wrenches applied in object axes whatever the object does.

    Args:
        planner: of as many steps as the run has, `per` time steps each.  What is required is what its wrenches and
            forces make together on the object as it is.
        reference: of the orientation, as the controller believes it.
    """

    def __init__(self, planner: Planner, reference: Turn, per: int):
        self._planner, self._reference, self._per = planner, reference, per
        self.plan: Plan | None = None

    def prepare(self, states: States, out: Answers) -> None:
        """Plan from the state of the first world.

        Raises:
            PlanError: there is no plan.
        """
        horizon = self._planner.horizon
        state = BodyState(*(np.array(values[0]) for values in states))
        wanted = np.asarray(self._reference(horizon.times).orientation)
        plan = self._planner.plan(state, horizon.arc(wanted, state))
        if plan.status != "solved":
            raise PlanError(plan)
        self.plan = plan

    def __call__(self, k: int, states: States, before: Array | None, out: Answers) -> None:
        assert self.plan is not None
        t = k // self._per
        out.wrench[:], out.force[:] = self.plan.wrench[t], self.plan.force[t].ravel()
        for i, orientation in enumerate(states.orientation):
            out.required[i] = self.plan.horizon.controller.jacobian(orientation) @ out.force[i] + out.wrench[i]
        out.residual[:], out.status[:] = self.plan.residual, 0
