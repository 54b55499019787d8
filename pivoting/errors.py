"""The base of every error that this package raises: one `except PivotingError` catches them all.

Each kind is defined where it arises, and is also a RuntimeError or a ValueError:

    pivoting.controller.errors      SolveError, PlanError: a solver has no answer that may be used
    pivoting.controller.validate    InputError: an argument that cannot be used
    pivoting.models.names           ModelError: a MuJoCo model that cannot be served
    pivoting.sim.attach             ControlError: a state of the simulation that cannot be controlled
    pivoting.sim.drawing            RecordingOffError: the environment forbids recordings
"""


class PivotingError(Exception):
    """What every error of this package is."""
