"""The stages of a step and what passes between them: sense, observe, control, actuate; one protocol each.

    states -> sense -> observe -> control -> actuate -> plant

All stages work on W worlds at once. A stage that is left out costs nothing. Stages may have state, which `prepare` and
the order of the steps determine; random draws are keyed (see `random_draws`), so that a replayed world is the same.
"""

from collections.abc import Mapping
from importlib import import_module
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.control_laws import Law
from pivoting.controller.kernels.compiled_step import STATE
from pivoting.controller.validate import frozen
from pivoting.controller.wrench_controller import WrenchController

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
    """

    __slots__ = ("joint_position", "joint_velocity", "touching", "values")

    def __init__(self, values: Array, joint_position: Array, joint_velocity: Array, touching: Array):
        self.values, self.touching = _shown(values), _shown(touching)
        self.joint_position, self.joint_velocity = _shown(joint_position), _shown(joint_velocity)

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
        return States(self.values[worlds, :STATE], *joints, self.touching[worlds])

    def changed(self, values: Array) -> "States":
        """The same joints with other values (W, 13) of the object, as something measures or estimates it."""
        return States(values, self.joint_position, self.joint_velocity, self.touching)

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


class Setting(NamedTuple):
    """What a stage is built from, beside the value of its key.

    Attributes:
        seed, worlds, first_world: of the run; world i of a run is number first_world + i.
        dt: time step [s].
        axes: (A, 3) world axes about which the object can turn: the plane's normal, or three.
        law: of the controller.
        controllers: one for each world, or one that they share; what they believe.
    """

    seed: int
    worlds: int
    first_world: int
    dt: float
    axes: Array
    law: Law
    controllers: tuple[WrenchController, ...]


class Stages(NamedTuple):
    """The stages around a control, in their order; where there is none the values pass unchanged."""

    sense: tuple[Sense, ...] = ()
    observe: tuple[Observe, ...] = ()
    correct: tuple[Correct, ...] = ()
    actuate: tuple[Actuate, ...] = ()


def build_stages(values: Mapping[str, float], setting: Setting) -> Stages:
    """The stages that a scenario's keys ask for.

    Args:
        values: by the place of a stage's class, "module:Class"; a value of 0 asks for none.
    """
    built: dict[str, list[Any]] = {slot: [] for slot in Stages._fields}
    for place, value in values.items():
        if value:
            module, _, name = place.partition(":")
            made = getattr(import_module(module), name)(value, setting)
            built[made.slot].append(made)
            if made.slot == "observe" and hasattr(made, "correct"):  # what it observes, it takes away again
                built["correct"].append(made.correct)
    return Stages(**{slot: tuple(stages) for slot, stages in built.items()})
