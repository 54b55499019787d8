"""A run as a table of pandas, a row for each world and state, for plots and statistics."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.solution import STATUS
from pivoting.models.length_unit import POWERS
from pivoting.sim.run_arrays import CONTACT_AXES, WRENCH, own_values

if TYPE_CHECKING:
    import pandas
    from pivoting.sim.fleet import Fleet
    from pivoting.sim.run import Run

Array = NDArray[Any]


def data_frame(run: "Run") -> "pandas.DataFrame":
    """A row for each world and state, in SI units as the columns' names end, whatever the model's unit of length is.

    The index is (world, step); state `step` is the one at which step `step` begins, and what belongs to a step is nan
    in the last row of a world. Columns: time_s; theta_rad, omega_rad_s, angle_error_rad and theta_desired_rad; x_m,
    vx_m_s, ... of the centre of mass, qw, ..., wx_rad_s, ... in world axes; clearance_m; slip_0_m of each contact; the
    applied wrench, wrench_Fu_N, ... in object axes; of each contact force_0_n_N, ... as predicted and
    force_measured_0_n_N, ... in table axes, and friction_use_0; residual, status and control_us; what each
    world has of its own, as world.KEY in the units of the keys.

    Raises:
        ModuleNotFoundError: pandas is not installed.
    """
    pandas = _pandas()
    states, steps = np.arange(run.time.size), run.time.size - 1
    index = pandas.MultiIndex.from_product([np.arange(run.worlds), states], names=["world", "step"])
    columns = {name: _column(values, run.worlds, states.size) for name, values in _columns(run).items()}
    columns |= {name: np.repeat(values, states.size) for name, values in own_values(run).items()}
    frame = pandas.DataFrame(columns, index=index)
    codes = np.full((run.worlds, states.size), -1, dtype=np.int8)  # of what there is not
    codes[:, :steps] = run.status
    frame["status"] = pandas.Categorical.from_codes(codes.ravel(), list(STATUS))
    return frame


def fleet_frame(fleet: "Fleet") -> "pandas.DataFrame":
    """A row for each world of a fleet: its measures, in the units that the columns' names end with, and `passed`.

    The index is world, from 0. What each has of its own comes first, as world.KEY in the units of the keys.

    Raises:
        ModuleNotFoundError: pandas is not installed.
    """
    pandas = _pandas()
    passed = np.isin(np.arange(fleet.worlds), fleet.failed_worlds, invert=True)
    return pandas.DataFrame(
        {**own_values(fleet), **vars(fleet.measures), "passed": passed},
        index=pandas.RangeIndex(fleet.worlds, name="world"),
    )


def _pandas() -> Any:
    """The module, which is imported when it is needed."""
    try:
        import pandas
    except ModuleNotFoundError as error:
        if error.name != "pandas":
            raise
        told = "to_dataframe needs pandas, which is not installed; the extra has it: pip install 'pivoting[data]'"
        raise ModuleNotFoundError(told, name="pandas") from None
    return pandas


def _columns(run: "Run") -> dict[str, Array]:
    """By name the values ([world,] state or step)."""
    found = {"time_s": run.time, "theta_rad": run.theta, "omega_rad_s": run.omega, "angle_error_rad": run.angle_error}
    found |= {"theta_desired_rad": run.reference[0]}
    axes = list(enumerate("xyz"))
    found |= {f"{axis}_m": run.unit * run.position[..., i] for i, axis in axes}
    found |= {f"q{axis}": run.quaternion[..., i] for i, axis in enumerate("wxyz")}
    found |= {f"v{axis}_m_s": run.unit * run.velocity[..., i] for i, axis in axes}
    found |= {f"w{axis}_rad_s": run.angular_velocity[..., i] for i, axis in axes}
    found |= {"clearance_m": run.unit * run.clearance}
    for i, name in enumerate(WRENCH[run.truth.dim]):
        unit = "N" if name.startswith("F") else "N m"
        found[f"wrench_{name.replace('_', '')}_{unit.replace(' ', '_')}"] = (
            run.unit ** POWERS[unit] * run.wrench[..., i]
        )
    for k in range(len(run.points)):
        found[f"slip_{k}_m"] = run.unit * np.linalg.norm(run.slip[:, :, k], axis=-1)
        for i, axis in enumerate(CONTACT_AXES[run.truth.dim]):
            found[f"force_{k}_{axis}_N"] = run.unit * run.force[:, :, k, i]
            found[f"force_measured_{k}_{axis}_N"] = run.unit * run.force_measured[:, :, k, i]
        found[f"friction_use_{k}"] = run.friction_use[..., k]
    return found | {"residual": run.residual, "control_us": run.control_us}


def _column(values: Array, worlds: int, states: int) -> Array:
    """(worlds * states,) of values that may be the same for all worlds, and end a step earlier."""
    out = np.full((worlds, states), np.nan)
    out[:, : values.shape[-1]] = values
    return out.ravel()
