"""The integrators with which a plan integrates the equations of motion over a step."""

# Order of the difference that stands for the acceleration, and how many poses back the forces act.
INTEGRATORS = {"quasi-dynamic": (1, 0), "implicit": (2, 0), "semi-implicit": (2, 1), "forward": (2, 2)}
