"""The contacts of every step, sorted a few steps at once: all that MuJoCo lists of them would fill the memory."""

import numpy as np
from numpy.typing import NDArray
from pivoting.models.contact_softness import ContactRows
from pivoting.sim.contact_sensing import ContactReadings, Declared, sort_contacts
from pivoting.sim.judging.predicted_slip import RowEffects, RowNumbers, Sums

Array = NDArray[np.float64]
BLOCK = 256  # worlds times steps whose contacts are sorted at once: what stays in the caches


class ContactLog:
    """Sorts the contacts of every step, some steps at once: what MuJoCo lists of them all would fill the memory."""

    def __init__(
        self,
        declared: Declared,
        rows: ContactRows | None,
        axes: Array,
        where: dict[str, slice],
        steps: int,
        worlds: int,
    ):
        K = len(declared.points)
        places = [(where[key].start, where[key].stop) for key in ("contacts", "touching")]
        known = None if rows is None else tuple(RowNumbers.of(rows, axes))
        self._with = *places, tuple(declared), known, np.empty((K, 3)), np.empty(K), tuple(Sums.of(K))
        self.readings = ContactReadings(
            *(np.empty((steps, worlds, *rest)) for rest in ((K, 3), (), (), (), ())),
        )
        self.held = RowEffects(
            np.full((steps, worlds, K, 2), np.nan), np.zeros((steps, worlds, K)), np.zeros((steps, worlds, K), np.bool_)
        )

    def sort(self, first: int, poses: Array, sensed: Array) -> None:
        """Sort the contacts (B, W, sensors) of the steps from `first` on, that began at the states (B, W, sensors)."""
        now = slice(first, first + len(sensed))
        contacts, touching, declared, rows, *scratch = self._with
        readings, held = (tuple(values[now] for values in kept) for kept in (self.readings, self.held))
        sort_contacts(sensed, contacts, touching, poses, declared, rows, *scratch, readings, held)
