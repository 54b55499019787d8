"""Numba's cache on disk knows when a function's own file changes, but not the files of the functions that it calls.

Without this, an edit of `certificate.py` would leave the loop compiled in `controller.py` running the old certificate.
"""

from pathlib import Path


def drop_stale_kernels(room: Path) -> list[Path]:
    """Remove the compiled kernels of a folder if any of its sources is newer than one of them; returns what went."""
    newest = max(source.stat().st_mtime for source in room.glob("*.py"))
    compiled = [path for path in room.glob("__pycache__/*.nb[ic]") if path.is_file()]
    if all(path.stat().st_mtime >= newest for path in compiled if path.suffix == ".nbi"):
        return []
    for path in compiled:
        path.unlink(missing_ok=True)
    return compiled
