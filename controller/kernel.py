"""How compiled functions are compiled: cached on disk, divisions by zero as in NumPy, inlined or not.

Numba hands the option `forceinline` on to whatever is compiled along the way, so that it is always said: with all
of the interior point inlined into itself, compilation takes minutes.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import guvectorize, njit
from numba.extending import register_jitable


def _cache_folder() -> Path | None:
    """Where numba keeps what it compiles of this room: NUMBA_CACHE_DIR, else beside the sources, else in the user's
    cache; None where it can write to none of them, and would raise for each function that asks for a cache."""
    try:
        return Path(njit(cache=True)(_cache_folder).stats.cache_path)
    except RuntimeError:
        return None


CACHE = _cache_folder()
CACHED = CACHE is not None

_ours: dict[str, Any] = {"error_model": "numpy", "no_cfunc_wrapper": True}
_inside = {**_ours, "_nrt": False, "no_cpython_wrapper": True}

kernel = njit(cache=CACHED, forceinline=False, _nrt=False, **_ours)
allocating = njit(cache=CACHED, forceinline=False, **_ours)
subroutine = register_jitable(forceinline=False, **_inside)
inlined = register_jitable(forceinline=True, **_inside)


def elementwise(layout: str) -> Callable[..., Any]:
    """A decorator: two float arrays and an output, broadcast over all axes but those that `layout` names."""
    return guvectorize(["void(f8[:], f8[:], f8[:])"], layout, cache=CACHED)

