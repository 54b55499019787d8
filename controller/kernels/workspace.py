"""The scratch arrays of the compiled solvers, which are made once for a problem size: the solvers allocate nothing."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.kernels.compilation import subroutine
from pivoting.controller.validate import Array

MEMBERS = 32  # at the ends of the intervals of an uncertain set: mass, inertia and three of the centre of mass
P, Q, DP, DQ, C = 0, 1, 2, 3, 4  # columns of `Work.floor`


class Reduced(NamedTuple):
    """Scratch for one contact in the plane, n = 2.

    H: (n, n) and h: (n,) of the problem in f alone.  x: (n,).  pull: (2, nw) for Q_w w and |Q_w||w|.
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
    piece: NDArray[np.int64]  # (K,) and one more
    s: Array  # (K, 3): slack of the cones, (mu f_n, f_t, f_o); f_o = 0 in the plane
    y: Array  # (K, 3): its multiplier
    bar: Array  # (K, 4): scaling point and eta, see `scaling`
    lam: Array  # (K, 4): scaled slack, which is also the scaled multiplier, and its determinant
    u: Array  # (K, 3): scaled step of the slack
    c: Array  # (K, 3): scaled corrector
    floor: Array  # (K, 5): slack p = f_n - f_min, its multiplier q, dp, dq, corrector
    of: NDArray[np.int64]  # (M,): the contact of each cone, of which there are M >= K; all (K, .) from s on are (M, .)
    tip: Array  # (M, 3): the apex of each cone, (f_n, f_t, f_o)
    kept: Array  # (M, 3) and (K,): the multipliers of cones and floors that belong to the best iterate
    kept_floor: Array


def workspace(nw: int, K: int, dim: int) -> tuple[tuple[Any, ...] | None, tuple[Any, ...] | None]:
    """The scratch for one problem size: for `planar_wrench` the values of a `Reduced`, else that of `contact_wrench`.

    The latter is unpacked by `opened`. One contact in the plane needs only the reduced problem. The one that is not
    needed is None, which tells the compiler to leave it out, and this saves most of its work. The arrays are few and
    in plain tuples, because passing each of them costs 0.07 us, and 0.16 us in a named tuple.
    """
    n = K * dim
    if n == 2:
        return tuple(Reduced(np.zeros((n, n)), np.zeros(n), np.zeros(n), np.zeros((2, nw)))), None
    return None, several_workspace(nw, K, dim)


def several_workspace(nw: int, K: int, dim: int, cones: int = 1) -> tuple[Any, ...]:
    """The scratch of `contact_wrench`, and of `guarded_wrench` with so many `cones` at each contact."""
    n, M, axes, counts = K * dim, K * cones, tuple(range(dim)), np.zeros((2, K + 1), dtype=np.int64)
    squares, vectors, tangent = np.zeros((2, n, n)), np.zeros((8, n)), np.zeros((n, dim))
    wrenches, triples, fours, floor = np.zeros((3, nw)), np.zeros((6, M, 3)), np.zeros((2, M, 4)), np.zeros((K, 5))
    of = np.arange(M, dtype=np.int64) % K
    return axes, squares, vectors, wrenches, tangent, counts, triples, fours, floor, of


@subroutine
def opened(scratch, cones):  # type: ignore[no-untyped-def]
    """The `Work` in a scratch of `workspace`, for so many cones, M."""
    axes, squares, vectors, wrenches, tangent, counts, triples, fours, floor, of = scratch
    return Work(
        axes, squares[0], vectors[0], squares[1], vectors[1], vectors[2], vectors[3], vectors[4], vectors[5],
        vectors[6], wrenches[0], wrenches[1:], tangent, counts[0], counts[1], triples[0, :cones], triples[1, :cones],
        fours[0, :cones], fours[1, :cones], triples[2, :cones], triples[3, :cones], floor, of[:cones],
        triples[4, :cones], triples[5, :cones], vectors[7],
    )  # fmt: skip


class Guard(NamedTuple):
    """Scratch for cones that are moved; the problem is stated from the apex of one cone at each contact, the tip."""

    tip: Array  # (n,)
    floor: Array  # (K,): floors, from 0
    height: Array  # (K,): floors, from the tip
    left: Array  # (nw,): the wrench that is required beside forces at the tips
    linear: Array  # (n,): the linear cost of what the forces are more than that
    apex: Array  # (V, K, d): of all members, `MEMBERS`, or of one contact in the plane the one that they have in common
    chosen: NDArray[np.int64]  # (K,): the member that decides at each contact
    corner: Array  # (4, 2) and (3, 2): see `worst_planar_force`
    ends: Array
    place: Array  # (5,), (4, 3), (K, 5, 3), (3, 3), (K, d), (K, 2): see `worst_member_forces`
    state: Array
    frame: Array
    tensor: Array
    force: Array
    lifted: Array


def guard(nw: int, K: int, dim: int) -> Guard:
    """The scratch for one problem size."""
    n, members = K * dim, 1 if K * dim == 2 else MEMBERS
    first, rest = ((n,), (K,), (K,), (nw,), (n,), (members, K, dim)), ((4, 2), (3, 2), (5,), (4, 3), (K, 5, 3), (3, 3))
    arrays = (np.zeros(shape) for shape in (*rest, (K, dim), (K, 2)))
    return Guard._make([*map(np.zeros, first), np.zeros(K, dtype=np.int64), *arrays])
