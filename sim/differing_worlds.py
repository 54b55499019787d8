"""Worlds that differ: what each of them has of its own, set on what the compiler makes of all of them."""

import copy
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray
from pivoting.controller.plane_and_space import space
from pivoting.models.contact_settings import SETTINGS_FIELDS, ContactSettings, contact_settings, set_contact_settings
from pivoting.models.contact_softness import ContactRows, read_rows
from pivoting.models.frames import matrix
from pivoting.models.object_values import FIELDS, set_object_values
from pivoting.models.rigid_body import RigidBody, in_plane_axes, with_inertia_of
from pivoting.sim.world_values import WorldValues

Array = NDArray[np.float64]


class Truth(NamedTuple):
    """What one world has of its own, whatever the controller believes.

    Attributes:
        mass: [kg].  inertia: (3, 3) about the centre of mass, object axes [kg m^2].
        offset: (3,) from the centre of mass to the point that the controller takes for it, object axes [m].
        mu: friction of the object and its support.
        rows: MuJoCo's contacts with the support; None where nothing touches.
    """

    mass: float
    inertia: Array
    offset: Array
    mu: float
    rows: ContactRows | None

    @classmethod
    def of(cls, body: RigidBody, at: Array, mu: float, rows: ContactRows | None) -> "Truth":
        """Of an object, whose CoM the controller takes to be `at` (3,), body frame [m]."""
        offset = matrix(body.axes).T @ (at - body.com)
        return cls(body.mass, space(body.dim).lift_inertia(body.inertia), offset, mu, rows)


@dataclass(frozen=True, eq=False)
class DifferingWorlds:
    """W worlds of one scene that differ in values of the object.

    Attributes:
        values: of each.
        shared: what else is set on their models, see `object_values`.
        bare: the model before anything is set.  body: as it has the object.
        believed: mass that the controller takes for nominal [kg].
        at: (3,) the point that it takes for the CoM, body frame [m].
        mu: friction where the worlds have none of their own.
        rows: the contact rows of the world in the middle.
        pressed: qpos (nq,) of the object pressed on its contact along its motion.
        chosen: whether the contacts' parameters are chosen for each world.
        unit: of the models' lengths [m].
    """

    values: WorldValues
    shared: Mapping[str, float]
    bare: mujoco.MjModel
    body: RigidBody
    believed: float
    at: Array
    mu: float
    rows: ContactRows | None
    pressed: tuple[Array, ...]
    chosen: bool
    unit: float

    @property
    def worlds(self) -> int:
        """W."""
        return len(self.values.values)

    def part(self, first: int, worlds: int) -> "DifferingWorlds":
        """Some of them, from that with the index `first` on."""
        some = replace(self, values=self.values.part(first, worlds))
        if "truths" in vars(self):  # which takes long enough to be read once
            vars(some)["truths"] = self.truths[first : first + worlds]
        return some

    def models(self) -> Iterator[mujoco.MjModel]:
        """The model of each world in turn, which is the same object with other values each time."""
        model, data = copy.copy(self.bare), mujoco.MjData(self.bare)
        for world in range(self.worlds):
            for name in (*FIELDS, *SETTINGS_FIELDS):
                _field(model, name)[:] = _field(self.bare, name)
            self.set(model, data, world)
            yield model

    def set(self, model: mujoco.MjModel, data: mujoco.MjData, world: int) -> ContactSettings | None:
        """Set what a world has of its own on a bare model; returns the contact settings that are chosen for it."""
        body = self.body
        values = scene_values({**self.shared, **self.values.of(world)}, self.believed)
        set_object_values(model, data, body.index, body.support, values, in_plane_axes(body), self.unit)
        if not self.chosen:
            return None
        step = float(model.opt.timestep)
        settings = contact_settings(model, body.index, body.support, self.pressed, step)
        set_contact_settings(model, body.index, body.support, settings)
        return settings

    @cached_property
    def truths(self) -> tuple[Truth, ...]:
        """Of each world."""
        columns, found, pressed = self.values.columns, [], self._pressed()
        mu = columns.get("mu", np.full(self.worlds, self.mu)).tolist()
        for world, model in enumerate(self.models()):
            rows = self._rows(model, pressed)
            found.append(Truth.of(with_inertia_of(self.body, model), self.at, mu[world], rows))
        return tuple(found)

    def _rows(self, model: mujoco.MjModel, pressed: Array | None) -> ContactRows | None:
        """Of a world's own model, from one placement: what is the same all the way along is known."""
        if self.rows is None or pressed is None:
            return None
        own = read_rows(model, self.body.index, self.body.support, [pressed])
        assert own is not None, "it touches where it touched"
        mu = own.mu if "mu" in self.values.names else self.rows.mu
        return self.rows._replace(D=own.D, b=own.b, k=own.k, solimp=own.solimp, mu=mu)

    def _pressed(self) -> Array | None:
        """The first placement in which there is a contact."""
        body = self.body
        return next((at for at in self.pressed if read_rows(self.bare, body.index, body.support, [at])), None)

    def fill(self, batch: Batch) -> None:
        """Give each world of a batch of the bare model what it has of its own."""
        names = (*FIELDS, *SETTINGS_FIELDS) if self.chosen else FIELDS
        fields = {name: batch.expand(name) for name in names if _field(self.bare, name).size}
        for world, model in enumerate(self.models()):
            for name, values in fields.items():
                values[world] = _field(model, name)
        batch.set_const()


def scene_values(values: Mapping[str, float], believed: float) -> dict[str, float]:
    """What a scene takes of a scenario's values: its factor is on an inertia in proportion to the world's own mass.

    Args:
        believed: mass that the controller takes for nominal [kg], with which the scenario's factor counts.
    """
    changed = dict(values)
    if "inertia" in changed and "mass" in changed:
        changed["inertia"] *= believed / changed["mass"]
    return changed


def _field(model: mujoco.MjModel, name: str) -> Any:
    """An array of a model, or of its options."""
    return getattr(model.opt, name.removeprefix("opt.")) if name.startswith("opt.") else getattr(model, name)
