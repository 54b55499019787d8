"""How compiled functions are compiled: cached on disk, divisions by zero as in NumPy, inlined or not.

Numba hands the option `forceinline` on to whatever is compiled along the way, so that it is always said: with all
of the interior point inlined into itself, compilation takes minutes.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import guvectorize, njit


def _cache_folder() -> Path | None:
    """Where numba keeps what it compiles of this room: NUMBA_CACHE_DIR, else beside the sources, else in the user's
    cache; None where it can write to none of them, and would raise for each function that asks for a cache."""
    try:
        return Path(njit(cache=True)(_cache_folder).stats.cache_path)
    except RuntimeError:
        return None


CACHE = _cache_folder()
CACHED = CACHE is not None

kernel = njit(cache=CACHED, error_model="numpy", forceinline=False)
inlined = njit(cache=CACHED, error_model="numpy", forceinline=True)  # a call with ten arrays costs 0.1 us


def elementwise(layout: str) -> Callable[..., Any]:
    """A decorator: two float arrays and an output, broadcast over all axes but those that `layout` names."""
    return guvectorize(["void(f8[:], f8[:], f8[:])"], layout, cache=CACHED)
