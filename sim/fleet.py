"""A fleet: many worlds of which only measures, and perhaps samples, are kept; any of them can be run again in full."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.validate import InputError, fail
from pivoting.errors import PivotingError
from pivoting.sim.belief import Controllers
from pivoting.sim.experiment import Experiment
from pivoting.sim.judging.findings import Findings
from pivoting.sim.judging.measures import Measures
from pivoting.sim.pipeline.own_control import OwnControlFunction
from pivoting.sim.pipeline.stages import Observe

if TYPE_CHECKING:
    import pandas
    from pivoting.sim.run import Run

Array = NDArray[np.float64]
SAMPLES = 200  # of a world, at most


class ReplayError(PivotingError, RuntimeError):
    """A world that was run again is not what it was in its fleet; the message says in what."""

    def __init__(self, world: int, name: str, now: float, then: float):
        super().__init__(
            f"world = {world}: run again its {name} is {now!r}, and was {then!r}; the model, versions and machine have"
            " to be the same, and a control or observer of your own has to begin anew with each chunk of worlds"
        )


class Handed(NamedTuple):
    """What was handed to `simulate` beside the scenario; None for what was not."""

    controller: Controllers = None
    control: OwnControlFunction | None = None
    observe: Observe | None = None

    def of(self, world: int) -> "Handed":
        """What one of the worlds has of it."""
        each = self.controller
        return self._replace(controller=each[world]) if isinstance(each, list | tuple) else self

    @property
    def names(self) -> tuple[str, ...]:
        """Of what there is."""
        return tuple(name for name, value in self._asdict().items() if value is not None)


class WorldSamples(NamedTuple):
    """Of W worlds at the beginning of S <= 200 steps, evenly spaced from the first; values as the arrays of a `Run`.

    Attributes:
        time: (S,) [s].
        theta, angle_error: (W, S) [rad].
        slip: (W, S, K, 2) [the model's unit of length].
        wrench: (W, S, 3 or 6), asked for at these steps.
        friction_use: (W, S, K) during them.
    """

    time: Array
    theta: Array
    angle_error: Array
    slip: Array
    wrench: Array
    friction_use: Array


@dataclass(frozen=True, eq=False)
class Fleet(Experiment):
    """W worlds of which their measures are kept; all read-only. Worlds are counted from 0, as in a `Run`.

    Attributes:
        measures: of each world, the same as those of a run to the last bit.
        samples: of each world, if keep="reduced"; else None.
        findings: what else there is to say of it.
        control_us: (N,) time to sense, observe, state, solve and certify the problem of one world [microseconds].
        events: the first thousand, world by world.  events_left_out: how many more there were.
        handed: what was handed to `simulate`.
    """

    measures: Measures
    samples: WorldSamples | None
    findings: Findings
    control_us: Array
    events_left_out: int
    handed: Handed

    @property
    def worlds(self) -> int:
        """W."""
        return len(self.measures.slip_max_m)

    @property
    def keep(self) -> str:
        """What was kept, "measures" or "reduced"."""
        return "measures" if self.samples is None else "reduced"

    @property
    def open_loop(self) -> bool:
        """False: a plan is played in runs alone."""
        return False

    @property
    def strays(self) -> list[str]:
        """Which geoms met in contacts that are not declared, in words."""
        return self.findings.strays

    def replay(self, world: int) -> "Run":
        """One world again, alone and in full: the same to the last bit, which is checked by its measures.

        Args:
            world: index in the fleet; in the run that is returned it is world 0.

        Raises:
            ValueError: there is no such world, or a control or observer that it was run with is no longer there.
            ReplayError: what came out is not what was measured in the fleet.
        """
        from pivoting.sim.simulation import simulate  # which makes fleets

        if isinstance(world, bool) or not isinstance(world, int | np.integer) or not 0 <= world < self.worlds:
            raise fail("world", world, f"a whole number in [0, {self.worlds})")
        if lost := [name for name in self.python_objects if name not in self.handed.names]:
            raise InputError(f"fleet: Python objects, which no file holds, were its {' and '.join(lost)}")
        first, handed = self.first_world + int(world), self.handed.of(int(world))
        run = simulate(self.scenario, 1, self.seed, first_world=first, **handed._asdict())
        for name, values in vars(self.measures).items():
            now, then = getattr(run.measures, name)[0], values[world]
            if not np.array_equal(now, then, equal_nan=True):
                raise ReplayError(int(world), name, float(now), float(then))
        return run

    def summary(self) -> dict[str, Any]:
        """The fleet in numbers, of the worst world, with the keys of a run's summary; what `--json` prints."""
        return {**super().summary(), "keep": self.keep, "events_left_out": self.events_left_out}

    def to_dataframe(self) -> "pandas.DataFrame":
        """A row for each world, with its measures, and whether it passed.

        Raises:
            ModuleNotFoundError: pandas, of the extra [data], is not installed.
        """
        from pivoting.sim.data_frame import fleet_frame

        return fleet_frame(self)
