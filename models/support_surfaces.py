"""What a body stands on: the flat upper face of a fixed plane, box or upright cylinder, found under the body."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray
from pivoting.models.errors import ModelError
from pivoting.models.geom_below import first_met
from pivoting.models.names import body_name, geom_id, label
from pivoting.models.placement.convex_hull import colliding

Array = NDArray[np.float64]
PLANE, BOX, CYLINDER = (int(getattr(mujoco.mjtGeom, f"mjGEOM_{kind}")) for kind in ("PLANE", "BOX", "CYLINDER"))


@dataclass(frozen=True, eq=False)
class Surface:
    """A flat face to stand on.

    Attributes:
        geom: id of the geom whose face it is.
        axes: (3, 3) columns (t, o, n) in the world, n the outward normal.
        origin: (3,) its middle, world axes [m].
        half: (2,) how far it reaches along t and o [m]; inf for a plane.
        thick: how far its geom goes down below it [m]; inf for a plane.
        disc: whether it is a disc of radius half[0], not a rectangle.
    """

    geom: int
    axes: Array
    origin: Array
    half: Array
    thick: float
    disc: bool

    def beyond(self, points: ArrayLike) -> Array:
        """(N,) how far points (N, 3) [world axes, m] are outside the face, seen along its normal; 0 inside [m]."""
        across = (np.atleast_2d(np.asarray(points, dtype=float)) - self.origin) @ self.axes[:, :2]
        if self.disc:
            return np.maximum(np.linalg.norm(across, axis=1) - self.half[0], 0.0)
        return np.linalg.norm(np.maximum(np.abs(across) - self.half, 0.0), axis=1)


def upward(model: mujoco.MjModel) -> Array:
    """(3,) unit vector against gravity, world axes; z without gravity."""
    size = float(np.linalg.norm(model.opt.gravity))
    return -np.array(model.opt.gravity) / size if size > 0.0 else np.array([0.0, 0.0, 1.0])


def support_surface(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> Surface:
    """The face of a geom that is turned up most.

    Args:
        data: with the kinematics computed.

    Raises:
        ModelError: the geom is no plane, box or upright cylinder, or it can move.
    """
    if model.body_weldid[model.geom_bodyid[geom]] != 0:
        raise ModelError(f"support = {label(model, geom)}: it can move; must be fixed; name another --support")
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    R, up = data.geom_xmat[geom].reshape(3, 3), upward(model)
    if kind == PLANE:
        return Surface(geom, np.array(R), np.array(data.geom_xpos[geom]), np.full(2, np.inf), np.inf, False)
    k = int(np.abs(R.T @ up).argmax())
    if kind not in (BOX, CYLINDER) or (kind == CYLINDER and k != 2):
        word = mujoco.mjtGeom(kind).name.removeprefix("mjGEOM_").lower()
        told = "the cylinder lies on its side" if kind == CYLINDER else f"of geoms of type {word} no flat face is known"
        out = "must be a plane, a box or an upright cylinder: give the model a box there, or name another --support"
        raise ModelError(f"support = {label(model, geom)}: {told}; {out}")
    n, t = R[:, k] * (1.0 if R[:, k] @ up >= 0.0 else -1.0), R[:, (k + 1) % 3]
    below = float(size[1] if kind == CYLINDER else size[k])  # half of it
    half = np.full(2, size[0]) if kind == CYLINDER else size[[(k + 1) % 3, (k + 2) % 3]]
    return Surface(
        geom,
        np.column_stack([t, np.cross(n, t), n]),
        data.geom_xpos[geom] + below * n,
        np.array(half, dtype=float),
        2.0 * below,
        kind == CYLINDER,
    )


def find_support(model: mujoco.MjModel, data: mujoco.MjData, body: int, named: str | None = None) -> int:
    """Id of the geom that the body stands on: the named one, or else what is under it.

    Of those with which it can collide, that on which it would fall first, see `geom_below.first_met`.

    Args:
        data: with the kinematics computed.  named: a geom's name, or '#id'.

    Raises:
        ModelError: there is no such geom, or nothing under the body.
    """
    if named is not None:
        return geom_id(model, named)
    name = body_name(model, body)
    own = colliding(model, body)
    if not own:
        raise ModelError(f"body = {name!r}: it has no colliding geom; must have one with contype, conaffinity or pair")
    others = [geom for geom in range(model.ngeom) if any(can_collide(model, geom, mine) for mine in own)]
    met = first_met(model, data, body, own, others, upward(model))
    if met is None:
        raise ModelError(f"support = None: nothing that body {name!r} can collide with is under it; name a --support")
    return met


def can_collide(model: mujoco.MjModel, one: int, other: int) -> bool:
    """Whether two geoms may touch: by an explicit pair, or by contype and conaffinity, and not excluded."""
    ends = zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True)
    if any({one, other} == {a, b} for a, b in ends):
        return True
    first, second = int(model.geom_bodyid[one]), int(model.geom_bodyid[other])
    if model.body_weldid[first] == model.body_weldid[second]:
        return False
    excluded = {int(pair) for pair in model.exclude_signature}
    if {(first << 16) + second, (second << 16) + first} & excluded:
        return False
    meet = model.geom_contype[one] & model.geom_conaffinity[other]
    return bool(meet or model.geom_contype[other] & model.geom_conaffinity[one])
