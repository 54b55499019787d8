"""The scenes that ship with the project: loading, changing their physical parameters, and fitting sensors."""

from collections.abc import Mapping
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray
from pivoting.models.reading import ModelError, PlanarBody

BODY, TABLE = "block", "table"  # names in the scenes
WORLD_KEYS = ("mu", "mass", "size", "incline", "gravity", "dt", "timeconst", "impedance", "impratio")

STIFF = 2.1  # time constant of the contacts, in time steps: see settings-2d.xml
SITE = "pivoting/object"  # object axes at the centre of mass
SENSORS = ("position", "quaternion", "velocity", "angular_velocity", "contact")


def scene_path(name: str) -> Path:
    """The MJCF file of a scene of this package."""
    return Path(__file__).parent / f"{name}.xml"


def load(path: Path, changes: Mapping[str, float] | None = None) -> mujoco.MjSpec:
    """Read an MJCF file and apply `changes`, whose keys are `WORLD_KEYS`.

    mu: sliding friction of every geom. mass [kg], size [m]: of the block. incline [deg]: the table rises to the right.
    gravity [m/s^2]: its magnitude, straight down. dt [s]: the time step; the contacts' time constant stays 2.1 dt
    unless `timeconst` [s] is given. impedance: the constant solimp. impratio: the option.

    Raises:
        ModelError: the file is not MJCF.
    """
    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except ValueError as error:
        raise ModelError(f"model = {str(path)!r}: not a readable MJCF file ({error})") from None
    wanted = dict(changes or {})
    if "dt" in wanted:
        wanted.setdefault("timeconst", STIFF * wanted["dt"])
        spec.option.timestep = wanted["dt"]
    if "impratio" in wanted:
        spec.option.impratio = wanted["impratio"]
    if "gravity" in wanted:
        spec.option.gravity = [0.0, 0.0, -wanted["gravity"]]
    block, table = spec.geom(BODY), spec.geom(TABLE)
    if "size" in wanted:
        block.size[[0, 2]] = 0.5 * wanted["size"]
    if "mass" in wanted:
        block.mass = wanted["mass"]
    if "incline" in wanted:
        half = 0.5 * np.deg2rad(wanted["incline"])
        table.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT  # in place of the file's euler
        table.quat = [np.cos(half), 0.0, -np.sin(half), 0.0]
    for geom in (block, table):
        if "mu" in wanted:
            geom.friction[0] = wanted["mu"]
        if "timeconst" in wanted:
            geom.solref[0] = wanted["timeconst"]
        if "impedance" in wanted:
            geom.solimp[:2] = wanted["impedance"]
    return spec


def compiled(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """The model of a spec.

    Raises:
        ModelError: MuJoCo does not compile it, for the reason that it gives.
    """
    try:
        return spec.compile()
    except ValueError as error:
        raise ModelError(f"model = {spec.modelname!r}: MuJoCo cannot compile it ({error})") from None


def instrument(spec: mujoco.MjSpec, body: PlanarBody, support: str) -> tuple[mujoco.MjModel, dict[str, slice]]:
    """Compile `spec` with a site at the object's axes and CoM and the sensors that the loop reads.

    Args:
        spec: the model; sensors are added to it.
        body: what `read_body` found.
        support: name of the geom that the body stands on.

    Returns:
        The model, and where each of `SENSORS` is in sensordata: position (3) of the CoM, quaternion (4) object to
        world, velocity (3) of the CoM and angular_velocity (3), world axes; contact (4): contacts found, net force (3)
        on the body in world axes [N].
    """
    spec.body(body.name).add_site(name=SITE, pos=body.com, quat=body.axes)
    at_site = {"objtype": mujoco.mjtObj.mjOBJ_SITE, "objname": SITE}
    kinds = {
        "position": mujoco.mjtSensor.mjSENS_FRAMEPOS,
        "quaternion": mujoco.mjtSensor.mjSENS_FRAMEQUAT,
        "velocity": mujoco.mjtSensor.mjSENS_FRAMELINVEL,
        "angular_velocity": mujoco.mjtSensor.mjSENS_FRAMEANGVEL,
    }
    for name, kind in kinds.items():
        spec.add_sensor(name=f"pivoting/{name}", type=kind, **at_site)
    fields = mujoco.mjtConDataField
    netforce = 3  # reduce="netforce": one contact that stands for all, in world axes
    contact = spec.add_sensor(
        name="pivoting/contact",
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        objtype=mujoco.mjtObj.mjOBJ_GEOM,
        objname=support,
        reftype=mujoco.mjtObj.mjOBJ_BODY,
        refname=body.name,
    )
    contact.intprm = [1 << int(fields.mjCONDATA_FOUND) | 1 << int(fields.mjCONDATA_FORCE), netforce, 1]
    model = compiled(spec)
    where = {}
    for name in SENSORS:
        sensor = model.sensor(f"pivoting/{name}")
        start = int(sensor.adr[0])
        where[name] = slice(start, start + int(sensor.dim[0]))
    return model, where


def corner(model: mujoco.MjModel) -> NDArray[np.float64]:
    """(3,) the bottom-left corner of the scenes' block, in its body frame [m]."""
    half = model.geom(BODY).size
    return np.array([-half[0], 0.0, -half[2]])
