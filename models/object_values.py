"""What of an object is set on its compiled model: its friction, mass, inertia, and where its centre of mass is.

Worlds of one batch share what the compiler makes of a scene, and may differ in these values.
"""

from collections.abc import Mapping

import mujoco
import numpy as np
from pivoting.models.body_contacts import contact_parts
from pivoting.models.errors import ModelError
from pivoting.models.frames import Array
from pivoting.models.mujoco_constants import LEAST_FRICTION

COM = ("com_x", "com_y", "com_z")  # of the centre of mass, from where the file has it, object axes
OBJECT_VALUES = ("mass", "inertia", "mu", *COM)
FIELDS = ("body_mass", "body_inertia", "body_ipos", "geom_friction", "pair_friction", "opt.o_friction")  # that change
_INERTIAL = tuple(int(getattr(mujoco.mjtSameFrame, f"mjSAMEFRAME_{kind}")) for kind in ("INERTIA", "INERTIAROT"))


def check_friction(mu: float) -> None:
    """Raise if MuJoCo does not simulate so little friction.

    Raises:
        ModelError: it does not.
    """
    if mu <= LEAST_FRICTION:
        raise ModelError(
            f"mu = {mu:g}: must be > {LEAST_FRICTION:g}, which is the least friction coefficient that MuJoCo simulates"
        )


def free_the_com(model: mujoco.MjModel, body: int) -> None:
    """Have MuJoCo compute where the centre of mass of a body is, whatever the compiler found of it.

    Where a body's CoM is at its origin, the compiler notes that their frames are the same, and that those of its geoms
    and sites are that of its inertia; what moves with the CoM would then be left where it was.
    """
    model.body_sameframe[body] = 0
    for owners, same in ((model.geom_bodyid, model.geom_sameframe), (model.site_bodyid, model.site_sameframe)):
        same[(owners == body) & np.isin(same, _INERTIAL)] = 0


def set_object_values(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    body: int,
    support: int,
    values: Mapping[str, float],
    axes: Array | None = None,
    unit: float = 1.0,
) -> None:
    """Set what a body has of its own, and all that MuJoCo derives from it.

    Args:
        model: as it was compiled, of a body that is not "simple" where its CoM is to move; changed.
        data: of the model, scratch.
        body, support: ids of the body and of the geom that it stands on.
        values: by `OBJECT_VALUES`: the mass [kg], the inertia in proportion to it; a factor on that inertia; the
            sliding friction of the body and its support; where the CoM is, from where it was, along `axes` [m].
        axes: (3, 3) object axes in the body frame, along which `COM` counts; of one along which it does not, 0.
        unit: of the model's lengths [m].
    """
    if "mu" in values:
        _set_friction(model, body, support, values["mu"])
    if "mass" in values:
        share = values["mass"] / float(model.body_mass[body])
        model.body_mass[body] *= share
        model.body_inertia[body] *= share
    if "inertia" in values:
        model.body_inertia[body] *= values["inertia"]
    if any(name in values for name in COM):
        assert axes is not None, "the centre of mass moves along the object's axes"
        model.body_ipos[body] += axes @ np.array([values.get(name, 0.0) for name in COM]) / unit
    if set(values) - {"mu"}:
        mujoco.mj_setConst(model, data)


def _set_friction(model: mujoco.MjModel, body: int, support: int, mu: float) -> None:
    """The sliding friction of all that touches."""
    geoms, pairs, overrides = contact_parts(model, body, support)
    model.geom_friction[geoms, 0] = mu
    model.pair_friction[pairs, :2] = mu
    if overrides:
        model.opt.o_friction[:2] = mu
