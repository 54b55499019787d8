"""What MuJoCo makes of the contacts between a body and its support: the rows that say how soft they are.

A contact row is J a + R f = -b v - k d r, with the regularisation R = (1 - d) / d D and the impedance d of its depth.
The rows of an elliptic cone are its normal and both tangents, those of a pyramidal one its edges, J_n + mu J_t and
J_n - mu J_t of both tangents, which are alike. docs/fidelity.md says what follows from them.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray
from pivoting.models.body_contacts import forced
from pivoting.models.rigid_body import initial_data

Array = NDArray[np.float64]


class ContactRows(NamedTuple):
    """What MuJoCo makes of the contacts between a body and its support, which are all alike.

    Attributes:
        points: contacts that share the load at the start.
        pyramidal: whether the friction cone is, else elliptic.
        mu: (2,) friction along both tangents.
        D: (3,) R d / (1 - d) of the normal row and of both tangents' [1/kg]; of a pyramid, while all its edges push.
        b: damping [1/s].  k: stiffness over the impedance [1/s^2].
        solimp: (5,) how the impedance d follows from the depth.
        margin: distance from which the contact is active [m].
        h: time step [s].
        unknown: why the drift cannot be told from these, or "".
    """

    points: int
    pyramidal: bool
    mu: Array
    D: Array
    b: float
    k: float
    solimp: Array
    margin: float
    h: float
    unknown: str

    @property
    def law(self) -> tuple[ArrayLike, ...]:
        """What has to be the same of all contacts."""
        return self.pyramidal, self.D, self.b, self.k, self.solimp, self.margin

    @property
    def regularisation(self) -> float:
        """R of the normal row of a contact that just touches [1/kg]."""
        return float(self.D[0] * self.softness(np.array(0.0)))

    def impedance(self, depth: Array) -> Array:
        """d (...) at depths (...) below the margin [m]."""
        return impedance(np.asarray(depth), *self.solimp)

    def softness(self, depth: Array) -> Array:
        """R / D = (1 - d) / d (...) at depths (...) below the margin [m]."""
        return softness(self.impedance(depth))

    def depth(self, load: ArrayLike) -> Array:
        """(...) how far below the margin a contact rests [m] under normal loads (...) [N]: k d delta = R f.

        0 where the rows do not say: the discrete integrator's have no k.
        """
        least = np.clip(min(self.solimp[:2]), 1e-9, None)
        push = self.D[0] * np.maximum(load, 0.0) / (self.k or np.inf)
        low, high = np.zeros(np.shape(push)), push * (1.0 - least) / least**2
        for _ in range(0 if self.solimp[0] == self.solimp[1] else 50):
            middle = 0.5 * (low + high)
            soft = self.impedance(middle) * middle < push * self.softness(middle)
            low, high = np.where(soft, middle, low), np.where(soft, high, middle)
        return high


def impedance(depth: Any, low: Any, high: Any, width: Any, middle: Any, power: Any) -> Any:
    """d of a contact at a depth below its margin [m] by the five of MuJoCo's `solimp`; of arrays or compiled floats."""
    x = np.minimum(np.maximum(depth / width, 0.0), 1.0)
    rising, left = np.minimum(x, middle), 1.0 - np.maximum(x, middle)
    risen = rising**power / middle ** (power - 1.0) + (1.0 - middle) - left**power / (1.0 - middle) ** (power - 1.0)
    return low + (high - low) * risen


def softness(d: Any) -> Any:
    """R / D at an impedance d; of arrays or compiled floats."""
    return (1.0 - d) / d


def read_rows(model: mujoco.MjModel, body: int, support: int, placements: Iterable[Array]) -> ContactRows | None:
    """The contact rows between a body and a geom; None where there is no contact.

    Args:
        placements: of qpos (nq,), where the body is pressed on its support; the first as at the start.
    """
    data, found, points = initial_data(model), [], 0
    for qpos in placements:
        data.qpos[:] = qpos
        mujoco.mj_fwdPosition(model, data)
        own = forced(model, data, body, support)
        points = points or len(own)
        found += [_row(model, data, one.contact) for one in own]
    if not found:
        return None
    first, unknown = found[0], _unknown(model, body)
    for other in found[1:]:
        if not all(np.allclose(a, b, rtol=1e-6, atol=1e-12) for a, b in zip(first.law, other.law, strict=True)):
            unknown = unknown or "the contacts of its geoms differ in their parameters"
    mu = np.min([row.mu for row in found], axis=0)
    return first._replace(points=points, mu=mu, unknown=unknown or first.unknown)


def _row(model: mujoco.MjModel, data: mujoco.MjData, contact: Any) -> ContactRows:
    """What MuJoCo made of one contact of `data`."""
    row, dim = int(contact.efc_address), int(contact.dim)
    pyramidal = int(model.opt.cone) == int(mujoco.mjtCone.mjCONE_PYRAMIDAL)
    k, b, d = (float(x) for x in data.efc_KBIP[row, :3])
    mu, D = np.array(contact.friction[:2]), np.array(data.efc_R[row : row + 3]) * d / (1.0 - d)
    if pyramidal:  # the rows are edges, J_n + mu J_t and J_n - mu J_t, alike
        D = D[0] * np.array([0.25, 0.5 / mu[0] ** 2, 0.5 / mu[1] ** 2])
    elif dim > 1:
        b = float(data.efc_KBIP[row + 1, 1])  # solreffriction
    low, high, width, middle, power = contact.solimp
    low, high, middle = np.clip([low, high, middle], 1e-4, 0.9999)  # as MuJoCo does
    if width <= 1e-15:
        low = high = 0.5 * (low + high)
    return ContactRows(
        points=1,
        pyramidal=pyramidal,
        mu=mu,
        D=D,
        b=b,
        k=k,
        solimp=np.array([low, high, max(width, 1e-15), middle, max(power, 1.0)]),
        margin=float(contact.includemargin),
        h=float(model.opt.timestep),
        unknown="" if dim == 3 else f"its contacts have condim {dim}, not 3",
    )


def _unknown(model: mujoco.MjModel, body: int) -> str:
    """What of the model leaves the rows, or the step, different from what is assumed here; "" if nothing does."""
    opt, flags = model.opt, mujoco.mjtEnableBit
    integrator = mujoco.mjtIntegrator(int(opt.integrator)).name.removeprefix("mjINT_")
    if integrator not in ("EULER", "IMPLICIT", "IMPLICITFAST"):
        return f"integrator {integrator.lower()}"
    if opt.noslip_iterations > 0:
        return "noslip_iterations change the contact forces that the rows give"
    if int(opt.solver) == int(mujoco.mjtSolver.mjSOL_PGS):
        return "solver PGS leaves the rows unbalanced"
    for flag in ("DIAGEXACT", "SPECULATIVE", "IPC", "SLEEP"):
        if int(opt.enableflags) & int(getattr(flags, f"mjENBL_{flag}")):
            return f"the flag {flag.lower()}"
    first = int(model.body_dofadr[body])
    if np.any(model.dof_dampingpoly[first : first + int(model.body_dofnum[body])]):
        return "its joints' damping is not linear"
    return ""
