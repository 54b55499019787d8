"""Bodies and geoms by name, or by '#id' where they have none."""

import mujoco
from pivoting.models.errors import ModelError


def body_name(model: mujoco.MjModel, body: int) -> str:
    """The body's name, or '#id'."""
    return model.body(body).name or f"#{body}"


def geom_name(model: mujoco.MjModel, geom: int) -> str:
    """The geom's name, or '#id'; as --support takes it."""
    return model.geom(geom).name or f"#{geom}"


def body_id(model: mujoco.MjModel, name: str) -> int:
    """Id of the body called `name`, or with the id that '#id' gives.

    Raises:
        ModelError: there is none; those that there are are listed.
    """
    bodies = {body_name(model, i): i for i in range(1, model.nbody)}
    bodies |= {f"#{i}": i for i in range(1, model.nbody) if f"#{i}" not in bodies}
    if not isinstance(name, str) or name not in bodies:
        shown = ", ".join(repr(body_name(model, i)) for i in range(1, model.nbody))
        raise ModelError(f"body = {name!r}: must be one of {shown or '(the model has none)'}")
    return bodies[name]


def geom_id(model: mujoco.MjModel, name: str) -> int:
    """Id of the geom called `name`, or with the id that '#id' gives, which stands on its own for a support.

    Raises:
        ModelError: there is none; those that are fixed to the world are listed.
    """
    geoms = {model.geom(i).name: i for i in range(model.ngeom) if model.geom(i).name}
    geoms |= {f"#{i}": i for i in range(model.ngeom) if f"#{i}" not in geoms}
    if not isinstance(name, str) or name not in geoms:
        fixed = [i for i in range(model.ngeom) if model.body_weldid[model.geom_bodyid[i]] == 0]
        shown = ", ".join(label(model, i) for i in fixed) or "(the model has none)"
        raise ModelError(f"support = {name!r}: the model has no geom of that name; fixed ones are {shown}")
    return geoms[name]


def label(model: mujoco.MjModel, geom: int) -> str:
    """A geom in words: its name, or '#id' and whose it is."""
    name = model.geom(geom).name
    if name and not name.startswith("#"):
        return repr(name)
    kind = mujoco.mjtGeom(int(model.geom_type[geom])).name.removeprefix("mjGEOM_").lower()
    body = int(model.geom_bodyid[geom])
    return f"{name or f'#{geom}'!r} ({kind} of {f'body {body_name(model, body)!r}' if body else 'the world'})"
