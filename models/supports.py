"""What a body stands on: the flat upper face of a fixed plane, box or upright cylinder, found under the body."""

import copy
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray
from pivoting.models.hull import colliding, ellipsoids
from pivoting.models.naming import ModelError, geom_id, label

Array = NDArray[np.float64]
RAYS = 64  # at most, cast down from the lowest points of the body
PLANE, BOX, CYLINDER = (int(getattr(mujoco.mjtGeom, f"mjGEOM_{kind}")) for kind in ("PLANE", "BOX", "CYLINDER"))


@dataclass(frozen=True, eq=False)
class Surface:
    """A flat face to stand on.

    Attributes:
        geom: id of the geom whose face it is.
        axes: (3, 3) columns (t, o, n) in the world, n the outward normal.
        origin: (3,) its middle, world axes [m].
        half: (2,) how far it reaches along t and o [m]; inf for a plane.
        disc: whether it is a disc of radius half[0], not a rectangle.
    """

    geom: int
    axes: Array
    origin: Array
    half: Array
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
        raise ModelError(f"support = {label(model, geom)}: it can move; must be fixed to the world")
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    R, up = data.geom_xmat[geom].reshape(3, 3), upward(model)
    if kind == PLANE:
        return Surface(geom, np.array(R), np.array(data.geom_xpos[geom]), np.full(2, np.inf), False)
    k = int(np.abs(R.T @ up).argmax())
    if kind not in (BOX, CYLINDER) or (kind == CYLINDER and k != 2):
        kind_word = mujoco.mjtGeom(kind).name.removeprefix("mjGEOM_").lower()
        told = f"a {kind_word} has no flat face that is known" if kind != CYLINDER else "the cylinder lies on its side"
        out = "give the model a box with its upper face there, or name another --support"
        raise ModelError(
            f"support = {label(model, geom)}: {told}; must be a plane, a box or an upright cylinder: {out}"
        )
    n, t = R[:, k] * (1.0 if R[:, k] @ up >= 0.0 else -1.0), R[:, (k + 1) % 3]
    thick = size[1] if kind == CYLINDER else size[k]
    half = np.full(2, size[0]) if kind == CYLINDER else size[[(k + 1) % 3, (k + 2) % 3]]
    return Surface(
        geom,
        np.column_stack([t, np.cross(n, t), n]),
        data.geom_xpos[geom] + thick * n,
        np.array(half, dtype=float),
        kind == CYLINDER,
    )


def find_support(model: mujoco.MjModel, data: mujoco.MjData, body: int, named: str | None = None) -> int:
    """Id of the geom that the body stands on: the named one, or else what is under it.

    Rays are cast down from the lowest points of the body; the first geom that they meet, with which the body can
    collide, is what it comes to stand on. One that is a little inside the body counts.

    Args:
        data: with the kinematics computed.  named: a geom's name, or '#id'.

    Raises:
        ModelError: there is no such geom, or nothing under the body.
    """
    if named is not None:
        return geom_id(model, named)
    name = model.body(body).name
    own = colliding(model, body)
    if not own:
        raise ModelError(f"body = {name!r}: it has no colliding geom; must have one with contype, conaffinity or pair")
    others = [geom for geom in range(model.ngeom) if any(can_collide(model, geom, mine) for mine in own)]
    up = upward(model)
    _, centre, axes = ellipsoids(model, own)
    R, origin = data.xmat[body].reshape(3, 3), data.xpos[body]
    local = R.T @ up
    reach = np.linalg.norm(local @ axes, axis=1)
    half = np.einsum("nij,nj->ni", axes, local @ axes) / np.maximum(reach, 1e-300)[:, None]
    low, top = centre @ local - reach, float((centre @ local + reach).max())
    lowest = np.argsort(low, kind="stable")
    near = lowest[low[lowest] <= low[lowest[0]] + 0.02 * (top - low[lowest[0]])]
    picked = near[np.linspace(0, len(near) - 1, min(RAYS, len(near))).round().astype(int)]
    points = origin + (centre - half)[picked] @ R.T
    points = np.vstack([points, points.mean(axis=0)])
    probe = _only(model, others)
    best, drop = -1, np.inf
    for point in points:
        above = top - float((point - origin) @ up)
        hit = np.full(1, -1, dtype=np.int32)
        start = point + above * up
        group = np.array([1, 0, 0, 0, 0, 0], dtype=np.uint8)
        far = mujoco.mj_ray(probe, data, start, -up, group, 1, body, hit)
        if hit[0] >= 0 and far - above < drop - 1e-9 * max(top, 1.0):
            best, drop = int(hit[0]), far - above
    if best < 0:
        raise ModelError(f"support = None: nothing that body {name!r} can collide with is under it; name a --support")
    return best


def _only(model: mujoco.MjModel, geoms: list[int]) -> mujoco.MjModel:
    """A copy in which rays meet these geoms alone; planes have no end there, as they have none for contacts."""
    probe = copy.copy(model)
    probe.geom_group[:] = 1
    probe.geom_group[geoms] = 0
    probe.geom_size[probe.geom_type == PLANE, :2] = 0.0
    probe.geom_matid[:] = -1  # rays pass through what is drawn transparent
    probe.geom_rgba[:, 3] = 1.0
    return probe


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


def body_size(model: mujoco.MjModel, body: int) -> float:
    """Diagonal of the box, along the body's axes, around its colliding geoms [m]."""
    _, centre, axes = ellipsoids(model, colliding(model, body))
    reach = np.linalg.norm(axes, axis=2)
    return float(np.linalg.norm((centre + reach).max(axis=0) - (centre - reach).min(axis=0)))
