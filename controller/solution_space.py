"""The geometry of the notes' second figure: the contact's wrench cone, the wrenches that balance, and the optimum."""

from typing import NamedTuple

import numpy as np
from pivoting.controller.validate import Array, fail


class SolutionSpace(NamedTuple):
    """A planar problem, or many of them, drawn in the space of wrenches (F_u, F_v, M), object axes [N, N, N m].

    J_c has two columns, so the contact's composite wrench cone {J f} is a flat sector of the 3-D wrench space, and the
    wrenches that balance, {required - J f}, are its mirror image with the apex moved to `required`, where the contact
    carries nothing. The optimum is the cheapest point of that set.

    Attributes:
        cone: (..., P, 3) polygon of the contact's wrenches J f; its apex, or its floor, comes first.
        admissible: (..., P, 3) polygon of the applied wrenches that balance: required - cone.
        required: (..., 3) the wrench that contact and applied wrench must make together (-m g for balance).
        wrench: (..., 3) the applied wrench w.
        contact: (..., 3) the wrench J f of the contact.
        lacking: (..., 3) required - w - J f; zero unless bounds did not allow what is required.
    """

    cone: Array
    admissible: Array
    required: Array
    wrench: Array
    contact: Array
    lacking: Array


def solution_space(
    jacobian: Array, mu: float, f_min: float, required: Array, wrench: Array, force: Array, reach: float | None = None
) -> SolutionSpace:
    """The geometry of planar problems with one contact and of their given answers; it solves nothing.

    Args:
        jacobian: (..., 3, 2).
        mu: friction that may be used.  f_min: least normal force [N].
        required, wrench: (..., 3) [N, N m].  force: (..., 2) the contact's [N].
        reach: largest normal force that is drawn [N]; by default twice the load or the answers', whichever is larger.

    Raises:
        ValueError: the problem is not planar or has several contacts, whose cones do not fit one picture.
    """
    if jacobian.shape[-2:] != (3, 2):
        raise fail("jacobian", f"of shape {jacobian.shape}", "(..., 3, 2): of one planar contact")
    load = float(np.linalg.norm(required[..., :2], axis=-1).max())
    top = 2.0 * max(load, float(force[..., 1].max()), 1e-9) if reach is None else reach
    forces = np.array([[-mu * f_min, f_min], [-mu * top, top], [mu * top, top], [mu * f_min, f_min]])
    cone = forces @ np.swapaxes(jacobian, -1, -2)
    contact = np.einsum("...ij,...j", jacobian, force)
    return SolutionSpace(
        cone=cone,
        admissible=required[..., None, :] - cone,
        required=np.array(required),
        wrench=np.array(wrench),
        contact=contact,
        lacking=required - wrench - contact,
    )
