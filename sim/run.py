"""A finished run: its arrays, and what is derived from them."""

from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from pivoting.controller.plane_and_space import Space, space
from pivoting.controller.planning.sequential_convex import Plan
from pivoting.controller.rotations import CONJUGATE, quaternion_product, rotated
from pivoting.controller.units import lever
from pivoting.models.contact_settings import ContactSettings
from pivoting.models.contact_softness import ContactRows
from pivoting.models.frames import matrix
from pivoting.models.names import geom_name
from pivoting.models.rigid_body import RigidBody, file_frame, laid_over
from pivoting.sim.attach import Attached
from pivoting.sim.contact_sensing import ContactReadings, Declared
from pivoting.sim.judging.advice import reasons, remedies
from pivoting.sim.judging.measures import Measures, measure, slip_floor_unknown
from pivoting.sim.judging.predicted_slip import Held, stepped_point
from pivoting.sim.judging.undeclared_contacts import stray_words
from pivoting.sim.judging.verdict import Check, Limits, judge, worst_world
from pivoting.sim.pipeline.control import BOUNDED, Event, PlanLog, plan_figures
from pivoting.sim.scenarios.relative_values import Load
from pivoting.sim.scenarios.scenario import Scenario

Array = NDArray[np.float64]
_CHOSEN = ("contacts", "coupling", "reason")  # of the contact settings, what the model itself does not say


def frozen(values: Array) -> Array:
    """What is measured cannot be changed before it is judged."""
    values.flags.writeable = False
    return values


def _freeze(values: Any) -> None:
    if isinstance(values, np.ndarray):
        values.flags.writeable = False
    elif isinstance(values, tuple):
        for value in values:
            _freeze(value)


@dataclass(frozen=True, eq=False)
class Run:
    """A closed-loop run, W worlds and N steps. States have N + 1 entries, answers N; all read-only.

    Attributes:
        scenario: what was run, overrides included.
        seed: of the worlds' initial errors.
        attached: the controller and what it believes.
        load: what the scenario's relative values are relative to.
        unit: of the model's lengths [m], and with it of all lengths, forces and moments below.
        model: the world's, with the sensors of the loop.  truth: the body as that has it.
        replaced: what of the file gave way to the settings of the shipped scenes: name, and what it was.
        settings: contact parameters that were chosen for the object, if they were.
        declared: the contacts that are to stick, as the world has them.
        radius: (K,) of what rolls, else 0 [m].
        face: (P, 3) likewise, the corners of the face that the object lies on at angle 0.
        turn: the axis (3,) [world axes] and the orientation (4,) at angle 0 that `theta` is counted from.
        mu_world: the world's friction.
        contact_rows: MuJoCo's contacts with the support, for the predicted slip.
        start: qpos (W, nq) and qvel (W, nv) of the worlds at time 0, from which the applied wrenches replay the run.
        time: (N+1,) [s].
        reference: desired angle, rate and acceleration, each (N+1,) [rad, s].
        desired: the same as orientations (N+1, 4), angular velocities and accelerations (N+1, 3), world axes.
        position: (W, N+1, 3) CoM, world axes [m].  quaternion: (W, N+1, 4) object to world.
        velocity, angular_velocity: (W, N+1, 3) of the CoM, world axes [m/s, rad/s].
        required: (W, N, nw) what the solved problem required, J f + w, object axes [N, N m].
        wrench: (W, N, 3 or 6) object axes, (F_u, F_v, M) in the plane [N, N m]; nan where there was no
            answer, and then none is applied.
        wrench_world: (W, N, 6) applied force and torque at the CoM, world axes.
        force: (W, N, K, d) contact forces (f_t, f_n) or (f_t, f_o, f_n) predicted by the solution, table axes [N].
        force_measured: (W, N, K, d) by MuJoCo's contacts, likewise.
        contacts: what else they say, see `ContactReadings`; held: what their rows do, see `Held`.
        residual: (W, N) relative KKT residuals.
        status: (W, N) codes of `solution.STATUS`; 0 is solved, 3 as far as the bounds allowed.
        control_us: (N,) time to state, solve and certify the problem of one world [microseconds].
        wall_s: of the loop.
        plan: that was played in open loop, else None.
        plans: of a receding horizon, what came of each; else None.  events: what a user has to know of.
        engine_warnings: what MuJoCo warned of, as of a world that diverges: each once, with its first time.
        controller: "scenario" for the scenario's own, "given" for another that was handed to `simulate`.
    """

    scenario: Scenario
    seed: int
    attached: Attached
    load: Load
    unit: float
    model: mujoco.MjModel
    truth: RigidBody
    replaced: tuple[tuple[str, str], ...]
    settings: ContactSettings | None
    declared: Declared
    radius: Array
    face: Array
    turn: tuple[Array, Array]
    mu_world: float
    contact_rows: ContactRows | None
    start: tuple[Array, Array]
    time: Array
    reference: tuple[Array, Array, Array]
    desired: tuple[Array, Array, Array]
    position: Array
    quaternion: Array
    velocity: Array
    angular_velocity: Array
    required: Array
    wrench: Array
    wrench_world: Array
    force: Array
    force_measured: Array
    contacts: ContactReadings
    held: Held
    residual: Array
    status: NDArray[np.int8]
    control_us: Array
    wall_s: float
    plan: Plan | None
    plans: PlanLog | None
    events: tuple[Event, ...]
    engine_warnings: tuple[str, ...]
    controller: str

    def __setstate__(self, state: dict[str, Any]) -> None:
        """From pickle, which forgets that arrays are read-only."""
        vars(self).update(state)
        _freeze(tuple(state.values()))

    @property
    def points(self) -> Array:
        """(K, 3) the contact points, or centres of what rolls, from the CoM, object axes [m]."""
        return self.declared.points

    @property
    def contacts_found(self) -> Array:
        """(W, N) contacts between the body and its support, as MuJoCo counts them."""
        return self.contacts.found

    @property
    def size(self) -> float:
        """Lever from the CoM to the contacts [m], against which lengths are judged."""
        return lever(self.points) + float(np.mean(self.radius))

    @property
    def worlds(self) -> int:
        """W."""
        return self.position.shape[0]

    @property
    def dt(self) -> float:
        """Time step [s]."""
        return float(self.time[1] - self.time[0])

    @cached_property
    def space(self) -> Space:
        """The plane of motion, with angles from the table that the world has, whatever the controller believes."""
        return space(self.truth.dim, self.truth.table)

    @cached_property
    def theta(self) -> Array:
        """(W, N+1) angle turned about the reference's axis [rad]; in the plane from the world's table."""
        axis, start = self.turn
        turned = quaternion_product(self.quaternion, start * CONJUGATE)
        half = np.arctan2(turned[..., 1:] @ axis, turned[..., 0])
        return frozen(np.arctan2(np.sin(2.0 * half), np.cos(2.0 * half)))

    @cached_property
    def omega(self) -> Array:
        """(W, N+1) rate of turn about the reference's axis [rad/s]."""
        return frozen(self.angular_velocity @ self.turn[0])

    @cached_property
    def angle_error(self) -> Array:
        """(W, N+1) angle from the desired orientation [rad], with its sign about the axis."""
        turned = quaternion_product(self.quaternion, self.desired[0] * CONJUGATE)
        turned *= np.where(turned[..., :1] < 0.0, -1.0, 1.0)  # the shorter way round
        size = 2.0 * np.arctan2(np.linalg.norm(turned[..., 1:], axis=-1), turned[..., 0])
        return frozen(np.copysign(size, turned[..., 1:] @ self.turn[0]))

    @cached_property
    def table_axes(self) -> Array:
        """(3, 3) the table's axes (t, o, n) as columns, world axes."""
        return matrix(self.truth.table)

    @cached_property
    def turning(self) -> Array:
        """(W, N+1, K, 3) from the CoM to the material contact points, or the centres of what rolls, table axes [m]."""
        return frozen(self._from_com(self.points))

    @cached_property
    def lever(self) -> Array:
        """(W, N+1, K, 3) from the CoM to where the contacts touch, table axes [m]."""
        return frozen(self.turning - self._up)

    @cached_property
    def stepped(self) -> Array:
        """(W, N+1, 3) from the CoM to the point of the body whose velocity MuJoCo steps, table axes [m]."""
        point = stepped_point(self.model, self.truth.index) - self.truth.com
        return frozen(self._from_com(point[None] @ matrix(self.truth.axes))[..., 0, :])

    @cached_property
    def stepped_velocity(self) -> Array:
        """(W, N+1, 3) of that point, table axes [m/s]."""
        omega = self.angular_velocity @ self.table_axes
        return frozen(self.velocity @ self.table_axes + np.cross(omega, self.stepped))

    @cached_property
    def corner(self) -> Array:
        """(W, N+1, K, 3) where the contacts touch, from the table's origin, table axes [m]."""
        return frozen(self._com[..., None, :] + self.lever)

    @cached_property
    def rolled(self) -> Array:
        """(W, N+1, K, 2) how far along the table (t, o) the contacts have rolled since the start [m].

        The sum of omega x (radius n) dt, omega at the end of each step: with that velocity MuJoCo moves the body.
        """
        speed = np.cross((self.angular_velocity @ self.table_axes)[..., None, :], self._up)[..., :2]
        speed[:, 0] = 0.0
        return frozen(np.cumsum(speed * self.dt, axis=1))

    @property
    def _up(self) -> Array:
        """(K, 3) from where the contacts touch to their points, table axes [m]."""
        return self.radius[:, None] * np.array([0.0, 0.0, 1.0])

    @cached_property
    def clearance(self) -> Array:
        """(W, N+1) height above the table of the highest corner of the face that the object lies on at angle 0 [m]."""
        return frozen((self._com[..., None, :] + self._from_com(self.face))[..., 2].max(axis=-1))

    @property
    def _com(self) -> Array:
        """(W, N+1, 3) the CoM from the table's origin, table axes."""
        return (self.position - self.truth.origin) @ self.table_axes

    def _from_com(self, points: Array) -> Array:
        """(W, N+1, P, 3) points (P, 3) of the object, turned from object to table axes."""
        return rotated(self.quaternion[..., None, :], points) @ self.table_axes

    @cached_property
    def slip(self) -> Array:
        """(W, N+1, K, 2) displacement of the contacts along the table (t, o) since the start, less `rolled` [m]."""
        return frozen(self.corner[..., :2] - self.corner[:, :1, :, :2] - self.rolled)

    @cached_property
    def friction_use(self) -> Array:
        """(W, N, K) measured |f_t| / (mu f_n) with the world's mu, at 1 a contact slides; nan without a push."""
        tangential = np.linalg.norm(self.force_measured[..., :-1], axis=-1)
        normal = self.force_measured[..., -1]
        pushed = normal > 0.0
        return frozen(np.where(pushed, tangential, np.nan) / np.where(pushed, self.mu_world * normal, 1.0))

    @cached_property
    def landed(self) -> NDArray[np.bool_]:
        """(W, N) whether there are all the contacts that the scenario is to end with."""
        return self.contacts_found >= max(1, self.scenario.limits.contacts_end)

    @cached_property
    def measures(self) -> Measures:
        """What the monitor makes of it, for each world."""
        return measure(self)

    @property
    def limits(self) -> Limits:
        """Of the verdict, with that on the slip in metres."""
        return self.scenario.limits.for_object(
            self.unit * self.size, self.unit * float(np.linalg.norm(self.truth.gravity))
        )

    @cached_property
    def strays(self) -> list[str]:
        """Which geoms met in contacts that are not declared, in words."""
        return stray_words(self)

    @cached_property
    def checks(self) -> tuple[Check, ...]:
        """The verdict, line by line."""
        return judge(self.measures, self.limits)

    @property
    def failed_worlds(self) -> NDArray[np.intp]:
        """Indices of the worlds that fail any check."""
        return np.flatnonzero(np.any([check.failed for check in self.checks], axis=0))

    @cached_property
    def worst_world(self) -> int:
        """The one in which a measured value is the greatest multiple of its limit."""
        return worst_world(self)

    @property
    def verdict(self) -> str:
        """ "pass" if every world is within every limit of the scenario, else "fail"."""
        return "fail" if self.failed_worlds.size else "pass"

    def summary(self) -> dict[str, Any]:
        """The run in numbers, of the worst world, SI units in the keys; what `--json` prints."""
        worst = {key: float(np.max(value)) for key, value in vars(self.measures).items()}
        return {
            "scenario": self.scenario.name,
            "model": str(self.scenario.path),
            "body": self.scenario.body,
            "length_unit_m": self.unit,
            "contacts": (self.unit * self.points).tolist(),
            "radius": (self.unit * self.radius).tolist(),
            "changes": self.scenario.changes,
            "resolved": self.scenario.resolved(self.load),
            "limits": asdict(self.limits),
            "controller": self.controller,
            "seed": self.seed,
            "worlds": self.worlds,
            "verdict": self.verdict,
            "failed_worlds": self.failed_worlds.tolist(),
            "worst_world": self.worst_world,
            **worst,
            "slip_floor_unknown": slip_floor_unknown(self) or None,
            "solve_us_median": float(np.median(self.control_us)),
            "solve_us_p99": float(np.quantile(self.control_us, 0.99)),
            "sim_s": float(self.time[-1]),
            "wall_s": self.wall_s,
            "real_time_factor": self.worlds * float(self.time[-1]) / self.wall_s,
            "bounded_steps": int(np.count_nonzero(self.status == BOUNDED)),
            "reasons": reasons(self),
            "remedies": [remedy.setting for remedy in remedies(self)],
            "undeclared_contacts": self.strays,
            "support": geom_name(self.model, self.truth.support),
            "contact": "; ".join(",".join(f"{x:.9g}" for x in point) for point in self._in_file),
            "object": self.object,
            "contact_settings": self.contact_settings,
            "events": [event._asdict() for event in self.events],
            "engine_warnings": list(self.engine_warnings),
            **({} if self.plans is None else plan_figures(self.plans)),
            **({} if self.plan is None else {"plan_angle_error_max_deg": float(np.rad2deg(self.plan_error.max()))}),
        }

    @property
    def _in_file(self) -> Array:
        """(K, 3) the contacts as --contact takes them, in the frame and unit of length that the file gives the body."""
        origin, axes = file_frame(self.model, self.truth.index)
        return (self.truth.com + self.points @ matrix(self.truth.axes).T - origin) @ axes

    @property
    def object(self) -> dict[str, Any]:
        """What was read of the object, as the world has it, in the frame that its file gives the body."""
        origin, axes = file_frame(self.model, self.truth.index)
        return {
            "support": geom_name(self.model, self.truth.support),
            "mass_kg": self.truth.mass,
            "inertia_kg_m2": (self.unit**2 * np.asarray(self.truth.inertia)).tolist(),
            "com_m": (self.unit * (self.truth.com - origin) @ axes).tolist(),
            "mu": self.mu_world,
            "contacts_m": (self.unit * self._in_file).tolist(),
            "radius_m": (self.unit * self.radius).tolist(),
            "damping": 0.0 if self.truth.drag is None else float(self.truth.drag.damping.max()),
            "frictionloss": 0.0 if self.truth.drag is None else float(self.truth.drag.friction.max()),
            "laid_over_deg": laid_over(self.model, self.truth, self.turn[1]),
        }

    @property
    def contact_settings(self) -> dict[str, Any]:
        """The support's contact parameters in the world, and what they replaced of the file."""
        opt, geom = self.model.opt, self.truth.support
        return {
            "dt_s": float(opt.timestep),
            "solref": self.model.geom_solref[geom].tolist(),
            "solimp": self.model.geom_solimp[geom].tolist(),
            "impratio": float(opt.impratio),
            "cone": mujoco.mjtCone(int(opt.cone)).name.removeprefix("mjCONE_").lower(),
            "replaced": dict(self.replaced),
            "f_min_N": self.unit * float(self.attached.controller.belief.f_min.max()),
            **({} if self.settings is None else {key: getattr(self.settings, key) for key in _CHOSEN}),
        }

    @cached_property
    def plan_error(self) -> Array:
        """(W, P) angle [rad] between the object and the plan played in open loop, at the P poses that it has.

        Raises:
            ValueError: the run was not in open loop.
        """
        if self.plan is None:
            raise ValueError("run: was in closed loop; must be of simulate(..., open_loop=True)")
        first = self.plan.horizon.times[0] - self.plan.horizon.h  # of pose 0
        times = np.concatenate([[first], self.plan.horizon.times])
        kept = times <= self.time[-1] + 1e-9
        steps = np.round(times[kept] / self.dt).astype(int)
        turned = quaternion_product(self.quaternion[:, steps], self.plan.orientation[kept] * CONJUGATE)
        return frozen(2.0 * np.arctan2(np.linalg.norm(turned[..., 1:], axis=-1), np.abs(turned[..., 0])))
