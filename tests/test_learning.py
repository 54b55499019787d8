"""What motion and contact forces tell: the set holds the truth, shrinks, and is what linear programs say it is."""

from dataclasses import replace

import numpy as np
import pytest
from pivoting.controller.learning.balances import Balances, Cuts
from pivoting.controller.learning.friction import friction_bounds
from pivoting.controller.learning.identification import Identification, force_cuts, identify, moment_cuts
from pivoting.controller.learning.isolating_windows import isolating_windows
from pivoting.controller.learning.least_squares import RecursiveLeastSquares
from pivoting.controller.learning.motion_log import MeasurementErrors, motion_log
from pivoting.controller.learning.polytope import Polytope
from pivoting.controller.learning.set_membership import SetMembership
from pivoting.controller.learning.unknowns import Unknowns
from pivoting.controller.learning.windows import Window, weights, windows
from pivoting.controller.plane_and_space import space
from pivoting.controller.rotations import exponential, quaternion_product, rotated
from pivoting.controller.uncertainty.uncertainty import Interval, Uncertainty
from pivoting.sim import Run, simulate
from pivoting.sim.identification.logged_motion import run_log
from scipy.optimize import linprog

from tests.pivot_runs import GRAVITY, PivotRun, pivot_runs


def holds(found: Identification, run: PivotRun) -> bool:
    """Whether the truth is in the set, and in the interval of every parameter."""
    values = [run.member.mass, *run.member.com, run.member.inertia, *run.truth[1:-1]]
    inside = [each.after.low <= value <= each.after.high for each, value in zip(found.parameters, values, strict=False)]
    return found.consistent and found.set.holds(run.truth) and all(inside)


@pytest.mark.parametrize(
    ("dim", "count", "shove", "omega"), [(2, 20, 0.2, 0.0), (2, 10, 0.0, 0.02), (3, 12, 0.2, 0.0), (3, 8, 0.0, 0.02)]
)
def test_the_set_holds_the_truth(dim: int, count: int, shove: float, omega: float) -> None:
    """Of 50 objects; `make learning` looks at a thousand. Of some also the intervals, and what the controller gets."""
    for i, run in enumerate(pivot_runs(1, count, dim, shove, omega)):
        estimator = SetMembership(run.unknowns)
        for make in (moment_cuts, force_cuts):
            update = estimator.update(make(run.log, run.errors, run.unknowns))
            assert update.status != "reset"
            assert update.set.holds(run.truth)
        if i % 8:
            continue
        found = identify(run.log, run.errors, run.unknowns)
        assert holds(found, run)
        learned, member = found.uncertainty, run.member
        assert learned.mass.low <= member.mass <= learned.mass.high
        offset = member.com - found.shift
        assert ((learned.com[:, 0] <= offset) & (offset <= learned.com[:, 1])).all()


def test_after_one_pivot_the_first_moment_is_known_three_times_as_well() -> None:
    """In the median, without a shove and from motion alone; with what accuracy is measured by `make learning`."""
    ratios = []
    for run in pivot_runs(2, 7, 2, shove=0.0):
        log = replace(run.log, contact_force=np.full_like(run.log.contact_force, np.nan))
        found = {each.name: each for each in identify(log, run.errors, run.unknowns).parameters}
        ratios.append([found[name].after.half / found[name].before.half for name in ("m c_u", "m c_v")])
    assert np.median(ratios, axis=0).max() < 1.0 / 3.0


def test_bounds_that_are_too_narrow_are_noticed() -> None:
    """Or these tests could not fail: with errors that are said to be smaller than they are, the truth is lost."""
    for name, told, shove in (("theta", 0.02, 0.0), ("shove", 0.0, 0.2)):
        lost = 0
        for run in pivot_runs(3, 4, 2, shove):
            found = identify(run.log, replace(run.errors, **{name: told * getattr(run.errors, name)}), run.unknowns)
            lost += not holds(found, run)
        assert lost >= 2, name


@pytest.mark.parametrize("dim", [2, 3])
def test_the_box_is_that_of_all_cuts_by_another_solver(dim: int) -> None:
    """An interior point on the whole stack of half-spaces, none of which is left out as redundant."""
    (run,) = pivot_runs(4, 1, dim)
    estimator, prior = SetMembership(run.unknowns), run.unknowns.polytope
    cuts = [make(run.log, run.errors, run.unknowns) for make in (moment_cuts, force_cuts)]
    for each in cuts:
        estimator.update(each)
    A, b = Cuts.together(cuts).half_spaces
    A, b = np.vstack([prior.A, run.unknowns.select(A)]), np.concatenate([prior.b, b])
    width, middle = prior.high - prior.low, 0.5 * (prior.high + prior.low)
    size = np.abs(A) @ width
    scaled = A * width / size[:, None], (b - A @ middle) / size
    for i in range(len(width)):
        for sign, ours in ((1.0, estimator.set.high[i]), (-1.0, -estimator.set.low[i])):
            cost = -sign * np.eye(len(width))[i]
            other = linprog(cost, *scaled, bounds=(-0.5, 0.5), method="highs-ipm")
            best = -other.fun * width[i] + sign * middle[i]
            assert -1e-7 * width[i] <= ours - best <= 1e-5 * width[i]


def part(cuts: Cuts, first: int) -> Cuts:
    """Forty of them."""
    return Cuts(*(values[first : first + 40] for values in vars(cuts).values()))


def test_the_set_only_shrinks() -> None:
    """Points of each set are points of the one before, and what it cuts off stays away."""
    rng = np.random.default_rng(5)
    (run,) = pivot_runs(5, 1, 2)
    estimator = SetMembership(run.unknowns)
    whole = [make(run.log, run.errors, run.unknowns) for make in (moment_cuts, force_cuts)]
    for cuts in [part(each, first) for each in whole for first in range(0, len(each.values), 40)]:
        before, after = estimator.set, estimator.update(cuts).set
        assert (after.low >= before.low).all()
        assert (after.high <= before.high).all()
        inside = [x for x in rng.uniform(after.low, after.high, (200, len(after.low))) if after.holds(x)]
        assert all(before.holds(x) for x in inside)


def test_an_empty_set_is_reported_and_becomes_the_prior_again() -> None:
    (run,) = pivot_runs(6, 1, 2)
    estimator = SetMembership(run.unknowns)
    cuts = moment_cuts(run.log, run.errors, run.unknowns)
    assert estimator.update(cuts).status == "shrunk"
    assert estimator.update(replace(cuts, values=cuts.values + 10.0 * np.abs(cuts.values))).status == "reset"
    assert estimator.set is estimator.prior
    assert estimator.resets == 1
    assert estimator.update(cuts).status == "shrunk"
    found = identify(run.log, replace(run.errors, theta=0.0, shove=0.0, rate=0.0, contact_force=0.0), run.unknowns)
    assert not found.consistent


def test_a_polytope_is_outer_whatever_its_solver_says() -> None:
    """Boxes and ratios of random polytopes hold all their points, of which some are close to each side."""
    rng = np.random.default_rng(7)
    for n in (2, 4):
        for _ in range(10):
            A = rng.normal(size=(12, n))
            found = Polytope.box(np.full(n, 1.0), np.full(n, 3.0)).cut(
                A, A @ np.full(n, 2.0) + rng.uniform(0.1, 1.0, 12)
            )
            assert found is not None
            points = rng.uniform(1.0, 3.0, (20000, n))
            points = points[(points @ found.A.T <= found.b).all(axis=1)]
            assert (found.low <= points.min(axis=0)).all()
            assert (found.high >= points.max(axis=0)).all()
            low, high = found.ratio(1, 0)
            ratios = points[:, 1] / points[:, 0]
            assert low <= ratios.min() <= low + (0.1 if n == 2 else 0.4) * (high - low)
            assert high - (0.1 if n == 2 else 0.4) * (high - low) <= ratios.max() <= high
            c = rng.normal(size=n)
            least, most = found.interval(c)
            assert least <= (points @ c).min()
            assert most >= (points @ c).max()
    assert found.cut(np.eye(n)[:1], np.array([0.5])) is None


@pytest.mark.parametrize("dim", [2, 3])
def test_the_prior_holds_every_member(dim: int) -> None:
    """And no more than it has to of mass and first moment, whose bounds are products of ends."""
    rng = np.random.default_rng(8)
    (run,) = pivot_runs(8, 1, dim)
    prior, known = run.unknowns.prior, run.unknowns.polytope
    members = [prior.at(rng.random(3 + dim)) for _ in range(500)] + prior.vertices()
    points = np.array([run.unknowns.of(each.mass, each.com, each.inertia) for each in members])
    assert all(known.holds(x) for x in points)
    np.testing.assert_allclose(known.low[: 1 + dim], points[:, : 1 + dim].min(axis=0), rtol=1e-6)
    np.testing.assert_allclose(known.high[: 1 + dim], points[:, : 1 + dim].max(axis=0), rtol=1e-6)
    farthest = run.unknowns.select(run.unknowns.farthest) @ points.T
    size = np.linalg.norm(points[:, 1 : 1 + dim], axis=1)
    assert (farthest >= size - 1e-12).all()
    assert (farthest <= 1.1 * size).all()


def test_a_weight_is_integrated_exactly() -> None:
    time = np.cumsum(np.random.default_rng(9).uniform(0.5, 1.5, 200))
    for window in windows(np.ones(199, bool)):
        w = weights(window, time)
        corners = time[list(window.corners)]
        exact = np.trapezoid(window.heights, corners)
        assert w.step.sum() == pytest.approx(exact, abs=1e-9)
        assert w.around.sum() == pytest.approx(exact, abs=1e-9)
        assert w.slope @ w.duration == pytest.approx(0.0, abs=1e-12)
        assert (w.size >= np.abs(w.step)).all()


@pytest.mark.parametrize("dim", [2, 3])
def test_windows_made_for_a_log_tell_more_of_it_and_any_others_hold_the_truth(dim: int) -> None:
    rng, narrower = np.random.default_rng(dim), []
    for run in pivot_runs(5, 4, dim, 0.2):
        balances, prior = Balances(run.log, run.errors, run.unknowns), run.unknowns.polytope
        made = isolating_windows(balances, run.log.sticking, prior.low, prior.high)
        assert len(made) >= 3
        corners = made[0].corners
        any_ = [Window(corners, (0.0, *rng.uniform(-1.0, 1.0, len(corners) - 2), 0.0)) for _ in range(50)]
        boxes = []
        for more in ([], made, any_):
            estimator = SetMembership(run.unknowns)
            estimator.update(Cuts.together([balances.moments(each) for each in windows(run.log.sticking) + more]))
            assert estimator.set.holds(run.truth)
            assert estimator.resets == 0
            boxes.append((estimator.set.high - estimator.set.low)[1 : 1 + dim])
        assert (boxes[1] <= boxes[0] * (1.0 + 1e-9)).all()
        narrower.append((boxes[1] / boxes[0]).min())
    assert np.median(narrower) < 0.98


def test_least_squares_find_it_but_guarantee_nothing() -> None:
    """Of three logs one has a sensor with a constant error: there the truth is far outside the covariance."""
    off = []
    for run in pivot_runs(10, 3, 2, shove=0.0):
        squares, estimator = RecursiveLeastSquares(run.unknowns), SetMembership(run.unknowns)
        cuts = moment_cuts(run.log, run.errors, run.unknowns)
        squares.update(cuts)
        np.testing.assert_allclose(squares.mean[1:3], run.truth[1:3], rtol=0.2)
        assert estimator.update(cuts).set.holds(run.truth)
        off.append(np.abs(squares.mean - run.truth)[1:3].max() / np.sqrt(np.diag(squares.covariance))[1:3].max())
    assert min(off) < 0.5
    assert max(off) > 2.0


def hung(contact: int | None) -> tuple[Unknowns, MeasurementErrors, Identification]:
    """An object that swings in the air, turned and carried by a known wrench: its mass is 1.1 kg, 3 cm off."""
    here, dt, mass, offset = space(3), 2e-3, 1.1, np.array([0.03, -0.02, 0.01])
    time = dt * np.arange(501)
    orientation = exponential(np.outer(0.5 * time, [0.6, 0.8, 0.0]))
    com = np.stack([0.1 * np.sin(3.0 * time), 0.0 * time, 0.5 * time**2], axis=1)
    acceleration = np.stack([-0.9 * np.sin(3.0 * time), 0.0 * time, 1.0 + 0.0 * time], axis=1)
    force = rotated(orientation * np.array([1.0, -1.0, -1.0, -1.0]), mass * (acceleration - GRAVITY))[:-1]
    prior = Uncertainty(mass=(0.8, 1.2), com=(-0.05, 0.05), dim=3)
    unknowns = Unknowns(here, np.array([0.2, 0.1, 0.3]), np.diag([0.01, 0.02, 0.03]), prior)
    log = motion_log(
        time,
        orientation,
        np.hstack([force, np.zeros_like(force)]),
        unknowns.lever,
        GRAVITY,
        position=com - rotated(orientation, offset),
        contact=None if contact is None else np.full(500, contact),
    )
    errors = MeasurementErrors(theta=np.deg2rad(0.1), rate=0.6, position=5e-4)
    return unknowns, errors, identify(log, errors, unknowns)


def test_a_lift_off_tells_the_mass() -> None:
    """An open contact exerts no force, and nobody has to measure that."""
    unknowns, _, found = hung(2)
    mass = found.parameters[0]
    assert found.set.holds(unknowns.of(1.1, [0.03, -0.02, 0.01], 1.0))
    assert mass.after.half < 0.1 * mass.before.half
    assert mass.why == "contact force"


def test_friction_is_bounded_by_what_was_used_and_by_a_slip() -> None:
    time, steps = np.linspace(0.0, 1.0, 11), 10
    forces = np.column_stack([np.linspace(1.0, 3.0, steps), np.full(steps, 10.0)])
    contact = np.array([0] * 8 + [1] * 2)
    log = motion_log(
        time, np.zeros(11), np.zeros((steps, 3)), [0.1, 0.1], GRAVITY, contact_force=forces, contact=contact
    )
    normal = np.array([0.0, 0.0, 1.0])
    exact = friction_bounds(log, normal, 0.0)
    assert exact.used == pytest.approx(forces[7, 0] / 10.0)
    assert exact.slipped == pytest.approx(forces[8, 0] / 10.0)
    loose = friction_bounds(log, normal, 0.1)
    assert loose.used < exact.used
    assert loose.slipped > exact.slipped
    assert loose.within(Interval(0.1, 0.5)) == Interval(loose.used, loose.slipped)
    assert exact.within(Interval(0.4, 0.5)) is None
    assert friction_bounds(log, normal, 0.0, several=True).slipped == np.inf


def test_about_an_edge_only_the_parts_across_it_are_told() -> None:
    """And the answer says so by name."""
    (run,) = pivot_runs(11, 1, 3, shove=0.0)
    axis = np.array([0.0, -1.0, 0.0])
    time = np.linspace(0.0, 2.0, 401)
    orientation = exponential(np.outer(0.8 + 0.7 * np.sin(2.0 * time), axis))
    c = run.unknowns.lever
    mass = run.unknowns.prior.nominal.mass
    J = run.unknowns.inertia + mass * (c @ c * np.eye(3) - np.outer(c, c))
    h = mass * c
    middle = exponential(np.outer(0.8 + 0.7 * np.sin(2.0 * time[:-1] + 0.005), axis))
    turning = -2.8 * np.sin(2.0 * time[:-1] + 0.005) * J[1, 1]
    moment = turning - np.cross(rotated(middle, h), GRAVITY) @ axis
    wrench = np.zeros((400, 6))
    wrench[:, 4] = -moment
    log = motion_log(time, orientation, wrench, c, GRAVITY, axes=axis[None])
    prior = Uncertainty(mass=mass, com=(-0.1 * c.min(), 0.1 * c.min()), inertia=(0.8, 1.2), dim=3)
    unknowns = Unknowns(space(3), c, run.unknowns.inertia, prior)
    found = identify(log, MeasurementErrors(theta=3e-4, rate=1.5), unknowns)
    told = {each.name: each for each in found.parameters}
    assert found.set.holds(unknowns.of(mass, np.zeros(3), 1.0))
    assert told["m c_x"].told
    assert told["m c_z"].told
    assert told["I_P yy"].told
    assert told["m c_y"].why == "no balance depends on it: about an edge only the components across it do"
    assert told["mu"].why == "needs a measured contact force"


def test_momentum_needs_no_rates() -> None:
    """Of an object that tumbles about a point in space without gravity: of finer steps less is left of the balance."""
    left = []
    for steps in (100, 200):
        (run,) = pivot_runs(12, 1, 3, shove=0.0)
        J = run.unknowns.inertia
        dt, q, omega = 1.0 / steps, np.array([1.0, 0.0, 0.0, 0.0]), np.array([2.0, 0.3, 1.0])
        states = [q]
        for _ in range(steps):
            for _ in range(10):
                omega = omega + 0.1 * dt * np.linalg.solve(J, -np.cross(omega, J @ omega))
                q = quaternion_product(q, exponential(0.1 * dt * omega))
            states.append(q)
        log = motion_log(
            dt * np.arange(steps + 1), np.array(states), np.zeros((steps, 6)), [1.0, 1.0, 1.0], np.zeros(3)
        )
        cuts = Balances(log, MeasurementErrors(), run.unknowns).moments(windows(log.sticking)[0])
        left.append(np.abs(cuts.rows[:, 4:10] @ J[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)]).max() / J.max())
    assert left[1] < 1e-2
    assert left[1] < 0.6 * left[0]


def truth_of(run: Run, unknowns: Unknowns) -> np.ndarray:
    """The unknowns of the world, whose centre of mass is where it is believed to be."""
    body = run.truth
    x = unknowns.of(body.mass, np.zeros(body.dim), 1.0)
    tensor = space(body.dim).lift_inertia(body.inertia)
    c = unknowns.lever
    about = tensor + body.mass * (c @ c * np.eye(3) - np.outer(c, c))
    entries = [about[1, 1]] if body.dim == 2 else about[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)].tolist()
    return np.array([*x[: 1 + body.dim], *entries, np.trace(tensor) / np.trace(unknowns.inertia)])


@pytest.mark.parametrize(
    ("name", "keys"),
    [
        ("pivot-2d", {"world": {"mass": 1.15}, "noise": 0.1}),
        ("pivot-2d", {"world": {"mass": 0.85}}),
        ("pivot-3d", {"noise": 0.1, "world": {"mass": 1.1}}),
        ("spin-3d", {"noise": 0.02}),
    ],
)
def test_of_runs_in_mujoco(name: str, keys: dict[str, object]) -> None:
    """From what the controller knew, the world's mass and inertia are found within their bounds."""
    moved = {"reference": "arc"} if name.startswith("pivot") else {}
    run = simulate(name, seconds=1.0, **moved, **keys)
    believed = run_log(run)
    reach = 0.1 * float(np.linalg.norm(believed.log.lever))
    factor = (0.75, 1.25)
    prior = Uncertainty(
        mass=(0.8 * believed.mass, 1.2 * believed.mass),
        com=(-reach, reach),
        inertia=factor,
        theta=np.deg2rad(0.1),
        dim=run.truth.dim,
    )
    unknowns = Unknowns(believed.log.space, believed.log.lever, believed.inertia, prior)
    weight = believed.mass * 10.0
    errors = MeasurementErrors.of(prior, rate=1.5 * believed.log.measured_rate(), contact_force=0.02 * weight)
    found = identify(believed.log, errors, unknowns, several=believed.several)
    assert found.consistent
    assert found.set.holds(truth_of(run, unknowns))
    mass = found.parameters[0]
    assert mass.after.half < 0.5 * mass.before.half
    assert found.parameters[-1].after.low <= run.world.mu
