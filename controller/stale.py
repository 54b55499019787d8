"""Numba's cache on disk knows when a function's own file changes, but not the files of the functions that it calls.

Without this, an edit of `certificate.py` would leave the loop compiled in `controller.py` running the old certificate.
"""

from contextlib import suppress
from pathlib import Path

from numba import config


def drop_stale_kernels(room: Path) -> list[Path]:
    """Remove the compiled kernels of a folder if any of its sources is newer than one of them; returns what went."""
    newest = max(source.stat().st_mtime for source in room.glob("*.py"))
    folders = [room / "__pycache__"]
    if config.CACHE_DIR:  # numba then makes one folder for each folder of sources, named after it
        folders += Path(config.CACHE_DIR).glob(f"{room.name}_*")
    compiled = [path for folder in folders for path in folder.glob("*.nb[ic]") if path.is_file()]
    with suppress(FileNotFoundError):  # another process is dropping them
        if all(path.stat().st_mtime >= newest for path in compiled if path.suffix == ".nbi"):
            return []
    for path in compiled:
        path.unlink(missing_ok=True)
    return compiled
