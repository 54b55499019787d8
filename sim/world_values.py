"""What each world has of its own: a member of the set of a scenario's intervals, drawn by its number, or a vertex."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.uncertainty.uncertainty import Interval
from pivoting.controller.validate import frozen
from pivoting.sim.pipeline.random_draws import Draws
from pivoting.sim.scenarios.object_keys import SET_KEYS

Array = NDArray[np.float64]


class WorldValues(NamedTuple):
    """Values of W worlds.

    Attributes:
        names: of the keys, of `SET_KEYS`.
        values: (W, n) in the keys' units.
    """

    names: tuple[str, ...]
    values: Array

    def part(self, first: int, worlds: int) -> "WorldValues":
        """Those of some worlds, from that with the index `first` on."""
        return self._replace(values=self.values[first : first + worlds])

    def of(self, world: int) -> dict[str, float]:
        """Those of one world, by key; as world.KEY they make it alone."""
        return dict(zip(self.names, self.values[world].tolist(), strict=True))

    @property
    def columns(self) -> dict[str, Array]:
        """(W,) by key."""
        return {name: self.values[:, i] for i, name in enumerate(self.names)}


def drawn_values(sets: Mapping[str, Interval], seed: int, worlds: int, first: int) -> WorldValues:
    """Members drawn uniformly and independently; a world's depend on the seed and its number, and one on no other key.

    Args:
        first: number of the first world.
    """
    shares = 0.5 + 0.5 * Draws(seed, "what a world has of its own", worlds, first).uniform(0, len(SET_KEYS))
    return values_at(sets, shares[:, [SET_KEYS.index(key) for key in sets]])


def vertex_values(sets: Mapping[str, Interval], worlds: int, first: int) -> WorldValues:
    """The vertices of the set in turn, of which world i is number i modulo how many there are."""
    wide = [key for key, interval in sets.items() if interval.half > 0.0]
    number = np.arange(first, first + worlds, dtype=np.int64) % 2 ** len(wide)
    shares = np.zeros((worlds, len(sets)))
    for bit, key in enumerate(reversed(wide)):
        shares[:, list(sets).index(key)] = number >> bit & 1
    return values_at(sets, shares)


def values_at(sets: Mapping[str, Interval], shares: Array) -> WorldValues:
    """The members at these shares (W, n) of the way through the intervals."""
    columns = [[interval.at(share) for share in shares[:, i].tolist()] for i, interval in enumerate(sets.values())]
    return WorldValues(tuple(sets), frozen(np.array(columns).T.reshape(len(shares), len(sets))))
