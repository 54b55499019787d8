"""Writing a file whole or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Yield a temporary path that replaces `path` on success; on failure it is removed and `path` is untouched."""
    partial = part(path)
    try:
        yield partial
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def part(path: Path) -> Path:
    """The temporary file next to `path`, with a name of its own for each process."""
    return path.with_name(f".{path.name}.{os.getpid()}.part")
