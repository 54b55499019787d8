"""Removes compiled kernels whose sources have changed; numba's cache notices changes of their own file only.

Without this, an edit of `kkt_residual.py` would leave the loop compiled in `compiled_step.py` running the old residual.
"""

import hashlib
import os
from contextlib import suppress
from pathlib import Path
from types import FunctionType

from numba import njit


def cache_folder(room: Path) -> Path | None:
    """The folder in which numba keeps what it compiles from the files of a room.

    It lies in NUMBA_CACHE_DIR, else beside the sources, else in the user's cache. None where none of them can be
    written to; numba then raises for each function that asks for a cache.
    """
    code = (lambda: None).__code__.replace(co_filename=str(room / "__init__.py"))
    try:
        return Path(njit(cache=True)(FunctionType(code, {})).stats.cache_path)
    except RuntimeError:
        return None


def drop_stale_kernels(room: Path, *others: Path) -> None:
    """Remove what was compiled of a room and its sub-rooms, if its sources or those of `others` have changed since."""
    folders, now = sorted({path.parent for path in room.rglob("*.py")}), _digest(room, *others)
    for cache in map(cache_folder, folders):
        if cache is not None:
            _drop_unless(now, cache)


def drop_stale(cache: Path, *rooms: Path) -> list[Path]:
    """Remove the kernels in the folder `cache` that were compiled from other sources than these rooms have now.

    Returns what was removed. Sources are compared by their contents, because the dates of installed files need not
    increase from one version to the next.
    """
    return _drop_unless(_digest(*rooms), cache)


def _digest(*rooms: Path) -> str:
    """Of all sources of these rooms."""
    digest = hashlib.sha256()
    for room in rooms:
        for source in sorted(room.rglob("*.py")):
            digest.update(str(source.relative_to(room)).encode() + b"\0" + hashlib.sha256(source.read_bytes()).digest())
    return digest.hexdigest()


def _drop_unless(now: str, cache: Path) -> list[Path]:
    """Remove the kernels in a folder that were compiled from sources with another digest; returns what was removed."""
    kept = cache / "kernels.sha256"
    with suppress(FileNotFoundError):
        if kept.read_text() == now:
            return []
    stale = [path for path in cache.glob("*.nb[ic]") if path.is_file()]
    for path in stale:
        path.unlink(missing_ok=True)  # another process may be dropping them
    cache.mkdir(parents=True, exist_ok=True)
    partial = cache / f"{kept.name}.{os.getpid()}"
    partial.write_text(now)
    partial.replace(kept)
    return stale
