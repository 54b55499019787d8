"""Follow a reference of your own: any object with a duration that gives a `Motion` at the times it is asked for."""

import math

import numpy as np
from pivoting import simulate
from pivoting.controller import Motion, Sampled


class GrowingSwing:
    """theta = 45 deg + (1 - exp(-t)) 5 deg sin(4 t), which begins at rest and goes on for ever."""

    duration = math.inf

    def __call__(self, times) -> Motion:
        t = np.asarray(times, dtype=float)
        a, decay, s, c = np.deg2rad(5.0), np.exp(-t), np.sin(4 * t), np.cos(4 * t)
        angle = np.deg2rad(45.0) + a * (1 - decay) * s
        rate = a * (decay * s + 4 * (1 - decay) * c)
        acceleration = a * (-decay * s + 8 * decay * c - 16 * (1 - decay) * s)
        return Motion(angle, rate, acceleration)


# Or angles at equal intervals, as another planner may give them; a spline finds their rates.
samples = np.deg2rad(45.0) + np.deg2rad(10.0) * np.sin(np.linspace(0.0, np.pi, 41)) ** 3

for name, reference in (("of its own formula", GrowingSwing()), ("from samples", Sampled(samples, dt=0.05))):
    run = simulate("pivot-2d", reference=reference, seconds=2.0)
    print(f"{name:18} {run.verdict}: RMS error {run.measures.angle_error_rms_deg[0]:.4f} deg")
