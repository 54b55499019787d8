"""Reading rerun recordings back."""

from pathlib import Path
from typing import Any

import numpy as np
from rerun.chunk import RrdReader

Columns = dict[str, Any]


def read(path: Path) -> dict[str, Columns]:
    """Entity -> column -> instances of each row, or the times; "static ..." is one row for ever."""
    out: dict[str, Columns] = {}
    for chunk in RrdReader(path).stream():
        columns = out.setdefault(str(chunk.entity_path), {})
        batch = chunk.to_record_batch()
        for name in batch.schema.names[1:]:  # the first is the row's id
            key = f"static {name}" if chunk.is_static else name
            assert key not in columns or columns[key].equals(batch.column(name))  # one chunk each, on the same times
            columns[key] = batch.column(name)
    return out


def one_each(column: Any) -> np.ndarray:
    """The instances (R, ...) of a column that has one in every row."""
    rows = column.to_pylist()
    assert all(len(row) == 1 for row in rows)
    return np.array([row[0] for row in rows])


def steps(columns: Columns) -> np.ndarray:
    return columns["step"].to_numpy()
