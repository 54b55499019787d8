"""The contact parameters that are chosen for a body: softer, where many contacts hold it at once."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from pivoting.models.contact_settings import COUPLED, ContactSettings, contact_settings
from pivoting.sim import Run, own_object, simulate

PLATE, CUBE = ".1 .1 .02", ".05 .05 .05"
SHIPPED = (2.1, 1.0, 0.5)  # timeconst in time steps, dampratio, impedance


def boxes(size: str, count: int, mass: float = 1.0) -> str:
    return count * f'<geom type="box" size="{size}" mass="{mass / count}"/>'


def turned(folder: Path, geoms: str, contact: str = "edge", dt: float = 0.002, extra: str = "", **keys: object) -> Run:
    path = folder / "object.xml"
    path.write_text(
        f'<mujoco><option timestep="{dt}"/>{extra}<worldbody><geom name="floor" type="plane" size="9 9 .1"/>'
        f'<body name="object" pos="0 0 2"><freejoint/>{geoms}</body></worldbody></mujoco>'
    )
    return simulate(own_object(path, "object", contact), spread=0.0, **keys)  # type: ignore[arg-type]


def settings(run: Run) -> ContactSettings:
    assert run.world.settings is not None
    return run.world.settings


def in_steps(run: Run) -> tuple[float, float, float]:
    chosen = settings(run)
    return chosen.timeconst / run.dt, chosen.dampratio, chosen.impedance


def holds(run: Run) -> None:
    """Without bouncing, and hardly slipping: as a single box does."""
    assert run.verdict == "pass", [check.name for check in run.checks if not check.passed]
    assert run.measures.contact_lost_s.max() == 0.0
    assert run.measures.slip_max_m.max() <= 5e-5
    assert run.measures.force_mismatch_rel.max() < 1e-3


@pytest.mark.parametrize("contact", ["edge", "vertex"])
@pytest.mark.parametrize("size", [PLATE, CUBE, ".3 .01 .01", ".03 .03 .3", ".2 .15 .002", ".005 .005 .001"])
def test_one_box_keeps_the_shipped_settings(tmp_path: Path, size: str, contact: str) -> None:
    run = turned(tmp_path, boxes(size, 1), contact, seconds=0.5)
    assert in_steps(run) == pytest.approx(SHIPPED)
    assert settings(run).coupling < COUPLED
    assert "as in the shipped scenes" in settings(run).reason
    np.testing.assert_allclose(run.model.geom_solref, [[0.0042, 1.0]] * 2)


@pytest.mark.parametrize("contact", ["edge", "vertex"])
@pytest.mark.parametrize("size", [PLATE, CUBE])
def test_coincident_boxes_are_as_one(tmp_path: Path, size: str, contact: str) -> None:
    """6 or 20 of them: the body feels the same b, k and impedance, and sinks in as deep, creeps and slips as much."""
    runs = [turned(tmp_path, boxes(size, count), contact) for count in (6, 20)]
    for run, count in zip(runs, (6, 20), strict=True):
        holds(run)
        assert settings(run).contacts == count * (2 if contact == "edge" else 1)
        rows, d = run.world.contact_rows, settings(run).impedance
        assert rows is not None
        assert rows.b * rows.h == pytest.approx(2.0 / (0.5 * 2.1))
        assert rows.k * d * rows.h**2 == pytest.approx(0.5 / (0.5 * 2.1) ** 2)
        assert settings(run).coupling / (settings(run).coupling + (1.0 - d) / d) == pytest.approx(
            COUPLED / (COUPLED + 1)
        )
    assert runs[1].measures.slip_max_m == pytest.approx(runs[0].measures.slip_max_m, rel=1e-3)
    assert runs[1].log.contacts.depth.max() == pytest.approx(runs[0].log.contacts.depth.max(), rel=1e-3)


@pytest.mark.parametrize(
    ("geoms", "keys"),
    [
        (boxes(PLATE, 3, 0.01), {}),
        (boxes(PLATE, 3, 500.0), {}),
        (boxes(PLATE, 3), {"theta_end": 60.0, "seconds": 0.5}),
        (boxes(PLATE, 20), {"dt": 0.0005, "seconds": 0.5}),
        (boxes(PLATE, 20), {"dt": 0.005}),
        (boxes(".005 .005 .001", 6, 0.001), {}),
        (boxes("1.5 1.5 .3", 6, 100.0), {}),
        (boxes(".3 .01 .01", 10), {}),
        ("".join(f'<geom type="box" size=".005 .05 .02" pos="{x:.3f} 0 0"/>' for x in np.linspace(-0.1, 0.1, 15)), {}),
        (6 * '<geom type="cylinder" size=".04 .01" mass=".1"/>', {"contact": "vertex"}),
        (6 * '<geom type="capsule" size=".02 .06" mass=".1"/>', {"contact": "vertex"}),
    ],
)
def test_objects_of_many_geoms_hold(tmp_path: Path, geoms: str, keys: dict[str, object]) -> None:
    """Light, heavy, fast, small and large ones, finely and coarsely stepped, combs, stacked discs and capsules."""
    holds(turned(tmp_path, geoms, **keys))  # type: ignore[arg-type]


def test_a_bin_of_five_boxes_holds(tmp_path: Path) -> None:
    """Its walls and its floor touch together; a wall's contacts lie between the edge's ends."""
    walls = "".join(
        f'<geom type="box" pos="{x} {y} .03" size="{a} {b} .03" mass=".06"/>'
        for x, y, a, b in (
            (0, -0.095, 0.1, 0.005),
            (0, 0.095, 0.1, 0.005),
            (0.095, 0, 0.005, 0.09),
            (-0.095, 0, 0.005, 0.09),
        )
    )
    run = turned(tmp_path, walls + '<geom type="box" pos="0 0 .005" size=".1 .1 .005" mass=".06"/>')
    holds(run)
    assert settings(run).contacts == 8


def test_with_the_shipped_settings_they_would_bounce(tmp_path: Path) -> None:
    """Share times (2 b h + k h^2) < 4 is where the simulator itself becomes unstable: between two boxes and three."""
    for count, stable in ((2, True), (3, False)):
        softened = turned(tmp_path, boxes(PLATE, count))
        coupling = settings(softened).coupling
        bh, kh2 = 2.0 / (0.5 * 2.1), 0.5 / (0.5 * 2.1) ** 2
        assert (coupling / (coupling + 1.0) * (2.0 * bh + kh2) < 4.0) == stable
        run = turned(tmp_path, boxes(PLATE, count), timeconst=0.0042)
        assert run.world.settings is None
        assert (run.measures.contact_lost_s[0] == 0.0) == stable


def test_the_summary_says_what_was_chosen_and_why(tmp_path: Path) -> None:
    run = turned(tmp_path, boxes(PLATE, 3), seconds=0.5)
    told = run.summary()["contact_settings"]
    assert told["contacts"] == 6
    assert told["coupling"] == pytest.approx(19.4, rel=0.01)
    assert told["solref"] == pytest.approx([settings(run).timeconst, settings(run).dampratio])
    assert told["solimp"][:2] == pytest.approx([settings(run).impedance] * 2)
    assert "6 contacts at once, 19.4 times as stiff" in told["reason"]
    assert told["replaced"]["solref"] == "0.02, 1"


def test_pairs_and_overrides_are_softened_too(tmp_path: Path) -> None:
    geoms = boxes(PLATE, 3).replace("<geom", '<geom name="g"', 1)
    pair = '<contact><pair geom1="floor" geom2="g" solreffriction=".1 1"/></contact>'
    run = turned(tmp_path, geoms, extra=pair)
    holds(run)
    assert run.model.pair_solref[0] == pytest.approx([settings(run).timeconst, settings(run).dampratio])
    run = turned(tmp_path, boxes(PLATE, 3), extra='<option><flag override="enable"/></option>')
    holds(run)
    assert run.model.opt.o_solimp[:2] == pytest.approx(settings(run).impedance)


def test_no_contact_changes_nothing() -> None:
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom type="plane" size="1 1 1"/><body><freejoint/><geom size=".1"/></body></worldbody>'
        "</mujoco>"
    )
    chosen = contact_settings(model, 1, 0, [np.array([0, 0, 1.0, 1, 0, 0, 0])], 0.001)
    assert chosen[:6] == pytest.approx((0.0021, 1.0, 0.5, 0, 0.0, 0.0))


LIGHT = '<inertial pos="0 0 0" mass="1" diaginertia="{0} {0} {0}"/><geom type="box" size=".2 .2 .015"/>'


@pytest.mark.parametrize("inertia", [4e-3, 1e-3, 1e-4])
def test_one_contact_of_a_body_of_little_inertia_holds(tmp_path: Path, inertia: float) -> None:
    """A plate whose lever weighs 20 to 800 times its inertia: it rings no longer than a box does."""
    run = turned(tmp_path, LIGHT.format(inertia), "vertex")
    chosen, rows = settings(run), run.world.contact_rows
    assert rows is not None
    assert chosen.alone == chosen.coupling > COUPLED
    assert (chosen.dampratio, chosen.impedance) == (1.0, 0.5)
    share = chosen.alone / (chosen.alone + 1.0)
    at_most = COUPLED / (COUPLED + 1.0) * (2.0 * 2.0 / (0.5 * 2.1) + 0.5 / (0.5 * 2.1) ** 2)
    assert share * (2.0 * rows.b * rows.h + rows.k * 0.5 * rows.h**2) == pytest.approx(at_most)
    assert 2.1 < chosen.timeconst / run.dt < 2.32
    holds(run)


def test_with_the_shipped_settings_it_diverges(tmp_path: Path) -> None:
    run = turned(tmp_path, LIGHT.format(1e-3), "vertex", timeconst=0.0042)
    assert "the object diverged" in run.summary()["reasons"][0]
