"""What the simulator itself does to a sticking contact: the slip to expect from MuJoCo, not from the controller.

MuJoCo's contact rows satisfy J a + R f = -b v - k r with J at the start of the step, and semi-implicit Euler of step h
moves the body with the velocities at its end. So a step takes the velocity v of the point that a friction row holds to

    v + h (-b v - R_t f_t)     and the body's turn then adds w x (change of its lever).

The material point lies below the one that the rows hold, by half of the depth delta. What both make of it from step to
step is its drift along the table; once settled this is, for a point at r of a body that turns at w,

    - R_t f_t / b              creep under tangential load
    + c_t (1 / b - h / 2)      rotation, c = w x (w x r); nothing at b h = 2, where the row rings for ever
    + w delta / 2              the lever of the penetration.

A ball of radius s that rolls has its centre at p and touches at r = p - s n, with the normal n at rest: only p turns.
The edges of a pyramidal cone are rows of their own, which carry f_t together. The contact forces, the depths and the
body's turn are those of the run; where the contact went along the table is not looked at. No row says how fast a
contact slides, and none holds one that has opened: the drift is then unknown. docs/fidelity.md derives and measures it.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray
from pivoting.models.reading import initial_data
from pivoting.sim.contact_readings import Listed

Array = NDArray[np.float64]
SLIDES = 1.0 - 1e-9  # of its friction: MuJoCo's cone is exact to rounding
SPREAD = 1e-4  # determinant of the contacts' shares, below which they are all at one place of an edge
END = 0.98  # least share of a contact that alone holds an end of an edge
UNHELD = 10  # steps on end that an end of an edge may be without contact while another contact holds


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
        low, high, width, middle, power = self.solimp
        if low == high:
            return np.full(np.shape(depth), low)
        x = np.clip(np.asarray(depth) / width, 0.0, 1.0)
        up, down = x**power / middle ** (power - 1.0), (1.0 - x) ** power / (1.0 - middle) ** (power - 1.0)
        return np.asarray(low + (high - low) * np.where(x <= middle, up, 1.0 - down))

    def softness(self, depth: Array) -> Array:
        """R / D = (1 - d) / d (...) at depths (...) below the margin [m]."""
        d = self.impedance(depth)
        return (1.0 - d) / d

    def depth(self, load: Array) -> Array:
        """(...) how far below the margin a contact rests [m] under normal loads (...) [N]: k d delta = R f."""
        least = np.clip(min(self.solimp[:2]), 1e-9, None)
        push = self.D[0] * np.maximum(load, 0.0) / self.k
        low, high = np.zeros(np.shape(push)), push * (1.0 - least) / least**2
        for _ in range(0 if self.solimp[0] == self.solimp[1] else 50):
            middle = 0.5 * (low + high)
            soft = self.impedance(middle) * middle < push * self.softness(middle)
            low, high = np.where(soft, middle, low), np.where(soft, high, middle)
        return high


class Held(NamedTuple):
    """What the contact rows do at K declared contacts; leading axes of steps and worlds.

    Attributes:
        give: (..., K, 2) R_t f_t along the table (t, o) [m/s^2]; nan where no row holds the contact.
        above: (..., K) height of what the rows hold above what touches [m].
        slides: (...) whether a contact is at the limit of its friction.
    """

    give: Array
    above: Array
    slides: NDArray[np.bool_]


def read_rows(model: mujoco.MjModel, body: int, support: int, placements: Iterable[Array]) -> ContactRows | None:
    """The contact rows between a body and a geom; None where there is no contact.

    Args:
        placements: of qpos (nq,), where the body is pressed on its support; the first as at the start.
    """
    data, found, points = initial_data(model), [], 0
    for qpos in placements:
        data.qpos[:] = qpos
        mujoco.mj_fwdPosition(model, data)
        ends = [model.geom_bodyid[contact.geom] for contact in data.contact]
        own = [
            contact
            for contact, bodies in zip(data.contact, ends, strict=True)
            if contact.efc_address >= 0 and support in contact.geom and body in bodies
        ]
        points = points or len(own)
        found += [_row(model, data, contact) for contact in own]
    if not found:
        return None
    first, unknown = found[0], _unknown(model, body)
    for other in found:
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


def stepped_point(model: mujoco.MjModel, body: int) -> Array:
    """(3,) the point of a body whose velocity MuJoCo steps, body frame [m]: its origin, or in the plane the hinge."""
    joint = int(model.body_jntadr[body] + model.body_jntnum[body]) - 1
    free = int(model.jnt_type[joint]) == int(mujoco.mjtJoint.mjJNT_FREE)
    return np.zeros(3) if free else np.array(model.jnt_pos[joint])


def held(rows: ContactRows, listed: Listed, at: Array, axes: Array) -> Held:
    """What the rows of listed contacts do at the declared ones.

    The object is rigid, so that along an edge it all is linear in the place.

    Args:
        listed: (..., S) contacts.  at: (..., K, 3) where the declared contacts touch, world axes [m].
        axes: (3, 3) the table's (t, o, n) as columns, world axes.
    """
    push, pull = listed.local[..., 0], listed.local[..., 1:]
    pressed = listed.share.any(axis=-1) & (push > 0.0)
    use = np.abs(pull) / rows.mu
    if rows.pyramidal:
        lean = np.maximum(
            1.0, (3.0 * use - push[..., None]) / np.where(use > 0.0, use, 1.0)
        )  # three edges push, not four
        slides = use.sum(axis=-1) >= SLIDES * push
    else:
        lean, slides = np.ones_like(use), (use**2).sum(axis=-1) >= SLIDES * push**2
    local = rows.softness(listed.depth + rows.margin)[..., None] * lean * rows.D[1:] * pull
    give = (local[..., :1] * listed.tangent + local[..., 1:] * np.cross(listed.normal, listed.tangent)) @ axes[:, :2]
    above = (listed.position - listed.share @ at) @ axes[:, 2]
    values = np.concatenate([give, above[..., None]], axis=-1)
    on = pressed & ~slides
    weight = np.where(on[..., None], listed.share, 0.0)
    total, shared = (
        np.einsum("...sk,...sv->...kv", weight, values),
        np.einsum("...sk,...sl->...kl", weight, listed.share),
    )
    firm = np.linalg.det(shared) > SPREAD
    out = np.linalg.solve(np.where(firm[..., None, None], shared, np.eye(shared.shape[-1])), total)
    if not firm.all():
        alone = on[..., None] & (listed.share >= END)
        count = alone.sum(axis=-2)[..., None]
        one = np.einsum("...sk,...sv->...kv", alone.astype(float), values) / np.where(count > 0, count, 1)
        out = np.where(firm[..., None, None], out, np.where(count > 0, one, np.nan))
    return Held(out[..., :2], np.nan_to_num(out[..., 2]), (pressed & slides).any(axis=-1))


@np.errstate(invalid="ignore", over="ignore")
def drift(
    rows: ContactRows,
    of: Held,
    turning: Array,
    touching: Array,
    velocity: Array,
    omega: Array,
    unseen: Array | None = None,
    settle: int = 0,
) -> Array:
    """Predicted slip (W, N+1, K, 2) of K contacts along the table (t, o) [m]; nan from where it is unknown.

    What no row holds in a step moves on as the body's acceleration makes it, which the forces give. That is told of an
    end of an edge, for a few steps while the other end is held (MuJoCo gives a short edge of a mesh one contact, at one
    end and the other in turn), and of the start, where a contact that does not carry its load yet may slide.

    Args:
        of: (W, N) first.
        turning: (W, N+1, K, 3) from `stepped_point` to each point, or to the centre of what rolls, table axes [m].
        touching: (W, N+1, K, 3) likewise to where they touch.
        velocity, omega: (W, N+1, 3) of that point and of the turn, table axes [m/s, rad/s].
        unseen: (W, N, K, 2) acceleration of what touches that the rows do not see [m/s^2].
        settle: steps that the start may take.
    """
    h, bh = rows.h, rows.b * rows.h
    after = omega[:, 1:, None]
    moved = turning[:, 1:] - turning[:, :-1]
    turns = np.cross(after, moved)[..., :2]
    beyond = (moved - h * np.cross(after, turning[:, :-1]))[..., :2]  # of second order in the step
    lever = of.above[..., None] * np.array([0.0, 0.0, 1.0])
    above, below = np.cross(omega[:, :-1, None], lever)[..., :2], np.cross(after, lever)[..., :2]
    gains = velocity[:, 1:, None] - velocity[:, :-1, None] + np.cross(after - omega[:, :-1, None], touching[:, :-1])
    free = np.isnan(of.give[..., :1])
    if bh <= 2.0:
        left, added = 1.0 - bh, (1.0 - bh) * above - h * of.give - below
    else:  # settled within a step, and beyond what a row's own recursion could follow
        left, added = 0.0, (turns / h - of.give) / rows.b - turns - below
    if unseen is not None:
        added = added + h * unseen * (1.0 if bh <= 2.0 else 1.0 / bh)
    kept, added = np.where(free, 1.0, left), np.where(free, gains[..., :2], added)
    speed = (velocity[:, 0, None] + np.cross(omega[:, 0, None], touching[:, 0]))[..., :2]
    path = np.zeros((added.shape[0], added.shape[1] + 1, *added.shape[2:]))
    for step in range(added.shape[1]):
        path[:, step + 1] = kept[:, step] * speed + added[:, step]
        speed = path[:, step + 1] + turns[:, step]
    path[:, 1:] = np.cumsum(h * path[:, 1:] + beyond, axis=1)
    path[:, 1:][np.logical_or.accumulate(_failure(of, settle) > 0, axis=1)] = np.nan
    return path if not rows.unknown else np.full_like(path, np.nan)


def why_unknown(rows: ContactRows | None, of: Held, time: Array, settle: int = 0) -> list[str]:
    """Of each world why its drift cannot be told, or "".

    Args:
        of: (W, N) first.  time: (N+1,) [s].  settle: as for `drift`.
    """
    if rows is None:
        return ["it does not touch its support at the start"] * len(of.slides)
    failure = _failure(of, settle)
    first = (failure > 0).argmax(axis=1)
    events = [(_FAILURES[int(row[step])], float(time[step])) for row, step in zip(failure, first, strict=True)]
    return [rows.unknown or (f"{what} at {when:.3g} s" if what else "") for what, when in events]


_FAILURES = ("", "a contact slides", "no contact holds it", "an end of the edge is without contact")


def _failure(of: Held, settle: int) -> NDArray[np.int8]:
    """(W, N) what of `_FAILURES` keeps the rows from telling the drift, after the first steps."""
    free = np.isnan(of.give[..., 0])
    count = np.cumsum(free, axis=1)
    streak = count - np.maximum.accumulate(np.where(free, 0, count), axis=1)
    failed = np.select([of.slides, free.all(axis=-1), (streak > UNHELD).any(axis=-1)], [1, 2, 3], 0)
    failed[:, :settle] = 0
    return np.asarray(failed, dtype=np.int8)
