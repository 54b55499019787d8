"""What the simulator itself does to a sticking contact: the slip to expect from MuJoCo, not from the controller.

MuJoCo's contact rows satisfy J a + R f = -b v - k r with J at the start of the step. For a corner that turns at rate w
the rows leave out c = w x (w x r), the centripetal acceleration (Jdot qdot). With semi-implicit Euler of step h the
tangential row settles at v = (c_t - R_t f_t) / b while the corner itself moves at v - c_t h / 2, and the normal row
settles at the depth delta with k delta = R_n f_n - c_n (1 - b h / 2); the constrained point lies delta / 2 above the
corner. So the material corner drifts along the table at

    - R_t f_t / b              creep under tangential load
    + c_t (1 / b - h / 2)      rotation; nothing at b h = 2, where the row rings for ever
    + w delta / 2              the lever of the penetration

and the contact opens where delta < 0: never by turning alone at b h = 2. A ball of radius s that rolls has its centre
at R p and touches at r = R p - s n, with the normal n at rest: only R p turns, and all of this holds of it with
c = w x (w x R p) for where it touches less what it has rolled, the sum of w x (s n) h with w at the end of the step.
f is the load of one contact point: an edge of the box makes two, which share it. docs/fidelity.md measures all three.
"""

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class ContactRows(NamedTuple):
    """What MuJoCo made of the contact at the start of a run.

    Attributes:
        points: contacts that share the load.
        R_n, R_t: regularisation of the normal and tangential rows [1/kg].
        b: damping [1/s] and k: stiffness [1/s^2] of the normal row; b is the tangential row's too.
        h: time step [s].
    """

    points: int
    R_n: float
    R_t: float
    b: float
    k: float
    h: float


def read_rows(model: mujoco.MjModel, data: mujoco.MjData, body: int, support: int) -> ContactRows | None:
    """The contact rows between a body and a geom of `data` after `mj_forward`; None where there is no contact."""
    ends = [model.geom_bodyid[contact.geom] for contact in data.contact]
    own = [
        contact
        for contact, bodies in zip(data.contact, ends, strict=True)
        if support in contact.geom and body in bodies and contact.efc_address >= 0
    ]
    if not own:
        return None
    row = int(own[0].efc_address)
    stiffness, damping, impedance = data.efc_KBIP[row, :3]
    return ContactRows(
        points=len(own),
        R_n=float(data.efc_R[row]),
        R_t=float(data.efc_R[row + 1]),
        b=float(damping),
        k=float(stiffness * impedance),  # MuJoCo's aref is -B v - K I r
        h=float(model.opt.timestep),
    )


def drift(rows: ContactRows, turning: Array, omega: Array, force: Array) -> Array:
    """Predicted slip (..., K, 2) [m/s] of K contacts along the table, (t, o).

    Args:
        rows: of the contact, whose points share the load of the K.
        turning: (..., K, 3) from the CoM to each point, or to the centre of what rolls, table axes [m].
        omega: (..., 3) angular velocity, table axes [rad/s].
        force: (..., K, 3) predicted contact forces (f_t, f_o, f_n) [N].
    """
    w = np.broadcast_to(omega[..., None, :], turning.shape)
    c = np.cross(w, np.cross(w, turning))
    load = force * (force.shape[-2] / rows.points)
    depth = np.maximum(rows.R_n * load[..., 2] - c[..., 2] * (1.0 - 0.5 * rows.b * rows.h), 0.0) / rows.k
    below = -0.5 * depth[..., None] * np.array([0.0, 0.0, 1.0])  # from the constrained point to the material one
    drifts = -rows.R_t * load / rows.b + c * (1.0 / rows.b - 0.5 * rows.h) + np.cross(w, below)
    return drifts[..., :2]
