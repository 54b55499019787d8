"""The verdict: explicit thresholds on what was measured."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.validate import fail
from pivoting.sim.scenarios.key_declaration import declared_keys, documented, key

if TYPE_CHECKING:
    from pivoting.sim.judging.measures import Measures

FALL = 0.01  # [s]


ALLOWED = "what the verdict allows, with the unit in the name"


@documented
@dataclass(frozen=True)
class Limits:
    """Thresholds of a verdict; angles, lost contact, friction and forces count after `settle_s`, all else always."""

    slip_m: float | None = key(
        1e-4,
        "displacement of the contact along the support",
        group=ALLOWED,
        unit="m",
        at_least=0.0,
        none="slip_rel, but no more than the object falls in 10 ms",
    )
    slip_rel: float = key(
        0.01,
        "the same, where slip_m is not given, in levers from the contact to the centre of mass",
        group=ALLOWED,
        at_least=0.0,
    )
    angle_rms_deg: float = key(0.1, "error of the angle, RMS", group=ALLOWED, unit="deg", at_least=0.0)
    angle_max_deg: float = key(0.2, "error of the angle, greatest", group=ALLOWED, unit="deg", at_least=0.0)
    contact_lost_s: float = key(
        0.0,
        "time in which nothing pushes on the contacts, or one of them has left the support",
        group=ALLOWED,
        unit="s",
        at_least=0.0,
    )
    undeclared_contact_s: float = key(
        0.0,
        "time in which something else than these contacts touches the object",
        group=ALLOWED,
        unit="s",
        at_least=0.0,
    )
    penetration_rel: float = key(
        0.01,
        "depth of the contact beyond what the soft contact explains, in levers",
        group=ALLOWED,
        at_least=0.0,
    )
    contacts_end: int = key(
        0, "contacts with the support that there have to be at the end; 0: any number", group=ALLOWED, at_least=0
    )
    bounce_m: float = key(
        1e-5, "height that the landed face may regain, where contacts_end is > 0", group=ALLOWED, unit="m", at_least=0.0
    )
    force_mismatch_rel: float = key(
        0.05,
        "RMS of the measured minus the predicted contact force, over the RMS of the predicted",
        group=ALLOWED,
        at_least=0.0,
    )
    friction_use: float = key(
        0.999, "measured |f_t| / (mu f_n), with the world's mu; at 1 the contact slides", group=ALLOWED, at_least=0.0
    )
    settle_s: float = key(0.1, "time that the start may take to settle", group=ALLOWED, unit="s", at_least=0.0)

    def __post_init__(self) -> None:
        for name, limit in declared_keys(Limits).items():
            limit.check(f"limits.{name}", getattr(self, name))
        object.__setattr__(self, "contacts_end", int(self.contacts_end))

    def for_object(self, lever: float, gravity: float) -> "Limits":
        """These limits for an object with a lever [m] under gravity [m/s^2]: that on its slip is a length."""
        fall = 0.5 * gravity * FALL**2 if gravity > 0.0 else np.inf
        return self if self.slip_m is not None else replace(self, slip_m=min(self.slip_rel * lever, fall))

    def change(self, limits: "Limits | Mapping[str, float | str]") -> "Limits":
        """These with other values, of a mapping from text if need be; or the limits that are given.

        Raises:
            ValueError: there is no such limit, or a value is not a number >= 0; it is named.
        """
        if isinstance(limits, Limits):
            return limits
        if not isinstance(limits, Mapping):
            raise fail("limits", limits, 'Limits, or a mapping such as {"slip_m": 2e-3}')
        new: dict[str, Any] = {}
        for name, value in limits.items():
            if name not in declared_keys(Limits):
                raise fail(f"limits.{name}", value, "a known limit: " + ", ".join(declared_keys(Limits)))
            new[name] = declared_keys(Limits)[name].read(f"limits.{name}", value)
        return replace(self, **new)


@dataclass(frozen=True, eq=False)
class Check:
    """One line of the verdict: the worst world's value against its limit.

    Attributes:
        name: key of the run's summary.  value, limit: in the unit that the name ends with.
        failed: (W,) which worlds are over the limit, or not finite.
    """

    name: str
    value: float
    limit: float
    failed: NDArray[np.bool_]

    @property
    def passed(self) -> bool:
        """No world failed it."""
        return not self.failed.any()


def judge(measures: "Measures", limits: Limits, certified: bool = True, guarded: bool = False) -> tuple[Check, ...]:
    """Every check of a run; a value that is not finite fails.

    Args:
        certified: whether the answers carry certificates and predicted contact forces; without, none is checked.
        guarded: whether a world may go over to a safe state, which is not what it was to do.
    """
    assert limits.slip_m is not None, "limits are for a lever"
    pairs = {
        "slip_max_m": (measures.slip_max_m, limits.slip_m),
        "angle_error_rms_deg": (measures.angle_error_rms_deg, limits.angle_rms_deg),
        "angle_error_max_deg": (measures.angle_error_max_deg, limits.angle_max_deg),
        "contact_lost_s": (measures.contact_lost_s, limits.contact_lost_s),
        "undeclared_contact_s": (measures.undeclared_contact_s, limits.undeclared_contact_s),
        "penetration_rel": (measures.penetration_rel, limits.penetration_rel),
        "friction_use_max": (measures.friction_use_max, limits.friction_use),
        "force_mismatch_rel": (measures.force_mismatch_rel, limits.force_mismatch_rel),
        "unsolved_steps": (measures.unsolved_steps, 0.0),
    }
    if not certified:
        del pairs["force_mismatch_rel"]
    if guarded:
        pairs["safe_s"] = measures.safe_s, 0.0
    if limits.contacts_end:
        pairs |= {
            "contacts_missing": (measures.contacts_missing, 0.0),
            "bounce_m": (measures.bounce_m, limits.bounce_m),
        }
    return tuple(Check(name, float(np.max(value)), limit, ~(value <= limit)) for name, (value, limit) in pairs.items())


def worst_world(checks: tuple[Check, ...], measures: "Measures") -> int:
    """The world in which a value is the greatest multiple of its limit; what is not finite is beyond any."""
    ratios = np.zeros(len(checks[0].failed))
    for check in checks:
        values = np.asarray(getattr(measures, check.name), dtype=float)
        over = np.where(np.isfinite(values), values, np.inf)
        over = over / check.limit if check.limit > 0.0 else np.where(over > 0.0, np.inf, 0.0)
        ratios = np.maximum(ratios, over)
    return int(np.argmax(ratios))
