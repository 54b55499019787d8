"""The present moment of the loop, ready to be drawn: a `DrawnWorld` whose sizes do not change from frame to frame."""

from dataclasses import dataclass

import numpy as np
from pivoting.sim.drawing.drawn_world import DrawnWorld
from pivoting.sim.drawing.shapes import Solid


@dataclass(frozen=True, eq=False)
class LiveWorld(DrawnWorld):
    """The last steps of a run that goes on.

    Attributes:
        shape: of the body, see `solids`.
    """

    shape: list[Solid]

    @property
    def solids(self) -> list[Solid]:
        """The body's geoms, object axes."""
        return self.shape

    @property
    def usual_force(self) -> float:
        """The floor of the normal forces, with some room: what is to come is not known [N]."""
        return 1.5 * float(self.run.attached.controller.belief.contacts.f_min.sum())

    @property
    def usual_moment(self) -> float:
        """A quarter of the weight at its lever from the contacts [N m]."""
        return 0.25 * float(np.linalg.norm(self.weight)) * self.run.size

    @property
    def grown(self) -> float:
        """Half the size of the picture of the wrench space: a little more than the weight or the floor [N]."""
        return max(1.5 * float(np.linalg.norm(self.weight)), 1.2 * self.usual_force, 1e-9)
