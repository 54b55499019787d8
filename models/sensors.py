"""The sensors that the loop reads: where the object is, and every contact that it makes."""

from dataclasses import replace

import mujoco
from pivoting.models.frames import Array, matrix, quaternion
from pivoting.models.rigid_body import file_frame, read_body
from pivoting.models.scenes import Scene

SITE = "pivoting/object"  # object axes at what is taken for the centre of mass
ON_PLANE, CONTACTS = 4, 8  # contacts of one geom with its support, at most: with a plane, with another geom
SLOTS = 64  # contacts that are listed, at most


def instrument(scene: Scene, at: Array | None = None) -> tuple[mujoco.MjModel, dict[str, slice]]:
    """Compile a scene with a site on the object, along its axes, and the sensors that the loop reads.

    Args:
        at: (3,) the point of the body where the site is, body frame [m]; by default the CoM.

    Returns:
        The model, and where each reading is in sensordata: position (3) of that point, quaternion (4) object to
        world, velocity (3) of the point and angular_velocity (3), world axes; contacts (S, 14): each contact with the
        support, as `sim.contact_sensing` takes them apart; touching (4): number of contacts with anything, and their
        net force (3), world axes [N].
    """
    bare = scene.compiled
    body = read_body(bare, scene.body, scene.support)
    origin, axes = file_frame(bare, body.index)
    point = body.com if at is None else at
    spec = scene.spec.copy()
    site = spec.body(scene.body).add_site(
        name=SITE, pos=axes.T @ (point - origin), quat=quaternion(axes.T @ matrix(body.axes))
    )
    del site
    at_site = {"objtype": mujoco.mjtObj.mjOBJ_SITE, "objname": SITE}
    kinds = {
        "position": mujoco.mjtSensor.mjSENS_FRAMEPOS,
        "quaternion": mujoco.mjtSensor.mjSENS_FRAMEQUAT,
        "velocity": mujoco.mjtSensor.mjSENS_FRAMELINVEL,
        "angular_velocity": mujoco.mjtSensor.mjSENS_FRAMEANGVEL,
    }
    for name, kind in kinds.items():
        spec.add_sensor(name=f"pivoting/{name}", type=kind, **at_site)
    touched = {"reftype": mujoco.mjtObj.mjOBJ_BODY, "refname": scene.body}
    plane = int(bare.geom_type[body.support]) == int(mujoco.mjtGeom.mjGEOM_PLANE)
    slots = min((ON_PLANE if plane else CONTACTS) * int(bare.body_geomnum[body.index]), SLOTS)
    spec.add_sensor(
        name="pivoting/contacts",
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        objtype=mujoco.mjtObj.mjOBJ_GEOM,
        objname=scene.support,
        **touched,
    ).intprm = [_fields("FOUND", "FORCE", "DIST", "POS", "NORMAL", "TANGENT"), 2 if slots == SLOTS else 0, slots]
    spec.add_sensor(name="pivoting/touching", type=mujoco.mjtSensor.mjSENS_CONTACT, **touched).intprm = [
        _fields("FOUND", "FORCE"), 3, 1,
    ]  # fmt: skip
    spec.option.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_SENSOR)
    model = replace(scene, spec=spec).compile()
    where = {}
    for name in (*kinds, "contacts", "touching"):
        sensor = model.sensor(f"pivoting/{name}")
        start = int(sensor.adr[0])
        where[name] = slice(start, start + int(sensor.dim[0]))
    return model, where


def _fields(*names: str) -> int:
    """What a contact sensor reports of each contact, as the bits that MuJoCo wants."""
    return sum(1 << int(getattr(mujoco.mjtConDataField, f"mjCONDATA_{name}")) for name in names)
