"""Files whose lengths are in mm or cm: keys and figures are in SI all the same, and equal those of the file in m."""

from pathlib import Path

import numpy as np
import pytest
from pivoting.models.length_unit import length_unit
from pivoting.sim import Run, simulate
from pivoting.sim.console.run_tables import print_run
from rich.console import Console

from tests.own_files import QUICK, own

KEYS = {"f_min": "0.5w", "force_max": "3w", "moment_max": 1.0, "length": 0.07, "limits": {"slip_m": 1e-4}}


def scaled(unit: float) -> str:
    """The box of 10 x 8 x 12 cm, 0.96 kg, in a file whose lengths are in `unit` [m]."""
    s = 1.0 / unit
    return (
        f'<mujoco><option timestep="0.001" gravity="0 0 {-9.81 * s}"/><worldbody><geom name="floor" type="plane"'
        f' size="{s} {s} {s}"/><body name="box" pos="0 0 {0.06 * s}"><freejoint/><geom name="g" type="box"'
        f' size="{0.05 * s} {0.04 * s} {0.06 * s}" mass=".96"/></body></worldbody></mujoco>'
    )


@pytest.fixture(scope="module")
def metres(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return simulate(own(tmp_path_factory.mktemp("m"), scaled(1.0)), **KEYS)


@pytest.mark.parametrize("unit", [1e-3, 1e-2])
def test_figures_are_those_of_the_file_in_metres(unit: float, metres: Run, tmp_path: Path) -> None:
    run = simulate(own(tmp_path, scaled(unit)), **KEYS)
    told, right = run.summary(), metres.summary()
    assert (told["length_unit_m"], right["length_unit_m"]) == (unit, 1.0)
    assert told["verdict"] == right["verdict"] == "pass"
    for key in ("slip_max_m", "slip_floor_m", "angle_error_rms_deg", "friction_use_max", "force_mismatch_rel"):
        assert told[key] == pytest.approx(right[key], rel=1e-5), key
    for key in ("limits", "resolved"):
        assert told[key] == pytest.approx(right[key], rel=1e-9), key
    for key in ("mass_kg", "inertia_kg_m2", "com_m", "contacts_m", "radius_m"):
        np.testing.assert_allclose(told["object"][key], right["object"][key], rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(unit * run.position, metres.position, atol=1e-12)
    page = Console(record=True, width=200)
    print_run(page, run)
    assert f"lengths are taken to be in {'mm' if unit == 1e-3 else 'cm'}" in page.export_text()


@pytest.mark.parametrize("key", [{"gravity": 5.0}, {"size": 0.2}, {"world": {"size": 0.11}}, {"f_min": 4.0}])
def test_keys_are_in_si(key: dict, tmp_path: Path) -> None:  # type: ignore[type-arg]
    right, run = (simulate(own(tmp_path, scaled(unit)), **key) for unit in (1.0, 1e-3))
    assert run.verdict == right.verdict
    np.testing.assert_allclose(1e-3 * run.position, right.position, atol=1e-9)
    assert run.measures.slip_max_m[0] == pytest.approx(right.measures.slip_max_m[0], rel=1e-4)


def test_remedies_are_in_si(tmp_path: Path) -> None:
    """What would hold it has the same value, and holds."""
    held = []
    for unit in (1.0, 1e-3):
        case = own(tmp_path, scaled(unit)).change(**QUICK, world={"mu": 0.05}, mu=1.0)
        held.append(simulate(case).summary())
    assert held[0]["verdict"] == held[1]["verdict"] == "fail"
    assert held[0]["remedies"] == held[1]["remedies"]
    assert held[0]["reasons"][0] == held[1]["reasons"][0]


@pytest.mark.parametrize(
    ("size", "unit"),
    [(9.81, 1.0), (9810.0, 1e-3), (10000.0, 1e-3), (981.0, 1e-2), (1.62, 1.0), (0.0, 1.0), (99.0, 1.0)],
)
def test_the_unit_is_read_from_the_size_of_gravity(size: float, unit: float) -> None:
    assert length_unit([0.0, -0.6 * size, -0.8 * size]) == unit
