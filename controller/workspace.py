"""Scratch of the compiled solvers, made once for a problem size: they allocate nothing."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.validate import Array

P, Q, DP, DQ, C = 0, 1, 2, 3, 4  # columns of `Work.floor`


class Reduced(NamedTuple):
    """Scratch for one contact in the plane, n = 2.

    H: (n, n) and h: (n,) of the problem in f alone.  x: (n,).  pull: (2, nw), Q_w w and |Q_w||w|.
    """

    H: Array
    h: Array
    x: Array
    pull: Array


class Work(NamedTuple):
    """Scratch for all other problems: K contacts, n = K d."""

    axes: tuple[int, ...]  # (0, ..., d - 1): its length makes d a constant when compiled
    H: Array  # (n, n) and (n,): the problem in f alone
    h: Array
    M: Array  # (n, n): the matrix being factored
    x: Array  # (n,): right-hand side and step
    z: Array  # (n,): gradient
    moved: Array  # (n,): forces before a step
    now: Array  # (n,): iterate
    g: Array  # (n,): H f - h at the iterate
    trial_f: Array  # (n,) and (nw,): an answer that may be better
    trial_w: Array
    pull: Array  # (2, nw): Q_w w, and |Q_w||w|
    tangent: Array  # (n, d)
    start: NDArray[np.int64]  # (K + 1,)
    piece: NDArray[np.int64]  # (K,)
    s: Array  # (K, 3): slack of the cones, (mu f_n, f_t, f_o); f_o = 0 in the plane
    y: Array  # (K, 3): its multiplier
    bar: Array  # (K, 4): scaling point and eta, see `scaling`
    lam: Array  # (K, 4): scaled slack, which is also the scaled multiplier, and its determinant
    u: Array  # (K, 3): scaled step of the slack
    c: Array  # (K, 3): scaled corrector
    floor: Array  # (K, 5): slack p = f_n - f_min, its multiplier q, dp, dq, corrector


def workspace(nw: int, K: int, dim: int) -> tuple[tuple[Any, ...] | None, tuple[Any, ...] | None]:
    """Scratch for `planar_wrench`, or else for `contact_wrench`: the values of a `Reduced` or of a `Work`.

    One contact in the plane needs no more than the reduced problem. None tells the compiler which of the two to leave
    out, and that is most of its work. Plain tuples, because handing over a named one costs 0.16 us for each array.
    """
    n = K * dim
    if n == 2:
        return tuple(Reduced(np.zeros((n, n)), np.zeros(n), np.zeros(n), np.zeros((2, nw)))), None
    vectors = {name: np.zeros(n) for name in ("h", "x", "z", "moved", "now", "g", "trial_f")}
    triples = {name: np.zeros((K, 3)) for name in ("s", "y", "u", "c")}
    return None, tuple(
        Work(
            axes=tuple(range(dim)),
            **vectors,
            **triples,
            H=np.zeros((n, n)),
            M=np.zeros((n, n)),
            trial_w=np.zeros(nw),
            pull=np.zeros((2, nw)),
            tangent=np.zeros((n, dim)),
            start=np.zeros(K + 1, dtype=np.int64),
            piece=np.zeros(K, dtype=np.int64),
            bar=np.zeros((K, 4)),
            lam=np.zeros((K, 4)),
            floor=np.zeros((K, 5)),
        )
    )
