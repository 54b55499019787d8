"""A closed-loop run, from a scenario to what is measured: the world, the belief, the start, the steps."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray
from pivoting.controller.kernels.compilation import first_calls
from pivoting.controller.orientation_references import Turn
from pivoting.controller.plane_and_space import space
from pivoting.controller.rotations import exponential, quaternion_product
from pivoting.controller.validate import fail
from pivoting.controller.wrench_controller import WrenchController
from pivoting.models.contact_settings import contact_settings
from pivoting.models.contact_softness import read_rows
from pivoting.models.frames import matrix
from pivoting.models.friction_coefficient import read_friction
from pivoting.models.names import ModelError, body_id, geom_id
from pivoting.models.placement.convex_hull import body_size
from pivoting.models.placement.given_contacts import NEAR
from pivoting.models.rigid_body import initial_data, place, read_body, turn
from pivoting.models.scenes import Scene, load
from pivoting.models.sensors import instrument
from pivoting.sim.attach import Attached, attach
from pivoting.sim.contact_sensing import Declared
from pivoting.sim.engine_log import engine_log
from pivoting.sim.horizon_control import horizon_control, play_control
from pivoting.sim.joint_drag import drag_wrench
from pivoting.sim.judging.undeclared_contacts import contact_margin, refuse_strays
from pivoting.sim.pace import closing_force, fine_step
from pivoting.sim.pipeline.control import Answers, BoundedControl, Control, LawControl, States
from pivoting.sim.pipeline.loop import ContactLog, run_steps
from pivoting.sim.placement import Plan, planned, transplanted
from pivoting.sim.run import Run, frozen
from pivoting.sim.scenarios.scenario import Scenario
from pivoting.sim.scenarios.scenario_keys import CONTROL_KEYS
from pivoting.sim.scenarios.shipped_scenarios import scenario

Array = NDArray[np.float64]
START_DEPTH = 1e-6  # of the lever from contact to CoM: how deep it starts if its load does not say
DEEPEST = 1e-2  # likewise: how deep it may start
PRESSED, SAMPLES = 1e-3, 17  # levers that it is pressed in, and where along its way, to see what it touches with
Samples = tuple[Array, Array, Array]  # orientations, angular velocities and accelerations
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
    scene = load(case.path, body=case.body, support=case.support, chosen=case.chosen)
    attached, believed = believe(case, controller, scene)
    asked, case = case, case.absolute(believed.load)
    world = _finely_stepped(scene.changed(case.actual), case, believed)
    model, where = _instrumented(world)
    truth = read_body(model, world.body, world.support)
    plan = transplanted(believed, model, truth, world.scale / scene.changed(case.believed).scale)
    dt = float(model.opt.timestep)
    steps = round(case.duration / dt)
    if not 2 <= steps <= MAX_STEPS:
        raise fail("seconds", case.duration, f"such that a world takes 2 to {MAX_STEPS} steps, at dt = {dt:g} s")
    if steps * worlds > MAX_STEPS:
        raise fail(
            "worlds", worlds, f"at most {MAX_STEPS // steps}: of {steps} steps each, more are not kept in memory"
        )
    if steps * dt <= case.limits.settle_s:
        raise fail("seconds", case.duration, f"more than the {case.limits.settle_s:g} s that the verdict lets settle")
    time: Array = dt * np.arange(steps + 1, dtype=float)
    reference, desired, _ = _desired(case, plan, time)
    # the controller knows only the table that it believes in
    told, follow = _desired(case, believed, time)[1:]
    for values in (time, *reference, *desired):
        values.flags.writeable = False
    pressed = list(_pressed(model, plan, desired[0][np.linspace(0, steps, SAMPLES).astype(int)]))
    settings = None
    if case.chosen and not {"timeconst", "impedance"} & set(case.actual):
        settings = contact_settings(model, truth.index, truth.support, pressed, dt)
        model, where = _instrumented(world.with_contacts(settings))
    rows = read_rows(model, truth.index, truth.support, pressed)

    batch = Batch(model, int(worlds), nthread=1 if worlds == 1 else 0, persistent=True)
    errors = np.deg2rad(case.spread) * np.random.default_rng(seed).uniform(-1.0, 1.0, int(worlds))
    bounds = case.bounds(scene.unit)
    drag = drag_wrench(attached.body, attached.controller, *told)
    depth = 0.0
    if case.chosen and rows is not None:
        first = _load(attached.controller, LawControl(attached.controller, told, bounds, drag), told)
        depth = float(rows.depth(np.array(first / rows.points)))
    _start(batch, model, plan, desired, errors, depth)
    start = (np.array(batch.bind("qpos")), np.array(batch.bind("qvel")))
    for values in start:
        values.flags.writeable = False

    control: Control = LawControl(attached.controller, told, bounds, drag)
    horizons = played = None
    if attached.body.drag is not None and (open_loop or case.plan_hz is not None):
        raise ModelError(f"body = {attached.body.name!r}: a plan knows no joint damping or friction; must have none")
    if open_loop:
        control = played = play_control(case, attached, believed, follow, dt, steps)
    elif case.plan_hz is not None:
        control = horizons = horizon_control(case, attached, believed, follow, int(worlds), dt, steps)
    if bounds.any and not open_loop:  # a plan is within them
        control = BoundedControl(control, attached.controller, bounds, dt)
    K, d = len(plan.contacts), truth.dim
    declared = Declared(
        points=np.array([space(d).lift(truth.point(contact)) for contact in plan.contacts]),
        up=plan.radius[:, None] * matrix(truth.table)[:, 2],
        across=np.ascontiguousarray(matrix(truth.table)[:, : d - 1].T),
        near=float(NEAR * body_size(model, truth.index)),
        landing=case.limits.contacts_end > 0,
    )
    contacts = ContactLog(declared, rows, matrix(truth.table), where, steps, int(worlds))
    with engine_log() as warned:
        log = run_steps(batch, control, attached.controller, contacts, truth.index, where, steps, progress)
    axes = matrix(truth.table) @ space(d).force_map
    return Run(
        scenario=asked,
        seed=int(seed),
        attached=attached,
        load=believed.load,
        unit=scene.unit,
        replaced=world.replaced,
        settings=settings,
        model=model,
        truth=truth,
        declared=declared,
        radius=plan.radius,
        face=np.array([space(d).lift(truth.point(corner)) for corner in plan.face]),
        turn=(plan.axis, plan.start),
        mu_world=read_friction(model, truth.index, truth.support, plan.contacts),
        contact_rows=rows,
        start=start,
        time=time,
        reference=reference,
        desired=desired,
        position=log.states.position,
        quaternion=log.states.orientation,
        velocity=log.states.velocity,
        angular_velocity=log.states.angular_velocity,
        required=log.answers.required,
        wrench=log.answers.wrench,
        wrench_world=log.wrench_world,
        force=log.answers.force.reshape(worlds, steps, K, d),
        force_measured=frozen(log.contacts.force @ axes),
        contacts=log.contacts,
        held=log.held,
        residual=log.answers.residual,
        status=log.answers.status,
        control_us=frozen(log.control_ns / (1e3 * worlds)),
        wall_s=log.wall_s,
        plan=None if played is None else played.plan,
        plans=None if horizons is None else horizons.log,
        events=() if horizons is None else tuple(horizons.events),
        engine_warnings=(*world.warned, *warned),
        controller="scenario" if controller is None else "given",
    )


def _finely_stepped(world: Scene, case: Scenario, plan: Plan) -> Scene:
    """With a finer time step, where the settings are chosen and an object so large would drift too far as it turns."""
    if not case.chosen or "dt" in case.actual:
        return world
    # what the object may slip, whatever it is judged by
    limits = replace(case.limits, slip_m=None).for_object(
        plan.load.lever, plan.unit * float(np.linalg.norm(plan.body.gravity))
    )
    assert limits.slip_m is not None, "limits are for a lever"
    given = float(world.spec.option.timestep)
    dt = fine_step(given, plan.unit * plan.arm, *case.pace, limits.slip_m)
    if dt == given:
        return world
    finer = world.changed({**case.actual, "dt": dt})
    return replace(finer, replaced=(*finer.replaced, ("timestep", f"{given:g}")))


def _instrumented(world: Scene) -> tuple[mujoco.MjModel, dict[str, slice]]:
    """The model that is simulated, and where each reading is in its sensordata."""
    model, where = instrument(world)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # a world that diverges is seen, not reset
    # bodies of several geoms: a plane's bounding box is 5e9 m deep there, and misses contacts of less than 1e-6 m
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE
    return model, where


def _pressed(model: mujoco.MjModel, plan: Plan, orientations: Array) -> Iterator[Array]:
    """The qpos of the object pressed on its contact at each of these orientations (S, 4)."""
    data, up, point = initial_data(model), matrix(plan.body.table)[:, 2], plan.contacts[0]
    lever = float(np.linalg.norm(plan.body.com - point) + plan.radius[0])
    for orientation in orientations:
        place(model, data, plan.body, orientation, point, plan.at + (plan.radius[0] - PRESSED * lever) * up)
        yield np.array(data.qpos)


def _load(controller: WrenchController, law: LawControl, told: Samples) -> float:
    """The normal force [N] on all contacts with which the law begins."""
    states = States.turning(told[0][:1], told[1][:1])
    nw, d, K = len(controller.Q_w), controller.space.dim, len(controller.contacts)
    out = Answers(np.empty((1, nw)), np.empty((1, nw)), np.empty((1, K * d)), np.empty(1), np.empty(1, np.int8))
    with first_calls():
        law(0, states, None, out)
    return float(out.force.reshape(K, d)[:, -1].sum())


def _start(
    batch: Batch,
    model: mujoco.MjModel,
    plan: Plan,
    desired: tuple[Array, Array, Array],
    errors: Array,
    depth: float,
) -> None:
    """Put every world on its contact, off the reference by `errors` (W,) [rad].

    Everything else is where the model's first keyframe, or else qpos0, has it.

    Args:
        depth: at which it rests under its load, 0 if that is not known [m]; one that has less to carry at first would
            slide, and one that has more is thrown up.

    Raises:
        ModelError: the object would touch something else there; it is named.
    """
    body = plan.body
    data, up, point = initial_data(model), matrix(body.table)[:, 2], plan.contacts[0]
    lever = float(np.linalg.norm(body.com - point) + plan.radius[0])
    depth = min(depth or START_DEPTH * lever, DEEPEST * lever)
    kind, floats = int(mujoco.mjtState.mjSTATE_INTEGRATION), 0.0
    state = np.empty(mujoco.mj_stateSize(model, kind))
    for row, error in zip(batch.state, errors, strict=True):
        for _ in range(2):  # a contact with a margin holds the body above the table: how far, only MuJoCo knows
            at = plan.at + (plan.radius[0] + floats - depth) * up
            place(model, data, body, quaternion_product(exponential(error * plan.axis), desired[0][0]), point, at)
            touching = point - plan.radius[0] * up @ data.xmat[body.index].reshape(3, 3)
            turn(model, data, body, desired[1][0], touching)
            mujoco.mj_forward(model, data)
            if floats or not (floats := contact_margin(model, data, body)):
                break
        refuse_strays(model, data, body, plan.unit)
        mujoco.mj_getState(model, data, state, kind)
        row[:] = state


def believe(
    case: Scenario, controller: WrenchController | None = None, scene: Scene | None = None
) -> tuple[Attached, Plan]:
    """The controller of a scenario (or another) attached to the world that the scenario believes in, and its plan."""
    read = scene or load(case.path, body=case.body, support=case.support, chosen=case.chosen)
    believed = read.changed(case.believed)
    nominal = believed.compile()
    case = replace(case, body=believed.body, support=believed.support)
    plan = planned(case, nominal, read.unit)
    if case.chosen and case.mu is None:  # what the file itself says of friction holds: it may have none
        read_friction(read.read, body_id(read.read, read.body), geom_id(read.read, read.support), plan.contacts)
    if controller is not None:
        _check(controller, case, plan)
    floor = (case.f_min or 0.0) if controller is None else controller.belief.f_min.max()
    if plan.load.force == 0.0 and floor == 0.0:
        raise fail("gravity", 0.0, "> 0, or f_min > 0: without a load nothing presses the object on its support")
    if controller is not None:
        return Attached(nominal, plan.body, controller), plan
    attached = attach(
        nominal,
        body=case.body,
        contacts=list(plan.contacts),
        radius=plan.radius,
        law=case.control_law(),
        mu=case.mu,
        margin=case.margin,
        f_min=_floor(case.absolute(plan.load), plan) / read.unit,
        Q_w=case.wrench_weight(plan.body.dim, read.unit),
        support=case.support,
    )
    return attached, plan


def _floor(case: Scenario, plan: Plan) -> float:
    """Of each contact's normal force [N]."""
    if case.f_min is not None:
        return float(case.f_min)
    return closing_force(plan.body.mass, plan.unit * plan.arm, case.pace[1])


def _check(controller: WrenchController, case: Scenario, plan: Plan) -> None:
    """Refuse a controller that is not of these contacts, or that the loop would not ask."""
    if not isinstance(controller, WrenchController):
        raise fail("controller", controller, "a WrenchController")
    if [contact.dim for contact in controller.contacts] != [plan.body.dim] * len(plan.contacts):
        kind = "planar" if plan.body.dim == 2 else "spatial"
        given = f"one with {len(controller.contacts)} contacts in dimension {controller.space.dim}"
        raise fail("controller", given, f"of {len(plan.contacts)} {kind} contact{'s' * (len(plan.contacts) > 1)}")
    for name in ("problem", "jacobian"):
        if getattr(getattr(controller, name), "__func__", None) is not getattr(WrenchController, name):
            allowed = (
                f"without a {name}() of its own: the compiled loop states the problems of all worlds from `belief`"
            )
            raise fail("controller", type(controller).__name__, allowed + ", and would never call it")
    ignored = [key for key in CONTROL_KEYS if key in case.changes]
    if ignored:
        raise fail(ignored[0], case.changes[ignored[0]], "left out: the controller that is given has its own")


def _desired(case: Scenario, plan: Plan, time: Array) -> tuple[Samples, Samples, Turn]:
    """The reference at every step, as angles and as orientations, and as what gives the latter at any time.

    Checked: whatever it says of itself, it has to keep the object on its contact.
    """
    angle, rate, acceleration = case.samples(time)
    low, high = np.rad2deg([angle.min(), angle.max()])
    least, most = np.rad2deg(plan.range)
    if not least - 1e-9 <= low <= high <= most + 1e-9:
        raise fail("reference", f"angles from {low:g} to {high:g} deg", f"in [{least:.4g}, {most:.4g}] deg")
    turn = Turn(case.motion, plan.axis, plan.start)
    q, omega, alpha = (np.array(values, dtype=float) for values in turn(time))
    return (angle, rate, acceleration), (q, omega, alpha), turn
