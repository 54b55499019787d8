"""Many worlds, run in chunks: of each only what the policy says is kept, so that the memory is bounded."""

import ctypes
from collections.abc import Callable, Mapping
from contextlib import nullcontext, suppress
from dataclasses import replace
from typing import Any

import numpy as np
from pivoting.sim.engine_log import engine_log
from pivoting.sim.experiment import freeze
from pivoting.sim.fleet import SAMPLES, Fleet, Handed, WorldSamples
from pivoting.sim.judging.advice import reasons, remedies
from pivoting.sim.judging.findings import Findings, bounded_steps, unguaranteed_steps
from pivoting.sim.judging.measures import Measures, slip_floor_unknown
from pivoting.sim.judging.undeclared_contacts import stray_words
from pivoting.sim.pipeline.plan_log import Event, PlanLog
from pivoting.sim.run import Run
from pivoting.sim.run_setup import Begun
from pivoting.sim.simulation import run_worlds

CHUNK = 250_000  # worlds times steps that are in memory at once, about 1 kB each with what is measured of them
EVENTS = 1000  # that are kept

Report = Callable[[int, int], None]


def run_in_chunks(begun: Begun, handed: Handed, keep: str, progress: Report | None) -> Fleet:
    """Run all worlds; no world knows which others are in its chunk.

    Args:
        keep: "measures" or "reduced".  progress: called with (done, all), steps times worlds.
    """
    worlds, steps = begun.setting.worlds, begun.steps
    size = max(1, CHUNK // steps)
    kept = _Kept(worlds, steps, keep == "reduced")
    with engine_log() as warned:
        for first in range(0, worlds, size):
            part = begun.part(first, min(size, worlds - first))
            kept.add(run_worlds(part, handed, _report(progress, part, first, worlds * steps), nullcontext([])), first)
            give_back()
    fleet = kept.fleet(begun, handed, tuple(warned))
    if not fleet.failed_worlds.size:
        return fleet
    worst = run_worlds(begun.part(fleet.worst_world, 1), handed, None, engine_log())
    found = fleet.findings._replace(
        reasons=reasons(worst, fleet.strays), remedies=[each.setting for each in remedies(worst)]
    )
    return replace(fleet, findings=found)


def give_back() -> None:
    """Have glibc return what a chunk has freed: it keeps it in pieces that the next may not fit into, ever more."""
    with suppress(AttributeError, OSError, TypeError):  # another C library, which has no such function
        ctypes.CDLL(None).malloc_trim(0)


def _report(progress: Report | None, part: Begun, first: int, of: int) -> Report | None:
    """What tells of the steps of one chunk."""
    if progress is None:
        return None
    return lambda done, steps: progress(first * steps + done * part.setting.worlds, of)


class _Kept:
    """What is kept of the chunks that have been run."""

    def __init__(self, worlds: int, steps: int, reduced: bool):
        self._worlds, self._reduced = worlds, reduced
        self._arrays: dict[type, dict[str, Any]] = {Measures: {}, WorldSamples: {}, PlanLog: {}}  # by name
        self._control_ns, self._wall_s = np.zeros(steps), 0.0
        self._events: list[Event] = []
        self._left_out = self._most_strayed = 0
        self._found = Findings("", 0, [], [], [])

    def add(self, run: Run, first: int) -> None:
        """Keep what is to be kept of a chunk whose first world has this index in the fleet."""
        self._write(Measures, vars(run.measures), first)
        if self._reduced:
            self._write(WorldSamples, samples(run)._asdict(), first, "time")
        if run.plans is not None:
            self._write(PlanLog, run.plans._asdict(), first, "step")
        self._control_ns += run.log.control_ns
        self._wall_s += run.wall_s
        events = [event._replace(world=first + event.world) for event in run.events]
        self._events += sorted(events, key=lambda event: event.world)
        self._left_out += len(self._events[EVENTS:])
        del self._events[EVENTS:]
        self._find(run, first)

    def _write(self, kind: type, values: Mapping[str, Any], first: int, shared: str = "") -> None:
        """Write arrays (chunk, ...) into those of all worlds, which are there from the first chunk on.

        Args:
            shared: name of an array that is the same in all chunks.
        """
        kept = self._arrays[kind]
        for name, part in values.items():
            if name == shared:
                kept[name] = part
            else:
                if name not in kept:
                    kept[name] = np.empty((self._worlds, *part.shape[1:]), part.dtype)
                kept[name][first : first + len(part)] = part

    def _find(self, run: Run, first: int) -> None:
        """What there is to say of the chunk, as of a run of all worlds."""
        found = self._found
        strayed = int(np.count_nonzero(run.log.contacts.strays > 0.0, axis=1).max())
        if strayed > self._most_strayed:
            self._most_strayed = strayed
            found = found._replace(strays=stray_words(run, first))
        unknown = found.slip_floor_unknown or slip_floor_unknown(run, first, self._worlds)
        self._found = found._replace(
            slip_floor_unknown=unknown,
            bounded_steps=found.bounded_steps + bounded_steps(run),
            unguaranteed_steps=found.unguaranteed_steps + unguaranteed_steps(run),
        )

    def fleet(self, begun: Begun, handed: Handed, warned: tuple[str, ...]) -> Fleet:
        """The fleet, without why it failed."""
        sampled, plans = self._arrays[WorldSamples], self._arrays[PlanLog]
        fleet = Fleet(
            **begun.experiment,
            wall_s=self._wall_s,
            plans=PlanLog(**plans) if plans else None,
            events=tuple(self._events),
            engine_warnings=(*begun.world.warned, *warned),
            python_objects=handed.names,
            measures=Measures(**self._arrays[Measures]),
            samples=WorldSamples(**sampled) if sampled else None,
            findings=self._found,
            control_us=self._control_ns / (1e3 * self._worlds),
            events_left_out=self._left_out,
            handed=handed,
        )
        freeze(tuple(vars(fleet).values()))
        return fleet


def samples(run: Run) -> WorldSamples:
    """Those of each world of a run."""
    steps = len(run.time) - 1
    at = slice(0, steps, -(-steps // SAMPLES))
    return WorldSamples(
        time=run.time[at].copy(),
        theta=run.theta[:, at].copy(),
        angle_error=run.angle_error[:, at].copy(),
        slip=run.slip[:, at].copy(),
        wrench=run.wrench[:, at].copy(),
        friction_use=run.friction_use[:, at].copy(),
    )
