"""Cholesky factors of small dense systems, in place and without allocation: the inner loop of the contact solvers."""

import numpy as np
from pivoting.controller.kernels.compilation import subroutine

TINY = 1e-14  # least pivot, relative to its diagonal entry: a matrix that rounding made indefinite stays usable


@subroutine
def factor(M, n):  # type: ignore[no-untyped-def]
    """Factor M = U'U: overwrite the upper triangle of the leading (n, n) block of M with U.

    It works by rows, which vectorises. The diagonal of U is stored inverted. A nan stays nan.
    """
    for k in range(n):
        pivot = M[k, k]
        inverse = 1.0 / np.sqrt(pivot)
        M[k, k] = inverse
        for j in range(k + 1, n):
            M[k, j] *= inverse
        for i in range(k + 1, n):
            before, scale = M[i, i], M[k, i]
            for j in range(i, n):
                M[i, j] -= scale * M[k, j]
            if M[i, i] < TINY * before:
                M[i, i] = TINY * before


@subroutine
def solve_factored(U, x, n):  # type: ignore[no-untyped-def]
    """Solve with the factor U of `factor`: overwrite the right-hand side x (n,) with the solution."""
    for k in range(n):
        x[k] *= U[k, k]
        value = x[k]
        for j in range(k + 1, n):
            x[j] -= U[k, j] * value
    for k in range(n - 1, -1, -1):
        value = x[k]
        for j in range(k + 1, n):
            value -= U[k, j] * x[j]
        x[k] = value * U[k, k]
