"""The closed loop, over a leading world axis: read the state, solve, apply, step. Judged when it is over."""

from collections.abc import Callable
from time import perf_counter, perf_counter_ns
from typing import Any, NamedTuple

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray
from pivoting.controller.controller import WrenchController, world_wrench
from pivoting.controller.rotations import Turn
from pivoting.controller.so3 import exponential
from pivoting.controller.space import quaternion_product, space
from pivoting.controller.validate import fail
from pivoting.models.reading import RigidBody, matrix, place, read_friction, turn
from pivoting.models.scenes import compiled, instrument, load
from pivoting.sim.attach import Attached, attach
from pivoting.sim.control import Answers, BoundedControl, Control, LawControl, States
from pivoting.sim.engine_log import engine_log
from pivoting.sim.fidelity import ContactRows, read_rows
from pivoting.sim.keys import CONTROL_KEYS
from pivoting.sim.plan import Plan, planned
from pivoting.sim.planning import horizon_control, play_control
from pivoting.sim.run import Run
from pivoting.sim.scenario import Scenario, scenario

Array = NDArray[np.float64]
START_DEPTH = 1e-6  # of the lever from contact to CoM: there is contact from the first step on
MAX_STEPS = 10_000_000  # worlds times steps that are kept in memory, about 0.5 kB each


def simulate(
    name: str | Scenario,
    worlds: int = 1,
    seed: int = 0,
    *,
    controller: WrenchController | None = None,
    progress: Callable[[int, int], None] | None = None,
    open_loop: bool = False,
    **overrides: Any,
) -> Run:
    """Run a scenario in closed loop in MuJoCo and measure it.

    Args:
        name: of a shipped scenario, or a `Scenario`.
        worlds: how many; they differ by their initial angle errors, drawn from `seed`. World i of one run is world i of
            any other with the same seed.
        seed: same seed, same arrays, bit for bit.
        controller: to be tested in place of the scenario's own, which is built from what the scenario believes.
        progress: called with (steps done, steps) about a hundred times.
        open_loop: plan the whole motion once, in steps of the scenario's `plan_step`, and apply those wrenches whatever
            happens: the run's `plan` is then to be compared with what MuJoCo makes of it.
        overrides: keys of the scenario; `world={"mu": 0.2}` or `**{"world.mu": 0.2}` changes the world alone.

    Raises:
        ValueError: an unknown scenario or key, or a value out of range; it is named.
        PlanError: open loop, and there is no plan.
    """
    if not isinstance(name, str | Scenario):
        raise fail("scenario", name, "a name or a Scenario")
    case = (scenario(name) if isinstance(name, str) else name).change(**overrides)
    for key, value, least in (("worlds", worlds, 1), ("seed", seed, 0)):
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
            raise fail(key, value, f"a whole number >= {least}")
    if case.gravity == 0.0 and case.f_min == 0.0:
        raise fail("gravity", 0.0, "> 0, or f_min > 0: without a load nothing presses the corner on the table")
    attached, believed = believe(case, controller)
    spec = load(case.path, case.actual, body=case.body, support=case.support, chosen=case.chosen)
    bare = compiled(spec)
    plan = planned(case, bare)
    truth = plan.body
    model, where = instrument(spec, truth, bare.geom(truth.support).name, plan.contacts)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # a world that diverges is seen, not reset
    # bodies of several geoms: a plane's bounding box is 5e9 m deep there, and misses contacts of less than 1e-6 m
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE
    dt = float(model.opt.timestep)
    steps = round(case.duration / dt)
    if steps < 2 or steps * worlds > MAX_STEPS:
        allowed = f"such that {worlds} worlds take 2 to {MAX_STEPS} steps together, at dt = {dt:g} s"
        raise fail("seconds", case.duration, allowed)
    if steps * dt <= case.limits.settle_s:
        raise fail("seconds", case.duration, f"more than the {case.limits.settle_s:g} s that the verdict lets settle")
    time: Array = dt * np.arange(steps + 1, dtype=float)
    reference, desired, _ = _desired(case, plan, time)
    # the controller knows only the table that it believes in
    told, follow = _desired(case, believed, time)[1:]
    for values in (time, *reference, *desired):
        values.flags.writeable = False

    batch = Batch(model, int(worlds), nthread=1 if worlds == 1 else 0, persistent=True)
    errors = np.deg2rad(case.spread) * np.random.default_rng(seed).uniform(-1.0, 1.0, int(worlds))
    rows = _start(batch, model, plan, desired, errors)
    start = (np.array(batch.bind("qpos")), np.array(batch.bind("qvel")))
    for values in start:
        values.flags.writeable = False

    bounds = case.bounds()
    control: Control = LawControl(attached.controller, told, bounds)
    horizons = played = None
    if open_loop:
        control = played = play_control(case, attached, believed, follow, dt, steps)
    elif case.plan_hz is not None:
        control = horizons = horizon_control(case, attached, believed, follow, int(worlds), dt, steps)
    if bounds.any and not open_loop:  # a plan is within them
        control = BoundedControl(control, attached.controller, bounds, dt)
    with engine_log() as warned:
        log = _loop(batch, control, attached.controller, truth, where, steps, progress)
    K, d = len(plan.contacts), truth.dim
    read = {key: log.sensors[..., columns] for key, columns in where.items()}
    forces = [read["contact"]] if K == 1 else [read[f"contact {i}"] for i in range(K)]
    axes = matrix(truth.table) @ space(d).force_map
    measured = np.stack([force[1:, :, 1:4] @ axes for force in forces], axis=2)
    return Run(
        scenario=case,
        seed=int(seed),
        attached=attached,
        model=model,
        truth=truth,
        points=np.array([space(d).lift(truth.point(contact)) for contact in plan.contacts]),
        radius=plan.radius,
        face=np.array([space(d).lift(truth.point(corner)) for corner in plan.face]),
        turn=(plan.axis, plan.start),
        mu_world=read_friction(model, truth.index, truth.support),
        contact_rows=rows,
        start=start,
        time=time,
        reference=reference,
        desired=desired,
        position=_worlds_first(read["position"]),
        quaternion=_worlds_first(read["quaternion"]),
        velocity=_worlds_first(read["velocity"]),
        angular_velocity=_worlds_first(read["angular_velocity"]),
        wrench=_worlds_first(log.wrench),
        wrench_world=_worlds_first(log.wrench_world),
        force=_worlds_first(log.force).reshape(worlds, steps, K, d),
        force_measured=_worlds_first(measured),
        contacts_found=_worlds_first(read["contact"][1:, :, 0]),
        residual=_worlds_first(log.residual),
        status=_worlds_first(log.status),
        control_us=_worlds_first((log.control_ns / (1e3 * worlds))[:, None])[0],
        wall_s=log.wall_s,
        plan=None if played is None else played.plan,
        plans=None if horizons is None else horizons.log,
        events=() if horizons is None else tuple(horizons.events),
        engine_warnings=tuple(warned),
        controller="scenario" if controller is None else "given",
    )


def _start(
    batch: Batch, model: mujoco.MjModel, plan: Plan, desired: tuple[Array, Array, Array], errors: Array
) -> ContactRows | None:
    """Put every world on its contact, off the reference by `errors` (W,) [rad]; its contact rows."""
    body = plan.body
    data, up, point = mujoco.MjData(model), matrix(body.table)[:, 2], plan.contacts[0]
    lever = float(np.linalg.norm(body.com - point) + plan.radius[0])
    at = plan.at + (plan.radius[0] - START_DEPTH * lever) * up
    for qpos, qvel, error in zip(batch.bind("qpos"), batch.bind("qvel"), errors, strict=True):
        place(model, data, body, quaternion_product(exponential(error * plan.axis), desired[0][0]), point, at)
        touching = point - plan.radius[0] * up @ data.xmat[body.index].reshape(3, 3)
        turn(model, data, body, desired[1][0], touching)
        qpos[:], qvel[:] = data.qpos, data.qvel
    mujoco.mj_forward(model, data)
    return read_rows(model, data, body.index, body.support)


def believe(case: Scenario, controller: WrenchController | None = None) -> tuple[Attached, Plan]:
    """The controller of a scenario (or another) attached to the world that the scenario believes in, and its plan."""
    nominal = compiled(load(case.path, case.believed, body=case.body, support=case.support, chosen=case.chosen))
    plan = planned(case, nominal)
    if controller is not None:
        if not isinstance(controller, WrenchController):
            raise fail("controller", controller, "a WrenchController")
        if [contact.dim for contact in controller.contacts] != [plan.body.dim] * len(plan.contacts):
            kind = "planar" if plan.body.dim == 2 else "spatial"
            given = f"one with {len(controller.contacts)} contacts in dimension {controller.space.dim}"
            raise fail("controller", given, f"of {len(plan.contacts)} {kind} contact{'s' * (len(plan.contacts) > 1)}")
        ignored = [key for key in CONTROL_KEYS if key in case.changes]
        if ignored:
            raise fail(ignored[0], case.changes[ignored[0]], "left out: the controller that is given has its own")
        return Attached(nominal, plan.body, controller), plan
    attached = attach(
        nominal,
        body=case.body,
        contacts=list(plan.contacts),
        radius=plan.radius,
        law=case.control_law(),
        mu=case.mu,
        margin=case.margin,
        f_min=case.f_min,
        Q_w=case.wrench_weight(plan.body.dim),
        support=case.support,
    )
    return attached, plan


Samples = tuple[Array, Array, Array]


def _desired(case: Scenario, plan: Plan, time: Array) -> tuple[Samples, Samples, Turn]:
    """The reference at every step, as angles and as orientations, and as what gives the latter at any time.

    Checked: whatever it says of itself, it has to keep the object on its contact.
    """
    angle, rate, acceleration = (np.array(values, dtype=float) for values in case.motion(time))
    for name, values in (("angle", angle), ("rate", rate), ("acceleration", acceleration)):
        if values.shape != time.shape or not np.isfinite(values).all():
            raise fail(
                "reference", f"{name} of shape {values.shape}", f"finite and of the shape of the times, {time.shape}"
            )
    low, high = np.rad2deg([angle.min(), angle.max()])
    least, most = np.rad2deg(plan.range)
    if not least - 1e-9 <= low <= high <= most + 1e-9:
        raise fail("reference", f"angles from {low:g} to {high:g} deg", f"in [{least:.4g}, {most:.4g}] deg")
    turn = Turn(case.motion, plan.axis, plan.start)
    q, omega, alpha = (np.array(values, dtype=float) for values in turn(time))
    return (angle, rate, acceleration), (q, omega, alpha), turn


class _Log(NamedTuple):
    """What the loop keeps, time first: sensors (N+1, W, ...), answers (N, W, ...), control_ns (N,), wall_s."""

    sensors: Array
    wrench: Array
    wrench_world: Array
    force: Array
    residual: Array
    status: NDArray[np.int8]
    control_ns: Array
    wall_s: float


def _worlds_first(values: NDArray[Any]) -> NDArray[Any]:
    """(step, world, ...) as the read-only view (world, step, ...)."""
    out = np.moveaxis(values, 1, 0)
    out.flags.writeable = False
    return out


def _loop(
    batch: Batch,
    control: Control,
    controller: WrenchController,
    truth: RigidBody,
    where: dict[str, slice],
    steps: int,
    progress: Callable[[int, int], None] | None,
) -> _Log:
    """Step all worlds to the end."""
    worlds, belief = batch.nsim, controller.belief
    sensordata, xfrc = batch.bind("sensordata"), batch.bind("xfrc_applied")[:, truth.index]
    stage = int(mujoco.mjtStage.mjSTAGE_VEL)
    batch.forward(stage=stage)
    states = States(*(sensordata[:, where[key]] for key in ("position", "quaternion", "velocity", "angular_velocity")))
    nw, n = belief.wrench_map.shape[0], belief.Q_f.shape[0]
    log = _Log(
        sensors=np.empty((steps + 1, *sensordata.shape)),
        wrench=np.empty((steps, worlds, nw)),
        wrench_world=np.empty((steps, worlds, 6)),
        force=np.empty((steps, worlds, n)),
        residual=np.empty((steps, worlds)),
        status=np.empty((steps, worlds), np.int8),
        control_ns=np.empty(steps),
        wall_s=0.0,
    )
    sensors, wrench, wrench_world, force, residual, status, spent, _ = log
    control.prepare(states, Answers(wrench[0], force[0], residual[0], status[0]))  # compiled before it is timed
    world_wrench(belief.wrench_map, states.orientation, wrench[0], wrench_world[0])
    sensors[0] = sensordata
    report = max(1, steps // 100)
    start = perf_counter()
    for k in range(steps):
        tick = perf_counter_ns()
        before = wrench[k - 1] if k else None
        control(k, states, before, Answers(wrench[k], force[k], residual[k], status[k]))
        spent[k] = perf_counter_ns() - tick
        world_wrench(belief.wrench_map, states.orientation, wrench[k], wrench_world[k])
        xfrc[:] = wrench_world[k]
        batch.step(stage=stage)
        sensors[k + 1] = sensordata
        if progress is not None and (k + 1) % report == 0:
            progress(k + 1, steps)
    return log._replace(wall_s=perf_counter() - start)
