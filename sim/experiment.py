"""What a run and a fleet have in common: what was set up, and the verdict on what was measured."""

import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from pivoting.controller.units import lever
from pivoting.controller.validate import frozen
from pivoting.controller.wrench_controller import WrenchController
from pivoting.models.rigid_body import RigidBody
from pivoting.sim.attachment import Attached
from pivoting.sim.judging.measures import Measures
from pivoting.sim.judging.summary import contact_figures, object_figures, summary
from pivoting.sim.judging.verdict import Check, Limits, judge, worst_world
from pivoting.sim.pipeline.plan_log import Event, PlanLog
from pivoting.sim.scenarios.relative_values import Load
from pivoting.sim.scenarios.scenario import Scenario
from pivoting.sim.stances import Stance
from pivoting.sim.world import World

if TYPE_CHECKING:
    from pivoting.sim.judging.findings import Findings

Array = NDArray[np.float64]


def freeze(values: Any) -> None:
    """Make an array read-only, or all arrays of a tuple or of measures."""
    if isinstance(values, np.ndarray):
        frozen(values)
    elif isinstance(values, Measures):
        freeze(tuple(vars(values).values()))
    elif isinstance(values, tuple):
        for value in values:
            freeze(value)


@dataclass(frozen=True, eq=False)
class Experiment:
    """A scenario that was run in W worlds and N steps, and the verdict on it; all read-only.

    Attributes:
        scenario: what was run, overrides included.
        seed: of what differs between the worlds.  first_world: number of the first of them.
        attached: the controller and what it believes.
        load: what the scenario's relative values are relative to.
        world: what was simulated.
        stances: the sets of contacts that are to hold, one after another.
        time: (N+1,) [s].
        reference: desired angle, rate and acceleration, each (N+1,) [rad, s].
        wall_s: of the loop.
        plans: of a receding horizon, what came of each; else None.  events: what a user has to know of.
        engine_warnings: what MuJoCo warned of, as of a world that diverges: each once, with its first time.
        python_objects: which of controller, control and observe were handed to `simulate`.
    """

    scenario: Scenario
    seed: int
    first_world: int
    attached: Attached
    load: Load
    world: World
    stances: tuple[Stance, ...]
    time: Array
    reference: tuple[Array, Array, Array]
    wall_s: float
    plans: PlanLog | None
    events: tuple[Event, ...]
    engine_warnings: tuple[str, ...]
    python_objects: tuple[str, ...]

    if TYPE_CHECKING:  # what runs and fleets have each in their own way

        @property
        def worlds(self) -> int:
            """W."""

        @property
        def measures(self) -> Measures:
            """What the monitor makes of it, for each world."""

        @property
        def findings(self) -> "Findings":
            """What else there is to say of it."""

        @property
        def control_us(self) -> Array:
            """(N,) time to sense, observe, state, solve and certify the problem of one world [microseconds]."""

        @property
        def open_loop(self) -> bool:
            """Whether a plan was played, whatever the object did."""

        @property
        def keep(self) -> str:
            """What was kept: "all", "reduced" or "measures"."""

    def __setstate__(self, state: dict[str, Any]) -> None:
        """From pickle, which forgets that arrays are read-only."""
        vars(self).update(state)
        freeze(tuple(state.values()))

    @property
    def controller(self) -> str:
        """ "scenario" for the scenario's own, "given" for another that was handed to `simulate`, "own control" for a
        function of the user's own."""
        if "control" in self.python_objects:
            return "own control"
        return "given" if "controller" in self.python_objects else "scenario"

    def controller_of(self, world: int, stance: int = 0) -> WrenchController:
        """That of one world in one of its stances."""
        controllers = self.stances[stance].controllers
        return controllers[world % len(controllers)]

    @property
    def certified(self) -> bool:
        """Whether every answer carries a certificate and a prediction of the contact forces."""
        return "control" not in self.python_objects

    @property
    def model(self) -> mujoco.MjModel:
        """The world's, with the sensors of the loop; where the worlds differ as of `truth`."""
        return self.world.model

    @property
    def truth(self) -> RigidBody:
        """The object as the world has it; where the worlds differ as in the middle of them, see `World.of`."""
        return self.world.truth

    def values_of(self, world: int) -> dict[str, float]:
        """What one world has of its own, as overrides of its scenario, by "world.KEY"; nothing where they are alike."""
        values = self.world.values
        return {} if values is None else {f"world.{key}": value for key, value in values.of(world).items()}

    @property
    def unit(self) -> float:
        """Of the model's lengths [m], and with it of all lengths, forces and moments of a run."""
        return self.world.unit

    @property
    def dt(self) -> float:
        """Time step [s]."""
        return float(self.time[1] - self.time[0])

    @property
    def points(self) -> Array:
        """(K, 3) the contact points, or centres of what rolls, from what is taken for the CoM, object axes [m]."""
        return self.world.declared.points

    @property
    def size(self) -> float:
        """Lever from the CoM to the contacts [m], against which lengths are judged."""
        first = self.stances[0].held
        return lever(self.points[first]) + float(np.mean(self.world.radius[first]))

    @property
    def limits(self) -> Limits:
        """Of the verdict, with that on the slip in metres."""
        return self.scenario.limits.for_object(
            self.unit * self.size, self.unit * float(np.linalg.norm(self.truth.gravity))
        )

    @cached_property
    def checks(self) -> tuple[Check, ...]:
        """The verdict, line by line."""
        return judge(self.measures, self.limits, self.certified, self.scenario.safe_after > 0.0)

    @property
    def failed_worlds(self) -> NDArray[np.intp]:
        """Indices of the worlds that fail any check."""
        return np.flatnonzero(np.any([check.failed for check in self.checks], axis=0))

    @cached_property
    def worst_world(self) -> int:
        """The one in which a measured value is the greatest multiple of its limit."""
        return worst_world(self.checks, self.measures)

    @property
    def verdict(self) -> str:
        """ "pass" if every world is within every limit of the scenario, else "fail"."""
        return "fail" if self.failed_worlds.size else "pass"

    @property
    def object(self) -> dict[str, Any]:
        """What was read of the object, as the world has it, in the frame that its file gives the body."""
        return object_figures(self)

    @property
    def contact_settings(self) -> dict[str, Any]:
        """The support's contact parameters in the world, and what they replaced of the file."""
        return contact_figures(self)

    def summary(self) -> dict[str, Any]:
        """All of it in numbers, of the worst world, SI units in the keys; what `--json` prints."""
        return summary(self)

    def save(self, folder: str | os.PathLike[str]) -> Path:
        """Keep it in a folder, from which `pivoting.load` gets it back, and return that.

        It is made if need be, and gets two files, both of them whole or neither: run.nc, all arrays, which
        `xarray.open_dataset(..., engine="scipy")` opens, and scenario.json, which `pivoting run --scenario` runs again,
        if nothing that the run was made with is a Python object. What was kept there before is replaced.

        Raises:
            OSError: a file cannot be written.
        """
        from pivoting.sim.saved_run import save  # which makes runs and fleets

        return save(self, folder)
