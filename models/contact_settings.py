"""How soft the chosen contacts are: as in settings.xml, or softer where many contacts hold one body at once.

MuJoCo makes each contact as soft as is right for it alone: R = (1 - d) / d D, with D the body's own inverse mass. What
the contacts of a body have together is the inverse inertia A = J M^-1 J' between all of them. Where an eigenvalue of it
is c D, they give way there by the share c / (c + (1 - d) / d) of their reference, and a step of that is stable only
while share (2 b h + k h^2) < 4. So (1 - d) / d grows with the greatest c, the `coupling`, and timeconst and dampratio
with it, such that b, k and the share stay those of settings.xml: docs/fidelity.md derives and measures it.
"""

from collections.abc import Iterable
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray
from pivoting.models.body_contacts import forced
from pivoting.models.reading import initial_data

Array = NDArray[np.float64]
STIFF = 2.1  # time constant of the contacts, in time steps: see settings.xml
IMPEDANCE = 0.5  # see settings.xml
COUPLED = 9.0  # coupling up to which settings.xml serves: the normal rows' ringing dies as fast as the friction rows'


class ContactSettings(NamedTuple):
    """Contact parameters for a body on its support.

    Attributes:
        timeconst: [s] and dampratio: solref.
        impedance: the constant solimp.
        contacts: most contacts at once.
        coupling: greatest eigenvalue of their normal rows' A / D, the friction rows holding.
        reason: for these parameters, in words.
    """

    timeconst: float
    dampratio: float
    impedance: float
    contacts: int
    coupling: float
    reason: str


def contact_settings(
    model: mujoco.MjModel, body: int, support: int, placements: Iterable[Array], dt: float
) -> ContactSettings:
    """The contact parameters for a body, from the contacts that it makes along its way.

    Args:
        model: of the world; what its contacts' solref and solimp are does not count.
        body, support: ids of the body and of the geom that it stands on.
        placements: of qpos (nq,), where the body is pressed on its support.
        dt: time step [s].
    """
    data = initial_data(model)
    contacts, coupling = 0, 0.0
    for qpos in placements:
        data.qpos[:] = qpos
        mujoco.mj_fwdPosition(model, data)
        A = _inverse_inertia(model, data, body, support)
        contacts = max(contacts, len(A) // 3)
        coupling = max(coupling, _normal_coupling(A, float(model.opt.impratio)))
    ratio = max(1.0, coupling / COUPLED)
    impedance = IMPEDANCE / (IMPEDANCE + (1.0 - IMPEDANCE) * ratio)
    softer = impedance / IMPEDANCE
    told = f"{contacts} contact{'s' * (contacts != 1)} at once, {coupling:.3g} times as stiff as one on the body alone"
    return ContactSettings(
        timeconst=STIFF * dt / softer,
        dampratio=float(np.sqrt(softer)),
        impedance=impedance,
        contacts=contacts,
        coupling=coupling,
        reason=f"{told}: " + ("made softer, or they would bounce" if ratio > 1.0 else "as in the shipped scenes"),
    )


def _inverse_inertia(model: mujoco.MjModel, data: mujoco.MjData, body: int, support: int) -> Array:
    """(3 n, 3 n) J M^-1 J' / D of the n contacts of a body with its support, each normal first, positions as in `data`.

    D is the body's inverse mass as MuJoCo takes it for a contact's, its mean over the directions at qpos0.
    """
    M, rows, translation = np.zeros((model.nv, model.nv)), [], np.zeros((3, model.nv))
    mujoco.mj_fullM(model, data, M)
    for _, _, contact in forced(model, data, body, support):
        mujoco.mj_jac(model, data, translation, None, contact.pos, body)
        rows.append(contact.frame.reshape(3, 3) @ translation)
    J = np.concatenate(rows) if rows else np.zeros((0, model.nv))
    return np.asarray(J @ np.linalg.solve(M, J.T) / model.body_invweight0[body, 0])


def _normal_coupling(A: Array, impratio: float) -> float:
    """Greatest eigenvalue of A (3 n, 3 n) among the normal rows, while the friction rows hold: the Schur complement.

    Those are softened, too, by 1 / impratio.
    """
    if not len(A):
        return 0.0
    normal = np.arange(len(A)) % 3 == 0
    held = A[~normal][:, ~normal] + np.diag(np.full(2 * len(A) // 3, 1.0 / impratio))
    across = A[normal][:, ~normal]
    return float(np.linalg.eigvalsh(A[normal][:, normal] - across @ np.linalg.solve(held, across.T))[-1])
