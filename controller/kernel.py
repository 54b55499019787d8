"""How functions are compiled: `kernel`, which Python calls, and `subroutine`, which only kernels call.

Compiling is what a new user waits for, and most of it is numba's own work in Python and the code of callees, which is
optimised again in each caller. So kernels neither allocate nor count references (scratch is handed in, and no array is
returned), subroutines have no entry from Python and are compiled only once, arrays are copied in loops (an assignment
of slices brings the code of its error message along, with text and lists), all arrays are contiguous, and what a
problem does not need is None, whose branches are left out.
"""

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from numba import njit
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

_common: dict[str, Any] = {"error_model": "numpy", "no_cfunc_wrapper": True, "_nrt": False}

kernel = njit(cache=CACHED, **_common)
subroutine = register_jitable(no_cpython_wrapper=True, **_common)


@contextmanager
def first_calls() -> Iterator[None]:
    """Around calls that may compile: numba makes objects by the million, and looking for garbage among them costs it a
    tenth of its time."""
    collected = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collected:
            gc.enable()
