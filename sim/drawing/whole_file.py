"""Files that appear, or are replaced, when they are whole."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Where to write what is then at `path`; if that fails nothing is left, and what was there stays."""
    partial = part(path)
    try:
        yield partial
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def part(path: Path) -> Path:
    """The file beside it that is written first, another one for each process."""
    return path.with_name(f".{path.name}.{os.getpid()}.part")
