"""Sparse matrices with a fixed pattern, filled block by block: only their numbers change from step to step."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.kernels.compilation import kernel
from pivoting.controller.validate import Array
from scipy import sparse

Indices = NDArray[np.int64]


class Part(NamedTuple):
    """S blocks of one shape, at rows (S, r) and columns (S, c); the mask (r, c) marks entries that may be nonzero.

    still: (r, c) numbers that are the same in all blocks and never change; None if the numbers change.
    """

    rows: Indices
    columns: Indices
    mask: NDArray[np.bool_]
    still: Array | None = None


class Sparse(NamedTuple):
    """A matrix in compressed columns; it costs half as much as SciPy's, which checks its arrays each time."""

    data: Array
    indices: NDArray[np.int32]
    indptr: NDArray[np.int32]
    shape: tuple[int, int]

    def csc(self) -> Any:
        """The same as a SciPy matrix."""
        return sparse.csc_matrix((self.data, self.indices, self.indptr), shape=self.shape)

    def dense(self, *, mirrored: bool = False) -> Array:
        """The same as an array (rows, columns); with `mirrored`, the symmetric matrix whose upper triangle this is."""
        out = np.zeros(self.shape)
        _fill_dense(self.data, self.indices, self.indptr, mirrored, out)
        return out


class BlockMatrix:
    """A sparse matrix made of parts that do not overlap: its pattern, and those of its numbers that never change."""

    def __init__(self, shape: tuple[int, int], parts: list[Part]):
        self.shape = shape
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
        self._data = np.zeros(len(order))
        self._slots: tuple[Indices, ...] = ()  # of each part that changes: (S, entries of a block)
        self._entries: tuple[Indices, ...] = ()  # of a block
        for part, where in zip(parts, np.split(slots, np.cumsum(counts)[:-1]), strict=True):
            entries = np.flatnonzero(part.mask)
            where = where.reshape(len(part.rows), len(entries))
            if part.still is None:
                self._slots, self._entries = (*self._slots, where), (*self._entries, entries)
            else:
                self._data[where] = part.still.ravel()[entries]

    def filled(self, values: tuple[Array, ...]) -> Sparse:
        """The matrix with the numbers of one array (S, r, c) for each part that changes."""
        data = self._data.copy()
        if len(values) != len(self._slots):
            raise ValueError(f"{len(values)} arrays for {len(self._slots)} parts that change")
        for slots, entries, blocks in zip(self._slots, self._entries, values, strict=True):
            _scatter(slots, entries, blocks, data)
        return Sparse(data, self._indices, self._indptr, self.shape)


@kernel
def _scatter(slots, entries, blocks, data):  # type: ignore[no-untyped-def]
    """Write the entries (e,) of blocks (S, r, c) into data at slots (S, e)."""
    width = blocks.shape[2]
    for s in range(slots.shape[0]):
        for e in range(slots.shape[1]):
            data[slots[s, e]] = blocks[s, entries[e] // width, entries[e] % width]


@kernel
def _fill_dense(data, indices, indptr, mirrored, out):  # type: ignore[no-untyped-def]
    for j in range(out.shape[1]):
        for k in range(indptr[j], indptr[j + 1]):
            out[indices[k], j] = data[k]
            if mirrored:
                out[j, indices[k]] = data[k]
