"""`sweep`: many worlds of a scenario whose object is not known exactly, in chunks that may be run anywhere."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from pivoting.controller.uncertainty.uncertainty import Interval
from pivoting.controller.validate import fail, one_of
from pivoting.sim.chunks import CHUNK
from pivoting.sim.run_setup import set_up
from pivoting.sim.saved_run import VERSIONS
from pivoting.sim.scenarios.scenario import Scenario
from pivoting.sim.scenarios.scenario_file import ScenarioFile, described, expressible, written
from pivoting.sim.scenarios.shipped_scenarios import scenario
from pivoting.sim.sweeping.chunk_task import ChunkTask, Rows, run_chunk
from pivoting.sim.sweeping.part_files import WHOLE, PartFiles, plan_of, refused_unless, rows_in
from pivoting.sim.sweeping.sampling import SAMPLING, sampled_values
from pivoting.sim.sweeping.swept import Swept

AHEAD = 64  # chunks that an executor is given at once


class SweepProgress(NamedTuple):
    """How far a sweep is.

    Attributes:
        done: worlds so far, of all `worlds`.  failed: those of them that failed.
        began: how many were done already.  seconds: since.
    """

    done: int
    worlds: int
    failed: int
    began: int
    seconds: float

    @property
    def rate(self) -> float:
        """Worlds a second."""
        return (self.done - self.began) / max(self.seconds, 1e-9)

    @property
    def left(self) -> float:
        """Time that the others will take [s]."""
        return (self.worlds - self.done) / self.rate if self.rate else np.inf


Report = Callable[[SweepProgress], None]


def sweep(
    name: str | Scenario,
    worlds: int,
    vary: Mapping[str, Any],
    *,
    seed: int = 0,
    sampling: str = "drawn",
    out: Path | str | None = None,
    resume: bool = False,
    chunk: int | None = None,
    executor: Executor | None = None,
    progress: Report | None = None,
    **overrides: Any,
) -> Swept:
    """Run many worlds of a scenario, each with values of its own; of each only its measures are kept.

    Args:
        name: of a shipped scenario, or a `Scenario`.
        worlds: how many.
        vary: intervals by key, such as {"mass": "0.8:1.2"}: of the object, which the controller is told; or of the
            worlds alone, {"world.mass": (0.8, 1.2)}.
        seed: of what is drawn, as of `simulate`.
        sampling: of `SAMPLING`: which members of the set the worlds are.
        out: a Parquet file for the rows.
        resume: go on with a sweep that was begun, which gives the rows that it would have given.
        chunk: how many worlds are run at once, and lost at most by a kill; None: as many as fit into some 250 MB.
        executor: where the chunks are run, of `concurrent.futures` or alike; None: here, one after the other.
        progress: called after each chunk.
        overrides: keys of the scenario.

    Raises:
        ValueError: an unknown scenario or key, or a value out of range; it is named.
    """
    one_of("sampling", sampling, tuple(SAMPLING))
    if resume and out is None:
        raise fail("resume", resume, "given with out, the file in which a sweep was begun")
    case = (scenario(name) if isinstance(name, str) else name).change(**overrides, **_intervals(vary))
    begun = set_up(case, None, worlds=2, seed=seed, first_world=0)
    if begun.world.values is None or case.differing is None:
        raise fail("vary", dict(vary), "at least one key of the object as an interval")
    for key, count in (("worlds", worlds), ("chunk", chunk)):
        if count is not None and (isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 1):
            raise fail(key, count, "a whole number >= 1")
    sets = {key: case.differing[key] for key in begun.world.values.names}
    size = max(1, CHUNK // begun.steps) if chunk is None else int(chunk)
    values = sampled_values(sets, sampling, int(seed), int(worlds))
    firsts = range(0, int(worlds), size)
    tasks = [ChunkTask(case, int(seed), first, values.part(first, size)) for first in firsts]
    if out is None:
        return Swept(case, int(seed), sampling, _joined(dict(_run(tasks, range(len(tasks)), executor, progress))))
    path = Path(out)
    parts = PartFiles(path, _plan(case, int(worlds), int(seed), sampling, size), resume)
    if not parts.complete:
        missing = parts.missing(len(tasks))
        for chunk, rows in _run(tasks, missing, executor, progress, parts.failed(len(tasks))):
            parts.write(chunk, rows)
        parts.join(len(tasks))
    return Swept(case, int(seed), sampling, rows_in(path))


def read_sweep(path: Path | str) -> Swept:
    """A sweep that has come to its end, from its file.

    Raises:
        ValueError: it is no file of a sweep.
    """
    plan = plan_of(Path(path))
    with refused_unless(Path(path), WHOLE):
        file, sampling = described(json.loads(plan["scenario"]), Path(path).parent), plan["sampling"]
    return Swept(file.scenario, file.seed, sampling, rows_in(Path(path)))


def _intervals(vary: Mapping[str, Any]) -> dict[str, Any]:
    """Refuse to vary what is no interval."""
    from pivoting.sim.scenarios.intervals import read_interval

    found = {key: read_interval(key, value) for key, value in vary.items()}
    for key, value in found.items():
        if not isinstance(value, Interval):
            raise fail(key, value, "an interval LOW:HIGH, to be varied")
    return found


def _plan(case: Scenario, worlds: int, seed: int, sampling: str, size: int) -> dict[str, Any]:
    """What is run, as a file can say it."""
    if not expressible(case):
        raise fail("out", case.name, "left out: a Python object, which no file holds, is part of the scenario")
    said = written(ScenarioFile(case, worlds, seed, keep="measures", versions=VERSIONS))
    return {"scenario": json.dumps(said), "sampling": sampling, "worlds": worlds, "chunk": size}


def _run(
    tasks: Sequence[ChunkTask],
    chunks: Sequence[int],
    executor: Executor | None,
    progress: Report | None,
    failed: int = 0,
) -> Iterator[tuple[int, Rows]]:
    """Run some of the chunks, and yield the rows of each as they come.

    Args:
        failed: worlds of the other chunks that failed.
    """
    worlds, start = sum(task.worlds for task in tasks), perf_counter()
    began = done = worlds - sum(tasks[chunk].worlds for chunk in chunks)
    for chunk, rows in _results(tasks, chunks, executor):
        yield chunk, rows
        done, failed = done + tasks[chunk].worlds, failed + int(np.count_nonzero(~rows["passed"].astype(bool)))
        if progress is not None:
            progress(SweepProgress(done, worlds, failed, began, perf_counter() - start))


def _results(
    tasks: Sequence[ChunkTask], chunks: Sequence[int], executor: Executor | None
) -> Iterator[tuple[int, Rows]]:
    if executor is None:
        yield from ((chunk, run_chunk(tasks[chunk])) for chunk in chunks)
        return
    waiting: dict[Future[Rows], int] = {}
    try:
        for chunk in chunks:
            waiting[executor.submit(run_chunk, tasks[chunk])] = chunk
            if len(waiting) >= AHEAD:
                yield from _first(waiting)
        while waiting:
            yield from _first(waiting)
    finally:  # after an error, or an interrupt
        for future in waiting:
            future.cancel()


def _first(waiting: dict[Future[Rows], int]) -> Iterator[tuple[int, Rows]]:
    """Those that are done next."""
    for future in wait(waiting, return_when=FIRST_COMPLETED).done:
        yield waiting.pop(future), future.result()


def _joined(chunks: Mapping[int, Rows]) -> Rows:
    """All rows, in the order of the chunks."""
    return {name: np.concatenate([chunks[chunk][name] for chunk in sorted(chunks)]) for name in chunks[0]}
