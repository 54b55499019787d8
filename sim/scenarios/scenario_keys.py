"""The keys of a scenario, each declared once: what it means, what it may be, who may know it, and how it is read."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pivoting.controller.control_laws import FORMULATIONS
from pivoting.controller.planning.equations_of_motion import INTEGRATORS
from pivoting.controller.validate import fail, number, one_of
from pivoting.sim.scenarios.relative_values import MEANING, multiple

LOWEST = 0.1  # [deg] from a face: closer, the next corner touches the table too


@dataclass(frozen=True)
class Key:
    """What a key means and may be.

    Attributes:
        help: what it is.
        of: whose it is, of `GROUPS`.
        unit: of a number.
        limits: of a number, see `validate.number`.
        optional: what it means to leave it out (None), in words; "" of one that has to be there.
        whole: whether it is a whole number.
        relative: what it may be relative to, "w" or "T", see `relative_values.MEANING`.
        words: what it may be, if it is a word.
    """

    help: str
    of: str
    unit: str = ""
    limits: Mapping[str, float] = field(default_factory=dict)
    optional: str = ""
    whole: bool = False
    relative: str = ""
    words: tuple[str, ...] = ()

    @property
    def allowed(self) -> str:
        """What it may be, in a few words."""
        if self.words:
            return ", ".join(self.words)
        signs = {"above": ">", "at_least": ">=", "below": "<", "at_most": "<="}
        within = " and ".join(f"{signs[bound]} {value:g}" for bound, value in self.limits.items())
        return within + (f" {self.unit}" if self.unit else "") + (f", or 2{self.relative}" if self.relative else "")

    @property
    def kind(self) -> str:
        """What is asked for, where it is not given."""
        return "a number" + (f", or in {MEANING[self.relative]}" if self.relative else "")


# Whose a key is.
OBJECT = "the object and its support, and what is believed of them; as world.KEY of the world alone"
SIMULATOR = "the simulator"
REFERENCE = "the reference"
CONTROLLER = "the controller"
BOUNDS = "bounds on the wrench, in object axes"
HORIZON = "a receding horizon"
GROUPS = (OBJECT, REFERENCE, CONTROLLER, BOUNDS, HORIZON, SIMULATOR)

SCENE = "as the scene has it"
STEP = "as the scene has it, for a large object of your own finer"
CLOSED = "what keeps the contact closed as it turns"
_WEIGHT = {"at_least": 0.0}
_POSITIVE = {"above": 0.0}  # masses, and forces, which go with the weight: objects may be as large as they are
_SLOPE, _ANGLE = {"above": -90.0, "below": 90.0}, {"at_least": LOWEST, "at_most": 90.0 - LOWEST}


def _from_0_to(most: float) -> dict[str, float]:
    return {"at_least": 0.0, "at_most": most}


def _to(most: float) -> dict[str, float]:
    return {"above": 0.0, "at_most": most}


KEYS = {
    "reference": Key(
        "stay at theta, go to theta_end, also come back, or swing about theta", REFERENCE,
        words=("constant", "arc", "return", "sine"),
    ),
    "law": Key("from the error of the pose to the wrench", CONTROLLER, words=FORMULATIONS),
    "integrator": Key("of the motion, step by step", HORIZON, words=tuple(INTEGRATORS)),
    "mu": Key("friction between them", OBJECT, "", _to(10.0), optional=SCENE),
    "mass": Key("of the object", OBJECT, "kg", _POSITIVE, optional=SCENE),
    "size": Key("longest side of the object, a box", OBJECT, "m", _to(1e3), optional=SCENE),
    "incline": Key("angle by which the support rises to the right", OBJECT, "deg", _SLOPE, optional=SCENE),
    "gravity": Key("its size; it points as in the file", OBJECT, "m/s^2", _from_0_to(1e3), optional=SCENE),
    "dt": Key("time step", SIMULATOR, "s", _to(0.1), optional=STEP),
    "timeconst": Key("time constant of the contact", SIMULATOR, "s", _to(1.0), optional="2.1 dt"),
    "impedance": Key("of the contact (solimp)", SIMULATOR, "", {"above": 0.0, "below": 1.0}, optional=SCENE),
    "impratio": Key("how much stiffer the contact is along the support", SIMULATOR, "", _to(1e9), optional=SCENE),
    "theta": Key("angle at which the object starts (one of your own: as its shape allows)", REFERENCE, "deg", _ANGLE),
    "theta_end": Key("angle to which an arc leads (likewise)", REFERENCE, "deg", _ANGLE),
    "seconds": Key("duration of each arc, or of the run", REFERENCE, "s", _to(3600.0), relative="T"),
    "hold": Key("rest before and after each arc", REFERENCE, "s", _from_0_to(3600.0), relative="T"),
    "amplitude": Key("of the swing of a sine", REFERENCE, "deg", {"at_least": 0.0, "below": 45.0}),
    "period": Key("of a sine", REFERENCE, "s", _to(3600.0), relative="T"),
    "bandwidth": Key("of the law; of a quasi-dynamic one 1/h", CONTROLLER, "rad/s", _to(1e5)),
    "damping": Key("ratio of the law", CONTROLLER, "", _to(100.0)),
    "margin": Key("share of the friction that is kept unused", CONTROLLER, "", {"at_least": 0.0, "below": 1.0}),
    "f_min": Key(
        "floor of each contact's normal force (of an object of your own what keeps it closed)", CONTROLLER, "N",
        _WEIGHT, optional=CLOSED, relative="w",
    ),
    "length": Key("lever at which moments cost as forces do", CONTROLLER, "m", _to(1e6), optional="to the CoM"),
    "force_max": Key("greatest force", BOUNDS, "N", _POSITIVE, optional="none", relative="w"),
    "moment_max": Key("greatest moment", BOUNDS, "N m", _POSITIVE, optional="none", relative="w"),
    "force_rate": Key("fastest change of the force", BOUNDS, "N/s", _POSITIVE, optional="none", relative="w"),
    "moment_rate": Key("fastest change of the moment", BOUNDS, "N m/s", _POSITIVE, optional="none", relative="w"),
    "plan_hz": Key("how often it is planned", HORIZON, "Hz", _to(1e4), optional="never"),
    "plan_steps": Key("how many steps a plan has", HORIZON, "", {"at_least": 1, "at_most": 1000}, whole=True),
    "plan_step": Key("duration of one of them", HORIZON, "s", _to(10.0), relative="T"),
    "track": Key("what an error of one radian or one lever costs, in squares of the weight", HORIZON, "", _to(1e12)),
    "spread": Key("angle by which a world may start off the reference", REFERENCE, "deg", _from_0_to(10.0)),
}  # fmt: skip

RELATIVE_KEYS = tuple(name for name, key in KEYS.items() if key.relative)
HIDDEN_KEYS = tuple(name for name, key in KEYS.items() if key.of == OBJECT)  # that the world may have and no one know
BOUND_KEYS = tuple(name for name, key in KEYS.items() if key.of == BOUNDS)
CONTROL_KEYS = tuple(name for name, key in KEYS.items() if key.of == CONTROLLER)  # of the controller alone


def parsed(name: str, value: Any, prefix: str = "") -> Any:
    """The value of a key, from the command line's text if need be; what is relative stays so.

    Raises:
        ValueError: text that is no number, where one is asked for.
    """
    key = KEYS[name]
    if key.words or not isinstance(value, str):
        return value
    if multiple(value, key.relative) is not None:
        return value.strip()
    try:
        read = float(value)
    except ValueError:
        raise fail(prefix + name, value, key.kind) from None
    return int(read) if key.whole and read.is_integer() else read


def check(name: str, value: Any, prefix: str = "", **limits: float) -> None:
    """Raise unless a key may have this value.

    Args:
        name: of the key.  prefix: before it in the message.
        limits: of a number, in place of the key's own.
    """
    key = KEYS[name]
    if key.words:
        one_of(name, value, key.words)
    elif value is not None or not key.optional:
        times = multiple(value, key.relative)
        if times is None:
            number(prefix + name, value, unit=key.unit, **(limits or key.limits))
        elif not (np.isfinite(times) and (times > 0.0 if "above" in key.limits else times >= 0.0)):
            raise fail(prefix + name, value, f"{key.kind}, finite and {'>' if 'above' in key.limits else '>='} 0")
        if key.whole and not float(value).is_integer():
            raise fail(prefix + name, value, "a whole number")
