"""The contacts that MuJoCo has found between a body and what is around it."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray


class ContactParts(NamedTuple):
    """What has the parameters of the contacts between a body and its support.

    Attributes:
        geoms: (ngeom,) which geoms, the support's among them.  pairs: (npair,) which explicit pairs.
        overrides: whether the option's own take the place of all geoms', by <flag override="enable"/>.
    """

    geoms: NDArray[np.bool_]
    pairs: NDArray[np.bool_]
    overrides: bool


def contact_parts(model: mujoco.MjModel, body: int, support: int) -> ContactParts:
    """Of a body and the geom that it stands on, by their ids."""
    own = model.geom_bodyid == body
    pairs = own[model.pair_geom1] | own[model.pair_geom2]
    overrides = bool(model.opt.enableflags & int(mujoco.mjtEnableBit.mjENBL_OVERRIDE))
    return ContactParts(own | (np.arange(model.ngeom) == support), pairs, overrides)


class BodyContact(NamedTuple):
    """A contact of a body: ids of its own geom and of the other, and the contact itself."""

    own: int
    other: int
    contact: Any


def contacts_of(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> Iterator[BodyContact]:
    """Every contact of a body that `data` lists, those within a gap, which make no force, included."""
    for contact in data.contact:
        first, second = (int(geom) for geom in contact.geom)
        if min(first, second) < 0:  # of a flex
            continue
        if int(model.geom_bodyid[first]) == body:
            yield BodyContact(first, second, contact)
        elif int(model.geom_bodyid[second]) == body:
            yield BodyContact(second, first, contact)


def forced(model: mujoco.MjModel, data: mujoco.MjData, body: int, other: int | None = None) -> list[BodyContact]:
    """The contacts of a body that make a force, with any geom or only with `other`; call after mj_fwdPosition."""
    found = contacts_of(model, data, body)
    return [one for one in found if one.contact.efc_address >= 0 and other in (None, one.other)]
