"""The same closed loop in another physics engine: Drake in place of MuJoCo.

Scene, start, reference, controller and time step are those of the shipped scenario; only the engine differs that takes
the wrench and gives the next state. The figures are the slip of the contact and the angle error in both engines, how
far apart their angles and contact forces are, and the slip that first-order integration alone adds to the path of a
turning corner: the length of the sum of h^2 / 2 omega x (omega x r) over the steps, along the table.

Drake is run with both of its models of contact, and each with all its convex approximations; of these the least and the
greatest figure are kept. It has no wheel for Windows.

    python benchmarks/engines.py --json benchmarks/results/engines.json
"""

from typing import NamedTuple

import numpy as np
from harness import main
from numpy.typing import NDArray
from pivoting.controller.kernels.compiled_step import world_wrench
from pivoting.controller.rotations import angle_between, rotated
from pivoting.sim import simulate
from pivoting.sim.pipeline.bounded_control import applied
from pivoting.sim.pipeline.stages import ANGULAR_VELOCITY, ORIENTATION, POSITION, Answers
from pivoting.sim.run import Run
from pivoting.sim.run_setup import set_up
from pivoting.sim.scenario_control import decide, laws_of, stages_of
from rich.progress import track

Array = NDArray[np.float64]
KINDS = ("point", "hydroelastic")
APPROXIMATIONS = ("sap", "similar", "lagged")
CLOSE = {"angle against MuJoCo's, greatest, deg": 0.005, "contact force against MuJoCo's, RMS, %": 1.0}
SCENARIOS = ("balance-2d", "incline-2d", "pivot-2d", "snap-2d", "mpc-2d", "pivot-3d", "settle-3d")


class Path(NamedTuple):
    """How one world moved in N steps.

    Attributes:
        position: (N+1, 3) of the centre of mass, world axes [m].  orientation: (N+1, 4) object axes to world.
        omega: (N+1, 3) angular velocity, world axes [rad/s].
        force: (N, 3) of all contacts on the object during each step, world axes [N].
    """

    position: Array
    orientation: Array
    omega: Array
    force: Array


def in_drake(run: Run, kind: str, approximation: str) -> Path:
    """The closed loop of a run of one world, from the same start, in Drake."""
    from drake_world import DrakeWorld  # of the extra [bench]

    begun = set_up(run.scenario, None, worlds=1, seed=run.seed, first_world=run.first_world)
    there, start = begun.world, run.start[0][0]
    world = DrakeWorld(there.model, there.truth, there.mu, start, kind=kind, approximation=approximation)
    world.rest(run.wrench_world[0, 0], float(run.force[0, 0, :, -1].sum()))
    stages, controller = stages_of(begun), begun.belief.attached.controller
    control = decide(begun, stages, laws_of(begun, stages)).control  # as `simulate` has it
    answers = Answers.empty((begun.steps, 1), *controller.widths)
    states, force, wrench, before = world.states, np.empty((begun.steps, 3)), np.empty(6), None
    control.prepare(states, Answers.empty((1,), *controller.widths))
    values = [states.values[0]]
    for k in range(begun.steps):
        control(k, states, before, now := Answers(answers.values[k], answers.status[k], answers.nw))
        before = now.wrench
        world_wrench(controller.belief.source.map, states.orientation[0], applied(before)[0], wrench)
        force[k] = world.step(wrench)
        states = world.states
        values.append(states.values[0])
    moved = np.array(values)
    return Path(moved[:, POSITION], moved[:, ORIENTATION], moved[:, ANGULAR_VELOCITY], force)


def in_mujoco(run: Run) -> Path:
    """The run itself."""
    force = run.log.contacts.force[0].sum(axis=1)
    return Path(run.position[0], run.quaternion[0], run.angular_velocity[0], force)


def slip(run: Run, path: Path) -> float:
    """Greatest displacement [mm] of a contact along the table from where it started."""
    at = path.position[:, None] + rotated(path.orientation[:, None], run.points)
    return 1e3 * float(np.linalg.norm(((at - at[0]) @ run.table_axes)[..., :2], axis=-1).max())


def integration_alone(run: Run, path: Path) -> float:
    """The slip [mm] that a first-order integrator makes of the turn of a corner, whatever its contact is."""
    r, omega = rotated(path.orientation[:, None], run.points), path.omega[:, None]
    drift = 0.5 * run.dt**2 * np.cumsum(np.cross(omega, np.cross(omega, r)), axis=0) @ run.table_axes
    return 1e3 * float(np.linalg.norm(drift[..., :2], axis=-1).max())


def compared(run: Run, path: Path) -> dict[str, float]:
    """What is judged of a path: its slip, its angle, and how far it is from MuJoCo's."""
    here, settled = in_mujoco(run), run.time >= run.limits.settle_s - 1e-12
    steps = settled[:-1]
    counted = steps & ~run.landed[0] if run.scenario.limits.contacts_end else steps  # then others share the load
    rms = {
        name: float(np.sqrt(np.mean(np.square(values))))
        for name, values in (
            ("angle", np.rad2deg(angle_between(path.orientation, run.desired[0]))[settled]),
            ("force", here.force[counted]),
            ("off", path.force[counted] - here.force[counted]),
        )
    }
    pushed = path.force @ run.table_axes[:, 2] > 0.0
    return {
        "slip, mm": slip(run, path),
        "angle error, RMS, deg": rms["angle"],
        "angle against MuJoCo's, greatest, deg": float(
            np.rad2deg(angle_between(path.orientation, here.orientation)[settled].max())
        ),
        "contact force against MuJoCo's, RMS, %": 100.0 * rms["off"] / rms["force"],
        "without contact, s": float(np.count_nonzero(~pushed[steps]) * run.dt),
    }


def measure(quick: bool) -> dict[str, float]:
    """The figures; see the head of this file."""
    out = {}
    for name in track(SCENARIOS, "scenarios", transient=True):
        run = simulate(name, landing="ignored")  # one stance: Drake's world does not tell how many contacts it has
        here = in_mujoco(run)
        judged = compared(run, here)
        out |= {f"{name}: MuJoCo, {what}": judged[what] for what in ("slip, mm", "angle error, RMS, deg")}
        out[f"{name}: integration alone, slip, mm"] = integration_alone(run, here)
        for kind in KINDS:
            used = APPROXIMATIONS[:1] if quick else APPROXIMATIONS
            found = [compared(run, in_drake(run, kind, each)) for each in used]
            for what in found[0]:
                values = [figures[what] for figures in found]
                out[f"{name}: Drake, {kind}, {what}, least"] = min(values)
                out[f"{name}: Drake, {kind}, {what}, greatest"] = max(values)
    return out


if __name__ == "__main__":
    bounds = {
        f"{name}: Drake, {kind}, {what}, greatest": bound
        for name in SCENARIOS
        for kind in KINDS
        for what, bound in {**CLOSE, "without contact, s": 0.0}.items()
    }
    main(__doc__ or "", measure, bounds)
