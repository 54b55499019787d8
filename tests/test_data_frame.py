"""A run as a table of pandas: what the columns hold, in SI units, and what is said where pandas is not installed."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pivoting.controller.solution import FAILED
from pivoting.sim import Run, simulate

from tests.own_files import BOX, FLOOR, mjcf, own


@pytest.fixture(scope="module")
def edge(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Two worlds of a box on an edge, two contacts in space."""
    return simulate(own(tmp_path_factory.mktemp("edge"), mjcf()), worlds=2)


def test_there_is_a_row_for_each_world_and_state(edge: Run) -> None:
    """What belongs to a step is nan in the last row of a world."""
    table = edge.to_dataframe()
    assert table.index.names == ["world", "step"]
    assert len(table) == 2 * edge.time.size
    for world in (0, 1):
        rows = table.loc[world]
        np.testing.assert_array_equal(rows["time_s"], edge.time)
        np.testing.assert_array_equal(rows["theta_rad"], edge.theta[world])
        np.testing.assert_array_equal(rows["theta_desired_rad"], edge.reference[0])
        np.testing.assert_array_equal(rows[["x_m", "y_m", "z_m"]], edge.position[world])
        np.testing.assert_array_equal(rows[["qw", "qx", "qy", "qz"]], edge.quaternion[world])
        np.testing.assert_array_equal(rows[["vx_m_s", "vy_m_s", "vz_m_s"]], edge.velocity[world])
        np.testing.assert_array_equal(rows[["wx_rad_s", "wy_rad_s", "wz_rad_s"]], edge.angular_velocity[world])
        wrench = [f"wrench_F{axis}_N" for axis in "xyz"] + [f"wrench_M{axis}_N_m" for axis in "xyz"]
        np.testing.assert_array_equal(rows[wrench].iloc[:-1], edge.wrench[world])
        for k in (0, 1):
            force = [f"force_{k}_{axis}_N" for axis in "ton"]
            np.testing.assert_array_equal(rows[force].iloc[:-1], edge.force[world, :, k])
            measured = [f"force_measured_{k}_{axis}_N" for axis in "ton"]
            np.testing.assert_array_equal(rows[measured].iloc[:-1], edge.force_measured[world, :, k])
            np.testing.assert_array_equal(rows[f"friction_use_{k}"].iloc[:-1], edge.friction_use[world, :, k])
        assert rows[[*wrench, "residual", "control_us", "status"]].iloc[-1].isna().all()
        np.testing.assert_array_equal(rows["control_us"].iloc[:-1], edge.control_us)
    assert (table["status"].dropna() == "solved").all()
    slip = table[["slip_0_m", "slip_1_m"]].groupby("world").max().max(axis=1)
    np.testing.assert_array_equal(slip, edge.measures.slip_max_m)


def test_the_plane_has_three_components(shipped: Callable[[str], Run]) -> None:
    run = shipped("snap-2d")
    table = run.to_dataframe()
    columns = [name for name in table.columns if name.startswith("wrench")]
    assert columns == ["wrench_Fu_N", "wrench_Fv_N", "wrench_M_N_m"]
    np.testing.assert_array_equal(table[columns].iloc[:-1], run.wrench[0])
    assert {"force_0_t_N", "force_0_n_N"} <= set(table.columns)
    assert "force_0_o_N" not in table.columns


def test_whatever_the_models_unit_is_the_table_is_in_si(tmp_path: Path) -> None:
    """A file in mm, against one in m of the same box."""
    (tmp_path / "m").mkdir()
    box = BOX.replace("/>", ' mass="1"/>')
    large = box.replace(".05 .04 .06", "50 40 60"), FLOOR.replace("2 2 .1", "2000 2000 100")
    small = simulate(own(tmp_path / "m", mjcf(box))).to_dataframe()
    text = mjcf(large[0], pose='pos="0 0 60"', floor=large[1], option='gravity="0 0 -9810"')
    run = simulate(own(tmp_path, text))
    assert run.unit == 1e-3
    table = run.to_dataframe()
    for name in ("z_m", "vz_m_s", "wrench_Fz_N", "wrench_Mx_N_m", "force_0_n_N", "theta_rad"):
        np.testing.assert_allclose(table[name], small[name], rtol=1e-4, atol=1e-5, err_msg=name)
        assert np.abs(small[name]).max() > 1e-2


def test_without_pandas_the_extra_is_named(edge: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ModuleNotFoundError, match=r"^to_dataframe needs pandas, .* pip install 'pivoting\[data\]'$"):
        edge.to_dataframe()


def test_a_world_that_diverges_has_a_table_too() -> None:
    run = simulate("balance-2d", bandwidth=5000, seconds=1.0)
    table = run.to_dataframe().iloc[:-1]
    assert np.isnan(run.wrench).any()
    np.testing.assert_array_equal(table["wrench_M_N_m"], run.wrench[0, :, 2])
    np.testing.assert_array_equal(table["status"] == "failed", run.status[0] == FAILED)


def test_pandas_is_imported_when_it_is_needed() -> None:
    code = f"import sys, {Run.__module__}; print([m for m in ('pandas', 'xarray', 'scipy.io') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
