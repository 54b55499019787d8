"""The set in which a scenario's controller believes the world to be."""

import numpy as np
from pivoting.controller.uncertainty.uncertainty import Interval, Uncertainty
from pivoting.controller.validate import fail
from pivoting.models.rigid_body import RigidBody
from pivoting.sim.scenarios.object_keys import COM_KEYS
from pivoting.sim.scenarios.scenario import Scenario
from pivoting.sim.scenarios.set_values import believed_values


def scenario_uncertainty(case: Scenario, body: RigidBody, unit: float = 1.0) -> Uncertainty | None:
    """The set about the nominal object, or None where everything is taken to be known exactly.

    Args:
        body: the nominal object, as the controller believes it to be.
        unit: of the model's lengths [m], in which the set is then.
    """
    told = believed_values(case)
    errors = case.shove_bound, case.theta_error, case.omega_error
    if not any(isinstance(value, Interval) for value in told.values()) and not any(errors):
        return None
    intervals = {key: _interval(value) for key, value in told.items()}
    mass = intervals["mass"] if isinstance(told.get("mass"), Interval) else body.mass
    inertia, mu = intervals.get("inertia"), told.get("mu")
    axes = COM_KEYS[::2] if body.dim == 2 else COM_KEYS
    offsets = [intervals.get(axis, Interval(0.0, 0.0)) for axis in axes]
    return Uncertainty(
        mass=mass,
        com=np.array([[-each.half, each.half] for each in offsets]) / unit,
        inertia=1.0 if inertia is None else np.divide(inertia, inertia.middle),
        mu=mu if isinstance(mu, Interval) else None,
        shove=case.shove_bound / unit,
        shove_seconds=case.shove_seconds,
        theta=np.deg2rad(case.theta_error),
        omega=np.deg2rad(case.omega_error),
    )


def refuse_across_the_plane(case: Scenario, body: RigidBody) -> None:
    """Raise if a coordinate of the CoM is given along which a planar object does not move.

    Raises:
        ValueError: it is; com, which stands for all that the object has, is not refused.
    """
    across = COM_KEYS[1]
    if body.dim == 2:
        for name, value in ((across, getattr(case, across)), (f"world.{across}", case.world.get(across))):
            if value is not None:
                raise fail(name, value, "left out: the object moves in a plane, and this is across it")


def _interval(value: float | Interval) -> Interval:
    return value if isinstance(value, Interval) else Interval(value, value)
