"""A finished run: its arrays, what is measured of them, and the verdict."""

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.rotations import angle_between
from pivoting.controller.validate import frozen
from pivoting.sim.judging.findings import Findings, find
from pivoting.sim.judging.margins_over_time import MarginsOverTime, margins_over_time
from pivoting.sim.judging.measures import Measures, measure
from pivoting.sim.judging.undeclared_contacts import stray_words
from pivoting.sim.slip import ContactMotion

if TYPE_CHECKING:
    import pandas

Array = NDArray[np.float64]


class Run(ContactMotion):
    """A closed-loop run; its arrays are those of `Trajectory` and `ContactMotion`, its verdict that of `Experiment`."""

    @property
    def keep(self) -> str:
        """What was kept: "all"."""
        return "all"

    @cached_property
    def measures(self) -> Measures:
        """What the monitor makes of it, for each world."""
        return measure(self)

    @cached_property
    def strays(self) -> list[str]:
        """Which geoms met in contacts that are not declared, in words."""
        return stray_words(self)

    @cached_property
    def findings(self) -> Findings:
        """What else there is to say of it."""
        return find(self)

    def summary(self) -> dict[str, Any]:
        """The run in numbers, of the worst world, SI units in the keys; what `--json` prints."""
        played = {} if self.plan is None else {"plan_angle_error_max_deg": float(np.rad2deg(self.plan_error.max()))}
        return {**super().summary(), **played}

    @cached_property
    def margins(self) -> MarginsOverTime | None:
        """Of the worst world over time: how well its wrenches held the set of its controller; None without a set."""
        return margins_over_time(self, self.worst_world)

    def to_dataframe(self) -> "pandas.DataFrame":
        """What people plot of it, as a table; see `data_frame`.

        Raises:
            ModuleNotFoundError: pandas, of the extra [data], is not installed.
        """
        from pivoting.sim.data_frame import data_frame

        return data_frame(self)

    @cached_property
    def plan_error(self) -> Array:
        """(W, P) angle [rad] between the object and the plan played in open loop, at the P poses that it has.

        Raises:
            ValueError: the run was not in open loop.
        """
        if self.plan is None:
            raise ValueError("run: was in closed loop; must be of simulate(..., open_loop=True)")
        first = self.plan.horizon.times[0] - self.plan.horizon.h  # of pose 0
        times = np.concatenate([[first], self.plan.horizon.times])
        kept = times <= self.time[-1] + 1e-9
        steps = np.round(times[kept] / self.dt).astype(int)
        return frozen(angle_between(self.quaternion[:, steps], self.plan.orientation[kept]))
