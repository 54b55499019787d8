"""Numba's cache on disk knows when a function's own file changes, but not the files of the functions that it calls.

Without this, an edit of `certificate.py` would leave the loop compiled in `controller.py` running the old certificate.
"""

import hashlib
import os
from contextlib import suppress
from pathlib import Path
from types import FunctionType

from numba import njit


def cache_folder(room: Path) -> Path | None:
    """Where numba keeps what it compiles of a room: NUMBA_CACHE_DIR, else beside the sources, else in the user's cache;
    None where it can write to none of them, and would raise for each function that asks for a cache."""
    code = (lambda: None).__code__.replace(co_filename=str(room / "__init__.py"))
    try:
        return Path(njit(cache=True)(FunctionType(code, {})).stats.cache_path)
    except RuntimeError:
        return None


def drop_stale_kernels(cache: Path, *rooms: Path) -> list[Path]:
    """Remove the kernels compiled into the folder `cache` of other sources than these rooms have; returns what went.

    Sources are told apart by what they say: dates of installed files need not grow from one version to the next.
    """
    digest = hashlib.sha256()
    for room in rooms:
        for source in sorted(room.rglob("*.py")):
            digest.update(str(source.relative_to(room)).encode() + b"\0" + hashlib.sha256(source.read_bytes()).digest())
    now, kept = digest.hexdigest(), cache / "kernels.sha256"
    with suppress(FileNotFoundError):
        if kept.read_text() == now:
            return []
    stale = [path for path in cache.glob("*.nb[ic]") if path.is_file()]
    for path in stale:
        path.unlink(missing_ok=True)  # another process may be dropping them
    partial = cache / f"{kept.name}.{os.getpid()}"
    partial.write_text(now)
    partial.replace(kept)
    return stale
