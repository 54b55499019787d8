"""The error that says why a model cannot be served."""

from pivoting.errors import PivotingError


class ModelError(PivotingError, ValueError):
    """A model, or a body in it, that cannot be served; the message says why and what would be."""
