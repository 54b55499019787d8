"""Whether contacts given by hand are on a body: points of the hull of its colliding geoms, or centres of round ends."""

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import ArrayLike
from pivoting.models.errors import ModelError
from pivoting.models.frames import Array, matrix
from pivoting.models.placement.convex_hull import SAMPLES, colliding, ellipsoids
from pivoting.models.rigid_body import RigidBody
from scipy.spatial import ConvexHull

NEAR = 0.01  # of the body's size


def refuse_off_body(model: mujoco.MjModel, body: RigidBody, contacts: Sequence[ArrayLike], radius: Array) -> None:
    """A point that is to stick has to be on the body's hull, and what is to roll a round end of it.

    Args:
        contacts: K points as `RigidBody.point` takes them; in the plane, distances are taken in the plane.
        radius: (K,) of what rolls, else 0 [m].

    Raises:
        ModelError: one is not; its value, and what there is, are named.
    """
    _, centre, axes = ellipsoids(model, colliding(model, body.index))
    into = matrix(body.axes)[:, [0, 2] if body.dim == 2 else [0, 1, 2]].T
    rank = np.count_nonzero(np.linalg.norm(axes, axis=1), axis=1)
    surface = [c + SAMPLES[k] @ A.T for c, A, k in zip(centre, axes, rank.tolist(), strict=True)]
    hull = ConvexHull((np.concatenate(surface) - body.com) @ into.T)
    near = NEAR * float(np.linalg.norm(np.ptp(hull.points, axis=0)))
    half = np.linalg.svd(into @ axes, compute_uv=False)
    round_ = (half[:, 0] > 0.0) & (half[:, 0] - half[:, -1] <= 1e-6 * near)
    ends, radii = (centre[round_] - body.com) @ into.T, half[round_, 0]
    for k, (contact, rho) in enumerate(zip(contacts, radius, strict=True)):
        point = body.point(contact)
        given = f"contacts[{k}] = {np.asarray(contact).tolist()}"
        if rho == 0.0:
            off = float(np.abs((hull.equations[:, :-1] @ point + hull.equations[:, -1]).max()))
            if off > near:
                where = f"{off:.2g} m off the surface of the hull of its colliding geoms"
                raise ModelError(
                    f"{given}: {where}; must be on it, within {near:.2g} m; of a round end give its radius"
                )
        elif not ((np.linalg.norm(ends - point, axis=1) <= near) & (np.abs(radii - rho) <= near)).any():
            there = [f"{c.tolist()} of radius {r:.6g}" for c, r in zip(centre[round_].round(9), radii, strict=True)]
            allowed = f"0 of a point, or that of a round end and its centre: {', '.join(there[:4])}" if there else "0"
            none = "" if there else ", as the body has no round ends"
            raise ModelError(
                f"radius = {rho:g}: {given} is no centre of an end of that radius; must be {allowed}{none}"
            )
