"""The set-membership estimator: all values of the unknowns that no measurement has excluded."""

from typing import NamedTuple

from pivoting.controller.learning.balances import Cuts
from pivoting.controller.learning.polytope import Polytope
from pivoting.controller.learning.unknowns import Unknowns

UNCHANGED, SHRUNK, RESET = "unchanged", "shrunk", "reset"


class Update(NamedTuple):
    """What some cuts did to the set. status: "unchanged", "shrunk", or "reset": nothing satisfied them."""

    status: str
    set: Polytope


class SetMembership:
    """Starts from the prior, intersects it with every cut, and holds the truth as long as the bounds of errors do.

    An empty intersection proves that a bound is wrong: the set becomes the prior again, and the cuts before are gone.

    Attributes:
        unknowns: what is estimated.  set: of their values.  resets: how often the set was empty.
    """

    def __init__(self, unknowns: Unknowns):
        self.unknowns = unknowns
        self.prior = unknowns.polytope
        self.set, self.resets = self.prior, 0

    def update(self, cuts: Cuts) -> Update:
        """Intersect the set with some cuts."""
        A, b = cuts.half_spaces
        smaller = self.set.cut(self.unknowns.select(A), b)
        if smaller is None:
            self.set, self.resets = self.prior, self.resets + 1
            return Update(RESET, self.set)
        status = UNCHANGED if smaller is self.set else SHRUNK
        self.set = smaller
        return Update(status, self.set)
