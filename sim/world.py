"""The world that is simulated: its model, the object as it really is there, and the contacts that are to stick."""

import copy
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray
from pivoting.controller.orientation_references import Turn
from pivoting.controller.plane_and_space import space
from pivoting.models.contact_settings import ContactSettings, contact_settings, set_contact_settings
from pivoting.models.contact_softness import ContactRows, read_rows
from pivoting.models.frames import matrix
from pivoting.models.friction_coefficient import read_friction
from pivoting.models.object_values import COM, OBJECT_VALUES, free_the_com
from pivoting.models.placement.convex_hull import body_size
from pivoting.models.placement.given_contacts import NEAR
from pivoting.models.rigid_body import RigidBody, initial_data, place, read_body, with_inertia_of
from pivoting.models.scenes import Scene
from pivoting.models.sensors import instrument
from pivoting.sim.contact_sensing import Declared
from pivoting.sim.differing_worlds import DifferingWorlds, Truth, scene_values
from pivoting.sim.pace import fine_step
from pivoting.sim.placement import Placement, transplanted
from pivoting.sim.scenarios.scenario import Scenario
from pivoting.sim.world_values import WorldValues

Array = NDArray[np.float64]
PRESSED, SAMPLES = 1e-3, 17  # levers that it is pressed in, and where along its way, to see what it touches with


@dataclass(frozen=True, eq=False)
class World:
    """What is simulated, whatever the controller believes.

    Where the worlds differ, it is the one in the middle of the set of them; `of` tells of each.

    Attributes:
        model: with the sensors that the loop reads.  sensors: where each of their readings is in `sensordata`.
        truth: the object as the model has it.
        placement: where the object is placed, and about what it turns; of an object whose CoM were where the
            controller takes it to be, see `applied_at`.
        declared: the contacts that are to stick.
        face: (P, 3) the corners of the face that the object lies on at angle 0, from `applied_at`, object axes [m].
        mu: friction of the object and its support.
        contact_rows: MuJoCo's contacts with the support, for the predicted slip; None where nothing touches.
        settings: contact parameters that were chosen for the object, if they were.
        replaced: what of the file gave way to the settings of the shipped scenes.
        unit: of the model's lengths [m].
        warned: what MuJoCo warned of when it read the file.
        values: what each world has of its own, by key; None where they are alike.
        differing: what makes the worlds differ; None where they are alike, or there is one.
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
    values: WorldValues | None = None
    differing: DifferingWorlds | None = None

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

    @property
    def applied_at(self) -> Array:
        """(3,) the point of the body that the controller takes for the CoM, body frame [m].

        Its wrench acts there, and positions and levers count from there.
        """
        return self.placement.body.com

    @cached_property
    def truths(self) -> tuple[Truth, ...]:
        """Of each world; one, where they are alike."""
        if self.differing is None:
            return (Truth.of(self.truth, self.applied_at, self.mu, self.contact_rows),)
        return self.differing.truths

    def read(self) -> None:
        """Read what each world has of its own now, once for all parts that are then made."""
        self.truths  # noqa: B018

    @cached_property
    def offsets(self) -> Array | None:
        """(W or 1, 3) from the CoM to where the wrench acts, object axes [m]; None where that is the CoM."""
        offsets = np.array([each.offset for each in self.truths])
        return offsets if offsets.any() else None

    def depths(self, loads: Array) -> Array:
        """(W, ...) how deep the contacts rest under normal loads (W, ...) [N], each world's own; 0 without contacts."""
        if self.contact_rows is None:
            return np.zeros(loads.shape)
        if self.differing is None:
            return self.contact_rows.depth(loads / self.contact_rows.points)
        each = zip((truth.rows for truth in self.truths), loads, strict=True)
        return np.array([0.0 * load if rows is None else rows.depth(load / rows.points) for rows, load in each])

    def part(self, first: int, worlds: int) -> "World":
        """The same for some of the worlds, from that with the index `first` on."""
        if self.values is None:
            return self
        differing = None if self.differing is None else self.differing.part(first, worlds)
        return replace(self, values=self.values.part(first, worlds), differing=differing)

    def with_values(self, values: WorldValues) -> "World":
        """The same scene, of worlds that have these values of the same keys."""
        assert self.differing is not None, "worlds differ in these keys"
        return replace(self, values=values, differing=replace(self.differing, values=values))

    def of(self, world: int) -> "World":
        """One of the worlds, as it is alone."""
        if self.differing is None:
            return self
        assert self.values is not None, "worlds differ in values"
        model = copy.copy(self.differing.bare)
        settings = self.differing.set(model, mujoco.MjData(model), world)
        truth = self.differing.truths[world]
        return replace(
            self,
            model=model,
            truth=with_inertia_of(self.truth, model),
            mu=truth.mu,
            contact_rows=truth.rows,
            settings=settings,
            values=self.values.part(world, 1),
            differing=None,
        )


def build_world(
    case: Scenario, believed: Scene, scene: Scene, placed: Placement, values: WorldValues | None = None
) -> World:
    """The world of a scenario, or as many as there are values.

    Args:
        case: `absolute`.  believed: the scene as the controller knows it.  scene: of the file.
        placed: where the object is placed in the believed world.
        values: of each world, where they differ.

    Raises:
        ModelError: the object cannot be placed so there.
    """
    other = case.world or case.differing
    actual = _finely_stepped(scene.changed(_changes(case, placed)) if other else believed, case, placed)
    model, sensors = _instrumented(actual, placed.body.com)
    truth = read_body(model, actual.body, actual.support)
    counted = replace(truth, com=placed.body.com)
    there = transplanted(placed, model, counted, actual.scale / believed.scale)
    pressed = tuple(_pressed(model, there, case))
    chosen = case.chosen and not {"timeconst", "impedance"} & set(case.actual)
    settings = None
    if chosen:
        settings = contact_settings(model, truth.index, truth.support, pressed, float(model.opt.timestep))
        set_contact_settings(model, truth.index, truth.support, settings)
    lift = space(truth.dim).lift
    world = World(
        model=model,
        sensors=sensors,
        truth=truth,
        placement=there,
        declared=_declared(model, counted, there, case),
        face=np.array([lift(counted.point(corner)) for corner in there.face]),
        mu=read_friction(model, truth.index, truth.support, there.contacts),
        contact_rows=read_rows(model, truth.index, truth.support, pressed),
        settings=settings,
        replaced=actual.replaced,
        unit=actual.unit,
        warned=actual.warned,
    )
    if values is None:
        return world
    return replace(world, values=values, differing=_differing(case, actual, placed, world, pressed, values))


def _differing(
    case: Scenario, actual: Scene, placed: Placement, nominal: World, pressed: tuple[Array, ...], values: WorldValues
) -> DifferingWorlds:
    """The worlds that have these values of their own, about the nominal one of a scene."""
    at = nominal.applied_at
    bare, _ = _instrumented(replace(actual, values={}), at)
    body = read_body(bare, actual.body, actual.support)
    shared = {key: value for key, value in case.actual.items() if key in OBJECT_VALUES}
    if any(name in shared for name in COM):
        free_the_com(bare, body.index)
    return DifferingWorlds(
        values=values,
        shared=shared,
        bare=bare,
        body=body,
        believed=placed.body.mass,
        at=at,
        mu=nominal.mu,
        rows=nominal.contact_rows,
        pressed=pressed,
        chosen=nominal.settings is not None,
        unit=nominal.unit,
    )


def _changes(case: Scenario, placed: Placement) -> dict[str, float]:
    """What is changed of the file's scene."""
    return scene_values(case.actual, placed.body.mass)


def _instrumented(scene: Scene, at: Array) -> tuple[mujoco.MjModel, dict[str, slice]]:
    """The model that is simulated, and where each reading is in its sensordata; of the pose: at (3,) of the body."""
    model, sensors = instrument(scene, at)
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
    finer = world.changed({**_changes(case, placed), "dt": dt})
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
