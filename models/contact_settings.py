"""How soft the chosen contacts are: as in settings.xml, or softer where many contacts hold a body, or where one is far
from the centre of mass of a body of little inertia.

MuJoCo makes each contact as soft as is right for a body's mass alone: R = (1 - d) / d D, with D its inverse. What the
contacts of a body have together is the inverse inertia A = J M^-1 J' between all of them. Where an eigenvalue of it is
c D, they give way there by the share c / (c + (1 - d) / d) of their reference, and a step of that is stable only while
share (2 b h + k d h^2) < 4. Up to a c of 9 the settings are those of settings.xml. Where many contacts make it greater,
the `coupling`, (1 - d) / d grows with it, and timeconst and dampratio such that b and k d stay. Where one alone
does, far from the CoM of a body of little inertia, timeconst grows until share (2 b h + k d h^2) is that of 9. (If that
one gave way more, the force that the law counts on would be off by more, which turns a light body at once: contact and
law together would ring until they diverge.) docs/fidelity.md derives and measures it.
"""

from collections.abc import Iterable
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray
from pivoting.models.body_contacts import contact_parts, forced
from pivoting.models.rigid_body import initial_data

Array = NDArray[np.float64]
STIFF = 2.1  # time constant of the contacts, in time steps: see settings.xml
IMPEDANCE = 0.5  # see settings.xml
COUPLED = 9.0  # coupling up to which settings.xml serves: the normal rows' ringing dies as fast as the friction rows'
RINGING = COUPLED / (COUPLED + 1.0) * (8.0 / STIFF + 2.0 / STIFF**2)  # share (2 b h + k d h^2) there


SETTINGS_FIELDS = ("geom_solref", "geom_solimp", "pair_solref", "pair_solimp", "opt.o_solref", "opt.o_solimp")


class ContactSettings(NamedTuple):
    """Contact parameters for a body on its support.

    Attributes:
        timeconst: [s] and dampratio: solref.
        impedance: the constant solimp.
        contacts: most contacts at once.
        coupling: greatest eigenvalue of their normal rows' A / D, the friction rows holding.
        alone: the same of the one contact of which it is greatest.
        reason: for these parameters, in words.
    """

    timeconst: float
    dampratio: float
    impedance: float
    contacts: int
    coupling: float
    alone: float
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
    contacts, coupling, alone, impratio = 0, 0.0, 0.0, float(model.opt.impratio)
    for qpos in placements:
        data.qpos[:] = qpos
        mujoco.mj_fwdPosition(model, data)
        A = _inverse_inertia(model, data, body, support)
        contacts = max(contacts, len(A) // 3)
        coupling = max(coupling, _normal_coupling(A, impratio))
        each = (slice(i, i + 3) for i in range(0, len(A), 3))
        alone = max([alone, *(_normal_coupling(A[one, one], impratio) for one in each)])
    reference = max(COUPLED, alone)
    ratio = max(1.0, coupling / reference)
    impedance = IMPEDANCE / (IMPEDANCE + (1.0 - IMPEDANCE) * ratio)
    softer = impedance / IMPEDANCE
    # 8 / steps + 2 / steps^2 = ringing / share
    steps = 2.0 / (np.sqrt(16.0 + 2.0 * RINGING * (reference + 1.0) / reference) - 4.0)
    told = f"{contacts} contact{'s' * (contacts != 1)} at once, {coupling:.3g} times as stiff as one on the body alone"
    softened = ratio > 1.0 or reference > COUPLED
    return ContactSettings(
        timeconst=float(steps) * dt / softer,
        dampratio=float(np.sqrt(softer)),
        impedance=impedance,
        contacts=contacts,
        coupling=coupling,
        alone=alone,
        reason=f"{told}: " + ("made softer, or they would bounce" if softened else "as in the shipped scenes"),
    )


def set_contact_settings(model: mujoco.MjModel, body: int, support: int, settings: ContactSettings) -> None:
    """Give a body and its support these contact parameters."""
    geoms, pairs, overrides = contact_parts(model, body, support)
    solref, solimp = (settings.timeconst, settings.dampratio), settings.impedance
    model.geom_solref[geoms, :2], model.geom_solimp[geoms, :2] = solref, solimp
    model.pair_solref[pairs, :2], model.pair_solimp[pairs, :2] = solref, solimp
    if overrides:
        model.opt.o_solref[:2], model.opt.o_solimp[:2] = solref, solimp


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
