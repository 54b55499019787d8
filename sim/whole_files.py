"""Files that are written together: each appears whole, and either all of them do or none."""

import errno
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from pivoting.sim.interrupts import uninterrupted

Writer = Callable[[Path], object]  # writes a file to the path that it is called with


def write_together(folder: Path, writers: Mapping[str, Writer]) -> None:
    """Write files into a folder, which is made if there is none; its other files stay as they are.

    Each is written under another name first. Only when all of them are whole do they take their places; if anything
    goes wrong before, or the user interrupts it, nothing is left.

    Args:
        writers: by the name of the file, in the order in which they are written.

    Raises:
        OSError: a file cannot be written.
    """
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    parts = {folder / name: folder / f".{name}.{os.getpid()}.part" for name in writers}
    done = False
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for part, write in zip(parts.values(), writers.values(), strict=True):
            write(part)
        for target in parts:
            if target.is_dir():
                raise IsADirectoryError(errno.EISDIR, "a folder is where the file is to be", str(target))
        with uninterrupted():
            for target, part in parts.items():
                part.replace(target)
            done = True
    finally:
        for part in parts.values():
            with suppress(FileNotFoundError, NotADirectoryError):  # it has moved, or there never was one
                part.unlink()
        if not done:
            for path in made:
                with suppress(OSError):  # somebody else has put something there
                    path.rmdir()


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Yield a temporary path that replaces `path` on success; on failure it is removed and `path` is untouched."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield part
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
