"""Checks of what users hand in: one error that names the argument, its value and what is allowed."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class InputError(ValueError):
    """An argument that cannot be used; the message names it, its value and what is allowed."""


def fail(name: str, value: object, allowed: str) -> InputError:
    """The error for an argument `name` whose `value` is not `allowed`."""
    shown = str(value.tolist()) if isinstance(value, np.ndarray) else repr(value)
    return InputError(f"{name} = {shown if len(shown) < 120 else shown[:117] + '...'}: must be {allowed}")


def array(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> Array:
    """A read-only float copy of `value`, finite and of `shape` (None: any length)."""
    wanted = "(" + ", ".join("any" if n is None else str(n) for n in shape) + ")"
    try:
        given = np.asarray(value)
    except ValueError:  # ragged
        raise fail(name, value, f"an array of numbers of shape {wanted}") from None
    if given.dtype.kind not in "iuf":  # not bool, text, complex, object
        raise fail(name, value, f"an array of real numbers of shape {wanted}")
    out = np.array(given, dtype=float)
    if out.ndim != len(shape) or any(n not in (None, m) for n, m in zip(shape, out.shape, strict=True)):
        raise fail(name, value, f"of shape {wanted}, not {out.shape}")
    if not np.isfinite(out).all():
        raise fail(name, value, "finite")
    out.flags.writeable = False
    return out


def unit_quaternions(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> Array:
    """The same for quaternions of unit length, the last axis of `shape`, to 1e-6."""
    out = array(name, value, shape)
    if (np.abs(np.sqrt((out * out).sum(axis=-1)) - 1.0) > 1e-6).any():
        raise fail(name, out, "a unit quaternion (w, x, y, z)" + (" in each row" if out.ndim > 1 else ""))
    return out


def number(
    name: str,
    value: float,
    *,
    above: float = -np.inf,
    below: float = np.inf,
    at_least: float = -np.inf,
    at_most: float = np.inf,
    unit: str = "",
) -> float:
    """A finite float inside the given open (`above`, `below`) and closed (`at_least`, `at_most`) bounds."""
    bounds = [
        f"{word} {bound:g}"
        for word, bound in ((">", above), ("<", below), (">=", at_least), ("<=", at_most))
        if np.isfinite(bound)
    ]
    allowed = "a finite number" + (f" {' and '.join(bounds)}" if bounds else "") + (f" [{unit}]" if unit else "")
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        raise fail(name, value, allowed)
    if not (np.isfinite(value) and above < value < below and at_least <= value <= at_most):
        raise fail(name, float(value), allowed)
    return float(value)


def positive_definite(name: str, value: ArrayLike, size: int) -> Array:
    """A symmetric positive definite (size, size) matrix; raises and shows the least eigenvalue if it is not."""
    matrix = array(name, value, (size, size))
    if np.abs(matrix - matrix.T).max() > 1e-9 * np.abs(matrix).max():
        raise fail(name, matrix, "symmetric")
    least = float(np.linalg.eigvalsh(matrix)[0])
    if least <= 0.0:
        raise fail(name, matrix, f"positive definite (its least eigenvalue is {least:.3g})")
    return matrix


def one_of(name: str, value: object, allowed: tuple[str, ...]) -> None:
    """Raise unless `value` is one of the `allowed` words."""
    if value not in allowed:
        raise fail(name, value, "one of " + ", ".join(allowed))
