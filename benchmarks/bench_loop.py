"""The closed loop against bare physics: the same scene, alternating in one run.

One world: `simulate` (read, state, solve, certify, apply, step, log) against a loop of nothing but `mj_step`.
256 worlds: against an open-loop `Batch.step` of the same motion, the run's own wrenches played back from its own start
(bit for bit the same states, which is checked), and against one with a constant wrench, whose block hardly moves; that
restarts every 200 steps, so that the block is still on its corner. Ratios are medians over pairs.

The scenarios that plan, one world, a hundred plans a second: simulated over real time, median of the runs, and what a
plan costs in the loop, where everything else has been in the caches since the last.
"""

import tempfile
from pathlib import Path
from time import perf_counter

import mujoco
import numpy as np
from harness import main
from mujoco.batch import Batch
from pivoting.models import load
from pivoting.models.sensors import instrument
from pivoting.sim import scenario, simulate
from pivoting.sim.drawing.rerun_recording import record
from pivoting.sim.run import Run

SCENARIO, RESTART = "pivot-2d", 200
REAL_TIME = {"mpc-2d": 3.0, "mpc-3d": 1.5}  # asked


def bare(run: Run, steps: int) -> float:
    """Seconds a step of `mj_step` alone, one world."""
    model = load(run.scenario.path, run.scenario.actual).compile()
    data = mujoco.MjData(model)
    qpos = model.keyframe("start").qpos
    wrench = run.wrench_world[0, 50]
    spent = 0.0
    for _ in range(steps // RESTART):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = qpos
        data.xfrc_applied[run.truth.index] = wrench
        start = perf_counter()
        for _ in range(RESTART):
            mujoco.mj_step(model, data)
        spent += perf_counter() - start
    return spent / (steps // RESTART * RESTART)


def fleet_model(run: Run) -> mujoco.MjModel:
    """The model that the loop steps, sensors included."""
    return instrument(load(run.scenario.path, run.scenario.actual))[0]


def replay(run: Run) -> float:
    """Seconds a step of `Batch.step` alone, all worlds, with the wrenches of the run: the same motion, open loop."""
    batch, steps = Batch(fleet_model(run), run.worlds, persistent=True), run.time.size - 1
    batch.bind("qpos")[:], batch.bind("qvel")[:] = run.start
    wrench = np.ascontiguousarray(np.moveaxis(run.wrench_world, 1, 0))
    xfrc, stage = batch.bind("xfrc_applied")[:, run.truth.index], int(mujoco.mjtStage.mjSTAGE_VEL)
    batch.forward(stage=stage)
    start = perf_counter()
    for k in range(steps):
        xfrc[:] = wrench[k]
        batch.step(stage=stage)
    spent = perf_counter() - start
    assert np.array_equal(batch.bind("sensordata")[:, 3:7], run.quaternion[:, -1])
    return spent / steps


def constant(run: Run, steps: int) -> float:
    """Seconds a step of `Batch.step` alone, all worlds, with a constant wrench."""
    model = fleet_model(run)
    batch = Batch(model, run.worlds, persistent=True)
    stage, spent = int(mujoco.mjtStage.mjSTAGE_VEL), 0.0
    for _ in range(max(1, steps // RESTART)):
        batch.reset(stage=int(mujoco.mjtStage.mjSTAGE_NONE))
        batch.bind("qpos")[:] = model.keyframe("start").qpos
        batch.bind("xfrc_applied")[:, run.truth.index] = run.wrench_world[0, 50]
        batch.forward(stage=stage)
        start = perf_counter()
        for _ in range(RESTART):
            batch.step(stage=stage)
        spent += perf_counter() - start
    return spent / (max(1, steps // RESTART) * RESTART)


def measure(quick: bool) -> dict[str, float]:
    """The figures; see the head of this file."""
    rounds = 5 if quick else 25
    first = simulate(SCENARIO)  # compiled and warm before anything is timed
    steps = first.time.size - 1
    pairs = []
    for _ in range(rounds):
        closed = simulate(SCENARIO)
        pairs.append((closed.wall_s / steps, bare(closed, steps), float(np.median(closed.control_us))))
    one = np.array(pairs)
    fleet = []
    for _ in range(rounds):
        many = simulate(SCENARIO, worlds=256, seconds=0.2, hold=0.05)
        steps_many = many.time.size - 1
        fleet.append((many.wall_s / steps_many, replay(many), constant(many, steps_many)))
    pair = np.array(fleet)
    return {
        "one world: closed / bare mj_step": float(np.median(one[:, 0] / one[:, 1])),
        "one world: closed, us a step": 1e6 * float(np.median(one[:, 0])),
        "one world: bare mj_step, us": 1e6 * float(np.median(one[:, 1])),
        "one world: state, solve, certify, us": float(np.median(one[:, 2])),
        "256 worlds: closed / open Batch.step": float(np.median(pair[:, 0] / pair[:, 1])),
        "256 worlds: closed / constant wrench": float(np.median(pair[:, 0] / pair[:, 2])),
        "256 worlds: closed, us a step and world": 1e6 / 256 * float(np.median(pair[:, 0])),
        "256 worlds: open, us a step and world": 1e6 / 256 * float(np.median(pair[:, 1])),
        "recording written when the loop is over, s": recorded(rounds),
        **planning(rounds),
    }


def planning(rounds: int) -> dict[str, float]:
    """Real-time factors of the scenarios that plan, and milliseconds a plan, of each the median run."""
    out = {}
    for name in REAL_TIME:
        simulate(name, seconds=0.5)  # warm
        runs = [simulate(name).summary() for _ in range(rounds)]
        for key, what in (("real_time_factor", "times real time"), ("plan_ms_median", "ms a plan")):
            out[f"{name}: {what}"] = float(np.median([run[key] for run in runs]))
    return out


def recorded(rounds: int) -> float:
    """Median seconds to write the recording of a run: nothing is recorded in the loop, so it cannot slow it."""
    writing = []
    with tempfile.TemporaryDirectory() as folder:
        run = simulate(SCENARIO)
        for _ in range(max(5, rounds // 2)):
            start = perf_counter()
            record(run, Path(folder) / "run.rrd")
            writing.append(perf_counter() - start)
    return float(np.median(writing))


if __name__ == "__main__":
    assert scenario(SCENARIO).scene == SCENARIO
    main(
        __doc__ or "",
        measure,
        {
            "one world: closed / bare mj_step": 5.0,
            "256 worlds: closed / open Batch.step": 1.5,
        },
        floors={f"{name}: times real time": factor for name, factor in REAL_TIME.items()},
    )
