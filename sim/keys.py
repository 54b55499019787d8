"""The keys of a scenario: what each may be, and reading them from the command line's text."""

from typing import Any

from pivoting.controller.validate import fail
from pivoting.models.scenes import WORLD_KEYS

HIDDEN_KEYS = ("mu", "mass", "size", "incline", "gravity")  # what the world may have and the controller not know
BOUND_KEYS = ("force_max", "moment_max", "force_rate", "moment_rate")
CONTROL_KEYS = ("law", "bandwidth", "damping", "margin", "f_min", "length")  # of the controller alone
LOWEST = 0.1  # [deg] from a face: closer, the next corner touches the table too
OPTIONAL = ("length", "plan_hz", *BOUND_KEYS, *WORLD_KEYS)  # None: as the scene or the contact has it
_POSITIVE = {"above": 0.0}
RANGES: dict[str, dict[str, Any]] = {
    "mu": {**_POSITIVE, "at_most": 10.0},
    "mass": {**_POSITIVE, "at_most": 1e6, "unit": "kg"},
    "size": {**_POSITIVE, "at_most": 1e3, "unit": "m"},
    "incline": {"above": -90.0, "below": 90.0, "unit": "deg"},
    "gravity": {"at_least": 0.0, "at_most": 1e3, "unit": "m/s^2"},
    "dt": {**_POSITIVE, "at_most": 0.1, "unit": "s"},
    "timeconst": {**_POSITIVE, "at_most": 1.0, "unit": "s"},
    "impedance": {**_POSITIVE, "below": 1.0},
    "impratio": {**_POSITIVE, "at_most": 1e9},
    "theta": {"at_least": LOWEST, "at_most": 90.0 - LOWEST, "unit": "deg"},
    "theta_end": {"at_least": LOWEST, "at_most": 90.0 - LOWEST, "unit": "deg"},
    "seconds": {**_POSITIVE, "at_most": 3600.0, "unit": "s"},
    "hold": {"at_least": 0.0, "at_most": 3600.0, "unit": "s"},
    "amplitude": {"at_least": 0.0, "below": 45.0, "unit": "deg"},
    "period": {**_POSITIVE, "at_most": 3600.0, "unit": "s"},
    "bandwidth": {**_POSITIVE, "at_most": 1e5, "unit": "rad/s"},
    "damping": {**_POSITIVE, "at_most": 100.0},
    "margin": {"at_least": 0.0, "below": 1.0},
    "f_min": {"at_least": 0.0, "at_most": 1e9, "unit": "N"},
    "length": {**_POSITIVE, "at_most": 1e6, "unit": "m"},
    "force_max": {**_POSITIVE, "at_most": 1e9, "unit": "N"},
    "moment_max": {**_POSITIVE, "at_most": 1e9, "unit": "N m"},
    "force_rate": {**_POSITIVE, "at_most": 1e12, "unit": "N/s"},
    "moment_rate": {**_POSITIVE, "at_most": 1e12, "unit": "N m/s"},
    "plan_hz": {**_POSITIVE, "at_most": 1e4, "unit": "Hz"},
    "plan_steps": {"at_least": 1, "at_most": 1000},
    "plan_step": {**_POSITIVE, "at_most": 10.0, "unit": "s"},
    "track": {**_POSITIVE, "at_most": 1e12},
    "spread": {"at_least": 0.0, "at_most": 10.0, "unit": "deg"},
}


WHOLE = ("plan_steps",)
WORDS = ("reference", "law", "integrator")
KEYS = (*WORDS, *RANGES)


def parsed(key: str, value: Any, prefix: str = "") -> Any:
    """The value of a key, from the command line's text if need be.

    Raises:
        ValueError: text that is no number, where one is asked for.
    """
    if key in WORDS:
        return value
    if isinstance(value, str):
        try:
            read = float(value)
        except ValueError:
            raise fail(prefix + key, value, "a number") from None
        return int(read) if key in WHOLE and read.is_integer() else read
    return value
