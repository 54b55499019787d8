"""The rows of a sweep on disk: a Parquet file for each chunk while it runs, and one file of all of them at its end.

Each file appears whole, so that a sweep that is killed loses the chunk under way and no more.
"""

import json
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import pyarrow.parquet as parquet
from pivoting.controller.validate import InputError
from pivoting.sim.sweeping.chunk_task import Rows
from pivoting.sim.whole_files import whole

WHOLE = "the file of a sweep, whole"
_PART = "a chunk of a sweep, whole: remove it and resume"
_PLAN, _KEY = "plan.json", b"pivoting"


class PartFiles:
    """The chunks of a sweep that have been run.

    Args:
        out: the file that they make in the end; they are beside it, in a hidden folder of its name.
        plan: what is run, which has to be the same where a sweep is resumed.
        resume: whether chunks that are there are kept.

    Raises:
        ValueError: a sweep was begun there that is not to be resumed, or is another.
        OSError: the folder cannot be written to.
    """

    def __init__(self, out: Path, plan: Mapping[str, Any], resume: bool):
        self._out, self._folder = out, out.with_name(f".{out.name}.parts")
        self._plan = json.loads(json.dumps(plan))
        begun = self._folder / _PLAN
        if begun.exists() and any(self._folder.glob("part-*.parquet")):
            with refused_unless(begun, "the plan of a sweep, whole: remove its folder"):
                then = dict(json.loads(begun.read_text(encoding="utf-8")))
            _refuse_another(begun, then, self._plan, resume)
            return
        if resume and out.exists():
            _refuse_another(out, plan_of(out), self._plan, resume)
            return
        self._folder.mkdir(parents=True, exist_ok=True)
        with whole(begun) as part:
            part.write_text(json.dumps(self._plan) + "\n", encoding="utf-8")

    @property
    def complete(self) -> bool:
        """Whether all chunks are in the file already."""
        return not self._folder.exists()

    def missing(self, chunks: int) -> list[int]:
        """The numbers of the chunks that have still to be run, of so many."""
        return [chunk for chunk in range(chunks) if not self._path(chunk).exists()]

    def write(self, chunk: int, rows: Rows) -> None:
        """Keep the rows of a chunk."""
        with whole(self._path(chunk)) as part:
            parquet.write_table(pyarrow.table(dict(rows)), part)

    def failed(self, chunks: int) -> int:
        """Worlds that failed in the chunks that are there."""
        there = set(range(chunks)) - set(self.missing(chunks))
        return sum(int(np.count_nonzero(~_column(self._path(chunk), "passed"))) for chunk in there)

    def join(self, chunks: int) -> None:
        """Make one file of all of them, in their order, and remove them."""
        with refused_unless(self._path(0), _PART):
            schema = parquet.read_schema(self._path(0)).with_metadata({_KEY: json.dumps(self._plan)})
        with whole(self._out) as part, parquet.ParquetWriter(part, schema) as writer:
            for chunk in range(chunks):
                with refused_unless(self._path(chunk), _PART):
                    rows = parquet.read_table(self._path(chunk)).replace_schema_metadata(schema.metadata)
                    if not rows.schema.equals(schema):
                        raise ValueError("its columns are others")
                writer.write_table(rows)
        shutil.rmtree(self._folder)

    def _path(self, chunk: int) -> Path:
        return self._folder / f"part-{chunk:06d}.parquet"


def plan_of(path: Path) -> dict[str, Any]:
    """What was run of a sweep that has come to its end.

    Raises:
        ValueError: it is no file of a sweep.
    """
    with refused_unless(path, WHOLE):
        return dict(json.loads(parquet.read_schema(path).metadata[_KEY]))


def rows_in(path: Path) -> Rows:
    """All rows of a sweep that has come to its end, by column.

    Raises:
        ValueError: the file is not whole.
    """
    with refused_unless(path, WHOLE):
        return {name: values.to_numpy() for name, values in zip(*_columns(path), strict=True)}


@contextmanager
def refused_unless(path: Path, what: str) -> Iterator[None]:
    """What is raised of a file that is not `what` it should be becomes one error, which names it."""
    try:
        yield
    except (LookupError, TypeError, ValueError, OSError, pyarrow.ArrowException) as error:
        raise InputError(f"{path}: must be {what} ({' '.join(str(error).split())})") from None


def _columns(path: Path) -> tuple[list[str], list[Any]]:
    table = parquet.read_table(path)
    return table.column_names, table.columns


def _column(path: Path, name: str) -> Any:
    with refused_unless(path, _PART):
        return parquet.read_table(path, columns=[name]).column(name).to_numpy()


def _refuse_another(where: Path, then: Mapping[str, Any], now: Mapping[str, Any], resume: bool) -> None:
    """Refuse to go on with a sweep that is another, or that nobody wants to go on with."""
    if not resume:
        raise InputError(f"{where.parent}: a sweep was begun there: resume it, or remove that folder")
    other = [key for key in {**then, **now} if then.get(key) != now.get(key)]
    if other:
        raise InputError(f"{where}: {', '.join(other)} must be as in the sweep that was begun")
