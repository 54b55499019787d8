"""How functions are compiled: a `kernel` can be called from Python, a `subroutine` only from kernels.

A first run has to wait for the compiler. Most of this time goes into numba's own Python code, and into callees, which
are optimised again in every caller. Some rules keep it short. Kernels get their scratch from outside, return no arrays
and count no references. Subroutines have no compiled entry from Python, where they are plain functions. Arrays are
copied in loops, because an assignment to a slice also compiles the text of its error message. All arrays are
contiguous. What a problem does not need is None, so that the compiler leaves its branch out.
"""

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from numba import njit
from numba.extending import register_jitable
from pivoting.compile_hooks import before_compiling
from pivoting.controller.kernels.kernel_cache import cache_folder, drop_stale_kernels

_controller = Path(__file__).parents[1]
_models, _sim = _controller.with_name("models"), _controller.with_name("sim")
CACHE = cache_folder(Path(__file__).parent)
CACHED = CACHE is not None
drop_stale_kernels(_controller)  # before any kernel is loaded
drop_stale_kernels(_sim, _controller, _models)
for announce in before_compiling:
    announce()

_common: dict[str, Any] = {"error_model": "numpy", "no_cfunc_wrapper": True, "_nrt": False}

kernel = njit(cache=CACHED, nogil=True, **_common)  # worlds are stepped by several threads
subroutine = register_jitable(no_cpython_wrapper=True, **_common)


@contextmanager
def first_calls() -> Iterator[None]:
    """Switch the garbage collector off during calls that may compile.

    Numba creates millions of objects, and searching them takes a tenth of the time."""
    collected = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collected:
            gc.enable()
