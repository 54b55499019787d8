"""What there is to say of a run beside its measures: what was unknown, what else it touched, and why it failed."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from pivoting.controller.solution import BOUNDED, UNGUARANTEED
from pivoting.sim.judging.advice import reasons, remedies
from pivoting.sim.judging.measures import slip_floor_unknown

if TYPE_CHECKING:
    from pivoting.sim.run import Run


class Findings(NamedTuple):
    """What a summary says beside the measures.

    Attributes:
        slip_floor_unknown: why the simulator's own slip cannot be predicted; "" where it can.
        bounded_steps: steps of all worlds in which the bounds did not allow what was required.
        strays: which geoms met in contacts that are not declared.
        reasons: why the worst world failed, a sentence each.  remedies: what might hold it, as the command line has it.
        unguaranteed_steps: those of `bounded_steps` in which no grip in all worlds of the controller's set was allowed.
    """

    slip_floor_unknown: str
    bounded_steps: int
    strays: list[str]
    reasons: list[str]
    remedies: list[str]
    unguaranteed_steps: int = 0


def find(run: "Run") -> Findings:
    """The findings of a run."""
    return Findings(
        slip_floor_unknown(run),
        bounded_steps(run),
        run.strays,
        reasons(run),
        [each.setting for each in remedies(run)],
        unguaranteed_steps(run),
    )


def bounded_steps(run: "Run") -> int:
    """See `Findings`."""
    return int(np.count_nonzero(np.isin(run.status, (BOUNDED, UNGUARANTEED))))


def unguaranteed_steps(run: "Run") -> int:
    """See `Findings`."""
    return int(np.count_nonzero(run.status == UNGUARANTEED))
