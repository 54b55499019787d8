"""One chunk of a sweep: a task that stands on its own, so that it may be run anywhere, and in any order."""

import pickle
from contextlib import nullcontext
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pivoting.sim.chunks import give_back
from pivoting.sim.engine_log import engine_log
from pivoting.sim.fleet import Handed
from pivoting.sim.run import Run
from pivoting.sim.run_setup import Begun, set_up
from pivoting.sim.scenarios.scenario import Scenario
from pivoting.sim.simulation import run_worlds
from pivoting.sim.world_values import WorldValues

Rows = dict[str, NDArray[np.generic]]


class ChunkTask(NamedTuple):
    """Some worlds of a sweep.

    Attributes:
        case: the scenario.  seed: of the sweep.
        first: number of the first world.  values: what each has of its own.
    """

    case: Scenario
    seed: int
    first: int
    values: WorldValues

    @property
    def worlds(self) -> int:
        """How many."""
        return len(self.values.values)


def run_chunk(task: ChunkTask) -> Rows:
    """Run the worlds of a chunk: their rows, by column."""
    begun = set_up_chunk(task)
    with engine_log():
        rows = rows_of(run_worlds(begun, Handed(), None, nullcontext([])), task)
    give_back()
    return rows


def set_up_chunk(task: ChunkTask) -> Begun:
    """The worlds of a chunk; what all chunks of a sweep have in common is made once in each process."""
    whole = _set_up(pickle.dumps(task.case), task.seed)
    setting = whole.setting._replace(worlds=task.worlds, first_world=task.first)
    return whole._replace(setting=setting, world=whole.world.with_values(task.values))


def rows_of(run: Run, task: ChunkTask) -> Rows:
    """The rows of a run of a chunk."""
    passed = np.isin(np.arange(run.worlds), run.failed_worlds, invert=True)
    own = {f"world.{key}": column for key, column in task.values.columns.items()}
    numbers = np.arange(task.first, task.first + task.worlds)
    return {"world": numbers, **own, **vars(run.measures), "passed": passed}


@lru_cache(maxsize=1)
def _set_up(case: bytes, seed: int) -> Begun:
    """A pickled scenario, for any worlds that differ."""
    return set_up(pickle.loads(case), None, worlds=2, seed=seed, first_world=0)
