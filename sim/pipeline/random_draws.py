"""Random numbers that belong to a seed, a world and a step, whatever else is drawn, replayed or resumed."""

import hashlib

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
BLOCK = 4  # numbers that Philox makes for each value of its counter


class Draws:
    """Uniform numbers by a counter-based generator (Philox, Salmon et al. 2011), whose counter is (world, step).

    Args:
        seed: of the run.
        stream: what they are drawn for; draws of one name are independent of those of any other.
        worlds: how many.  first: number of the first of them.
    """

    def __init__(self, seed: int, stream: str, worlds: int, first: int = 0):
        digest = hashlib.sha256(f"{seed} {stream}".encode()).digest()
        self._key = np.frombuffer(digest[:16], dtype=np.uint64)
        self._worlds, self._first = worlds, first

    def uniform(self, step: int, count: int) -> Array:
        """(W, count) numbers in [-1, 1), each world's own."""
        blocks = -(-count // BLOCK)
        counter = np.array([self._first * blocks, step, 0, 0], dtype=np.uint64)
        generator = np.random.Generator(np.random.Philox(key=self._key, counter=counter))
        return generator.uniform(-1.0, 1.0, (self._worlds, blocks * BLOCK))[:, :count]
