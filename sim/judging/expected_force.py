"""The contact forces that a world's own object needs to stick under the wrench that was applied.

A controller that believes in a set of objects predicts the forces of the nominal one. Those of another member follow
from its own equations of motion: with f the forces, s_k and t_k the levers from its centre of mass to where a contact
touches and to the material point there (the centre of what rolls), all contacts stay where they are if

    m a = F + m g + sum f_k,    I alpha = M + sum s_k x f_k - omega x I omega,
    a + alpha x s_k + omega x (omega x t_k) = 0.

Where that leaves forces open, as the squeeze along an edge, they are as the controller predicts them: of all that stick
these are the nearest.
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.rotations import rotated
from pivoting.sim.joint_drag import drag_wrench

if TYPE_CHECKING:
    from pivoting.sim.slip import ContactMotion

Array = NDArray[np.float64]
_HALVES = slice(0, 3), slice(3, 6)
RIDGE = 1e-12  # of the square of the compliance, added where several contacts leave forces open


@np.errstate(invalid="ignore", over="ignore")  # of a world that diverges
def expected_force(run: "ContactMotion") -> Array:
    """(W, N, K, d) the contact forces nearest to the predicted ones with which each world's own object sticks [N].

    Table axes. A world's are the same to the last bit, however many others there are.
    """
    return np.array([_of_world(run, world) for world in range(run.worlds)])


def _of_world(run: "ContactMotion", world: int) -> Array:
    """(N, K, d) of one world."""
    truth = run.world.truths[world % len(run.world.truths)]
    f = np.ascontiguousarray(run.force[world])
    (N, K, d), E, axes = f.shape, run.space.force_map, run.table_axes
    q, rate = (np.ascontiguousarray(each[world, :N]) for each in (run.quaternion, run.angular_velocity))
    turned = rotated(q[:, None], np.eye(3)) @ axes  # (N, 3, 3), its rows the object's axes
    offset, omega = truth.offset @ turned, rate @ axes
    inertia, compliance = (
        _in_table(each, turned) for each in (truth.inertia, np.asarray(np.linalg.pinv(truth.inertia), float))
    )
    arm, point = (np.ascontiguousarray(each[world, :N]) + offset[:, None] for each in (run.lever, run.turning))
    force, moment = _applied(run, world, q, rate, offset)
    predicted = f @ E.T
    force = force + predicted.sum(axis=1) + truth.mass * (run.truth.gravity @ axes)
    momentum = (inertia @ omega[..., None])[..., 0]
    moment = moment + np.cross(arm, predicted).sum(axis=1) - np.cross(omega, momentum)
    alpha = (compliance @ moment[..., None])[..., 0]
    drift = force[:, None] / truth.mass + np.cross(alpha[:, None], arm)
    drift += np.cross(omega[:, None], np.cross(omega[:, None], point))
    # of a unit force at contact l along axis j: the acceleration of contact k along axis i
    levers = np.cross(arm[:, :, None], E.T).reshape(N, K * d, 3)
    A = levers @ compliance @ np.swapaxes(levers, -1, -2) + np.tile(E.T @ E, (K, K)) / truth.mass
    held = np.repeat(run.standing[world], d, axis=-1)
    A = np.where(held[:, :, None] & held[:, None, :], A, np.eye(K * d))
    rest = np.where(held, (drift @ E).reshape(N, K * d), 0.0)[..., None]
    if K == 1:
        change = np.linalg.solve(A, rest)
    else:  # the least that leaves the least acceleration
        ridge = RIDGE * np.trace(A, axis1=-2, axis2=-1)[:, None, None] ** 2 * np.eye(K * d)
        change = A @ np.linalg.solve(A @ A + ridge, rest)
    return np.asarray(f - change.reshape(N, K, d))


def _in_table(tensor: Array, turned: Array) -> Array:
    """(N, 3, 3) of a tensor (3, 3) in object axes."""
    return np.swapaxes(turned, -1, -2) @ tensor @ turned


def _applied(run: "ContactMotion", world: int, q: Array, rate: Array, offset: Array) -> tuple[Array, Array]:
    """(N, 3) all known forces but gravity, and their moments about the CoM, table axes."""
    axes = run.table_axes
    force, moment = (np.ascontiguousarray(run.wrench_world[world, :, half]) @ axes for half in _HALVES)
    if run.attached.body.drag is None:
        return force, moment
    controller = run.controller_of(world)
    drag = drag_wrench(run.attached.body, controller, q, rate, run.desired[2][:-1])
    pull, twist = (rotated(q, each) @ axes for each in np.split(drag @ controller.belief.source.map, 2, axis=-1))
    return force + pull, moment + twist + np.cross(offset, pull)
