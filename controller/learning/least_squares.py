"""Recursive least squares: a point estimate of the unknowns with its covariance, which guarantees nothing."""

import numpy as np
from pivoting.controller.learning.balances import Cuts
from pivoting.controller.learning.unknowns import Unknowns
from pivoting.controller.validate import Array


class RecursiveLeastSquares:
    """The usual estimator: as if the prior's intervals and the bounds of the errors were those of uniform variables.

    Attributes:
        mean: (n,) of the unknowns.  covariance: (n, n).
    """

    def __init__(self, unknowns: Unknowns):
        prior = unknowns.polytope
        self._unknowns = unknowns
        self.mean: Array = 0.5 * (prior.low + prior.high)
        self.covariance: Array = np.diag((prior.high - prior.low) ** 2 / 12.0)

    def update(self, cuts: Cuts) -> None:
        """Take in the values of some cuts, one after another."""
        rows, spreads = self._unknowns.select(cuts.rows), self._unknowns.select(cuts.spreads)
        for row, value, spread, error in zip(rows, cuts.values, spreads, cuts.errors, strict=True):
            variance = (spread @ self.mean + error) ** 2 / 3.0
            gain = self.covariance @ row / (row @ self.covariance @ row + variance + 1e-300)
            self.mean = self.mean + gain * (value - row @ self.mean)
            self.covariance = self.covariance - np.outer(gain, row @ self.covariance)
