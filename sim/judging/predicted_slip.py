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

from collections.abc import Sequence
from typing import NamedTuple, Self

import mujoco
import numpy as np
from numpy.typing import NDArray
from pivoting.controller.kernels.compilation import subroutine
from pivoting.models.contact_softness import ContactRows, impedance, softness

Array = NDArray[np.float64]
SLIDES = 1.0 - 1e-9  # of its friction: MuJoCo's cone is exact to rounding
SPREAD = 1e-4  # determinant of the contacts' shares, below which they are all at one place of an edge
END = 0.98  # least share of a contact that alone holds an end of an edge
TINY = 1e-300
UNHELD = 10  # steps on end that an end of an edge may be without contact while another contact holds

_impedance, _softness = subroutine(impedance), subroutine(softness)


class RowEffects(NamedTuple):
    """What the contact rows do at K declared contacts; leading axes of steps and worlds.

    Attributes:
        give: (..., K, 2) R_t f_t along the table (t, o) [m/s^2]; nan where no row holds the contact.
        above: (..., K) height of what the rows hold above what touches [m].
        slides: (..., K) whether any part of the contact is at the limit of its friction.
    """

    give: Array
    above: Array
    slides: NDArray[np.bool_]


def stepped_point(model: mujoco.MjModel, body: int) -> Array:
    """(3,) the point of a body whose velocity MuJoCo steps, body frame [m]: its origin, or in the plane the hinge."""
    joint = int(model.body_jntadr[body] + model.body_jntnum[body]) - 1
    free = int(model.jnt_type[joint]) == int(mujoco.mjtJoint.mjJNT_FREE)
    return np.zeros(3) if free else np.array(model.jnt_pos[joint])


class RowNumbers(NamedTuple):
    """What of `ContactRows` the compiled sum over contacts needs: numbers, for arrays take longer to compile.

    Attributes:
        pyramidal, margin: of `ContactRows`.
        axes: the table's t, o and n, world axes.
        own: (W or 1, 9) what each world has of its own: mu and D of both tangents, and solimp.
    """

    pyramidal: bool
    margin: float
    axes: tuple[tuple[float, ...], ...]
    own: Array

    @classmethod
    def of(cls, rows: Sequence[ContactRows | None], axes: Array) -> Self | None:
        """Of each world, or one for all, with the table's (t, o, n) as columns; None where nothing touches."""
        first, own = rows[0], [np.concatenate([each.mu, each.D[1:], each.solimp]) for each in rows if each is not None]
        if first is None or len(own) < len(rows):
            return None
        return cls(first.pyramidal, first.margin, tuple(tuple(axis) for axis in axes.T.tolist()), np.array(own))


class Sums(NamedTuple):
    """Over the contacts that hold in one step, of K declared ones: scratch.

    Attributes:
        shared: (3,) of products of the shares that both ends of an edge carry: 0 0, 0 1 and 1 1.
        total: (K, 3) of (give, above), by shares.
        alone: (K, 3) of the same, of those that alone hold a declared contact.  number: (K,) how many there are.
    """

    shared: Array
    total: Array
    alone: Array
    number: Array

    @classmethod
    def of(cls, contacts: int) -> Self:
        """Of so many declared ones."""
        return cls(np.empty(3), np.empty((contacts, 3)), np.empty((contacts, 3)), np.empty(contacts))


@subroutine
def dot(axis, x, y, z):  # type: ignore[no-untyped-def]
    """Of an axis and (x, y, z)."""
    return axis[0] * x + axis[1] * y + axis[2] * z


@subroutine
def begin_rows(sums):  # type: ignore[no-untyped-def]
    """Clear the sums."""
    shared, total, alone, number = sums
    for i in range(3):
        shared[i] = 0.0
    for k in range(total.shape[0]):
        number[k] = 0.0
        for i in range(3):
            total[k, i] = alone[k, i] = 0.0


@subroutine
def add_row(rows, world, push, pulls, depth, where, tangent, other, at, share, sums):  # type: ignore[no-untyped-def]
    """Add what the rows of one contact do; returns whether it slides, and adds nothing of one that does.

    Args:
        rows: the values of `RowNumbers`.  world: of which it is.
        push, pulls: its force along its normal and both tangents [N].
        depth: [m].  where: its place [m].  tangent, other: both its tangents.
        at: (K, 3) where the declared contacts touch [m].  share: (K,) of it that each carries.
        sums: the values of `Sums`.
    """
    pyramidal, margin, axes, numbers = rows
    own = numbers[world % numbers.shape[0]]
    mu, D, solimp = (own[0], own[1]), (own[2], own[3]), (own[4], own[5], own[6], own[7], own[8])
    shared, total, alone, number = sums
    K, use, lean = share.shape[0], (abs(pulls[0]) / mu[0], abs(pulls[1]) / mu[1]), (1.0, 1.0)
    if pyramidal:
        if use[0] + use[1] >= SLIDES * push:
            return True
        # where three edges push, not four, it leans on them
        lean = max(1.0, 3.0 - push / max(use[0], TINY)), max(1.0, 3.0 - push / max(use[1], TINY))
    elif use[0] * use[0] + use[1] * use[1] >= SLIDES * push * push:
        return True
    d = solimp[0]
    if solimp[1] != d:  # powers take long
        d = _impedance(depth + margin, *solimp)
    soft = _softness(d)
    a, b = soft * lean[0] * D[0] * pulls[0], soft * lean[1] * D[1] * pulls[1]
    x, y, z = a * tangent[0] + b * other[0], a * tangent[1] + b * other[1], a * tangent[2] + b * other[2]
    give = dot(axes[0], x, y, z), dot(axes[1], x, y, z)
    x, y, z = where
    for k in range(K):
        x, y, z = x - share[k] * at[k, 0], y - share[k] * at[k, 1], z - share[k] * at[k, 2]
    above = dot(axes[2], x, y, z)
    shared[0] += share[0] * share[0]
    shared[1] += share[0] * share[K - 1]
    shared[2] += share[K - 1] * share[K - 1]
    for k in range(K):
        total[k, 0] += share[k] * give[0]
        total[k, 1] += share[k] * give[1]
        total[k, 2] += share[k] * above
        if share[k] >= END:
            alone[k, 0] += give[0]
            alone[k, 1] += give[1]
            alone[k, 2] += above
            number[k] += 1.0
    return False


@subroutine
def end_rows(sums, give, above):  # type: ignore[no-untyped-def]
    """Write what the rows do at the declared contacts, give (K, 2) and above (K,); see `RowEffects`.

    The object is rigid, so that along an edge it all is linear in the place.
    """
    shared, total, alone, number = sums
    K = number.shape[0]
    determinant = shared[0] * shared[2] - shared[1] * shared[1]
    for k in range(K):
        for v in range(3):
            if K == 2 and determinant > SPREAD:
                own, cross = (shared[2], shared[1]) if k == 0 else (shared[0], shared[1])
                value = (own * total[k, v] - cross * total[1 - k, v]) / determinant
            elif number[k] > 0.0:
                value = alone[k, v] / number[k]
            else:
                value = np.nan if v < 2 else 0.0
            if v < 2:
                give[k, v] = value
            else:
                above[k] = value


@np.errstate(invalid="ignore", over="ignore")
def drift(
    rows: ContactRows,
    of: RowEffects,
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


def why_unknown(rows: ContactRows | None, of: RowEffects, time: Array, settle: int = 0) -> list[str]:
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


def _failure(of: RowEffects, settle: int) -> NDArray[np.int8]:
    """(W, N) what of `_FAILURES` keeps the rows from telling the drift, after the first steps."""
    free = np.isnan(of.give[..., 0])
    count = np.cumsum(free, axis=1)
    streak = count - np.maximum.accumulate(np.where(free, 0, count), axis=1)
    failed = np.select([of.slides.any(axis=-1), free.all(axis=-1), (streak > UNHELD).any(axis=-1)], [1, 2, 3], 0)
    failed[:, :settle] = 0
    return np.asarray(failed, dtype=np.int8)
