"""The base of every error that this package raises: one `except PivotingError` catches them all.

Each kind is defined where it arises, and is also a RuntimeError, a ValueError or an OSError:

    pivoting.controller.errors      SolveError, PlanError: a solver has no answer that may be used
    pivoting.controller.validate    InputError: an argument that cannot be used
    pivoting.models.errors          ModelError: a MuJoCo model that cannot be served
    pivoting.sim.attachment         ControlError: a state of the simulation that cannot be controlled
    pivoting.sim.fleet              ReplayError: a world that was run again is not what it was
    pivoting.sim.drawing            RecordingOffError, GraphicsError: no recordings are wanted, nothing can be rendered
"""


class PivotingError(Exception):
    """What every error of this package is."""
