"""Stances: the sets of contacts that are to hold, one after another, and the controllers that hold them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.validate import frozen
from pivoting.controller.wrench_controller import WrenchController


class Stance(NamedTuple):
    """One set of contacts that are to hold.

    Attributes:
        held: (K,) which of the declared contacts they are.
        controllers: one for each world, or one that they share; their contacts are those that are held, in this order.
    """

    held: NDArray[np.bool_]
    controllers: tuple[WrenchController, ...]

    @classmethod
    def of(cls, held: list[bool], controllers: tuple[WrenchController, ...]) -> "Stance":
        """Of the declared contacts those that are held, by these controllers."""
        return cls(frozen(np.array(held)), controllers)

    @property
    def columns(self) -> NDArray[np.intp]:
        """Which of the K d numbers of all contact forces are those of its contacts."""
        dim = self.controllers[0].space.dim
        return np.flatnonzero(np.repeat(self.held, dim))
