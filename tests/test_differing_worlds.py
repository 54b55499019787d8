"""Worlds that differ: each is, bit for bit, what it is alone and what MuJoCo makes of a file that says the same."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from pivoting.controller.uncertainty.uncertainty import Interval
from pivoting.sim import SCENARIOS, Fleet, Run, load, simulate
from pivoting.sim.judging.expected_force import expected_force
from pivoting.sim.run_arrays import named_arrays
from pivoting.sim.simulation import new_batch, set_up

from tests.own_files import mjcf, own

SETS: dict[str, Any] = {"mass": (0.8, 1.2), "com": (-0.005, 0.005), "inertia": "0.8:1.2", "mu": (0.25, 0.8)}
QUICK = {"seconds": 0.4, "hold": 0.05, "theta_end": 30.0}  # of pivot-2d
SPACE: dict[str, Any] = {"mass": "8:12", "com_x": "-.02:.02", "com_y": 0.01, "com_z": (-0.02, 0.02), "mu": (0.3, 0.6)}
TIMES = {"control_ns", "plans_ms"}


@pytest.fixture(scope="module")
def planar() -> Run:
    """All 32 vertices of a set in the plane."""
    return simulate("pivot-2d", 32, worlds_at="vertices", **SETS, **QUICK)


def alone(run: Run, world: int, **others: Any) -> Run:
    """One of its worlds again, by what is told of it."""
    return simulate(
        run.scenario, 1, run.seed, first_world=run.first_world + world, **{**run.values_of(world), **others}
    )


def assert_same(one: Run, world: int, run: Run) -> None:
    """That world 0 of a run is, bit for bit, one of the worlds of another."""
    then = named_arrays(run)
    for name, values in named_arrays(one).items():
        if then[name].ndim and name not in {*TIMES, "world"} and len(then[name]) == run.worlds:
            np.testing.assert_array_equal(values[0], then[name][world], err_msg=name)
    for name, values in vars(one.measures).items():
        np.testing.assert_array_equal(values[0], getattr(run.measures, name)[world], err_msg=name)


def test_vertices_are_all_combinations(planar: Run) -> None:
    values = planar.world.values
    assert values is not None
    assert values.names == ("mass", "inertia", "mu", "com_x", "com_z")
    ends = np.array([[0.8, 1.2], [0.8, 1.2], [0.25, 0.8], [-0.005, 0.005], [-0.005, 0.005]])
    np.testing.assert_array_equal(values.values.min(axis=0), ends[:, 0])
    np.testing.assert_array_equal(values.values.max(axis=0), ends[:, 1])
    assert len({tuple(row) for row in values.values}) == 32
    again = simulate("pivot-2d", 2, first_world=31, worlds_at="vertices", **SETS, **QUICK).world.values
    assert again is not None
    np.testing.assert_array_equal(again.values, values.values[[31, 0]])


def test_each_world_is_what_it_is_alone(planar: Run) -> None:
    for world in (0, 13, 31):
        one = alone(planar, world)
        assert one.world.values is None
        assert_same(one, world, planar)
        own_model = planar.world.of(world).model
        assert same_model(own_model, one.model)
    assert np.unique(planar.position[:, -1], axis=0).shape[0] == 32


@pytest.mark.parametrize("name", ["pivot-3d", "settle-3d"])
def test_in_space_too(name: str) -> None:
    """Also through a landing, where another controller takes over."""
    changes = {"seconds": 0.5, "hold": 0.05} | ({"theta_end": 20.0} if name == "pivot-3d" else {"theta": 5.0})
    run = simulate(name, 3, 7, **SPACE, **changes)
    for world in range(3):
        assert_same(alone(run, world), world, run)


def same_model(one: mujoco.MjModel, other: mujoco.MjModel) -> bool:
    """Bit for bit."""
    saved = [np.zeros(mujoco.mj_sizeModel(each), np.uint8) for each in (one, other)]
    for each, buffer in zip((one, other), saved, strict=True):
        mujoco.mj_saveModel(each, None, buffer)
    return bool(np.array_equal(*saved))


def test_the_batch_has_the_models_of_each_world() -> None:
    begun = set_up(SCENARIOS["pivot-3d"].change(**SPACE), None, worlds=4, seed=3, first_world=0)
    batch = new_batch(begun.world, 4)
    for world in range(4):
        assert same_model(batch.get_model(world), begun.world.of(world).model)


def test_contact_parameters_are_chosen_for_each_world(tmp_path: Path) -> None:
    """Of an object of one's own, one of whose contacts is softer where little inertia makes it give way more."""
    case = own(tmp_path, mjcf()).change(inertia="0.05:1", mass="0.5:1.5", mu="0.4:0.9", com_z="-.055:0")
    run = simulate(case.change(worlds_at="vertices"), 16)
    softness = {float(run.world.of(world).model.geom_solref[0, 0]) for world in range(16)}
    assert len(softness) > 1
    for world in (0, 15):
        assert_same(alone(run, world), world, run)


SAID = """<mujoco><include file="{settings}"/>
<worldbody><geom name="table" type="plane" size="2 .6 .05" friction="{mu} 0 0"/>
<body name="block" pos=".5 0 .5"><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>
<joint type="hinge" axis="0 -1 0"/><geom type="box" size=".5 .2 .5" friction="{mu} 0 0"/>
<inertial pos="{com_x} 0 {com_z}" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/></body>
</worldbody></mujoco>"""


def test_it_moves_as_a_file_that_says_the_same(planar: Run) -> None:
    """The wrench acts at the body's origin, by mj_applyFT, wherever its centre of mass is."""
    for world in np.flatnonzero(planar.measures.slip_max_m < 1e-5)[[0, -1]]:  # where rounding does not grow
        told = {key.removeprefix("world."): value for key, value in planar.values_of(world).items()}
        settings = planar.scenario.path.with_name("settings.xml")
        text = SAID.format(settings=settings, inertia=told.pop("inertia") / 6.0, **told)  # of a square of 1 kg and 1 m
        model = mujoco.MjModel.from_xml_string(text)
        model.opt.disableflags = planar.model.opt.disableflags
        data, body = mujoco.MjData(model), model.body("block").id
        data.qpos[:], data.qvel[:] = (values[world] for values in planar.start)
        as_six, off = planar.attached.controller.belief.source.map, 0.0
        for step in range(len(planar.time) - 1):
            mujoco.mj_step1(model, data)
            turned = data.xmat[body].reshape(3, 3)
            force, moment = (turned @ each for each in np.split(planar.wrench[world, step] @ as_six, 2))
            data.qfrc_applied[:] = 0.0
            mujoco.mj_applyFT(model, data, force, moment, data.xpos[body], body, data.qfrc_applied)
            mujoco.mj_step2(model, data)
            mujoco.mj_kinematics(model, data)
            off = max(off, float(np.abs(data.xpos[body] - planar.position[world, step + 1]).max()))
        assert off < 1e-12
        np.testing.assert_allclose(model.body_ipos[body], planar.world.of(world).truth.com, atol=1e-15)


def test_the_contact_forces_are_those_of_each_worlds_own_object(planar: Run) -> None:
    """The nominal ones are 20 % off, those that follow from its own mass, inertia and CoM are not."""
    settled = planar.time[:-1] >= 0.1
    sticks = planar.measures.slip_max_m < 1e-5
    assert sticks.sum() >= 16
    off = [
        np.abs(each - planar.force_measured)[sticks][:, settled].max()
        for each in (expected_force(planar), planar.force)
    ]
    assert off[0] < 0.02
    assert off[1] > 1.5
    assert planar.measures.force_mismatch_rel[sticks].max() < 2e-3
    certain = simulate("pivot-2d", 2, **QUICK)
    np.testing.assert_allclose(expected_force(certain), certain.force, atol=1e-12)


def test_draws_belong_to_seed_and_world() -> None:
    """Whatever other worlds there are, and whatever else varies."""
    run, later = (
        simulate("balance-2d", worlds, 5, first_world=first, seconds=0.6, **sets).world.values
        for worlds, first, sets in ((5, 0, SETS), (2, 3, {"mu": (0.25, 0.8)}))
    )
    assert run is not None
    assert later is not None
    np.testing.assert_array_equal(later.columns["mu"], run.columns["mu"][3:])
    assert (np.diff(np.sort(run.columns["mass"])) > 0.0).all()
    assert run.columns["mass"].min() >= 0.8
    assert run.columns["mass"].max() <= 1.2


def test_what_the_controller_believes() -> None:
    case = SCENARIOS["pivot-2d"].change(
        mass="0.8:1.4", com=(0.0, 0.02), inertia=(1.0, 2.0), mu="0.2:0.4", shove_bound=0.2, theta_error=0.1
    )
    begun = set_up(case, None, worlds=1, seed=0, first_world=0)
    believed, belief = begun.belief.uncertainty, begun.belief.attached.controller.belief
    assert believed is not None
    assert believed.mass == (0.8, 1.4)
    assert belief.object.mass == pytest.approx(1.1)
    np.testing.assert_allclose(believed.com, [[-0.01, 0.01]] * 2)
    np.testing.assert_allclose(begun.belief.attached.body.com, [0.01, 0.0, 0.01])
    np.testing.assert_allclose(believed.inertia, [1.0 / 1.5, 2.0 / 1.5])
    assert belief.object.inertia[1, 1] == pytest.approx(1.1 * 1.5 / 6.0)
    assert believed.mu == Interval(0.2, 0.4)
    assert believed.shove == (-0.2, 0.2)
    assert believed.theta.high == pytest.approx(np.deg2rad(0.1))
    np.testing.assert_allclose(begun.world.applied_at, [0.01, 0.0, 0.01])
    assert begun.world.truth.mass != belief.object.mass


def test_a_world_of_the_set_has_the_inertia_that_is_believed_whatever_its_mass() -> None:
    """Without a set it is in proportion to its mass, as ever."""
    plain = simulate("balance-2d", seconds=0.6, **{"world.mass": 1.2})
    member = simulate("balance-2d", seconds=0.6, mass=(0.8, 1.2), **{"world.mass": 1.2})
    drawn = simulate("balance-2d", 2, seconds=0.6, mass=(0.8, 1.2))
    hidden = simulate("balance-2d", 2, seconds=0.6, **{"world.mass": (0.8, 1.2)})
    known = drawn.attached.controller.uncertainty
    assert known is not None
    assert known.inertia == (1.0, 1.0)  # and so the controller is told
    assert plain.truth.inertia == pytest.approx(0.2)
    assert member.truth.inertia == pytest.approx(1.0 / 6.0)
    assert plain.truth.mass == member.truth.mass == pytest.approx(1.2)
    assert [each.inertia[1, 1] for each in drawn.world.truths] == pytest.approx([1.0 / 6.0] * 2)
    for one, other in zip(hidden.world.truths, drawn.world.truths, strict=True):
        assert one.mass == other.mass
        assert one.inertia[1, 1] == pytest.approx(one.mass / 6.0)
    assert set_up(hidden.scenario, None, worlds=1, seed=0, first_world=0).belief.uncertainty is None


def test_known_figures() -> None:
    """Probed before this was written: how far the nominal controller slides, its wrench at the CoM it believes in."""
    off = {"mass": 1.2, "com_x": 0.05, "com_z": -0.05, "inertia": 1.2}
    slides = simulate("pivot-2d", mu=0.25, world=off)
    assert float(slides.measures.slip_max_m[0]) == pytest.approx(0.191, abs=1e-3)
    pressed = simulate("pivot-2d", mu=0.25, f_min=20.0, world=off)
    assert float(pressed.measures.slip_max_m[0]) < 1.1e-5


@pytest.fixture(scope="module")
def fleet() -> Fleet:
    return simulate("pivot-2d", 70, 2, keep="measures", **SETS, **QUICK)


def test_a_fleet_tells_what_each_world_has(fleet: Fleet, tmp_path: Path) -> None:
    frame = fleet.to_dataframe()
    assert list(frame.columns[:5]) == ["world.mass", "world.inertia", "world.mu", "world.com_x", "world.com_z"]
    row = frame.iloc[41]
    own = {name: float(row[name]) for name in frame.columns if name.startswith("world.")}
    assert own == fleet.values_of(41)
    once, again = simulate(fleet.scenario, 1, 2, first_world=41, **own), fleet.replay(41)
    np.testing.assert_array_equal(once.position, again.position)
    worst = fleet.summary()["worst_world_values"]
    assert worst == fleet.values_of(fleet.worst_world)
    assert fleet.summary()["object"]["mass_kg"] == pytest.approx(worst["world.mass"])
    back = load(fleet.save(tmp_path))
    assert back.scenario == fleet.scenario
    assert back.values_of(41) == own


def test_a_run_is_kept_with_it(tmp_path: Path) -> None:
    run = simulate("pivot-2d", 2, **SETS, **QUICK)
    back = load(run.save(tmp_path))
    assert isinstance(back, Run)
    for name, values in named_arrays(run).items():
        np.testing.assert_array_equal(named_arrays(back)[name], values)
    assert back.values_of(1) == run.values_of(1)
    assert run.to_dataframe().loc[1]["world.mu"].unique().tolist() == [run.values_of(1)["world.mu"]]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mass": "1.2:0.8"}, r"^mass = '1.2:0.8': must be an interval LOW:HIGH with LOW <= HIGH$"),
        ({"mass": "a:b"}, r"^mass = 'a:b': must be a number, or an interval LOW:HIGH$"),
        ({"mass": (0.0, 1.0)}, r"^mass = 0.0: must be a finite number > 0"),
        ({"mass": (1.0, 2.0, 3.0)}, r"^mass = .*: must be a number, or an interval LOW:HIGH$"),
        ({"size": "1:2"}, r"^size = '1:2': must be a number$"),
        (
            {"worlds_at": "vertices"},
            r"^worlds_at = 'vertices': must be left out: .* unless a key of the object is an int",
        ),
        ({"com_y": 0.1}, r"^com_y = 0.1: must be left out: the object moves in a plane"),
        ({"world.com_y": (0.0, 0.1)}, r"^world.com_y = .*: must be left out: the object moves in a plane"),
        ({"mu": (1e-6, 0.5)}, r"^mu = .*: must be > 1e-05, which is the least"),
    ],
)
def test_what_is_no_set_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        simulate("balance-2d", **changes)


def test_breaking_it_shows(planar: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """A wrench at the true centre of mass, or models that are all the same, are other worlds."""
    from pivoting.sim.differing_worlds import DifferingWorlds
    from pivoting.sim.world import World

    def moved(patch: Callable[[pytest.MonkeyPatch], None]) -> float:
        with monkeypatch.context() as context:
            patch(context)
            run = simulate("pivot-2d", 32, worlds_at="vertices", **SETS, **QUICK)
        return float(np.abs(run.position - planar.position).max())

    assert moved(lambda patch: patch.setattr(World, "offsets", None)) > 1e-8
    assert moved(lambda patch: patch.setattr(DifferingWorlds, "fill", lambda *_: None)) > 1e-6
