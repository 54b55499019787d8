"""What the simulator itself does to a sticking contact: the slip to expect from MuJoCo, not from the controller.

MuJoCo's contact rows satisfy J a + R f = -b v - k r with J at the start of the step. For a corner that turns at rate w
the rows leave out c = w x (w x r), the centripetal acceleration (Jdot qdot). With semi-implicit Euler of step h the
tangential row settles at v = (c_t - R_t f_t) / b while the corner itself moves at v - c_t h / 2, and the normal row
settles at the depth delta with k delta = R_n f_n - c_n (1 - b h / 2); the constrained point lies delta / 2 above the
corner. So the material corner drifts along the table at

    - R_t f_t / b              creep under tangential load
    + c_t (1 / b - h / 2)      rotation; nothing at b h = 2, where the row rings for ever
    + w delta / 2              the lever of the penetration

and the contact opens where delta < 0: never by turning alone at b h = 2.
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


def read_rows(model: mujoco.MjModel, data: mujoco.MjData) -> ContactRows | None:
    """The contact rows of `data` after `mj_forward`; None where there is no contact."""
    if data.ncon == 0:
        return None
    row = int(data.contact[0].efc_address)
    stiffness, damping, impedance = data.efc_KBIP[row, :3]
    return ContactRows(
        points=int(data.ncon),
        R_n=float(data.efc_R[row]),
        R_t=float(data.efc_R[row + 1]),
        b=float(damping),
        k=float(stiffness * impedance),  # MuJoCo's aref is -B v - K I r
        h=float(model.opt.timestep),
    )


def drift(rows: ContactRows, r_t: Array, r_n: Array, omega: Array, force: Array) -> Array:
    """Predicted velocity (...) [m/s] of the material corner along the table.

    Args:
        rows: of the contact.
        r_t, r_n: (...) from the CoM to the corner along the table and along its normal [m].
        omega: (...) rate of turn [rad/s].
        force: (..., 2) predicted contact force (f_t, f_n) [N].
    """
    c_t, c_n = -(omega**2) * r_t, -(omega**2) * r_n
    f_t, f_n = force[..., 0] / rows.points, force[..., 1] / rows.points
    depth = np.maximum(rows.R_n * f_n - c_n * (1.0 - 0.5 * rows.b * rows.h), 0.0) / rows.k
    return -rows.R_t * f_t / rows.b + c_t * (1.0 / rows.b - 0.5 * rows.h) + 0.5 * omega * depth
