"""Integral action: what remains of the angle error is summed up and added to the acceleration that the law asks for."""

import numpy as np
from pivoting.controller.rotations import CONJUGATE, quaternion_product, rotation_vector
from pivoting.controller.validate import fail
from pivoting.sim.pipeline.stages import Desired, Setting, States


class IntegralAction:
    """The third term of a PID law: kp rate times the integral of the orientation error, world axes.

    Without it a constant disturbance, such as a mass that is not as believed, leaves a constant error. By Routh's
    criterion the closed loop s^3 + kd s^2 + kp s + kp rate is stable for a rate below kd, see `Law`.

    Args:
        rate: at which a steady error is removed [1/s].

    Raises:
        ValueError: the law asks for no acceleration, or the loop would not be stable.
    """

    slot = "correct"

    def __init__(self, rate: float, setting: Setting):
        law = setting.law
        if not law.feedforward:
            raise fail("integral", rate, f"0 with law={law.formulation}, which follows no acceleration; or law=dynamic")
        if rate >= law.kd:
            raise fail("integral", rate, f"< 2 damping bandwidth = {law.kd:g} 1/s, or the loop is not stable")
        self._gain, self._dt = rate * law.kp, setting.dt
        self._integral = np.zeros((setting.worlds, 3))

    def __call__(self, states: States, desired: Desired) -> Desired:
        """The reference with the integral of the error, up to this step, in its acceleration."""
        turned = rotation_vector(quaternion_product(desired.orientation, states.orientation * CONJUGATE))
        self._integral += self._dt * np.where(np.isfinite(turned), turned, 0.0)  # of no measurement, nothing is kept
        corrected = Desired(np.broadcast_to(desired.values, (len(states.values), desired.values.shape[1])).copy())
        corrected.angular_acceleration[:] += self._gain * self._integral
        return corrected
