"""A finished run: its arrays, and what is derived from them."""

from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.space import Space, space
from pivoting.models.reading import PlanarBody, matrix
from pivoting.sim.attach import Attached
from pivoting.sim.fidelity import ContactRows
from pivoting.sim.monitor import Measures, measure
from pivoting.sim.scenario import Scenario
from pivoting.sim.verdict import Check, judge

Array = NDArray[np.float64]


def _frozen(values: Array) -> Array:
    """What is measured cannot be changed before it is judged."""
    values.flags.writeable = False
    return values


@dataclass(frozen=True, eq=False)
class Run:
    """A closed-loop run, W worlds and N steps. States have N + 1 entries, answers N; all read-only.

    Attributes:
        scenario: what was run, overrides included.
        seed: of the worlds' initial errors.
        attached: the controller and what it believes.
        truth: the body as the world has it.
        corner_point: (2,) the world's corner from the CoM, object axes [m].
        mu_world: the world's friction.
        contact_rows: MuJoCo's contact at the start, for the predicted slip.
        time: (N+1,) [s].
        reference: desired angle, rate and acceleration, each (N+1,) [rad, s].
        position: (W, N+1, 3) CoM, world axes [m].  quaternion: (W, N+1, 4) object to world.
        velocity, angular_velocity: (W, N+1, 3) of the CoM, world axes [m/s, rad/s].
        wrench: (W, N, 3) object axes (F_u, F_v, M) [N, N m]; nan where there was no answer, and then none is applied.
        wrench_world: (W, N, 6) applied force and torque at the CoM, world axes.
        force: (W, N, 1, 2) contact force (f_t, f_n) predicted by the solution, table axes [N].
        force_measured: (W, N, 1, 2) by MuJoCo's contact sensor, likewise.
        residual: (W, N) relative KKT residuals.  status: (W, N) codes of `solution.STATUS`, 0 is solved.
        control_us: (N,) time to state, solve and certify the problem of one world [microseconds].
        wall_s: of the loop.
        controller: "scenario" for the scenario's own, "given" for another that was handed to `simulate`.
    """

    scenario: Scenario
    seed: int
    attached: Attached
    truth: PlanarBody
    corner_point: Array
    mu_world: float
    contact_rows: ContactRows | None
    time: Array
    reference: tuple[Array, Array, Array]
    position: Array
    quaternion: Array
    velocity: Array
    angular_velocity: Array
    wrench: Array
    wrench_world: Array
    force: Array
    force_measured: Array
    residual: Array
    status: NDArray[np.int8]
    control_us: Array
    wall_s: float
    controller: str

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
        return space(2, self.truth.table)

    @cached_property
    def theta(self) -> Array:
        """(W, N+1) angle from the world's table [rad]."""
        return _frozen(self.space.angle(self.quaternion))

    @cached_property
    def omega(self) -> Array:
        """(W, N+1) rate of theta [rad/s]."""
        return _frozen(self.angular_velocity @ self.space.axial(1.0))

    @cached_property
    def angle_error(self) -> Array:
        """(W, N+1) theta minus the reference [rad]."""
        difference = self.theta - self.reference[0]
        return _frozen(np.arctan2(np.sin(difference), np.cos(difference)))

    @cached_property
    def table_axes(self) -> Array:
        """(3, 2) the table's tangent and normal as columns, world axes."""
        return matrix(self.truth.table)[:, [0, 2]]

    @cached_property
    def lever(self) -> Array:
        """(W, N+1, 2) from the CoM to the material corner along the table's tangent and normal [m]."""
        (u, v), s, c = self.corner_point, np.sin(self.theta), np.cos(self.theta)
        return _frozen(np.stack([c * u - s * v, s * u + c * v], axis=-1))

    @cached_property
    def corner(self) -> Array:
        """(W, N+1, 2) material corner from the table's origin along its tangent and normal [m]."""
        return _frozen((self.position - self.truth.origin) @ self.table_axes + self.lever)

    @cached_property
    def slip(self) -> Array:
        """(W, N+1) displacement of the material corner along the table since the start [m]."""
        return _frozen(self.corner[..., 0] - self.corner[:, :1, 0])

    @cached_property
    def friction_use(self) -> Array:
        """(W, N) measured |f_t| / (mu f_n) with the world's mu, at 1 the contact slides; nan without a push."""
        tangential, normal = np.abs(self.force_measured[..., 0, 0]), self.force_measured[..., 0, 1]
        pushed = normal > 0.0
        return _frozen(np.where(pushed, tangential, np.nan) / np.where(pushed, self.mu_world * normal, 1.0))

    @cached_property
    def measures(self) -> Measures:
        """What the monitor makes of it, for each world."""
        return measure(self)

    @cached_property
    def checks(self) -> tuple[Check, ...]:
        """The verdict, line by line."""
        return judge(self.measures, self.scenario.limits)

    @property
    def failed_worlds(self) -> NDArray[np.intp]:
        """Indices of the worlds that fail any check."""
        return np.flatnonzero(np.any([check.failed for check in self.checks], axis=0))

    @property
    def verdict(self) -> str:
        """ "pass" if every world is within every limit of the scenario, else "fail"."""
        return "fail" if self.failed_worlds.size else "pass"

    def summary(self) -> dict[str, Any]:
        """The run in numbers, of the worst world, SI units in the keys; what `--json` prints."""
        worst = {key: float(np.max(value)) for key, value in vars(self.measures).items()}
        return {
            "scenario": self.scenario.name,
            "changes": self.scenario.changes,
            "limits": asdict(self.scenario.limits),
            "controller": self.controller,
            "seed": self.seed,
            "worlds": self.worlds,
            "verdict": self.verdict,
            "failed_worlds": self.failed_worlds.tolist(),
            **worst,
            "solve_us_median": float(np.median(self.control_us)),
            "solve_us_p99": float(np.quantile(self.control_us, 0.99)),
            "sim_s": float(self.time[-1]),
            "wall_s": self.wall_s,
        }
