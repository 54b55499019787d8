"""How compiled functions are compiled: cached on disk, divisions by zero as in NumPy, inlined or not.

Numba hands the option `forceinline` on to whatever is compiled along the way, so that it is always said: with all
of the interior point inlined into itself, compilation takes minutes.
"""

from collections.abc import Callable
from typing import Any

from numba import guvectorize, njit

kernel = njit(cache=True, error_model="numpy", forceinline=False)
inlined = njit(cache=True, error_model="numpy", forceinline=True)  # a call with ten arrays costs 0.1 us


def elementwise(layout: str) -> Callable[..., Any]:
    """A decorator: two float arrays and an output, broadcast over all axes but those that `layout` names."""
    return guvectorize(["void(f8[:], f8[:], f8[:])"], layout, cache=True)
