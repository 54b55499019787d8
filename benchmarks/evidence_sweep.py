"""Ten thousand worlds of pivot-2d and of pivot-3d in which everything is wrong at once: what a guarantee is worth.

Half of the worlds are drawn from the set, half are its vertices. Only a noisy and late pose is measured, and each world
is shoved once. A world holds if its contact slips at most 1 mm more than the simulator itself causes, its angle is
never off by more than 0.5 deg, and its steady error is at most 0.1 deg.

Beside the guarantee are some of the same worlds, 2,000 in the plane and 500 in space, without it, and with the
smallest constant floor under the normal force with which none of them fails. It is found by bisection on these very
worlds, in hindsight, with the least friction of the set believed, which makes it smaller. Among all ten thousand it
would be no smaller. Where none of up to 4,096 N will do, because the smallest wrench of the believed object uses all of
its friction however hard it presses, the figures are those of 64 N.
"""

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from typing import Any

import numpy as np
from harness import main
from pivoting.controller.rotations import CONJUGATE, quaternion_product
from pivoting.sim import Run, scenario
from pivoting.sim.engine_log import engine_log
from pivoting.sim.fleet import Handed
from pivoting.sim.scenarios.intervals import read_interval
from pivoting.sim.simulation import run_worlds
from pivoting.sim.sweeping.chunk_task import ChunkTask, rows_of, set_up_chunk
from pivoting.sim.sweeping.sampling import sampled_values
from rich.progress import track
from scipy.stats import binomtest

SIDES = {"pivot-2d": {"x": 1.0, "z": 1.0}, "pivot-3d": {"x": 1.0, "y": 0.7, "z": 1.4}}  # of the block [m]
SET = {"mu": "0.25:0.8", "mass": "0.8:1.2", "inertia": "0.8:1.2"}
SHARE = 0.05  # of each side, by which the centre of mass may be off either way
REAL = {"noise": 0.1, "noise_position": 0.0005, "delay": 0.002, "shove": 0.2}
CONTROL = {"observer": 60.0, "disturbance": 20.0, "margin": 0.0}
BOUNDS = {"shove_bound": 0.2, "omega_error": 12.0}  # what the guarantee counts with, of the pose estimated too
THETA_ERROR = {"pivot-2d": 0.15, "pivot-3d": 0.2}  # [deg]
SLIP_M, ANGLE_DEG, STEADY_DEG = 1e-3, 0.5, 0.1
REST_S, AFTER_S = 0.1, 0.2  # over which the steady error is taken, and how long ago the shove has to be
CHUNK, WORLDS, COMPARED = 125, 10_000, {"pivot-2d": 2_000, "pivot-3d": 500}
FIRST, HIGHEST, FINE = 64.0, 4096.0, 0.01  # floors [N]: tried first, and at most; and how finely, of each


def case(name: str, guarantee: str, floor: float = 0.0) -> Any:
    """The scenario in which these worlds are run."""
    coms = {f"com_{axis}": f"{-SHARE * side:g}:{SHARE * side:g}" for axis, side in SIDES[name].items()}
    told: dict[str, Any] = {**SET, **coms}
    if guarantee == "set":
        told |= {**BOUNDS, "theta_error": THETA_ERROR[name]}
    if floor:
        told |= {"f_min": floor, "world.mu": told["mu"], "mu": 0.25}
    changes = {**told, **REAL, **CONTROL, "guarantee": guarantee}
    return scenario(name).change(
        **{key: read_interval(key, value) if ":" in str(value) else value for key, value in changes.items()},
        limits={"settle_s": 0.0},
    )


def tasks(name: str, worlds: int, guarantee: str, floor: float = 0.0) -> list[ChunkTask]:
    """The chunks of all worlds: the first half drawn, the second the vertices in turn."""
    asked = case(name, guarantee, floor)
    begun = set_up_chunk(ChunkTask(asked, 0, 0, sampled_values(asked.differing, "drawn", 0, 2)))
    names = begun.world.values.names
    sets = {key: asked.differing[key] for key in names}
    found, half = [], worlds // 2
    for kind, first in (("drawn", 0), ("vertices", half)):
        values = sampled_values(sets, kind, 0, half)
        found += [ChunkTask(asked, 0, first + i, values.part(i, CHUNK)) for i in range(0, half, CHUNK)]
    return found


def run_chunk(task: ChunkTask) -> dict[str, np.ndarray]:
    """A row for each world of a chunk, with what the verdict does not ask for."""
    with engine_log():
        run = run_worlds(set_up_chunk(task), Handed(), None, nullcontext([]))
    return {**rows_of(run, task), **costs(run), **estimates(run), "steady_deg": steady(run)}


def costs(run: Run) -> dict[str, np.ndarray]:
    """What is minimised, in the mean of all steps, and the applied force, RMS."""
    controller, dim = run.controller_of(0), run.truth.dim
    force = run.force.reshape(run.worlds, run.time.size - 1, -1)
    wrench = np.einsum("wni,ij,wnj->w", run.wrench, controller.Q_w, run.wrench)
    inside = np.einsum("wni,ij,wnj->w", force, controller.Q_f, force)
    steps = run.time.size - 1
    square = np.einsum("wni,wni->w", run.wrench[..., :dim], run.wrench[..., :dim])
    return {"objective": 0.5 * (wrench + inside) / steps, "force_square": square / steps}


def estimates(run: Run) -> dict[str, np.ndarray]:
    """By how much the observer was off at most."""
    known, true = run.log.estimated, run.log.states[:, :-1]
    off = quaternion_product(np.array(known[..., 3:7]), np.array(true[..., 3:7]) * CONJUGATE)
    angle = 2.0 * np.arcsin(np.clip(np.linalg.norm(off[..., 1:], axis=-1), 0.0, 1.0))
    rate = np.linalg.norm(known[..., 10:13] - true[..., 10:13], axis=-1)
    return {"theta_off_deg": np.rad2deg(angle).max(axis=1), "omega_off_deg": np.rad2deg(rate).max(axis=1)}


def steady(run: Run) -> np.ndarray:
    """The mean error at rest at the end; nan in worlds that were shoved just before."""
    last = round(REST_S / run.dt)
    error = np.rad2deg(np.abs(run.angle_error[:, -last:].mean(axis=1)))
    for event in run.events:
        if event.time > run.time[-1] - REST_S - AFTER_S:
            error[event.world] = np.nan
    return error


def lost(rows: dict[str, np.ndarray]) -> np.ndarray:
    """(W,) whether a world does not hold; one whose readings are no numbers does not."""
    beyond = rows["slip_max_m"] - np.nan_to_num(rows["slip_floor_m"])
    steady = np.nan_to_num(rows["steady_deg"], nan=0.0)
    return ~((beyond <= SLIP_M) & (rows["angle_error_max_deg"] <= ANGLE_DEG) & (steady <= STEADY_DEG))


def run_all(pool: ProcessPoolExecutor, chunks: Sequence[ChunkTask], words: str) -> Iterator[dict[str, np.ndarray]]:
    """The rows of chunks, in their order."""
    yield from track(pool.map(run_chunk, chunks), words, total=len(chunks), transient=True)


def smallest_floor(pool: ProcessPoolExecutor, name: str, worlds: int, order: Sequence[int]) -> float:
    """The smallest constant floor [N] with which no world of some chunks fails.

    Args:
        order: the chunks, those first in which most worlds fail without a floor.

    Returns:
        inf where no floor of up to `HIGHEST` will do.
    """
    suspects, low, high = list(order[:2]), 0.0, FIRST

    def fails(floor: float, which: Sequence[int]) -> list[int]:
        chunks = tasks(name, worlds, "none", floor)
        rows = run_all(pool, [chunks[i] for i in which], f"{name}: floor of {floor:g} N")
        return [i for i, each in zip(which, rows, strict=True) if lost(each).any()]

    while True:
        while fails(high, suspects):
            low, high = high, 2.0 * high
            if high > HIGHEST:
                return float("inf")
        while high - low > FINE * high:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if fails(middle, suspects) else (low, middle)
        found = fails(high, [i for i in order if i not in suspects])
        if not found:
            return high
        suspects, low, high = found[:2], high, 2.0 * high


def said(words: str, rows: Sequence[dict[str, np.ndarray]]) -> dict[str, float]:
    """The figures of one way to hold all worlds."""
    all_rows = {key: np.concatenate([each[key] for each in rows]) for key in rows[0]}
    failed, half = lost(all_rows), len(all_rows["world"]) // 2
    beyond = all_rows["slip_max_m"] - np.nan_to_num(all_rows["slip_floor_m"])
    test = binomtest(int(failed[:half].sum()), half, alternative="less")
    return {
        f"{words}: failures of those drawn": float(failed[:half].sum()),
        f"{words}: bound on their share, 95 %": float(test.proportion_ci(0.95, method="exact").high),
        f"{words}: failures of the vertices": float(failed[half:].sum()),
        f"{words}: slip beyond the floor, mm": 1e3 * float(beyond.max()),
        f"{words}: slip, mm": 1e3 * float(all_rows["slip_max_m"].max()),
        f"{words}: worlds that slip more than 1 mm": float((beyond > SLIP_M).sum()),
        f"{words}: angle error at any time, deg": float(all_rows["angle_error_max_deg"].max()),
        f"{words}: steady error, deg": float(np.nanmax(all_rows["steady_deg"])),
        f"{words}: estimated angle off, deg": float(all_rows["theta_off_deg"].max()),
        f"{words}: estimated rate off, deg/s": float(all_rows["omega_off_deg"].max()),
        f"{words}: objective, mean, N^2": float(all_rows["objective"].mean()),
        f"{words}: force, RMS, N": float(np.sqrt(all_rows["force_square"].mean())),
    }


def measure(quick: bool) -> Iterator[dict[str, float]]:
    """The figures of one scenario after the other; see the head of this file."""
    worlds = 1000 if quick else WORLDS
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        for name in SIDES:

            def run_some(words: str, which: Sequence[int], *how: Any, name: str = name) -> list[dict[str, np.ndarray]]:
                chunks = tasks(name, worlds, *how)
                return list(run_all(pool, [chunks[i] for i in which], f"{name}: {words}"))

            compared = 500 if quick else COMPARED[name]
            every, some = range(worlds // CHUNK), range(compared // CHUNK // 2)
            same = [*some, *(len(every) // 2 + i for i in some)]
            with_set = run_some("guaranteed", every, "set")
            figures = {f"{name}: worlds": float(worlds), **said(f"{name}, guaranteed", with_set)}
            without = run_some("not guaranteed", same, "none")
            order = [same[i] for i in np.argsort([-lost(each).sum() for each in without], kind="stable")]
            floor = smallest_floor(pool, name, worlds, order)
            constant = run_some("floor", same, "none", floor if floor <= HIGHEST else FIRST)
            figures[f"{name}: worlds compared"] = float(compared)
            figures[f"{name}: smallest constant floor without a failure, N"] = floor
            ways = {"guaranteed": [with_set[i] for i in same], "not guaranteed": without, "constant floor": constant}
            for how, rows in ways.items():
                figures |= said(f"{name} compared, {how}", rows)
            costs = (
                figures[f"{name} compared, {how}: objective, mean, N^2"] for how in ("guaranteed", "constant floor")
            )
            figures[f"{name}: objective, guaranteed over constant floor"] = float(np.divide(*costs))
            yield figures


if __name__ == "__main__":
    asked = {}
    for name in SIDES:
        asked[f"{name}, guaranteed: failures of those drawn"] = 0.0
        asked[f"{name}, guaranteed: failures of the vertices"] = 0.0
        asked[f"{name}, guaranteed: estimated angle off, deg"] = THETA_ERROR[name]
        asked[f"{name}, guaranteed: estimated rate off, deg/s"] = BOUNDS["omega_error"]
        asked[f"{name}: objective, guaranteed over constant floor"] = 1.0
    main(__doc__ or "", measure, asked)
