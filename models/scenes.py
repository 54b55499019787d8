"""Scenes: an MJCF file with a body to be pivoted, and what is changed of it."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from pivoting.models.contact_settings import STIFF
from pivoting.models.errors import ModelError
from pivoting.models.frames import Array
from pivoting.models.length_unit import length_unit
from pivoting.models.names import body_id, body_name, geom_id
from pivoting.models.object_values import COM, free_the_com, set_object_values
from pivoting.models.rigid_body import FILE_FRAME, degrees_of_freedom, in_plane_axes, initial_data, read_body
from pivoting.models.scene_changes import CHANGES, Edit
from pivoting.models.shipped_files import BODY, TABLE, scene_path
from pivoting.models.solver_settings import choose
from pivoting.models.support_surfaces import find_support

WORLD_KEYS = tuple(CHANGES)


@dataclass(frozen=True, eq=False)
class Scene:
    """An MJCF file with a body in it, and what is changed of it.

    Attributes:
        spec: what MuJoCo compiles.
        path: of the file.
        body, support: names of the body and of the geom that it stands on, '#id' of what the file leaves unnamed.
        values: that the body has once it is compiled, see `object_values`.
        scale: by which its size is changed.
        replaced: what of the file gave way to the settings of the shipped scenes, in words: what it was.
        unit: of the file's lengths [m], see `length_unit.length_unit`.
        warned: what MuJoCo had to say of the file when it read it.
        read: the model of the file as it is, but for names and what is fused into the body.
        unchanged: whether `spec` says the same as `read`.
    """

    spec: mujoco.MjSpec
    path: Path
    body: str
    support: str
    values: Mapping[str, float]
    scale: float
    replaced: tuple[tuple[str, str], ...]
    unit: float
    warned: tuple[str, ...]
    read: mujoco.MjModel
    unchanged: bool = False

    @cached_property
    def compiled(self) -> mujoco.MjModel:
        """The model, compiled once."""
        return self.read if self.unchanged else self.compile()

    def compile(self) -> mujoco.MjModel:
        """A model of one's own.

        Raises:
            ModelError: MuJoCo does not compile it, for the reason that it gives.
        """
        try:
            model = _compiled(self.spec)[0]
        except ValueError as error:
            raise ModelError(f"model = {str(self.path)!r}: MuJoCo cannot compile it ({error})") from None
        if self.values:  # of whatever the file derives it from: geoms, <inertial>, settotalmass
            self._set_values(model)
        return model

    def _set_values(self, model: mujoco.MjModel) -> None:
        body, axes = body_id(model, self.body), None
        if any(name in self.values for name in COM):
            free_the_com(model, body)
            axes = in_plane_axes(read_body(model, self.body, self.support))
        data = mujoco.MjData(model)
        set_object_values(model, data, body, geom_id(model, self.support), self.values, axes, self.unit)

    def changed(self, changes: Mapping[str, float]) -> "Scene":
        """This scene with `changes`, whose keys are `WORLD_KEYS`; what each changes: `scene_changes`.

        Lengths are in m whatever the file's unit is. With the contact settings of the shipped scenes timeconst is
        2.1 dt unless it is given.

        Raises:
            ModelError: there is no such key, or the file has nothing that a key could change.
        """
        if self.unchanged and not changes:
            return self
        for key, value in changes.items():
            if key not in CHANGES:
                raise ModelError(f"{key} = {value!r}: of a scene only {', '.join(CHANGES)} can be changed")
        spec, wanted = self.spec.copy(), dict(changes)
        edit = Edit(spec, self.body, self.unit, *self._parts(spec), dict(self.values), self.scale)
        if self.replaced or ("dt" in wanted and self.path.parent == Path(__file__).parent):
            wanted.setdefault("timeconst", STIFF * wanted.get("dt", spec.option.timestep))
        for key, change in CHANGES.items():
            if key in wanted:
                change(edit, wanted[key])
        return replace(self, unchanged=False, spec=spec, values=edit.values, scale=edit.scale)

    def _parts(self, spec: mujoco.MjSpec) -> tuple[list[Any], Any, list[Any]]:
        """Of a spec of this scene: the body's geoms, the support, and all that has parameters of their contacts."""
        geoms, table = list(spec.body(self.body).find_all(mujoco.mjtObj.mjOBJ_GEOM)), spec.geom(self.support)
        return geoms, table, [*geoms, table, *_pairs(spec, geoms)]


def load(
    path: Path | str,
    changes: Mapping[str, float] | None = None,
    *,
    body: str = BODY,
    support: str | None = TABLE,
    chosen: bool = False,
) -> Scene:
    """Read an MJCF file and apply `changes`, see `Scene.changed`.

    Args:
        path: of the file.
        changes: by key.
        body, support: names of the body and of the geom that it stands on, '#id' of what has no name; a support of None
            is what is under the body in the first keyframe, or at qpos0.
        chosen: give a model of your own the solver and contact parameters of settings.xml, before the changes.

    Raises:
        ModelError: the file is not MJCF, it or the body cannot be served, or has nothing that a key could change.
    """
    path = Path(path)
    if not path.is_file():  # MuJoCo would print a warning of its own
        why = "it is a directory" if path.is_dir() else "there is no such file"
        raise ModelError(f"model = {str(path)!r}: not a readable MJCF file ({why})")
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        raw, warned = _compiled(spec)
    except ValueError as error:
        raise ModelError(f"model = {str(path)!r}: not a readable MJCF file ({' '.join(str(error).split())})") from None
    for part in (*spec.bodies[1:], *spec.geoms):
        part.name = part.name or f"#{part.id}"
    index = body_id(raw, body)
    name = body_name(raw, index)
    degrees_of_freedom(raw, index)
    own = spec.body(name)
    own.add_site(name=FILE_FRAME)
    spec.compiler.fusestatic = True  # what hangs on the body rigidly is part of it
    read = _compiled(spec)[0]
    ground = find_support(read, initial_data(read), body_id(read, name), support)
    table = spec.geom(read.geom(ground).name)
    geoms = list(own.find_all(mujoco.mjtObj.mjOBJ_GEOM))
    replaced: dict[str, str] = {}
    if chosen:
        replaced = choose(
            spec, mujoco.MjSpec.from_file(str(scene_path("balance-2d"))), [*geoms, table, *_pairs(spec, geoms)]
        )
    scene = Scene(
        spec,
        path,
        name,
        table.name,
        {},
        1.0,
        tuple(replaced.items()),
        length_unit(raw.opt.gravity),
        warned,
        read,
        unchanged=not chosen,
    )
    return scene.changed(changes or {})


def _compiled(spec: mujoco.MjSpec) -> tuple[mujoco.MjModel, tuple[str, ...]]:
    """The model, and what MuJoCo warned of, a line each, which Python would print in several."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", UserWarning)
        model = spec.compile()
    return model, tuple(dict.fromkeys(" ".join(str(one.message).split()) for one in said))


def _pairs(spec: mujoco.MjSpec, geoms: list[Any]) -> list[Any]:
    """The explicit contact pairs of a body's geoms, whose parameters take the place of the geoms' own."""
    names = {geom.name for geom in geoms}
    return [pair for pair in spec.pairs if names & {pair.geomname1, pair.geomname2}]


def corner(model: mujoco.MjModel) -> Array:
    """(3,) the bottom-left corner of the planar scenes' block, in its body frame [m]."""
    half = model.geom(BODY).size
    return np.array([-half[0], 0.0, -half[2]])
