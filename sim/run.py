"""A finished run: its arrays, what is measured of them, and the verdict."""

import os
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.rotations import CONJUGATE, quaternion_product
from pivoting.sim.judging.findings import Findings, find
from pivoting.sim.judging.measures import Measures, measure
from pivoting.sim.judging.undeclared_contacts import stray_words
from pivoting.sim.slip import ContactMotion
from pivoting.sim.trajectory import frozen

if TYPE_CHECKING:
    import pandas

Array = NDArray[np.float64]


class Run(ContactMotion):
    """A closed-loop run; its arrays are those of `Trajectory` and `ContactMotion`, its verdict that of `Experiment`."""

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

    def save(self, folder: str | os.PathLike[str]) -> Path:
        """Keep the run in a folder, from which `pivoting.load` gets it back, and return that.

        It is made if need be, and gets two files, both of them whole or neither: run.nc, all arrays, which
        `xarray.open_dataset(..., engine="scipy")` opens, and scenario.json, which `pivoting run --scenario` runs again,
        if nothing that the run was made with is a Python object. A run that was kept there before is replaced.

        Raises:
            OSError: a file cannot be written.
        """
        from pivoting.sim.saved_run import save  # which makes runs

        return save(self, folder)

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
        turned = quaternion_product(self.quaternion[:, steps], self.plan.orientation[kept] * CONJUGATE)
        return frozen(2.0 * np.arctan2(np.linalg.norm(turned[..., 1:], axis=-1), np.abs(turned[..., 0])))
