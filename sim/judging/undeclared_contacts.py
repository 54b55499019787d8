"""Contacts that are not declared: refused at the start, and named when a run makes one."""

from typing import TYPE_CHECKING

import mujoco
import numpy as np
from pivoting.models.body_contacts import forced
from pivoting.models.errors import ModelError
from pivoting.models.names import label
from pivoting.models.rigid_body import RigidBody, initial_data
from pivoting.sim.engine_log import engine_log

if TYPE_CHECKING:
    from pivoting.sim.run import Run


def contact_margin(model: mujoco.MjModel, data: mujoco.MjData, body: RigidBody) -> float:
    """How far from its support the body is held [m]: the margin of the contacts that `data` has."""
    held = forced(model, data, body.index, body.support)
    return max((float(one.contact.includemargin) for one in held), default=0.0)


def refuse_strays(
    model: mujoco.MjModel, data: mujoco.MjData, body: RigidBody, unit: float = 1.0, when: str = "where it starts"
) -> None:
    """The object may touch nothing but its support at the start, in a model whose lengths are in `unit` [m].

    Raises:
        ModelError: it does; both geoms are named.
    """
    for own, other, contact in forced(model, data, body.index):
        if other != body.support:
            deep = f"by {-1e3 * unit * float(contact.dist):.3g} mm" if contact.dist < 0.0 else "within its margin"
            told = f"{when}, its geom {label(model, own)} is in {label(model, other)} {deep}"
            support = label(model, body.support)
            raise ModelError(f"body = {body.name!r}: {told}; must touch nothing but its support {support}")


@engine_log()
def stray_words(run: "Run", first: int = 0) -> list[str]:
    """Which geoms met in contacts that are not declared, in the worst world, and when first; by replaying it.

    The applied wrenches lead to the same states bit for bit, so that MuJoCo's own list of contacts can be read.

    Args:
        first: index of the run's first world, where it is part of a fleet.
    """
    strays = run.log.contacts.strays > 0.0
    if not strays.any():
        return []
    world = int(strays.sum(axis=1).argmax())
    last = int(np.flatnonzero(strays[world])[-1])
    model = run.world.of(world).model
    data, body = initial_data(model), run.truth.index
    data.qpos[:], data.qvel[:] = (values[world] for values in run.start)
    found: dict[tuple[int, int], float] = {}
    for step in range(last + 1):
        data.xfrc_applied[body] = run.wrench_world[world, step]
        if strays[world, step]:
            mujoco.mj_forward(model, data)
            at = run.world.declared.touch(run.position[world, step], run.quaternion[world, step])
            for own, other, contact in forced(model, data, body):
                _, away = run.world.declared.share(np.array(contact.pos), at)
                if other != run.truth.support or (away > run.world.declared.near and not run.world.declared.landing):
                    found.setdefault((own, other), float(run.time[step]))
        mujoco.mj_step(model, data)
    return [
        f"geom {label(run.model, own)} touches {label(run.model, other)}"
        + (" away from the contact" if other == run.truth.support else "")
        + f" at {time:.3g} s in world {first + world}"
        for (own, other), time in found.items()
    ]
