"""The stages of a step and what passes between them: sense, observe, control, actuate, disturb; one protocol each.

    states -> sense -> observe -> control -> actuate -> disturb -> plant

All stages work on W worlds at once. Stages may also stand around the control, and correct the reference that its law
sees. A stage that is left out costs nothing. Stages may have state, which `prepare` and
the order of the steps determine; random draws are keyed (see `random_draws`), so that a replayed world is the same.
"""

from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.control_laws import Law
from pivoting.controller.kernels.compiled_step import STATE
from pivoting.controller.rotations import rotation_matrix
from pivoting.controller.validate import fail, frozen
from pivoting.controller.wrench_controller import WrenchController
from pivoting.sim.pipeline.random_draws import Draws

if TYPE_CHECKING:  # which are built before the stages
    from mujoco.batch import Batch
    from pivoting.sim.scenarios.scenario import Scenario
    from pivoting.sim.world import World

Array = NDArray[np.float64]
# The columns of a state's values.
POSITION, ORIENTATION, VELOCITY, ANGULAR_VELOCITY = slice(0, 3), slice(3, 7), slice(7, 10), slice(10, 13)


def _shown(values: Array) -> Array:
    """A view that cannot be written to: no stage changes what another has given."""
    return frozen(values.view())


class States:
    """The states of W worlds at one time.

    Attributes:
        values: (W, 13) position, orientation, velocity and angular velocity, in this order, as the properties say;
            more columns may follow, which are no part of the state.
        joint_position: (W, nq) and joint_velocity: (W, nv) of all joints of the model.
        touching: (W,) how many contacts with its support the object has, as touch sensors would tell.
        fresh: (W,) whether a new measurement has arrived; where not, the values are older, or predicted.
    """

    __slots__ = ("fresh", "joint_position", "joint_velocity", "touching", "values")

    def __init__(
        self,
        values: Array,
        joint_position: Array,
        joint_velocity: Array,
        touching: Array,
        fresh: NDArray[np.bool_] | None = None,
    ):
        self.values, self.touching = _shown(values), _shown(touching)
        self.joint_position, self.joint_velocity = _shown(joint_position), _shown(joint_velocity)
        self.fresh = np.ones(len(values), np.bool_) if fresh is None else fresh

    @property
    def position(self) -> Array:
        """(W, 3) of the centre of mass, world axes [m]."""
        return self.values[:, POSITION]

    @property
    def orientation(self) -> Array:
        """(W, 4) quaternions, object axes to world."""
        return self.values[:, ORIENTATION]

    @property
    def velocity(self) -> Array:
        """(W, 3) of the centre of mass, world axes [m/s]."""
        return self.values[:, VELOCITY]

    @property
    def angular_velocity(self) -> Array:
        """(W, 3) world axes [rad/s]."""
        return self.values[:, ANGULAR_VELOCITY]

    def copy(self) -> "States":
        """The same in arrays of their own, for whoever may keep them: those of the plant change with every step."""
        return self.of(np.arange(len(self.values)))

    def of(self, worlds: NDArray[np.intp]) -> "States":
        """Those of some worlds, in arrays of their own."""
        joints = self.joint_position[worlds], self.joint_velocity[worlds]
        return States(self.values[worlds, :STATE], *joints, self.touching[worlds], self.fresh[worlds])

    def changed(self, values: Array, fresh: NDArray[np.bool_] | None = None) -> "States":
        """The same joints with other values (W, 13) of the object, as something measures or estimates it.

        Args:
            fresh: (W,) whether they are newly measured; None: where they were before.
        """
        changed = object.__new__(States)  # of what is shown already
        changed.values, changed.touching = _shown(values), self.touching
        changed.joint_position, changed.joint_velocity = self.joint_position, self.joint_velocity
        changed.fresh = self.fresh if fresh is None else fresh
        return changed

    @classmethod
    def turning(cls, orientation: Array, angular_velocity: Array) -> "States":
        """States of which only the rotation matters: orientations (W, 4) and angular velocities (W, 3)."""
        values = np.zeros((len(orientation), STATE))
        values[:, ORIENTATION], values[:, ANGULAR_VELOCITY] = orientation, angular_velocity
        return cls(values, np.zeros((len(values), 0)), np.zeros((len(values), 0)), np.zeros(len(values)))


class Answers(NamedTuple):
    """Where a control writes its answers to one step; of a whole run, leading axes of worlds and steps.

    Attributes:
        values: (W, 2 nw + K d + 1) the columns of `required`, `wrench`, `force` and `residual`, in this order.
        status: (W,) codes of `solution.STATUS`.
        nw: numbers of a wrench, 3 in the plane and 6 in space.
    """

    values: Array
    status: NDArray[np.int8]
    nw: int

    @property
    def required(self) -> Array:
        """(W, nw) what the contact forces and the wrench have to make together, object axes [N, N m]."""
        return self.values[..., : self.nw]

    @property
    def wrench(self) -> Array:
        """(W, nw) that is to be applied, object axes [N, N m]; nan where there is no answer."""
        return self.values[..., self.nw : 2 * self.nw]

    @property
    def force(self) -> Array:
        """(W, K d) contact forces that go with it, contact axes [N]."""
        return self.values[..., 2 * self.nw : -1]

    @property
    def residual(self) -> Array:
        """(W,) relative KKT residuals."""
        return self.values[..., -1]

    @classmethod
    def empty(cls, shape: tuple[int, ...], nw: int, forces: int) -> "Answers":
        """Without values yet, of worlds, or of steps and worlds, of this shape, with K d = `forces`."""
        return cls(np.empty((*shape, 2 * nw + forces + 1)), np.empty(shape, np.int8), nw)


class Desired:
    """Where the object is to be.

    Attributes:
        values: (W or 1, 10) the columns of the properties, in their order.
    """

    __slots__ = ("values",)

    def __init__(self, values: Array):
        self.values = values

    @property
    def orientation(self) -> Array:
        """(W or 1, 4) quaternions, object axes to world."""
        return self.values[..., :4]

    @property
    def angular_velocity(self) -> Array:
        """(W or 1, 3) world axes [rad/s]."""
        return self.values[..., 4:7]

    @property
    def angular_acceleration(self) -> Array:
        """(W or 1, 3) world axes [rad/s^2]."""
        return self.values[..., 7:]


def desired_values(orientation: Array, angular_velocity: Array, angular_acceleration: Array) -> Array:
    """The values (..., 10) of `Desired` out of (..., 4), (..., 3) and (..., 3)."""
    return np.concatenate([orientation, angular_velocity, angular_acceleration], axis=-1)


class Sense(Protocol):
    """What is measured."""

    def __call__(self, k: int, states: States) -> States:
        """What is measured of the true states at the start of step k."""
        ...


class Observe(Protocol):
    """What is made of the measurements."""

    def __call__(self, k: int, measured: States, applied: Array | None) -> States:
        """The estimated states at the start of step k; `applied`: (W, nw) wrenches of step k - 1, None at first."""
        ...


class Correct(Protocol):
    """What is added to the reference before the law sees it, such as integral action."""

    def __call__(self, states: States, desired: Desired) -> Desired:
        """The corrected reference at the estimated states of a step."""
        ...


class Control(Protocol):
    """What decides on the wrench."""

    def __call__(self, k: int, states: States, before: Array | None, out: Answers) -> None:
        """Write the answers to step k; `before`: (W, nw) wrenches asked for at step k - 1, None at first."""
        ...

    def prepare(self, states: States, out: Answers) -> None:
        """Do once what takes long, such as compiling; what is written does not count."""
        ...


class Actuate(Protocol):
    """What the actuators make of the wrench that is asked for."""

    def __call__(self, k: int, wrench: Array) -> Array:
        """(W, nw) wrenches that act during step k, object axes, of those asked for."""
        ...


class Wrap(Protocol):
    """What stands around a control, such as one that asks it less often, or that goes over to a safe state."""

    def __call__(self, control: Control, desired: Array) -> Control:
        """The control that takes its place; `desired`: (N+1, 10) values of `Desired` at every step, as it is told."""
        ...


class Disturb(Protocol):
    """What happens to the world without anybody's asking for it; neither the control nor an observer knows of it."""

    def begin(self, batch: "Batch", world: "World") -> None:
        """The worlds in which it will happen, before their first step."""
        ...

    def __call__(self, k: int) -> Array | None:
        """Change the worlds in step k; (W, 6) force and torque at the centre of mass, world axes, if any are added."""
        ...


class Setting(NamedTuple):
    """What a stage is built from, beside the value of its key.

    Attributes:
        seed, worlds, first_world: of the run; world i of a run is number first_world + i.
        dt: time step [s].
        axes: (A, 3) world axes about which the object can turn: the plane's normal, or three.
        law: of the controller.
        case: the scenario, `absolute`, with the values of all keys.
        controllers: of the first stance, one for each world or one that they share: what is believed.
        unit: of the model's lengths [m], and with it of its forces and moments.
    """

    seed: int
    worlds: int
    first_world: int
    dt: float
    axes: Array
    law: Law
    case: "Scenario"
    controllers: tuple[WrenchController, ...]
    unit: float

    def draws(self, stream: str) -> Draws:
        """Random numbers of the run's worlds; `stream`: what they are drawn for."""
        return Draws(self.seed, stream, self.worlds, self.first_world)

    @property
    def directions(self) -> Array:
        """(D, 3) world axes along which the object can move: two in the plane, or three."""
        space = self.controllers[0].space
        return space.force_map.T @ rotation_matrix(space.base).T if space.dim == 2 else np.eye(3)

    def step(self, name: str, seconds: float) -> int:
        """The number of steps that a time of the key `name` takes: 0, or at least one.

        Raises:
            ValueError: it is shorter than a step.
        """
        steps = round(seconds / self.dt)
        if seconds > 0.0 and steps == 0:
            raise fail(name, seconds, f"0, or at least the time step of {self.dt:g} s")
        return steps

    def every(self, name: str, rate: float) -> int:
        """The number of steps from one time to the next at a rate [Hz] of the key `name`.

        Raises:
            ValueError: the rate is above that of the steps.
        """
        if rate * self.dt > 1.0 + 1e-9:
            raise fail(name, rate, f"at most one for each time step, {1.0 / self.dt:g} Hz")
        return round(1.0 / (rate * self.dt))


class Stages(NamedTuple):
    """The stages around a control, in their order; where there is none the values pass unchanged."""

    sense: tuple[Sense, ...] = ()
    observe: tuple[Observe, ...] = ()
    correct: tuple[Correct, ...] = ()
    wrap: tuple[Wrap, ...] = ()
    actuate: tuple[Actuate, ...] = ()
    disturb: tuple[Disturb, ...] = ()

    def around(self, control: Control, desired: Array) -> Control:
        """The control with what stands around it, the first innermost; `desired` as of `Wrap`."""
        for wrap in self.wrap:
            control = wrap(control, desired)
        return control


def build_stages(values: Mapping[str, float], setting: Setting, own: Observe | None = None) -> Stages:
    """The stages that a scenario's keys ask for.

    What observes in order to correct the reference goes by the estimated state, and so comes after all that estimates.

    Args:
        values: by the place of a stage's class, "module:Class", that of the first of its keys that is set.
        own: an observer of the user's own, which goes by what the scenario's estimates.
    """
    built: dict[str, list[Any]] = {slot: [] for slot in Stages._fields}
    for place, value in values.items():
        module, _, name = place.partition(":")
        made = getattr(import_module(module), name)(value, setting)
        built[made.slot].append(made)
        if made.slot == "observe" and hasattr(made, "correct"):  # what it observes, it takes away again
            built["correct"].append(made.correct)
    estimating = [stage for stage in built["observe"] if not hasattr(stage, "correct")]
    correcting = [stage for stage in built["observe"] if hasattr(stage, "correct")]
    built["observe"] = [*estimating, *([] if own is None else [own]), *correcting]
    return Stages(**{slot: tuple(stages) for slot, stages in built.items()})
