"""What went wrong in a run, measured again by MuJoCo alone: the start and wrenches of the run, stepped by `mj_step`.

Of the project only arrays are used. Everything is read from `data.contact` and `data.qpos`: how far the contacts moved
along the table, how long nothing carried, how long the friction was used up, which other geoms touched, how deep.
"""

import re
from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
NEAR = 2e-3  # of the lever: a contact that close to what is held is one of it
CARRIES = 1e-6  # of the weight: less is no load
LIFTED = 1e-4  # of the lever: what is higher has left the table
USED_UP = 0.999  # of the friction
FAR = 1e6  # [m, m/s, rad/s]: what is farther or faster has diverged


class Tape(NamedTuple):
    """A run of one world.

    Attributes:
        model, body: the body's index in it.
        qpos (nq,), qvel (nv,): at the start.  wrench: (N, 6) force and torque at the CoM, world axes.
        held: (K, 3) what is to stick, or the centres of what is to roll, body frame [m].  radius: (K,) of that, else 0.
        table: (3, 3) columns (t, o, n), world axes.  height: of its surface along n [m].
        desired: (N+1, 4) orientations of the body, to world.
        force: (N, K, 3) contact forces that were predicted, world axes.
        settle: steps that do not count.
    """

    model: mujoco.MjModel
    body: int
    qpos: Array
    qvel: Array
    wrench: Array
    held: Array
    radius: Array
    table: Array
    height: float
    desired: Array
    force: Array
    settle: int


class Facts(NamedTuple):
    """What MuJoCo alone shows; all but the slip after the steps that do not count.

    Attributes:
        slip_m: greatest distance along the table of what is to stick from where it was.
        lost_s: time in which nothing carries, or something that is to stick is lifted off.
        slides_s: time in which |f_t| of a contact that carries is at mu f_n.
        others: seconds in which something else carries, by the two geoms that meet.
        deepest_m: greatest penetration.
        angle_rms_deg, angle_max_deg: off the desired orientation.
        mismatch: RMS of contact forces less the predicted over RMS of the predicted; of two that are held, what acts
            between them is shared by its distance from both.
        unanswered: steps without a wrench.
        diverged_s: when the state was beyond all bounds, else inf.
        touching: of each step, the first included, the number of contacts.
    """

    slip_m: float
    lost_s: float
    slides_s: float
    others: dict[str, float]
    deepest_m: float
    angle_rms_deg: float
    angle_max_deg: float
    mismatch: float
    unanswered: int
    diverged_s: float
    touching: tuple[int, ...]

    def lies(self, contacts: float) -> bool:
        """Whether it came to lie on so many contacts, and was never again on fewer."""
        enough = [count >= contacts for count in self.touching]
        return any(enough) and all(enough[enough.index(True) :])


def replay(tape: Tape) -> Facts:
    """Step it, and look."""
    model, dt = tape.model, float(tape.model.opt.timestep)
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    data.qpos[:], data.qvel[:] = tape.qpos, tape.qvel
    weight = float(model.body_mass[tape.body] * np.linalg.norm(model.opt.gravity))
    lever = float(np.linalg.norm(tape.held - model.body_ipos[tape.body], axis=1).max())
    first: Array | None = None
    slips, lost, slides, deepest, others, angles, off, wanted, touching = [0.0], 0, 0, 0.0, {}, [], [], [], []
    diverged, rolled = np.inf, np.zeros((len(tape.held), 3))
    for k, wrench in enumerate(tape.wrench):
        data.xfrc_applied[tape.body] = np.nan_to_num(wrench)
        mujoco.mj_step(model, data)  # kinematics and contacts are of the start of the step
        if not (np.abs(np.concatenate([data.qpos, data.qvel])) < FAR).all():
            diverged = k * dt
            break
        R = data.xmat[tape.body].reshape(3, 3)
        held = (data.xpos[tape.body] + tape.held @ R.T) @ tape.table - np.outer(tape.radius, [0.0, 0.0, 1.0])
        omega = data.qvel[-3:] if model.nv == 3 else R @ data.qvel[_dofs(model, tape.body)][3:]
        first = held if first is None else first
        slips.append(float(np.linalg.norm((held - first - rolled)[:, :2], axis=1).max()))
        rolled = rolled + dt * np.cross(omega @ tape.table, np.outer(tape.radius, [0.0, 0.0, 1.0]))
        found = [*_contacts(model, data, tape.body)]
        touching.append(len(found))
        if k < tape.settle:
            continue
        points = [(row.at - data.xpos[tape.body]) @ R for row in found]
        away = [_away(point, tape) > NEAR * lever for point in points]
        carrying = [row.normal > CARRIES * weight for row in found]
        mine = [row for row, other, loaded in zip(found, away, carrying, strict=True) if loaded and not other]
        lost += not mine or bool(held[:, 2].max() - tape.height > LIFTED * lever)
        slides += any(row.tangential >= USED_UP * row.mu * row.normal for row in mine)
        for pair in {row.pair for row, other, loaded in zip(found, away, carrying, strict=True) if loaded and other}:
            others[pair] = others.get(pair, 0.0) + dt
        deepest = max([deepest, *(row.depth for row in found)])
        angles.append(_angle(data.xquat[tape.body], tape.desired[k]))
        off.append(-tape.force[k])
        for row, point, other in zip(found, points, away, strict=True):
            off[-1] = off[-1] + (not other) * _shares(point, tape)[:, None] * row.force
        wanted.append(tape.force[k])
    rms = [float(np.sqrt(np.nanmean(np.square(values)))) if len(values) else np.nan for values in (off, wanted, angles)]
    return Facts(
        slip_m=max(slips),
        lost_s=lost * dt,
        slides_s=slides * dt,
        others=others,
        deepest_m=deepest,
        angle_rms_deg=rms[2],
        angle_max_deg=max(angles, default=np.nan),
        mismatch=rms[0] / rms[1],
        unanswered=int(np.isnan(tape.wrench).any(axis=1).sum()),
        diverged_s=diverged,
        touching=tuple(touching),
    )


class _Row(NamedTuple):
    pair: str
    at: Array
    normal: float
    tangential: float
    mu: float
    depth: float
    force: Array


def _contacts(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> list[_Row]:
    """The contacts of a body, the forces on it in world axes."""
    out = []
    for i, contact in enumerate(data.contact):
        ends = [int(model.body_weldid[model.geom_bodyid[geom]]) for geom in contact.geom]
        if model.body_weldid[body] not in ends or contact.efc_address < 0:
            continue
        local = np.zeros(6)
        mujoco.mj_contactForce(model, data, i, local)
        sign = 1.0 if ends[1] == model.body_weldid[body] else -1.0
        force = sign * contact.frame.reshape(3, 3).T @ local[:3]
        names = sorted(model.geom(int(geom)).name or f"#{int(geom)}" for geom in contact.geom)
        tangential = float(np.linalg.norm(local[1:3]))
        out.append(
            _Row(
                " and ".join(names), contact.pos.copy(), local[0], tangential, contact.friction[0], -contact.dist, force
            )
        )
    return out


def _shares(point: Array, tape: Tape) -> Array:
    """(K,) shares of a force at a point, body frame, that a point that is held or the two ends of a line carry."""
    if len(tape.held) == 1:
        return np.ones(1)
    a, b = tape.held
    share = float(np.clip((point - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0))
    return np.array([1.0 - share, share])


def _away(point: Array, tape: Tape) -> float:
    """Distance of a point in the body frame from what is held: a point, the line between two, or a ball's surface."""
    return float(abs(np.linalg.norm(point - _shares(point, tape) @ tape.held) - tape.radius[0]))


def _angle(one: Array, other: Array) -> float:
    """Between two orientations [deg]."""
    return float(np.rad2deg(2.0 * np.arccos(min(1.0, abs(float(one @ other))))))


def _dofs(model: mujoco.MjModel, body: int) -> slice:
    first = int(model.body_dofadr[body])
    return slice(first, first + int(model.body_dofnum[body]))


def claims(facts: Facts, limits: dict[str, float], lever: float) -> dict[str, bool]:
    """For each reason, given as a pattern of how it begins: do the facts confirm it?

    Args:
        limits: of the run's verdict.
        lever: [m].
    """
    tilts = facts.angle_rms_deg <= limits["angle_rms_deg"] and facts.angle_max_deg <= limits["angle_max_deg"]
    return {
        r"the object diverged": facts.diverged_s < np.inf,
        r"geom .+ touches .+ at": bool(facts.others),
        r"the contact let go|one of the contacts left the table": facts.lost_s > 0.0,
        r"the contact slid": facts.slides_s > 0.0,
        r"the contact crept by": facts.slip_m > limits["slip_m"],
        r"its contact and solver parameters are the file's": facts.slip_m > limits["slip_m"],  # goes with the creep
        r"the angle was off by": not tilts,
        r"the contact force was not the (predicted one|one)": not facts.mismatch <= limits["force_mismatch_rel"],
        r"\d+ steps had no certified answer": facts.unanswered > 0,
        r"the object was pressed deeper": facts.deepest_m > limits["penetration_rel"] * lever,
        r"the object did not come to lie on its face": not facts.lies(limits["contacts_end"]),
    }


def confirms(reasons: Sequence[str], facts: Facts, limits: dict[str, float], lever: float) -> bool:
    """Whether the facts bear out each of the reasons that a run gave, of which there is at least one."""
    known = claims(facts, limits, lever)
    return bool(reasons) and all(any(true and re.match(how, one) for how, true in known.items()) for one in reasons)
