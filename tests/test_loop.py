"""The closed loop: what it must show in MuJoCo, determinism, and what a run is made of."""

from collections.abc import Callable
from dataclasses import fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pivoting.controller import Motion, WrenchController, WrenchProblem, solve
from pivoting.controller.references import Constant, Sampled
from pivoting.controller.solution import BOUNDED
from pivoting.controller.wrench_controller import Belief
from pivoting.sim import SCENARIOS, Run, assert_sticking, assert_tracking, own_object, simulate
from scipy.spatial.transform import Rotation


def test_balance(shipped: Callable[[str], Run]) -> None:
    """10 s on the corner: slip <= 0.02 mm, angle error after 0.5 s <= 0.005 deg, force mismatch <= 1 %."""
    run = shipped("balance-2d")
    assert run.time[-1] == pytest.approx(10.0)
    assert run.measures.slip_max_m[0] <= 2e-5
    assert np.rad2deg(np.abs(run.angle_error[0, run.time >= 0.5])).max() <= 0.005
    assert run.measures.force_mismatch_rel[0] <= 0.01
    assert run.verdict == "pass"


def test_incline_measures_the_printed_force(shipped: Callable[[str], Run]) -> None:
    """MuJoCo's own contact sensor shows the notes' f_t = 1.39789, f_n = 4.65964 within 0.2 %, all the time."""
    run = shipped("incline-2d")
    measured = run.force_measured[0, run.time[:-1] >= 0.5, 0]
    np.testing.assert_allclose(measured, np.tile([1.39789, 4.65964], (len(measured), 1)), rtol=0.002)
    assert run.measures.force_mismatch_rel[0] <= 0.01
    assert run.verdict == "pass"
    assert run.world.mu == 0.4
    assert run.attached.controller.contacts[0].mu == 0.3


def test_pivot(shipped: Callable[[str], Run]) -> None:
    """10 to 80 deg and back: slip <= 0.02 mm, RMS <= 0.02 deg, mismatch <= 1 %, no step at all without contact."""
    run = shipped("pivot-2d")
    assert run.measures.slip_max_m[0] <= 2e-5
    assert run.measures.angle_error_rms_deg[0] <= 0.02
    assert (run.force_measured[0, :, 0, 1] > 0.0).all()
    assert run.measures.force_mismatch_rel[0] <= 0.01
    assert np.rad2deg(run.theta[0]).max() == pytest.approx(80.0, abs=0.05)
    assert np.rad2deg(run.theta[0, [0, -1]]) == pytest.approx([10.0, 10.0], abs=0.05)
    assert run.verdict == "pass"
    assert_sticking(run, slip_m=2e-5)
    assert_tracking(run, rms_deg=0.02)


def test_snap(shipped: Callable[[str], Run]) -> None:
    """10 to 80 deg in 0.3 s: slip <= 0.1 mm, RMS <= 0.1 deg, mismatch <= 5 %, no step without contact."""
    run = shipped("snap-2d")
    assert run.measures.slip_max_m[0] <= 1e-4
    assert run.measures.angle_error_rms_deg[0] <= 0.1
    assert (run.force_measured[0, run.time[:-1] >= 0.1, 0, 1] > 0.0).all()
    assert run.measures.force_mismatch_rel[0] <= 0.05
    assert np.abs(run.omega).max() > 7.0
    assert run.verdict == "pass"


def test_every_step_is_certified(shipped: Callable[[str], Run]) -> None:
    for name in ("balance-2d", "incline-2d", "pivot-2d", "snap-2d"):
        run = shipped(name)
        assert run.residual.max() <= 1e-11
        assert not run.status.any()


def test_the_loop_solves_the_same_problem_as_people_do(shipped: Callable[[str], Run]) -> None:
    """A step's logged answer, against the problem stated by `WrenchController.problem` and solved by Clarabel."""
    run = shipped("pivot-2d")
    for k in (0, 700, 1300, 2600, 4000):
        desired = Motion(*(float(values[k]) for values in run.reference))
        problem = run.attached.controller.problem(Motion(run.theta[0, k], run.omega[0, k]), desired)
        other = solve(problem, "clarabel")
        np.testing.assert_allclose(run.wrench[0, k], other.wrench, atol=1e-6)
        np.testing.assert_allclose(run.force[0, k], other.force, atol=1e-6)


@pytest.mark.parametrize(
    ("name", "keys"),
    [
        ("pivot-2d", {}),
        ("pivot-2d", {"moment_max": 3.0, "theta": 60.0}),
        ("pivot-2d", {"force_rate": 60.0, "spread": 0.1}),
        ("pivot-3d", {}),
        ("mpc-2d", {}),
        ("mpc-2d", {"open_loop": True, "plan_step": 0.005}),
    ],
    ids=["law", "a bound", "a bound on a rate", "space", "horizon", "a plan played"],
)
def test_what_is_required_is_what_contacts_and_wrench_make(name: str, keys: dict) -> None:
    """J f + w in every control, where nothing was given up for a bound."""
    run = simulate(name, worlds=2, seed=2, seconds=0.3, **keys)
    controller, exact = run.attached.controller, 0
    for i in range(run.worlds):
        for k in range(0, run.time.size - 1, 10):
            made = controller.jacobian(run.quaternion[i, k]) @ run.force[i, k].ravel() + run.wrench[i, k]
            exact += run.status[i, k] == 0
            off = np.abs((made - run.required[i, k]) / controller.units.wrench).max()
            assert off <= 1e-12 or (run.status[i, k] == BOUNDED and off >= 1e-6)
    assert exact > 30
    assert not run.required.flags.writeable
    assert run.required.shape == run.wrench.shape


def test_energy_is_accounted_for(shipped: Callable[[str], Run]) -> None:
    """Conserved quantity: work of the applied wrench = gain of energy; a stuck contact does none."""
    run = shipped("pivot-2d")
    dx = np.diff(run.position[0], axis=0)
    dtheta = np.diff(run.theta[0])
    work = np.cumsum((run.wrench_world[0, :, :3] * dx).sum(axis=1) - run.wrench_world[0, :, 4] * dtheta)
    energy = 10.0 * run.position[0, :, 2] + 0.5 * (run.velocity[0] ** 2).sum(axis=1) + run.omega[0] ** 2 / 12.0
    np.testing.assert_allclose(work, energy[1:] - energy[0], atol=0.01)


def test_same_seed_same_arrays() -> None:
    one, two = (simulate("pivot-2d", worlds=5, seed=3, seconds=0.2) for _ in range(2))
    for name in ("position", "quaternion", "wrench", "wrench_world", "force", "force_measured", "residual", "status"):
        assert np.array_equal(getattr(one, name), getattr(two, name)), name
    other = simulate("pivot-2d", worlds=5, seed=4, seconds=0.2)
    assert not np.array_equal(one.theta[:, 0], other.theta[:, 0])


def test_world_i_is_the_same_in_any_fleet() -> None:
    few, many = (simulate("pivot-2d", worlds=n, seed=3, seconds=0.2) for n in (1, 6))
    assert np.array_equal(few.theta[0], many.theta[0])
    assert np.array_equal(few.force_measured[0], many.force_measured[0])
    assert len({float(angle) for angle in many.theta[:, 0]}) == 6


def test_worlds_start_within_the_spread_and_converge() -> None:
    run = simulate("pivot-2d", worlds=16, seed=1, seconds=0.5, spread=0.5)
    start = np.rad2deg(run.angle_error[:, 0])
    assert 0.2 < np.abs(start).max() <= 0.5
    assert np.abs(np.rad2deg(run.angle_error[:, -1])).max() < 0.01


def test_mirrored_world_gives_the_mirrored_force() -> None:
    """Symmetry: at 90 - theta the block is its own mirror image, so f_t and the moment change sign, f_n does not."""
    left, right = (simulate("balance-2d", theta=theta, seconds=0.6, spread=0.0) for theta in (30.0, 60.0))
    np.testing.assert_allclose(left.force[0, -1, 0] * [-1.0, 1.0], right.force[0, -1, 0], atol=1e-4)
    np.testing.assert_allclose(left.wrench[0, -1, 2], -right.wrench[0, -1, 2], atol=1e-4)


def test_a_reference_of_ones_own() -> None:
    samples = np.deg2rad(30.0 + 10.0 * np.sin(np.linspace(0.0, np.pi, 21)) ** 2)
    run = simulate("pivot-2d", reference=Sampled(samples, 0.05), seconds=1.2)
    assert run.verdict == "pass"
    assert np.rad2deg(run.theta.max()) == pytest.approx(40.0, abs=0.05)


def test_sine_and_other_sizes() -> None:
    """Ten times smaller, a hundred times heavier, on a slope, another friction: the same program."""
    run = simulate("balance-2d", reference="sine", seconds=2.0, theta=40, amplitude=5, size=0.1, mass=100, mu=0.8,
                   incline=-10, gravity=9.81)  # fmt: skip
    assert run.verdict == "pass", run.checks
    assert run.truth.mass == pytest.approx(100.0)
    assert run.attached.controller.body.mass == pytest.approx(100.0)


def test_arrays_cannot_be_changed(shipped: Callable[[str], Run]) -> None:
    run = shipped("balance-2d")
    for name in ("wrench", "time", "theta", "slip", "corner", "friction_use", "control_us", "force_measured"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(run, name)[0] = 0.0
    with pytest.raises(TypeError, match="not support item assignment"):
        SCENARIOS["incline-2d"].world["mu"] = 0.1  # type: ignore[index]


def test_a_controller_of_ones_own_is_named_and_brings_its_own_settings(shipped: Callable[[str], Run]) -> None:
    mine = shipped("balance-2d").attached.controller
    run = simulate("balance-2d", controller=mine, seconds=0.6)
    assert run.summary()["controller"] == "given"
    assert run.summary()["limits"]["slip_m"] == 2e-5
    with pytest.raises(ValueError, match=r"margin = 0.5.*the controller that is given has its own"):
        simulate("balance-2d", controller=mine, margin=0.5)
    two = WrenchController(mine.body, mine.contacts * 2, mine.law, (0.0, -10.0))
    with pytest.raises(ValueError, match=r"controller = .*2 contacts.*1 planar contact"):
        simulate("balance-2d", controller=two)


def test_a_controller_that_would_not_be_asked_is_refused(shipped: Callable[[str], Run]) -> None:
    """A test that does not test what it is given is the worst outcome; what the loop does read may be another's."""
    mine = shipped("balance-2d").attached.controller
    given = {each.name: getattr(mine, each.name) for each in fields(WrenchController)}

    class Mine(WrenchController):
        def problem(self, *arguments: Any, **options: Any) -> WrenchProblem:
            raise AssertionError("never called")

    class Turned(WrenchController):
        def jacobian(self, orientation: np.ndarray) -> np.ndarray:
            return -super().jacobian(orientation)

    class Heavier(WrenchController):
        @cached_property
        def belief(self) -> Belief:
            return super().belief._replace(object=super().belief.object._replace(mass=1.2))

    for kind, name in ((Mine, "problem"), (Turned, "jacobian")):
        with pytest.raises(
            ValueError, match=rf"^controller = '{kind.__name__}': must be without a {name}\(\) of its own"
        ):
            simulate("balance-2d", controller=kind(**given), seconds=0.6)
    patched = WrenchController(**given)
    object.__setattr__(patched, "problem", lambda *arguments: None)
    with pytest.raises(ValueError, match=r"^controller = 'WrenchController': must be without a problem"):
        simulate("balance-2d", controller=patched, seconds=0.6)
    assert simulate("balance-2d", controller=Heavier(**given), seconds=0.6).verdict == "fail"
    assert (
        simulate("balance-2d", controller=type("Same", (WrenchController,), {})(**given), seconds=0.6).verdict == "pass"
    )


@pytest.mark.parametrize("gravity", ['<option gravity="0 0 0"/>', '<option><flag gravity="disable"/></option>'])
def test_no_gravity_in_the_file_is_refused_as_none_on_the_command_line(gravity: str, tmp_path: Path) -> None:
    model = tmp_path / "box.xml"
    model.write_text(
        f"""<mujoco>{gravity}<worldbody><geom type="plane" size="1 1 1"/><body name="box" pos="0 0 .1"><freejoint/>
        <geom type="box" size=".05 .04 .1" mass=".4"/></body></worldbody></mujoco>"""
    )
    case = own_object(model, "box", "edge")
    for given in (case, case.change(seconds="9T"), case.change(force_max="1w")):
        with pytest.raises(ValueError, match=r"^gravity = 0.0: must be > 0, or f_min > 0"):
            simulate(given)
    with pytest.raises(ValueError, match=r"^f_min = '1w': must be a number \[N\]: without gravity"):
        simulate(case, f_min="1w")


def test_too_many_worlds_are_named() -> None:
    with pytest.raises(ValueError, match=r"^worlds = 10000000000000: must be at most 1000: of 10000 steps each"):
        simulate("balance-2d", worlds=10**13)


@pytest.mark.parametrize("incline", [1.0, 5.0])
def test_what_is_measured_is_measured_from_the_worlds_table(incline: float) -> None:
    """A table that the controller does not know of: the corner and the angle, from MuJoCo's poses alone."""
    run = simulate("pivot-2d", seconds=1.0, world={"incline": incline}, spread=0.0)
    turned = Rotation.from_quat(np.roll(run.quaternion[0], -1, axis=-1))
    path = run.position[0] + turned.apply([-0.5, 0.0, -0.5])
    tangent = np.array([np.cos(np.deg2rad(incline)), 0.0, np.sin(np.deg2rad(incline))])
    np.testing.assert_allclose(run.slip[0, :, 0, 0], (path - path[0]) @ tangent, atol=1e-12)
    edge = turned.apply([1.0, 0.0, 0.0])
    np.testing.assert_allclose(run.theta[0], np.arctan2(edge[:, 2], edge[:, 0]) - np.deg2rad(incline), atol=1e-9)
    assert run.measures.angle_error_rms_deg[0] == pytest.approx(incline, abs=0.2)
    assert run.verdict == "fail"


def test_steep_tables_either_way() -> None:
    for incline in (-60.0, 60.0):
        assert simulate("balance-2d", incline=incline, mu=2.0, seconds=0.6).verdict == "pass"


def test_a_reference_that_starts_in_motion() -> None:
    """The world starts with the reference's rate; and what kick is left does not ring on in the contact."""
    run = simulate("balance-2d", reference="sine", seconds=3.0)
    assert run.omega[0, 0] == pytest.approx(float(run.reference[1][0]))
    assert run.verdict == "pass"
    kicked = simulate("balance-2d", reference=Sampled(np.full(10, 0.5) + 1e-4 * (np.arange(10) == 4), 0.1), seconds=3.0)
    late = kicked.force_measured[0, kicked.time[:-1] > 2.0, 0] - kicked.force[0, kicked.time[:-1] > 2.0, 0]
    assert np.abs(late).max() < 1e-4


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"name": "fly-2d"}, "scenario = 'fly-2d'.*balance-2d"),
        ({"worlds": 0}, "worlds = 0.*>= 1"),
        ({"worlds": 2.5}, "worlds = 2.5.*whole number"),
        ({"seed": -1}, "seed = -1.*>= 0"),
        ({"mass": float("nan")}, "mass = nan.*> 0"),
        ({"theta": 0.0}, "theta = 0.0.*>= 0.1"),
        ({"theta": 90}, "theta = 90.0.*<= 89.9"),
        ({"theta_end": -5}, "theta_end = -5.*>= 0.1"),
        ({"reference": "sine", "theta": 5, "amplitude": 10}, "amplitude = 10.*stays on its corner about theta = 5"),
        ({"mu": 0}, "mu = 0.0.*> 0"),
        ({"gravity": 0.0}, "gravity = 0.0.*f_min"),
        ({"theta": None}, "theta = None"),
        ({"mu": True}, "mu = True"),
        ({"name": 3}, "scenario = 3"),
        ({"world": None}, "world = None.*mapping"),
        ({"world_mu": 0.1}, "world_mu = 0.1.*known key"),
        ({"limits": None}, "limits = None"),
        ({"controller": "mine"}, "controller = 'mine'"),
        ({"reference": np.array([0.5, 0.6])}, "reference = 'ndarray'.*Sampled"),
        ({"reference": lambda t: (np.full(t.shape, np.nan), 0 * t, 0 * t)}, "reference = .*angle.*finite"),
        ({"reference": lambda t: (0.5, 0.0, 0.0)}, "reference = .*shape"),
        ({"reference": Constant(2.0)}, "theta = 114.592 deg.*it can be turned within"),
        ({"law": "magic"}, "law = 'magic'.*dynamic"),
        ({"reference": "spiral"}, "reference = 'spiral'.*arc"),
        ({"masss": 1.0}, "masss = 1.0.*known key"),
        ({"world": {"dt": 1.0}}, "world.dt = 1.0.*world.mu"),
        ({"world.mu": -1.0}, "world.mu = -1.0.*> 0"),
        ({"seconds": 3000.0, "dt": 1e-4}, "seconds = .*steps"),
        ({"name": "balance-2d", "seconds": 0.4}, "seconds = 0.4.*0.5 s that the verdict lets settle"),
    ],
)
def test_bad_input_is_named(arguments: dict, message: str) -> None:
    arguments = {"name": "pivot-2d", **arguments}
    with pytest.raises(ValueError, match=message):
        simulate(**arguments)
