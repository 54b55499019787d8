"""A second process that compiles a kernel while this one compiles others: in one process numba compiles one at a time.

`python -m pivoting.controller.kernels.second_compiler` reads from stdin which kernel, and for which types.
"""

import os
import pickle
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from numba import typeof
from pivoting.controller.kernels.compilation import CACHED, first_calls


@contextmanager
def compiled_beside(kernel: Any, *arguments: Any) -> Iterator[None]:
    """Compile a kernel for the types of these arguments beside what is done meanwhile, and wait for it at the end.

    Where something of it is in the cache, or nothing can be kept there, nothing is done; then, and where the second
    process fails, the kernel is compiled at its first call, to the same machine code.
    """
    process = None if not CACHED or _in_cache(kernel) else _second_compiler()
    if process is None:
        yield
        return
    asked = kernel.__module__, kernel.__name__, tuple(map(typeof, arguments))
    try:
        assert process.stdin is not None
        with suppress(BrokenPipeError), process.stdin as told:  # broken where it has ended already
            told.write(pickle.dumps(asked))
        yield
        process.wait()
    finally:
        process.kill()
        process.wait()


def _second_compiler() -> "subprocess.Popen[bytes] | None":
    """The process, or None where none can be had."""
    if not Path(sys.executable).stem.startswith("python"):  # another program, with Python within it
        return None
    try:
        return subprocess.Popen(
            [sys.executable, "-m", __name__],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
            process_group=0,  # Ctrl-C is for this one to hear
        )
    except OSError:  # as where no more processes or no more memory are allowed
        return None


def _in_cache(kernel: Any) -> bool:
    """Whether a variant of it has been compiled."""
    return any(Path(kernel.stats.cache_path).glob(f"*.{kernel.__name__}-*.nbi"))


if __name__ == "__main__":
    module, name, types = pickle.load(sys.stdin.buffer)
    with first_calls():
        getattr(import_module(module), name).compile(types)
