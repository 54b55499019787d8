"""Checks of arguments; their error names the argument, its value and what is allowed."""

from math import hypot
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pivoting.errors import PivotingError

Array = NDArray[np.float64]
MOST = int(np.finfo(float).max)
AnyArray = TypeVar("AnyArray", bound=NDArray[Any])


class InputError(PivotingError, ValueError):
    """An argument that cannot be used; the message names it, its value and what is allowed."""


def fail(name: str, value: object, allowed: str) -> InputError:
    """The error to raise for an argument `name` whose `value` is not `allowed`."""
    return InputError(f"{in_one_line(name)} = {shown(value)}: must be {allowed}")


def shown(value: object) -> str:
    """A value as an error shows it: in one line, and cut off where it is long."""
    text = " ".join((str(value.tolist()) if isinstance(value, np.ndarray) else repr(value)).splitlines())
    return text if len(text) < 120 else text[:117] + "..."


def in_one_line(name: str) -> str:
    """A name, which may be a user's own, as an error shows it."""
    return name if name.isprintable() else repr(name)


def frozen(values: AnyArray) -> AnyArray:
    """An array, made read-only: what is handed on is not changed by whoever gets it."""
    values.flags.writeable = False
    return values


def array(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> Array:
    """A read-only float copy of `value`, finite and of `shape` (None: any length)."""
    try:
        given = np.asarray(value)
    except ValueError:  # ragged
        raise fail(name, value, f"an array of numbers of shape {_shown(shape)}") from None
    if given.dtype.kind not in "iuf":  # not bool, text, complex, object
        raise fail(name, value, f"an array of real numbers of shape {_shown(shape)}")
    out = np.array(given, dtype=float, order="C")  # of any other order numba would compile everything anew
    if out.shape != shape and (
        out.ndim != len(shape) or any(n not in (None, m) for n, m in zip(shape, out.shape, strict=True))
    ):
        raise fail(name, value, f"of shape {_shown(shape)}, not {out.shape}")
    if not np.isfinite(out).all():
        raise fail(name, value, "finite")
    return frozen(out)


def dimensions(value: object) -> int:
    """How many dimensions an array of `value` would have; -1 of what is ragged, and none."""
    try:
        return np.ndim(value)  # type: ignore[arg-type]
    except ValueError:
        return -1


def for_each(name: str, value: ArrayLike, count: int) -> Array:
    """A read-only (count,) of `value`, which is one number for all or one for each."""
    return array(name, np.broadcast_to(value, (count,)) if dimensions(value) == 0 else value, (count,))


def _shown(shape: tuple[int | None, ...]) -> str:
    return "(" + ", ".join("any" if n is None else str(n) for n in shape) + ")"


def unit_quaternions(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> Array:
    """A read-only copy of quaternions, along the last axis of `shape`, whose length is 1 to within 1e-6."""
    out = array(name, value, shape)
    length = np.array(hypot(*out.tolist())) if out.ndim == 1 else np.linalg.norm(out, axis=-1)
    if np.abs(length - 1.0).max(initial=0.0) > 1e-6:
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
    real = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
    if isinstance(value, int):  # of which NumPy takes only those that its integers hold
        if abs(value) > MOST:
            raise fail(name, value, "a number that a float can hold")
        value = value if isinstance(value, bool) else float(value)
    if not (real and np.isfinite(value) and above < value < below and at_least <= value <= at_most):
        limits = ((">", above), ("<", below), (">=", at_least), ("<=", at_most))
        bounds = " and ".join(f"{word} {bound:g}" for word, bound in limits if np.isfinite(bound))
        allowed = "a finite number" + (f" {bounds}" if bounds else "") + (f" [{unit}]" if unit else "")
        raise fail(name, float(value) if real else value, allowed)
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
    if not isinstance(value, str) or value not in allowed:
        raise fail(name, value, "one of " + ", ".join(allowed))
