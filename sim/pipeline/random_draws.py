"""Random numbers that belong to a seed, a world and a step, whatever else is drawn, replayed or resumed."""

import hashlib
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from pivoting.sim.pipeline.stages import Setting

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

    def normal(self, step: int, count: int) -> Array:
        """(W, count) numbers of the standard normal distribution, each world's own, out of two uniform ones each.

        By the formula of Box and Muller (1958): a method that rejects some would take another number for each world.
        """
        pairs = self.uniform(step, 2 * count).reshape(self._worlds, count, 2)
        length = np.sqrt(-2.0 * np.log(0.5 - 0.5 * pairs[..., 0]))
        return np.asarray(length * np.cos(np.pi * pairs[..., 1]))

    def of(self, distribution: str) -> Callable[[int, int], Array]:
        """`uniform` or `normal`, by its name."""
        return self.normal if distribution == "normal" else self.uniform

    def shares(self, step: int) -> Array:
        """(W,) numbers in [0, 1), each world's own."""
        return 0.5 * (1.0 + self.uniform(step, 1)[:, 0])

    def direction(self, step: int, count: int) -> Array:
        """(W, count) unit vectors, of which every direction is as likely as any other, each world's own."""
        vectors = self.normal(step, count)
        return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


class Chance:
    """Whether something happens that happens in a share of the steps, once faults have begun.

    Args:
        share: of the steps.  stream: what it is.
    """

    def __init__(self, share: float, stream: str, setting: "Setting"):
        self._share, self._from = share, round(setting.case.fault_start / setting.dt)
        self._draws = setting.draws(stream)
        self._never = np.zeros(setting.worlds, np.bool_)

    def __call__(self, k: int) -> NDArray[np.bool_]:
        """(W,) whether it happens in step k."""
        return self._never if k < self._from else self._draws.shares(k) < self._share
