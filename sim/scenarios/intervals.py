"""Values that may be an interval: "0.8:1.2" or (0.8, 1.2), where it is not known exactly what the object has."""

from typing import Any

import numpy as np
from pivoting.controller.uncertainty.uncertainty import Interval
from pivoting.controller.validate import fail

KIND = "a number, or an interval LOW:HIGH"


def read_interval(name: str, value: Any) -> Any:
    """The interval that a text "LOW:HIGH" or a pair stands for; anything else as it is.

    Raises:
        ValueError: the ends are no numbers, or LOW is more than HIGH; it is named.
    """
    ends = value.split(":") if isinstance(value, str) and ":" in value else value
    if not isinstance(ends, list | tuple | np.ndarray) or isinstance(value, Interval):
        return value
    try:
        low, high = (float(end) for end in ends)
    except (TypeError, ValueError):
        raise fail(name, value, KIND) from None
    if not low <= high:
        raise fail(name, value, "an interval LOW:HIGH with LOW <= HIGH")
    return Interval(low, high)


def middle(value: Any) -> Any:
    """Halfway through an interval; a number as it is."""
    return value.middle if isinstance(value, Interval) else value


def spelled(value: Any) -> Any:
    """An interval as the command line has it; anything else as it is."""
    return f"{value.low!r}:{value.high!r}" if isinstance(value, Interval) else value
