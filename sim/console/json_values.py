"""Values as JSON can say them."""

from typing import Any

import numpy as np


def jsonable(value: Any) -> Any:
    """`value` with NumPy scalars as numbers and what is not finite as null: JSON has no nan."""
    if isinstance(value, dict):
        return {key: jsonable(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [jsonable(item) for item in value]
    if isinstance(value, np.generic):
        return jsonable(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
