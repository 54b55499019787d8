"""What came of a sweep: a row for each world, and what can be said of all of them."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.validate import fail
from pivoting.sim.fleet import ReplayError
from pivoting.sim.judging.measures import Measures
from pivoting.sim.run import Run
from pivoting.sim.scenarios.scenario import Scenario
from pivoting.sim.scenarios.scenario_file import ScenarioFile
from pivoting.sim.sweeping.chunk_task import Rows

if TYPE_CHECKING:
    import pandas

CONFIDENCE = 0.95
INFLUENCED = ("slip_max_m", "angle_error_max_deg", "friction_use_max")  # measures of which sensitivities are told
FEWEST = 64  # worlds of which sensitivities can be told


@dataclass(frozen=True, eq=False)
class Swept:
    """The worlds of a sweep, in the order of their numbers.

    Attributes:
        scenario: with its intervals.  seed: of what was drawn.  sampling: of `sampling.SAMPLING`.
        rows: by column (W,): world, world.KEY of what each has of its own, its measures, and whether it passed.
    """

    scenario: Scenario
    seed: int
    sampling: str
    rows: Rows

    @property
    def worlds(self) -> int:
        """W."""
        return len(self.rows["world"])

    @property
    def failed(self) -> NDArray[np.intp]:
        """The numbers of the worlds that failed."""
        return np.flatnonzero(~self.rows["passed"].astype(bool))

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys in which the worlds differ, as world.KEY, but for those that are the same in all."""
        own = (name for name in self.rows if name.startswith("world."))
        return tuple(name for name in own if np.ptp(self.rows[name].astype(float)) > 0.0)

    @property
    def bound(self) -> float | None:
        """The share of failures of the whole set is below this, with a confidence of 95 % (Clopper and Pearson).

        None where the worlds are no independent draws, of which alone that can be told.
        """
        from scipy.stats import binomtest

        if self.sampling != "drawn":
            return None
        test = binomtest(len(self.failed), self.worlds, alternative="less")
        return float(test.proportion_ci(CONFIDENCE, method="exact").high)

    @property
    def worst(self) -> int:
        """The number of the world, of those that failed if any did, whose contact slipped farthest."""
        slip = self.rows["slip_max_m"].astype(float)
        some = self.failed if len(self.failed) else np.arange(self.worlds)
        return int(some[np.argmax(np.where(np.isnan(slip[some]), np.inf, slip[some]))])

    def file_of(self, world: int) -> ScenarioFile:
        """What the file of one world alone says, with which `pivoting run --scenario` runs and records it.

        Raises:
            ValueError: there is no such world.
        """
        if isinstance(world, bool) or not isinstance(world, int | np.integer) or not 0 <= world < self.worlds:
            raise fail("world", world, f"a whole number in [0, {self.worlds})")
        own = {name: float(self.rows[name][world]) for name in self.rows if name.startswith("world.")}
        return ScenarioFile(self.scenario.change(**own), 1, self.seed, int(world))

    def replay(self, world: int) -> Run:
        """One world again, alone and in full, from its row; that it is the same to the last bit is checked.

        Raises:
            ValueError: there is no such world.
            ReplayError: what came out is not what its row says.
        """
        from pivoting.sim.simulation import simulate

        alone = self.file_of(world)
        run = simulate(alone.scenario, 1, alone.seed, first_world=alone.first_world)
        for name in Measures.__dataclass_fields__:
            now, then = float(getattr(run.measures, name)[0]), float(self.rows[name][world])
            if not np.array_equal(now, then, equal_nan=True):
                raise ReplayError(int(world), name, now, then)
        return run

    def sensitivities(self) -> dict[str, dict[str, float]]:
        """The share of the variance of each measure's rank that each key alone explains, by measure and key.

        First-order Sobol' indices by random balance designs (RBD-FAST, Tarantola, Gatelli and Mara 2006), which take
        any sample; nothing of vertices. Ranks, because the slip of few worlds is a thousand times that of the others.

        Raises:
            ModuleNotFoundError: SALib, of the extra [sweep], is not installed.
        """
        from SALib.analyze import rbd_fast
        from scipy.stats import rankdata

        if self.sampling == "vertices" or self.worlds < FEWEST:
            return {}
        points = np.column_stack([self.rows[key] for key in self.keys])
        bounds = np.column_stack([points.min(axis=0), points.max(axis=0)])
        problem = {"num_vars": len(self.keys), "names": list(self.keys), "bounds": bounds.tolist()}
        found: dict[str, dict[str, float]] = {}
        for name in INFLUENCED:
            values = self.rows[name].astype(float)
            there = np.isfinite(values)
            if there.sum() >= FEWEST and np.ptp(values[there]) > 0.0:
                told = rbd_fast.analyze(problem, points[there], rankdata(values[there]), num_resamples=2, seed=0)
                found[name] = dict(zip(self.keys, (float(each) for each in told["S1"]), strict=True))
        return found

    def summary(self) -> dict[str, Any]:
        """In numbers: what was swept, how many worlds failed, what that bounds, and the worst of each measure."""
        worst = {name: float(np.max(self.rows[name].astype(float))) for name in Measures.__dataclass_fields__}
        return {
            "scenario": self.scenario.label,
            "worlds": self.worlds,
            "seed": self.seed,
            "sampling": self.sampling,
            "failed": len(self.failed),
            "failed_worlds": self.failed.tolist(),
            "failure_bound_95": self.bound,
            **worst,
        }

    def to_dataframe(self) -> "pandas.DataFrame":
        """A row for each world.

        Raises:
            ModuleNotFoundError: pandas, of the extra [data], is not installed.
        """
        import pandas

        return pandas.DataFrame(dict(self.rows)).set_index("world")
