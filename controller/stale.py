"""Numba's cache on disk knows when a function's own file changes, but not the files of the functions that it calls.

Without this, an edit of `certificate.py` would leave the loop compiled in `controller.py` running the old certificate.
"""

import hashlib
import os
from contextlib import suppress
from pathlib import Path


def drop_stale_kernels(room: Path, cache: Path) -> list[Path]:
    """Remove the kernels compiled into the folder `cache` of other sources than `room` has now; returns what went.

    Sources are told apart by what they say: dates of installed files need not grow from one version to the next.
    """
    digest = hashlib.sha256()
    for source in sorted(room.glob("*.py")):
        digest.update(source.name.encode() + b"\0" + hashlib.sha256(source.read_bytes()).digest())
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
