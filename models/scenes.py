"""The scenes that ship with the project: loading, changing their physical parameters, and fitting sensors."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from pivoting.models.reading import ModelError, RigidBody

BODY, TABLE = "block", "table"  # names in the scenes
WORLD_KEYS = ("mu", "mass", "size", "incline", "gravity", "dt", "timeconst", "impedance", "impratio")

STIFF = 2.1  # time constant of the contacts, in time steps: see settings.xml
SITE = "pivoting/object"  # object axes at the centre of mass


def scene_path(name: str) -> Path:
    """The MJCF file of a scene of this package."""
    return Path(__file__).parent / f"{name}.xml"


def load(
    path: Path,
    changes: Mapping[str, float] | None = None,
    *,
    body: str = BODY,
    support: str | None = TABLE,
    chosen: bool = False,
) -> mujoco.MjSpec:
    """Read an MJCF file and apply `changes`, whose keys are `WORLD_KEYS`.

    mu: sliding friction of the body and its support. mass [kg], size [m] (the longest side): of a body of one geom.
    incline [deg]: the support rises to the right. gravity [m/s^2]: its magnitude, along the file's direction.
    dt [s]: the time step; the contacts' time constant stays 2.1 dt unless `timeconst` [s] is given.
    impedance: the constant solimp. impratio: the option.

    Args:
        path: of the file.
        changes: by key.
        body, support: names of the body and of the geom that it stands on, None for the only plane.
        chosen: give a model of your own the solver and contact parameters of settings.xml, before the changes.

    Raises:
        ModelError: the file is not MJCF, or has nothing that a key could change.
    """
    if not path.is_file():  # MuJoCo would print a warning of its own
        why = "it is a directory" if path.is_dir() else "there is no such file"
        raise ModelError(f"model = {str(path)!r}: not a readable MJCF file ({why})")
    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except ValueError as error:
        raise ModelError(f"model = {str(path)!r}: not a readable MJCF file ({error})") from None
    wanted = dict(changes or {})
    geoms, table = _geoms(spec, body, support)
    if chosen:
        _choose(spec, geoms, table)
        spec.compiler.fusestatic = bool(spec.body(body).joints)  # what hangs on it rigidly is part of it
        wanted.setdefault("timeconst", STIFF * wanted.get("dt", spec.option.timestep))
    if "dt" in wanted:
        wanted.setdefault("timeconst", STIFF * wanted["dt"])
        spec.option.timestep = wanted["dt"]
    if "impratio" in wanted:
        spec.option.impratio = wanted["impratio"]
    if "gravity" in wanted:
        size = np.linalg.norm(spec.option.gravity)
        down = spec.option.gravity / size if size > 0.0 else np.array([0.0, 0.0, -1.0])
        spec.option.gravity = wanted["gravity"] * down
    for key in ("mass", "size"):
        if key in wanted and len(geoms) != 1:
            raise ModelError(f"{key} = {wanted[key]:g}: the body has {len(geoms)} geoms; change them in its file")
    if "size" in wanted and geoms[0].type != mujoco.mjtGeom.mjGEOM_BOX:
        raise ModelError(f"size = {wanted['size']:g}: the body is not a box; change it in its file")
    if "size" in wanted:
        geoms[0].size = np.asarray(geoms[0].size) * 0.5 * wanted["size"] / np.max(geoms[0].size)
    if "mass" in wanted:
        geoms[0].mass = wanted["mass"]
    if "incline" in wanted:
        half = 0.5 * np.deg2rad(wanted["incline"])
        table.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT  # in place of the file's euler
        table.quat = [np.cos(half), 0.0, -np.sin(half), 0.0]
    for part in (*geoms, table, *_pairs(spec, geoms)):
        if "mu" in wanted:
            part.friction[0] = wanted["mu"]
        if "timeconst" in wanted:
            part.solref[:2] = wanted["timeconst"], 1.0
        if "impedance" in wanted:
            part.solimp[:2] = wanted["impedance"]
    return spec


def _choose(spec: mujoco.MjSpec, geoms: list[Any], table: Any) -> None:
    """The options and contact parameters of settings.xml, for the reasons given there."""
    ours = mujoco.MjSpec.from_file(str(scene_path("balance-2d")))
    for name in ("integrator", "cone", "impratio", "jacobian", "solver", "iterations", "tolerance", "ls_tolerance"):
        setattr(spec.option, name, getattr(ours.option, name))
    for part in (*geoms, table, *_pairs(spec, geoms)):
        part.condim = 3
        part.solimp = ours.default.geom.solimp


def _pairs(spec: mujoco.MjSpec, geoms: list[Any]) -> list[Any]:
    """The explicit contact pairs of a body's geoms, whose parameters take the place of the geoms' own."""
    names = {geom.name for geom in geoms}
    return [pair for pair in spec.pairs if names & {pair.geomname1, pair.geomname2}]


def _geoms(spec: mujoco.MjSpec, body: str, support: str | None) -> tuple[list[Any], Any]:
    """The geoms of the body and of what hangs on it, and the one that it stands on."""
    found = spec.body(body)
    if found is None:
        names = ", ".join(repr(each.name) for each in spec.bodies[1:]) or "(the model has none)"
        raise ModelError(f"body = {body!r}: must be one of {names}")
    if support is not None:
        table = spec.geom(support)
        if table is None:
            raise ModelError(f"support = {support!r}: the model has no geom of that name")
    else:
        planes = [geom for geom in spec.geoms if geom.type == mujoco.mjtGeom.mjGEOM_PLANE]
        if len(planes) != 1:
            raise ModelError(f"support = None: the model has {len(planes)} planes; name the geom it stands on")
        table = planes[0]
    table.name = table.name or "pivoting/support"  # sensors go by names
    return list(found.find_all(mujoco.mjtObj.mjOBJ_GEOM)), table


def compiled(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """The model of a spec.

    Raises:
        ModelError: MuJoCo does not compile it, for the reason that it gives.
    """
    try:
        return spec.compile()
    except ValueError as error:
        raise ModelError(f"model = {spec.modelname!r}: MuJoCo cannot compile it ({error})") from None


def instrument(
    spec: mujoco.MjSpec, body: RigidBody, support: str, contacts: NDArray[np.float64]
) -> tuple[mujoco.MjModel, dict[str, slice]]:
    """Compile `spec` with a site at the object's axes and CoM and the sensors that the loop reads.

    Args:
        spec: the model; sensors are added to it.
        body: what `read_body` found.
        support: name of the geom that it stands on.
        contacts: (K, 3) the points that are to stick, body frame [m]; of what rolls, which is one, the centre.

    Returns:
        The model, and where each reading is in sensordata: position (3) of the CoM, quaternion (4) object to
        world, velocity (3) of the CoM and angular_velocity (3), world axes; contact (4): number of contacts with the
        support, net force (3) on the body in world axes [N]; and contact 0, 1...: likewise near each of several points.
    """
    frame = spec.body(body.name)
    frame.add_site(name=SITE, pos=body.com, quat=body.axes)
    at_site = {"objtype": mujoco.mjtObj.mjOBJ_SITE, "objname": SITE}
    kinds = {
        "position": mujoco.mjtSensor.mjSENS_FRAMEPOS,
        "quaternion": mujoco.mjtSensor.mjSENS_FRAMEQUAT,
        "velocity": mujoco.mjtSensor.mjSENS_FRAMELINVEL,
        "angular_velocity": mujoco.mjtSensor.mjSENS_FRAMEANGVEL,
    }
    for name, kind in kinds.items():
        spec.add_sensor(name=f"pivoting/{name}", type=kind, **at_site)
    _contact_sensor(spec, "contact", mujoco.mjtObj.mjOBJ_GEOM, support, body.name)
    names = [*kinds, "contact"]
    if len(contacts) > 1:
        apart = min(np.linalg.norm(a - b) for i, a in enumerate(contacts) for b in contacts[:i])
        for i, point in enumerate(contacts):
            near = f"{SITE} {i}"
            frame.add_site(name=near, pos=point, type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[apart / 3.0] * 3)
            _contact_sensor(spec, f"contact {i}", mujoco.mjtObj.mjOBJ_SITE, near, body.name)
            names.append(f"contact {i}")
    model = compiled(spec)
    where = {}
    for name in names:
        sensor = model.sensor(f"pivoting/{name}")
        start = int(sensor.adr[0])
        where[name] = slice(start, start + int(sensor.dim[0]))
    return model, where


def _contact_sensor(spec: mujoco.MjSpec, name: str, kind: mujoco.mjtObj, of: str, body: str) -> None:
    """Net contact force on `body` from the geom, or within the site, `of`; number found and force (3), world axes."""
    fields = mujoco.mjtConDataField
    netforce = 3  # reduce="netforce": one contact that stands for all, in world axes
    sensor = spec.add_sensor(
        name=f"pivoting/{name}",
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        objtype=kind,
        objname=of,
        reftype=mujoco.mjtObj.mjOBJ_BODY,
        refname=body,
    )
    sensor.intprm = [1 << int(fields.mjCONDATA_FOUND) | 1 << int(fields.mjCONDATA_FORCE), netforce, 1]


def corner(model: mujoco.MjModel) -> NDArray[np.float64]:
    """(3,) the bottom-left corner of the planar scenes' block, in its body frame [m]."""
    half = model.geom(BODY).size
    return np.array([-half[0], 0.0, -half[2]])
