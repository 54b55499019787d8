"""A user's own table, read from a CSV or Parquet file: its columns as numbers, or one clear error."""

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.learning.motion_log import CONTACT as CONTACT_WORDS
from pivoting.controller.validate import Array, InputError, in_one_line, shown
from pivoting.sim.identification.log_columns import CONTACT, Column

ENDINGS = (".csv", ".parquet")


class LogTable:
    """The rows of a file.

    Args:
        path: of a .csv file, with the columns' names in its first line, or a .parquet file.

    Raises:
        ValueError: it is no such file, or has fewer than three rows.
        OSError: it cannot be read.
    """

    def __init__(self, path: Path):
        self.path = path
        self._columns: Mapping[str, Any] = _read_csv(path) if path.suffix.lower() == ".csv" else _read_parquet(path)
        self.rows = max((len(values) for values in self._columns.values()), default=0)
        if self.rows < 3:
            raise InputError(f"{path}: has {self.rows} rows; must have at least 3")

    def has(self, column: Column) -> bool:
        """Whether all of its columns are there.

        Raises:
            ValueError: some are, and others are not.
        """
        missing = [name for name in column.names if name not in self._columns]
        if 0 < len(missing) < len(column.names):
            raise InputError(f"{self.path}: has no column {missing[0]}, which belongs to {_listed(column.names)}")
        return not missing

    def need(self, *choices: Column) -> Column:
        """The first of these that is there.

        Raises:
            ValueError: none is; it says what there is.
        """
        for column in choices:
            if self.has(column):
                return column
        wanted = " or ".join(_listed(column.names) for column in choices)
        raise InputError(
            f"{self.path}: has no column {wanted} ({choices[0].what}); its columns are {_listed(tuple(self._columns))}"
        )

    def values(self, column: Column, *, rows: int | None = None, gaps: bool = False) -> Array:
        """(rows, n) numbers in SI units; of one column (rows,).

        Args:
            rows: that count; by default all.  gaps: whether empty values, which are nan, are allowed.

        Raises:
            ValueError: a value is not a finite number; its row is named.
        """
        found = np.column_stack([self._numbers(name)[:rows] for name in column.names])
        bad = np.argwhere(~np.isfinite(found) & ~(np.isnan(found) if gaps else False))
        if len(bad):
            row, which = bad[0].tolist()
            raise InputError(
                f"{self.path}: row {row + 1} of {column.names[which]} is {found[row, which]}; must be a finite number"
            )
        return column.scale * (found[:, 0] if len(column.names) == 1 else found)

    def contact(self) -> NDArray[np.int8] | None:
        """(rows - 1,) codes of what the contact does; None: the table does not say."""
        if not self.has(CONTACT):
            return None
        words = [str(word).strip() for word in self._columns[CONTACT.names[0]][: self.rows - 1]]
        for row, word in enumerate(words):
            if word not in CONTACT_WORDS:
                allowed = f"one of {_listed(CONTACT_WORDS)}"
                raise InputError(f"{self.path}: row {row + 1} of contact is {word!r}; must be {allowed}")
        return np.array([CONTACT_WORDS.index(word) for word in words], np.int8)

    def _numbers(self, name: str) -> Array:
        values = self._columns[name]
        if isinstance(values, np.ndarray) and values.dtype.kind in "iuf":
            return values.astype(float)
        found = np.empty(len(values))
        for row, value in enumerate(values):
            try:
                found[row] = float("nan" if value is None or value == "" else value)
            except (TypeError, ValueError):
                raise InputError(f"{self.path}: row {row + 1} of {name} is {shown(value)}; must be a number") from None
        return found


def _listed(names: tuple[str, ...]) -> str:
    return ", ".join(map(in_one_line, names[:24])) + ", ..." * (len(names) > 24)


def _read_csv(path: Path) -> dict[str, list[str]]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = [row for row in csv.reader(file, strict=True) if row]
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: is no CSV file ({error})") from None
    names = [name.strip() for name in rows[0]] if rows else []
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"{path}: has two columns {twice!r}")
    for number, row in enumerate(rows[1:], 1):
        if len(row) != len(names):
            raise InputError(
                f"{path}: row {number} has {len(row)} values; must have one for each of {len(names)} columns"
            )
    return {name: [row[i].strip() for row in rows[1:]] for i, name in enumerate(names)}


def _read_parquet(path: Path) -> dict[str, NDArray[np.float64]]:
    with path.open("rb"):
        pass  # an OSError of ours, not one of what follows
    try:
        import pandas
    except ModuleNotFoundError:
        told = "needs pandas, which is not installed; the extra has it: pip install 'pivoting[data]'"
        raise InputError(f"{path}: a Parquet file {told}") from None
    try:
        frame = pandas.read_parquet(path)
    except Exception as error:  # each engine has its own for what is no such file
        raise InputError(f"{path}: is no Parquet file ({' '.join(str(error).split())})") from None
    return {str(name): frame[name].to_numpy() for name in frame.columns}
