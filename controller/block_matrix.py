"""Sparse matrices of one pattern, filled block by block: what changes from step to step are numbers alone."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.validate import Array
from scipy import sparse

Indices = NDArray[np.int64]


class Part(NamedTuple):
    """S equal blocks: rows (S, r) and columns (S, c) of each, and the mask (r, c) of what may be other than zero."""

    rows: Indices
    columns: Indices
    mask: NDArray[np.bool_]


class Sparse(NamedTuple):
    """A matrix (rows, columns) in compressed columns; half the cost of SciPy's, which checks it anew each time."""

    data: Array
    indices: NDArray[np.int32]
    indptr: NDArray[np.int32]
    shape: tuple[int, int]

    def csc(self) -> Any:
        """The same as a SciPy matrix."""
        return sparse.csc_matrix((self.data, self.indices, self.indptr), shape=self.shape)


class BlockMatrix:
    """The pattern of a sparse matrix made of parts that do not overlap."""

    def __init__(self, shape: tuple[int, int], parts: list[Part]):
        self.shape = shape
        self._masks = [part.mask for part in parts]
        rows, columns, counts = [], [], []
        for part in parts:
            i, j = np.nonzero(part.mask)
            rows.append(part.rows[:, i].ravel())
            columns.append(part.columns[:, j].ravel())
            counts.append(rows[-1].size)
        row, column = np.concatenate(rows), np.concatenate(columns)
        order = np.lexsort((row, column))
        self._indices = row[order].astype(np.int32)
        self._indptr = np.concatenate([[0], np.cumsum(np.bincount(column, minlength=shape[1]))]).astype(np.int32)
        slots = np.empty(len(order), dtype=np.int64)
        slots[order] = np.arange(len(order))
        self._slots = np.split(slots, np.cumsum(counts)[:-1])
        self._entries = [np.flatnonzero(mask) for mask in self._masks]

    def filled(self, values: list[Array]) -> Sparse:
        """The matrix, from one array (S, r, c) for each part."""
        data = np.empty(len(self._indices))
        for slots, entries, mask, block in zip(self._slots, self._entries, self._masks, values, strict=True):
            if len(entries):  # no blocks at all, where N = 1 and they belong to the step before, are (0, r c)
                data[slots] = block.reshape(-1, mask.size)[:, entries].ravel()
        return Sparse(data, self._indices, self._indptr, self.shape)
