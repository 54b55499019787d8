"""What can be changed of a scene, and how: one function for each key that a scenario has for it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import mujoco
import numpy as np
from pivoting.models.errors import ModelError
from pivoting.models.object_values import COM, check_friction

INERTIA_FROM_GEOM = int(mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE)
_GRAVITY_OFF = int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
_OVERRIDE = int(mujoco.mjtEnableBit.mjENBL_OVERRIDE)


@dataclass
class Edit:
    """A scene while it is being changed.

    Attributes:
        spec: of the scene, a copy.
        body: name of the body.
        unit: of the spec's lengths [m].
        geoms, table: the body's geoms, and the support.
        parts: all that has parameters of their contacts: these geoms, the support, and explicit pairs.
        values: that the body is to have once it is compiled, see `object_values`.
        scale: by which its size is changed.
    """

    spec: mujoco.MjSpec
    body: str
    unit: float
    geoms: list[Any]
    table: Any
    parts: list[Any]
    values: dict[str, float]
    scale: float

    @property
    def overrides(self) -> bool:
        """Whether the option's own contact parameters take the place of all geoms', by <flag override="enable"/>."""
        return bool(self.spec.option.enableflags & _OVERRIDE)


def _time_step(edit: Edit, dt: float) -> None:
    """The time step [s]."""
    edit.spec.option.timestep = dt


def _gravity(edit: Edit, magnitude: float) -> None:
    """Gravity [m/s^2], along the file's direction."""
    option = edit.spec.option
    size = np.linalg.norm(option.gravity)
    down = option.gravity / size if size > 0.0 else np.array([0.0, 0.0, -1.0])
    option.gravity = magnitude / edit.unit * down
    option.disableflags &= ~_GRAVITY_OFF


def _size(edit: Edit, size: float) -> None:
    """The longest side [m] of a body of one box."""
    geoms, spec = edit.geoms, edit.spec
    if len(geoms) != 1:
        raise ModelError(f"size = {size:g}: the body has {len(geoms)} geoms; change them in its file")
    if geoms[0].type != mujoco.mjtGeom.mjGEOM_BOX:
        raise ModelError(f"size = {size:g}: the body is not a box; change it in its file")
    if spec.body(edit.body).explicitinertial and spec.compiler.inertiafromgeom != INERTIA_FROM_GEOM:
        raise ModelError(f"size = {size:g}: the body's <inertial> would not change with it; change both in its file")
    scale = 0.5 * size / edit.unit / float(np.max(geoms[0].size))
    geoms[0].size = np.asarray(geoms[0].size) * scale
    edit.scale *= scale


def _mass(edit: Edit, mass: float) -> None:
    """The mass of the body [kg], its inertia in proportion."""
    edit.values["mass"] = mass


def _inertia(edit: Edit, factor: float) -> None:
    """A factor on the inertia about the CoM that the body has with its mass."""
    edit.values["inertia"] = factor


def _com(axis: str) -> "Change":
    """What moves the CoM along one of the object's axes [m]."""

    def move(edit: Edit, offset: float) -> None:
        edit.spec.body(edit.body).simple = False  # of a simple body the compiler takes it that its CoM stays
        edit.values[axis] = offset

    return move


def _incline(edit: Edit, incline: float) -> None:
    """The angle [deg] by which the support, a plane of the world body, rises to the right."""
    table = edit.table
    fixed = table.parent.id == 0 and table.frame is None  # of a static body that was fused the frame is left
    if table.type != mujoco.mjtGeom.mjGEOM_PLANE or not fixed:
        raise ModelError(f"incline = {incline:g}: the support is not a plane of the world body; tilt it in its file")
    half = 0.5 * np.deg2rad(incline)
    table.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT  # in place of the file's euler
    table.quat = [np.cos(half), 0.0, -np.sin(half), 0.0]


def _friction(edit: Edit, mu: float) -> None:
    """The sliding friction of the body and its support."""
    check_friction(mu)
    edit.values["mu"] = mu


def _time_constant(edit: Edit, timeconst: float) -> None:
    """The time constant [s] of the contacts, which are critically damped."""
    for part in edit.parts:
        part.solref[:2] = timeconst, 1.0
    if edit.overrides:
        edit.spec.option.o_solref[:2] = timeconst, 1.0


def _impedance(edit: Edit, impedance: float) -> None:
    """The impedance of the contacts, at any depth."""
    for part in edit.parts:
        part.solimp[:2] = impedance
    if edit.overrides:
        edit.spec.option.o_solimp[:2] = impedance


def _impedance_ratio(edit: Edit, impratio: float) -> None:
    """The option impratio."""
    edit.spec.option.impratio = impratio


Change = Callable[[Edit, float], None]
CHANGES: Mapping[str, Change] = MappingProxyType(  # by key, in the order in which they are made
    {
        "dt": _time_step,
        "impratio": _impedance_ratio,
        "gravity": _gravity,
        "size": _size,
        "incline": _incline,
        "mu": _friction,
        "timeconst": _time_constant,
        "impedance": _impedance,
        "mass": _mass,
        "inertia": _inertia,
        **{axis: _com(axis) for axis in COM},
    }
)
