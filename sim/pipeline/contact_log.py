"""The contacts of every step, sorted a few steps at once: all that MuJoCo lists of them would fill the memory."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pivoting.models.contact_softness import ContactRows
from pivoting.sim.contact_sensing import ContactReadings, Declared, sort_contacts
from pivoting.sim.judging.predicted_slip import RowEffects, RowNumbers, Sums

Array = NDArray[np.float64]
READINGS = len(ContactReadings._fields)
BLOCK = 256  # worlds times steps whose contacts are sorted at once: what stays in the caches


class ContactLog:
    """Sorts the contacts of every step into the log, some steps at once.

    Args:
        rows: of each world, or one for all; None where nothing is known of them.
        sensors: where the readings of each are, see `models.sensors.instrument`.
        worlds: W.
        readings, held: of the log, (N, W, ...), in which they are written.
    """

    def __init__(
        self,
        declared: Declared,
        rows: Sequence[ContactRows | None],
        axes: Array,
        sensors: dict[str, slice],
        worlds: int,
        readings: ContactReadings,
        held: RowEffects,
    ):
        K, self.most = len(declared.points), max(1, BLOCK // worlds)
        places = [(sensors[key].start, sensors[key].stop) for key in ("contacts", "touching")]
        known = RowNumbers.of(rows, axes)
        self._with = *places, tuple(declared), known and tuple(known), np.empty((K, 3)), np.empty(K), tuple(Sums.of(K))
        self._kept = (*readings, *held)
        # contiguous, as the kernel takes them, whichever worlds of the log they are
        self._block = tuple(np.empty((self.most, worlds, *values.shape[2:]), values.dtype) for values in self._kept)

    def sort(self, first: int, poses: Array, sensed: Array) -> None:
        """Sort the contacts (B, W, sensors) of the steps from `first` on, that began at the states (B, W, 7 or more).

        B is at most `most`.
        """
        steps = len(sensed)
        sort_contacts(*self.arguments(poses, sensed))
        for kept, values in zip(self._kept, self._block, strict=True):
            kept[first : first + steps] = values[:steps]

    def arguments(self, poses: Array, sensed: Array) -> tuple[Any, ...]:
        """Those of `sort_contacts`."""
        contacts, touching, declared, rows, *scratch = self._with
        block = [values[: len(sensed)] for values in self._block]
        poses = np.ascontiguousarray(poses)
        held = tuple(block[READINGS:])
        return sensed, contacts, touching, poses, declared, rows, *scratch, tuple(block[:READINGS]), held
