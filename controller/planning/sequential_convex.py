"""Sequential convex programming: a horizon's program is solved and linearised again about its answer, repeatedly."""

from dataclasses import dataclass, field
from functools import cached_property
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from pivoting.controller.planning.equations_of_motion import Path
from pivoting.controller.planning.horizon import BodyState, Horizon
from pivoting.controller.planning.horizon_program import Guess, HorizonProgram
from pivoting.controller.rotations import fill_differences, quaternion_product, rotated
from pivoting.controller.solvers.clarabel_backend import ClarabelWithRetry
from pivoting.controller.solvers.conic_program import USABLE, ConicSolver
from pivoting.controller.solvers.qpsolvers_backend import QuadraticBackend, installed_backend
from pivoting.controller.validate import Array, array, fail, frozen, number, unit_quaternions

CONVERGED = 1e-9  # change of a pass, in weights, levers and radians
STATUS = ("solved", "not converged", "infeasible", "failed")


@dataclass(frozen=True, eq=False)
class Plan:
    """A planned motion over a horizon, and how well it satisfies its own equations.

    Attributes:
        program: of the horizon.  desired: poses (N, 3) and (N, 4), table axes.
        guess: the planned poses (table axes), wrenches and forces; the next program can be linearised about them.
        status: "solved", "not converged" (the last pass changed more than is tolerated), "infeasible" or "failed".
        said: what the solver reported.
        passes: number of programs that were solved.
        changes: by how much each of them changed the guess, in weights, levers, radians.
        residual: relative KKT residual of the last program.
        motion_defect: how far the plan is from the nonlinear equations of motion, over the weight.
        stick_defect: how far the contacts move, over the lever; 0 if they need not stick.
        seconds: time in all.  solver_seconds: time inside the solver.
    """

    program: HorizonProgram = field(repr=False)
    desired: tuple[Array, Array] = field(repr=False)
    guess: Guess = field(repr=False)
    status: str
    said: str
    passes: int
    changes: tuple[float, ...]
    residual: float
    motion_defect: float
    stick_defect: float
    seconds: float
    solver_seconds: float

    @property
    def horizon(self) -> Horizon:
        """The horizon that was planned."""
        return self.program.horizon

    @cached_property
    def objective(self) -> float:
        """The objective of the answer, in SI units."""
        return self.program.objective(self.desired, self.guess)

    @cached_property
    def position(self) -> Array:
        """The CoM (N+1, 3) at each pose [m], world axes."""
        return frozen(self.guess.path.position @ self.horizon.table.T)

    @cached_property
    def orientation(self) -> Array:
        """The orientation (N+1, 4) at each pose, object axes to world."""
        return frozen(quaternion_product(self.horizon.controller.base, self.guess.path.orientation))

    @cached_property
    def velocity(self) -> Array:
        """The velocity (N+1, 3) of the CoM with which each pose is reached, world axes [m/s]."""
        path = self.guess.path
        moved = np.concatenate([path.arriving[None, :3], np.diff(path.position, axis=0)])
        return frozen(moved @ self.horizon.table.T / self.horizon.h)

    @cached_property
    def angular_velocity(self) -> Array:
        """The angular velocity (N+1, 3) with which each pose is reached, world axes [rad/s]."""
        path = self.guess.path
        turned = np.empty((len(path.position), 3))
        turned[0] = path.arriving[3:]
        fill_differences(path.orientation, turned[1:])
        return frozen(rotated(self.orientation, turned / self.horizon.h))

    @property
    def wrench(self) -> Array:
        """The wrenches (N, nw), object axes [N, N m]; that of step t leads to pose t + 1."""
        return self.guess.wrench

    @property
    def force(self) -> Array:
        """The contact forces (N, K, d), contact axes [N]."""
        return self.guess.force.reshape(self.horizon.steps, -1, self.horizon.controller.space.dim)


class Planner:
    """Makes plans for one horizon, with a solver that is set up once.

    Args:
        horizon: the planning problem.
        method: "clarabel" or, in the plane, "qp:<backend>" of qpsolvers. The default is "qp:piqp" in the plane, and
            "clarabel" in space.
        options: of the solver.
    """

    def __init__(self, horizon: Horizon, method: str | None = None, **options: Any):
        if not isinstance(horizon, Horizon):
            raise fail("horizon", horizon, "a Horizon")
        self.horizon = horizon
        self.program = HorizonProgram(horizon)
        cones = bool(self.program.cones.orders)
        self.method = method or ("clarabel" if cones else "qp:piqp")
        if cones and self.method != "clarabel":
            raise fail("method", method, '"clarabel": this program has second-order cones')
        self._solve = _solver(self.method, options)

    def guess(self, state: BodyState, desired: tuple[Array, Array] | None = None) -> Guess:
        """A first guess: desired poses (N, 3), (N, 4), world axes, without forces.

        Without desired poses it is the present pose of the object, which is farther from the answer, but always keeps
        the contacts where they are.
        """
        start = self.horizon.start(state)
        return self._about(start, _still(start) if desired is None else self.horizon.desired(*desired))

    def _about(self, start: Path, poses: tuple[Array, Array], forces: tuple[Array, Array] | None = None) -> Guess:
        """A guess of poses 1 to N, (N, 3) and (N, 4) in table axes or one for all, that begins where the object is."""
        N, belief = self.horizon.steps, self.horizon.controller.belief
        position, orientation = np.empty((N + 1, 3)), np.empty((N + 1, 4))
        position[0], orientation[0] = start.position[0], start.orientation[0]
        position[1:], orientation[1:] = poses
        path = start._replace(position=position, orientation=orientation)
        zeros = np.zeros((N, len(belief.source.Q_w))), np.zeros((N, len(belief.contacts.Q_f)))
        return Guess(path, *(zeros if forces is None else forces))

    def _guesses(
        self, start: Path, wanted: tuple[Array, Array], guess: Guess | None, forces: tuple[Array, Array] | None
    ) -> list[Guess]:
        """About what the first program is stated, and what is tried if it has no answer; see `plan`."""
        if guess is not None:
            return [self._begun(guess, start)]
        if forces is not None:
            return [self._about(start, wanted, self._forces("forces", forces))]
        return [self._about(start, wanted), self._about(start, _still(start))]

    def _begun(self, guess: Guess, start: Path) -> Guess:
        """A guess that was made for another state, from this one."""
        N = self.horizon.steps
        if not isinstance(guess, Guess):
            raise fail("guess", guess, "a Guess, as `Plan.guess` or `Planner.guess` is")
        position = array("guess.path.position", guess.path.position, (N + 1, 3))
        orientation = unit_quaternions("guess.path.orientation", guess.path.orientation, (N + 1, 4))
        return self._about(start, (position[1:], orientation[1:]), self._forces("guess", (guess.wrench, guess.force)))

    def _forces(self, name: str, forces: tuple[Array, Array]) -> tuple[Array, Array]:
        """Copies of wrenches (N, nw) and forces (N, K d)."""
        N, belief = self.horizon.steps, self.horizon.controller.belief
        if not isinstance(forces, tuple | list) or len(forces) != 2:
            raise fail(name, forces, "wrenches (N, nw) and contact forces (N, K d)")
        wrench = array(f"{name}: wrenches", forces[0], (N, len(belief.source.Q_w)))
        force = array(f"{name}: forces", forces[1], (N, len(belief.contacts.Q_f)))
        return wrench.copy(), force.copy()  # that may be written: kernels tell the two apart

    def plan(
        self,
        state: BodyState,
        desired: tuple[Array, Array],
        *,
        guess: Guess | None = None,
        forces: tuple[Array, Array] | None = None,
        applied: Array | None = None,
        passes: int = 50,
        tolerance: float = CONVERGED,
    ) -> Plan:
        """Plan from `state` towards poses (N, 3), (N, 4), world axes, at the times `Horizon.times`.

        Check the status of the plan: one that is "infeasible" or "failed" is no plan, and contains only the guess.

        Args:
            guess: what the first program is linearised about; it is made to begin at `state`. The default is the
                desired poses or, if these are too far away for an answer, the present pose of the object.
            forces: wrenches (N, nw) and forces (N, K d) in place of a guess: the first program is linearised about the
                desired poses with these, and about nothing else.
            applied: see `HorizonProgram.stated`.
            passes: greatest number of programs; with 1 the answer is that of the program about the guess.
        """
        number("tolerance", tolerance, above=0.0)
        if isinstance(passes, bool) or not isinstance(passes, int | np.integer) or passes < 1:
            raise fail("passes", passes, "a whole number >= 1")
        if not isinstance(state, BodyState):
            raise fail("state", state, "a BodyState")
        if not isinstance(desired, tuple | list) or len(desired) != 2:
            raise fail("desired", desired, "positions (N, 3) and orientations (N, 4), as of `Horizon.arc`")
        if applied is not None:
            applied = array("applied", applied, (len(self.horizon.controller.Q_w),))
        if guess is not None and forces is not None:
            raise fail("forces", "given beside a guess", "left out: the guess has its own")
        began = perf_counter()
        start, wanted = self.horizon.start(state), self.horizon.desired(*desired)
        inside, tried = 0.0, 0
        for now in self._guesses(start, wanted, guess, forces):
            found = self._passes(now, wanted, applied, int(passes), tolerance)
            inside, tried = inside + found.seconds, tried + found.tried
            if found.changes:
                break
        motion, stick = self.program.defects(found.guess)
        for values in (found.guess.wrench, found.guess.force):
            frozen(values)
        return Plan(
            self.program,
            wanted,
            found.guess,
            status=found.status,
            said=found.said,
            passes=tried,
            changes=tuple(found.changes),
            residual=found.residual,
            motion_defect=motion,
            stick_defect=stick,
            seconds=perf_counter() - began,
            solver_seconds=inside,
        )

    def _passes(
        self, now: Guess, wanted: tuple[Array, Array], applied: Array | None, passes: int, tolerance: float
    ) -> "_Passes":
        """Solve programs about a guess, and about each answer, until that changes no more or there is none."""
        inside, tried, changes = 0.0, 0, []
        for _ in range(passes):
            program = self.program.stated(wanted, now, applied)
            answer = self._solve(program)
            inside, tried = inside + answer.seconds, tried + 1
            residual, said = answer.residual, answer.message
            if not residual <= USABLE:
                if "infeasible" not in said.lower() and self.method != "clarabel":  # few backends prove it
                    said = f"{said}; clarabel: {ClarabelWithRetry()(program).message}"
                status = "infeasible" if "infeasible" in said.lower() else "failed"
                break
            now, change = self.program.corrected(now, answer.x)
            changes.append(change)
            status = "solved" if change <= tolerance else "not converged"
            if status == "solved":
                break
        return _Passes(now, status, said, tried, changes, residual, inside)


class _Passes(NamedTuple):
    """Where passes ended; see `Plan`."""

    guess: Guess
    status: str
    said: str
    tried: int
    changes: list[float]
    residual: float
    seconds: float


def _solver(method: str, options: dict[str, Any]) -> ConicSolver:
    """What solves the programs of a horizon by "clarabel" or "qp:<backend>", and keeps what it can between them."""
    if method == "clarabel":
        return ClarabelWithRetry(**options)
    if method.startswith("qp:"):
        return QuadraticBackend(installed_backend(method), **options)
    raise fail("method", method, "clarabel or qp:<backend>")


def _still(start: Path) -> tuple[Array, Array]:
    """The pose of a path that has one."""
    return start.position[0], start.orientation[0]
