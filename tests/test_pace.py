"""What a large object asks of the simulation as it turns: a floor under its force, finer steps, a start at rest."""

from pathlib import Path

import numpy as np
import pytest
from pivoting.sim import Run, simulate
from pivoting.sim.pace import closing_force, fine_step

from tests.own_files import QUICK, mjcf, own, pivoted

ROCK = '<geom name="g" type="box" size="{0} {1} {2}" pos="{3} 0 0"/>'


def rock(size: float, aside: float = 0.0) -> str:
    """A box of 2 x 1.6 x 2.4 times a size [m], with the origin of its frame that far beside its middle."""
    return mjcf(ROCK.format(size, 0.8 * size, 1.2 * size, aside), pose=f'pos="0 0 {1.2 * size}"')


def failed(run: Run) -> list[str]:
    return [check.name for check in run.checks if not check.passed]


@pytest.mark.parametrize(
    ("size", "aside", "contact"), [(300.0, 0.0, "vertex"), (300.0, 0.0, "edge"), (80.0, 500.0, "vertex")]
)
def test_a_rock_of_hundreds_of_metres_holds(size: float, aside: float, contact: str, tmp_path: Path) -> None:
    """And with neither floor nor finer steps it lets go, or creeps too far."""
    case = own(tmp_path, rock(size, aside), contact).change(seconds=1.0)
    run = simulate(case)
    assert failed(run) == []
    assert run.dt < 0.001
    assert float(run.contact_settings["replaced"]["timestep"]) == 0.001
    assert run.contact_settings["f_min_N"] > 0.01 * run.load.force
    assert "contact_lost_s" in failed(simulate(case, f_min=0.0))
    assert failed(simulate(case, dt=0.001)) == ["slip_max_m"]


def test_it_starts_as_deep_as_it_rests(tmp_path: Path) -> None:
    """Deeper, fine steps would throw it up: the first force is of the size of the predicted one."""
    run = simulate(own(tmp_path, rock(80.0), "vertex"), dt=1e-4, seconds=1.0)
    push = run.force_measured[0, :50, 0, 2] / run.force[0, :50, 0, 2]
    assert push.max() < 1.5
    assert push.min() > 0.5


def test_small_objects_keep_their_step_and_are_hardly_pressed(tmp_path: Path) -> None:
    run = pivoted(tmp_path, mjcf())
    assert run.dt == 0.001
    assert "timestep" not in run.contact_settings["replaced"]
    assert 0.0 < run.contact_settings["f_min_N"] < 0.01 * run.load.force
    assert np.array_equal(
        run.wrench, simulate(own(tmp_path, mjcf()), f_min=0.0).wrench
    )  # the smallest wrench presses more


def test_by_hand(tmp_path: Path) -> None:
    """m omega^2 r / 7; h r / 40 times the integral of omega^2, of which a limit may take half."""
    rate = np.array([0.0, 2.0, -3.0])
    assert closing_force(5.0, 0.7, rate) == pytest.approx(5.0 * 9.0 * 0.7 / 7.0)
    times = np.linspace(0.0, 2.0, 2001)
    drift = 1e-3 * 100.0 / 40.0 * 2.0 * 0.3**2
    assert fine_step(1e-3, 100.0, times, np.full(2001, 0.3), 2.5 * drift) == 1e-3
    assert fine_step(1e-3, 100.0, times, np.full(2001, 0.3), 2.0 / 3.1 * drift) == pytest.approx(1e-3 / 4.0)
    run = pivoted(tmp_path, rock(1.0, 0.5))
    fastest = 1.875 * np.deg2rad(20.0) / QUICK["seconds"]
    arm = np.linalg.norm(run.truth.com + run.points, axis=1).max()
    wanted = run.truth.mass * fastest**2 * arm / 7.0
    assert run.contact_settings["f_min_N"] == pytest.approx(wanted, rel=1e-5)


def test_a_reference_that_is_not_finite_is_named(tmp_path: Path) -> None:
    """And not what would follow from it, such as a floor of nan."""
    case = own(tmp_path, mjcf()).change(reference=lambda t: (0.1 + 0.0 * np.asarray(t), *2 * [np.nan * np.asarray(t)]))
    with pytest.raises(ValueError, match=r"reference = 'rate of shape .*must be finite"):
        simulate(case)
