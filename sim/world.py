"""The world that is simulated: its model, the object as it really is there, and the contacts that are to stick."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray
from pivoting.controller.orientation_references import Turn
from pivoting.controller.plane_and_space import space
from pivoting.models.contact_settings import ContactSettings, contact_settings
from pivoting.models.contact_softness import ContactRows, read_rows
from pivoting.models.frames import matrix
from pivoting.models.friction_coefficient import read_friction
from pivoting.models.placement.convex_hull import body_size
from pivoting.models.placement.given_contacts import NEAR
from pivoting.models.rigid_body import RigidBody, initial_data, place, read_body
from pivoting.models.scenes import Scene
from pivoting.models.sensors import instrument
from pivoting.sim.contact_sensing import Declared
from pivoting.sim.pace import fine_step
from pivoting.sim.placement import Placement, transplanted
from pivoting.sim.scenarios.scenario import Scenario

Array = NDArray[np.float64]
PRESSED, SAMPLES = 1e-3, 17  # levers that it is pressed in, and where along its way, to see what it touches with


@dataclass(frozen=True, eq=False)
class World:
    """What is simulated, whatever the controller believes.

    Attributes:
        model: with the sensors that the loop reads.  sensors: where each of their readings is in `sensordata`.
        truth: the object as the model has it.
        placement: where the object is placed, and about what it turns.
        declared: the contacts that are to stick.
        face: (P, 3) the corners of the face that the object lies on at angle 0, from the CoM, object axes [m].
        mu: friction of the object and its support.
        contact_rows: MuJoCo's contacts with the support, for the predicted slip; None where nothing touches.
        settings: contact parameters that were chosen for the object, if they were.
        replaced: what of the file gave way to the settings of the shipped scenes.
        unit: of the model's lengths [m].
        warned: what MuJoCo warned of when it read the file.
    """

    model: mujoco.MjModel
    sensors: dict[str, slice]
    truth: RigidBody
    placement: Placement
    declared: Declared
    face: Array
    mu: float
    contact_rows: ContactRows | None
    settings: ContactSettings | None
    replaced: tuple[tuple[str, str], ...]
    unit: float
    warned: tuple[str, ...]

    @property
    def dt(self) -> float:
        """Time step [s]."""
        return float(self.model.opt.timestep)

    @property
    def radius(self) -> Array:
        """(K,) of what rolls, else 0 [m]."""
        more = len(self.declared.points) - len(self.placement.radius)
        return np.concatenate([self.placement.radius, np.zeros(more)])

    @property
    def turn(self) -> tuple[Array, Array]:
        """The axis (3,) [world axes] and the orientation (4,) at angle 0 that theta is counted from."""
        return self.placement.axis, self.placement.start


def build_world(case: Scenario, believed: Scene, scene: Scene, placed: Placement) -> World:
    """The world of a scenario.

    Args:
        case: `absolute`.  believed: the scene as the controller knows it.  scene: of the file.
        placed: where the object is placed in the believed world.

    Raises:
        ModelError: the object cannot be placed so there.
    """
    actual = _finely_stepped(scene.changed(case.actual) if case.world else believed, case, placed)
    model, sensors = _instrumented(actual)
    truth = read_body(model, actual.body, actual.support)
    there = transplanted(placed, model, truth, actual.scale / believed.scale)
    pressed = list(_pressed(model, there, case))
    settings = None
    if case.chosen and not {"timeconst", "impedance"} & set(case.actual):
        settings = contact_settings(model, truth.index, truth.support, pressed, float(model.opt.timestep))
        model, sensors = _instrumented(actual.with_contacts(settings))
    lift = space(truth.dim).lift
    return World(
        model=model,
        sensors=sensors,
        truth=truth,
        placement=there,
        declared=_declared(model, truth, there, case),
        face=np.array([lift(truth.point(corner)) for corner in there.face]),
        mu=read_friction(model, truth.index, truth.support, there.contacts),
        contact_rows=read_rows(model, truth.index, truth.support, pressed),
        settings=settings,
        replaced=actual.replaced,
        unit=actual.unit,
        warned=actual.warned,
    )


def _instrumented(scene: Scene) -> tuple[mujoco.MjModel, dict[str, slice]]:
    """The model that is simulated, and where each reading is in its sensordata."""
    model, sensors = instrument(scene)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # a world that diverges is seen, not reset
    # bodies of several geoms: a plane's bounding box is 5e9 m deep there, and misses contacts of less than 1e-6 m
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE
    return model, sensors


def _declared(model: mujoco.MjModel, truth: RigidBody, there: Placement, case: Scenario) -> Declared:
    """The contacts that are to stick, in the world as it is."""
    table, lift = matrix(truth.table), space(truth.dim).lift
    landing = there.landing if case.landing == "held" else np.zeros((0, 3))
    radius = np.concatenate([there.radius, np.zeros(len(landing))])
    return Declared(
        points=np.array([lift(truth.point(contact)) for contact in (*there.contacts, *landing)]),
        up=radius[:, None] * table[:, 2],
        across=np.ascontiguousarray(table[:, : truth.dim - 1].T),
        near=float(NEAR * body_size(model, truth.index)),
        landing=case.limits.contacts_end > 0,
    )


def _finely_stepped(world: Scene, case: Scenario, placed: Placement) -> Scene:
    """With a finer time step, where the settings are chosen and an object so large would drift too far as it turns."""
    if not case.chosen or "dt" in case.actual:
        return world
    # what the object may slip, whatever it is judged by
    gravity = placed.unit * float(np.linalg.norm(placed.body.gravity))
    limits = replace(case.limits, slip_m=None).for_object(placed.load.lever, gravity)
    assert limits.slip_m is not None, "limits are for a lever"
    given = float(world.spec.option.timestep)
    dt = fine_step(given, placed.unit * placed.arm, *case.pace, limits.slip_m)
    if dt == given:
        return world
    finer = world.changed({**case.actual, "dt": dt})
    return replace(finer, replaced=(*finer.replaced, ("timestep", f"{given:g}")))


def _pressed(model: mujoco.MjModel, there: Placement, case: Scenario) -> Iterator[Array]:
    """The qpos of the object pressed on its contact, at some orientations of its motion."""
    data, up, point = initial_data(model), matrix(there.body.table)[:, 2], there.contacts[0]
    at = there.at + (there.radius[0] - PRESSED * there.lever) * up
    dt = float(model.opt.timestep)
    times = dt * np.linspace(0, round(case.duration / dt), SAMPLES).astype(int)
    case.samples(times)  # refuses a reference that gives what is none
    for orientation in np.asarray(Turn(case.motion, there.axis, there.start)(times).orientation):
        place(model, data, there.body, orientation, point, at)
        yield np.array(data.qpos)
