"""What an uncertain set is guaranteed: against a global search for the worst member, and against cutting planes."""

import os
import re
from dataclasses import replace

import numpy as np
import pytest
from pivoting.controller import Body, Contact, Law, WrenchController, WrenchProblem, solve
from pivoting.controller.motion import Motion
from pivoting.controller.rotations import exponential
from pivoting.controller.uncertainty.uncertainty import Uncertainty
from pivoting.controller.uncertainty.worst_case import PossibleWorld, contact_forces, world_at, worst_case
from pivoting.sim import simulate
from scipy.optimize import minimize

from tests.draws import draw, stated

GRAVITY = 9.81
SETS = int(os.environ.get("PIVOTING_SETS", "1"))  # of each kind; `make guarantee` tries 500
LARGE = {"shove": 0.2, "theta": np.deg2rad(0.1), "omega": 0.1}


def planar(rng: np.random.Generator, about: str, **more: object) -> tuple[WrenchController, Motion, Motion]:
    """A block of random size and mass on its corner, its set, its state and its reference."""
    mass, sides = 10.0 ** rng.uniform(-1.0, 1.0), rng.uniform(0.05, 0.3, 2)
    angle, rate, low = rng.uniform(0.1, 1.45), rng.normal(), rng.uniform(0.2, 0.8)
    known = Uncertainty(
        mass=mass * np.array([1.0 - rng.uniform(0.0, 0.25), 1.0 + rng.uniform(0.0, 0.25)]),
        com=np.outer(sides, [-0.05, 0.05]),
        inertia=(1.0 - rng.uniform(0.0, 0.25), 1.0 + rng.uniform(0.0, 0.25)),
        about=about,
        mu=(low, 1.0),
        **more,  # type: ignore[arg-type]
    )
    contact = Contact(-0.5 * sides, mu=0.9, f_min=rng.uniform(0.0, 0.1) * mass * GRAVITY)
    body = Body(mass, mass / 12.0 * float(sides @ sides))
    controller = WrenchController(body, [contact], Law.dynamic(), (0.0, -GRAVITY), uncertainty=known)
    state = Motion(angle, rate)
    return controller, state, Motion(angle + 0.02 * rng.normal(), rate, 3.0 * rng.normal())


def spatial(rng: np.random.Generator, K: int, **more: object) -> tuple[WrenchController, Motion, Motion]:
    """A block in space on a vertex, turned in any way, or on an edge."""
    mass, sides = 10.0 ** rng.uniform(-1.0, 1.0), rng.uniform(0.05, 0.3, 3)
    q = exponential(0.6 * rng.normal(size=3) if K == 1 else [0.0, -rng.uniform(0.2, 1.4), 0.0])
    about = rng.normal(size=3) if K == 1 else rng.normal() * np.array([0.0, 1.0, 0.0])
    squares = sides**2
    known = Uncertainty(
        mass=mass * np.array([1.0 - rng.uniform(0.0, 0.25), 1.0 + rng.uniform(0.0, 0.25)]),
        com=np.outer(sides, [-0.05, 0.05]),
        inertia=(0.8, 1.2),
        mu=(rng.uniform(0.25, 0.8), 1.0),
        **more,  # type: ignore[arg-type]
    )
    corners = np.array([[-0.5, -0.5, -0.5], [-0.5, 0.5, -0.5]])[:K] * sides
    floor = 0.02 * mass * GRAVITY
    body = Body(mass, mass / 12.0 * np.diag(squares.sum() - squares))
    contacts = [Contact(corner, mu=0.9, f_min=floor) for corner in corners]
    controller = WrenchController(body, contacts, Law.dynamic(), (0.0, 0.0, -GRAVITY), uncertainty=known)
    return controller, Motion(q, about), Motion(q, about, (1.0 + rng.random()) * about)


def load(controller: WrenchController) -> float:
    return GRAVITY * controller.body.mass


@pytest.mark.parametrize("about", ["contact", "com"])
def test_no_member_in_the_plane_violates_a_cone(about: str) -> None:
    """By 1e-9 of the load, whatever a global search finds; exact about the contact: there it finds the edge itself."""
    rng, binding = np.random.default_rng(len(about)), 0
    for _ in range(SETS):
        controller, state, desired = planar(rng, about)
        answer = solve(controller.problem(state, desired))
        slack = worst_case(controller, state, answer.wrench, thorough=True).slack / load(controller)
        assert slack >= -1e-9
        binding += slack < 1e-7
    assert about == "com" or binding >= SETS // 5


def test_the_price_in_the_plane_is_the_least() -> None:
    """Cutting planes: of the worst members found so far; their optimum rises until no member is violated any more."""
    rng = np.random.default_rng(3)
    for _ in range(SETS):
        controller, state, desired = planar(rng, "contact")
        mine = solve(controller.problem(state, desired))
        assert abs(mine.objective - by_cutting_planes(controller, mine.problem, state)) <= 1e-7 * mine.objective


def by_cutting_planes(controller: WrenchController, problem: WrenchProblem, state: Motion) -> float:
    """The objective of the smallest wrench for the members that a search finds, one after another."""
    floor, apex = controller.contacts[0].f_min, [np.array([[0.0, -1e3 * load(controller)]])]

    def member(shares: np.ndarray) -> PossibleWorld:
        return world_at(controller, np.r_[shares[:2], 0.0, shares[2:], 0.5 * np.ones(9)])

    while True:
        now = solve(WrenchProblem(
            problem.jacobian, problem.required, problem.mu, Q_w=problem.Q_w, Q_f=problem.Q_f, apex=np.array(apex),
            f_min=max(0.0, *(floor + tip[0, 1] for tip in apex), 0.0),
        ))  # fmt: skip

        def slack(shares: np.ndarray, wrench: np.ndarray = now.wrench) -> float:
            t, n = contact_forces(controller, state, wrench, member(shares))[0]
            return float(min(problem.mu_planned[0] * n - abs(t), n - floor))

        vertices = [np.array([i & 1, i >> 1 & 1, i >> 2 & 1, i >> 3 & 1], dtype=float) for i in range(16)]
        starts = sorted([*vertices, *np.random.default_rng(len(apex)).random((40, 4))], key=slack)[:4]
        found = [minimize(slack, start, method="L-BFGS-B", bounds=[(0.0, 1.0)] * 4).x for start in starts]
        worst = min(found, key=slack)
        if slack(worst) >= -1e-9 * load(controller):
            return now.objective
        apex.append(now.force - contact_forces(controller, state, now.wrench, member(worst)))
        assert len(apex) < 60


@pytest.mark.parametrize("K", [1, 2])
@pytest.mark.parametrize("more", [{}, LARGE], ids=["set", "set and disturbances"])
def test_no_member_in_space_violates_a_cone(K: int, more: dict[str, float]) -> None:
    rng = np.random.default_rng(10 * K + len(more))
    for _ in range(SETS):
        controller, state, desired = spatial(rng, K, **more)
        answer = solve(controller.problem(state, desired))
        assert answer.residual < 1e-8
        assert worst_case(controller, state, answer.wrench).slack / load(controller) >= -1e-9


def test_what_is_guaranteed_is_said() -> None:
    """Strong stability of one contact, weak of two; a proof in the plane; an excess of a few per cent of the load."""
    rng = np.random.default_rng(6)
    for _ in range(SETS):
        for made, stability in ((planar(rng, "contact"), "strong"), (planar(rng, "com"), "strong"),
                                (spatial(rng, 1), "strong"), (spatial(rng, 2), "weak")):  # fmt: skip
            controller, state, desired = made
            said = controller.guarantee(state, desired)
            assert said.stability == stability
            assert 0.0 <= said.excess < 0.1 * load(controller)
            if controller.space.dim == 2:
                assert said.proved
            if controller.uncertainty is not None and controller.uncertainty.about == "contact":
                assert said.excess == 0.0


def test_disturbances_in_the_plane_violate_no_cone() -> None:
    """A shove, and errors of what is measured, belong to the set; without them in the set they do violate it."""
    rng, violated = np.random.default_rng(8), 0
    for _ in range(SETS):
        controller, state, desired = planar(rng, "com", **LARGE)
        answer = solve(controller.problem(state, desired))
        assert worst_case(controller, state, answer.wrench).slack >= -1e-9 * load(controller)
        known = controller.uncertainty
        assert known is not None
        unaware = WrenchController(
            controller.body, controller.contacts, controller.law, controller.gravity,
            uncertainty=replace(known, shove=0.0, theta=0.0, omega=0.0),
        )  # fmt: skip
        careless = solve(unaware.problem(state, desired)).wrench
        violated += worst_case(controller, state, careless).slack < -1e-3 * load(controller)
    assert violated >= SETS // 5


def test_a_larger_set_costs_more_and_none_nothing() -> None:
    rng = np.random.default_rng(2)
    for _ in range(SETS):
        controller, state, desired = planar(rng, "contact")
        known = controller.uncertainty
        assert known is not None
        evenly = replace(known, mass=controller.body.mass * np.array([0.8, 1.2]))
        costs = []
        for scale in (0.0, 0.5, 1.0):
            its = WrenchController(
                controller.body, controller.contacts, controller.law, controller.gravity,
                uncertainty=replace(evenly.scaled(scale), mu=known.mu),
            )  # fmt: skip
            costs.append(solve(its.problem(state, desired)).objective)
        nominal = WrenchController(
            controller.body, [Contact(controller.contacts[0].point, known.mu.low, controller.contacts[0].f_min)],
            controller.law, controller.gravity,
        )  # fmt: skip
        assert abs(costs[0] - solve(nominal.problem(state, desired)).objective) <= 1e-12 * costs[0]
        assert costs[0] <= costs[1] * (1.0 + 1e-12)
        assert costs[1] <= costs[2] * (1.0 + 1e-12)


@pytest.mark.parametrize(("K", "dim"), [(1, 2), (2, 2), (1, 3), (2, 3)])
def test_moved_cones_are_solved_alike_by_all_methods(K: int, dim: int) -> None:
    """One moved cone a contact, and several at once: certified, within all of them, and as dear as Clarabel's."""
    rng = np.random.default_rng(10 * K + dim)
    for case in range(40):
        plain = stated(draw(rng, K, dim, decades=2.0))
        size = abs(plain.required).max()
        apex = 0.3 * size * rng.normal(size=(1 if case % 2 else rng.integers(2, 33), K, dim))
        problem = WrenchProblem(
            plain.jacobian, plain.required, plain.mu, f_min=plain.f_min, Q_w=plain.Q_w, Q_f=plain.Q_f, apex=apex
        )
        answer, other = solve(problem, tolerance=1e-8), solve(problem, "clarabel", tolerance=1e-6)
        assert abs(answer.objective - other.objective) <= 1e-7 * other.objective
        moved = answer.force - apex
        within = problem.mu_planned * moved[..., -1] - np.linalg.norm(moved[..., :-1], axis=-1)
        assert min(within.min(), (answer.force[:, -1] - problem.f_min).min()) >= -1e-9 * size
        if dim == 2:
            exact = solve(problem, "qp:quadprog", tolerance=1e-6)
            assert abs(answer.objective - exact.objective) <= 1e-8 * exact.objective


@pytest.mark.parametrize(("wrong", "message"), [
    ({"mass": (2.0, 1.0)}, "mass = (2.0, 1.0): must be (low, high) with low <= high"),
    ({"mass": (0.0, 1.0)}, "mass = (0.0, 1.0): must be an interval (low, high) of numbers > 0 [kg]"),
    ({"inertia": (0.0, 1.2)}, "inertia = (0.0, 1.2): must be an interval (low, high) of numbers > 0"),
    ({"com": (0.1, 0.2)}, "com = (0.1, 0.2): must be a number >= 0, or an interval (low, high) with 0 in it"),
    ({"com": 0.1, "dim": None}, "dim = None: must be 2 or 3, where com is one interval for all axes"),
    ({"mu": float("nan")}, "mu = nan: must be a finite number"),
    ({"about": "pivot"}, "about = 'pivot': must be one of com, contact"),
    ({"shove": -1.0}, "shove = -1.0: must be"),
    ({"theta": "a"}, "theta = 'a': must be"),
])  # fmt: skip
def test_sets_that_no_world_is_in_are_refused(wrong: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        Uncertainty(**{"dim": 2, **wrong})  # type: ignore[arg-type]


@pytest.mark.parametrize(("known", "contact", "message"), [
    (Uncertainty(dim=3), Contact((-0.1, -0.1), 0.5), "uncertainty.com"),
    (Uncertainty(mass=(1.1, 1.2), dim=2), Contact((-0.1, -0.1), 0.5), "the believed mass of 1 kg is in it"),
    (Uncertainty(inertia=(1.1, 1.2), dim=2), Contact((-0.1, -0.1), 0.5), "1, the believed inertia, is in it"),
    (Uncertainty(dim=2), Contact((-0.1, -0.1), 0.5, radius=0.01), "of contacts that roll nothing is guaranteed"),
    ("mass", Contact((-0.1, -0.1), 0.5), "uncertainty = 'mass': must be an Uncertainty"),
])  # fmt: skip
def test_sets_that_are_not_of_the_controller_are_refused(known: Uncertainty, contact: Contact, message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        WrenchController(Body(1.0, 0.01), [contact], Law.static(), (0.0, -GRAVITY), uncertainty=known)


def test_an_error_of_theta_that_leaves_no_friction_is_refused() -> None:
    known = Uncertainty(theta=0.5, mu=0.3, dim=2)
    controller = WrenchController(
        Body(1.0, 0.01), [Contact((-0.1, -0.1), 0.5)], Law.static(), (0.0, -GRAVITY), uncertainty=known
    )
    with pytest.raises(ValueError, match="half-angle, of mu = 0"):
        controller.problem(Motion(0.5))


@pytest.mark.parametrize("name", ["pivot-2d", "spin-3d"])
def test_the_loop_solves_the_problems_of_the_controller(name: str) -> None:
    """Bit for bit what `problem` and `solve` give at the logged states."""
    run = simulate(name, 2, mass=(0.8, 1.2), com=(-0.005, 0.005), mu=(0.25, 0.8), seconds=0.6, hold=0.1)
    here, controller = run.attached.controller.space, run.attached.controller
    for k in (0, 137, 555):
        state = run.log.states[1, k]
        q, omega = state[3:7], state[10:13]
        seen = Motion(q, omega) if here.dim == 3 else Motion(float(here.angle(q)), float(omega @ here.axial(1.0)))
        sought = [np.asarray(each[k]) for each in run.desired]
        wanted = Motion(*sought) if here.dim == 3 else Motion(
            float(here.angle(sought[0])), *(float(each @ here.axial(1.0)) for each in sought[1:])
        )  # fmt: skip
        answer = solve(controller.problem(seen, wanted))
        assert answer.problem.moved
        assert np.abs(answer.wrench - run.log.answers.wrench[1, k]).max() <= 1e-9 * np.abs(answer.wrench).max()


def test_a_world_that_slides_without_the_guarantee_sticks_with_it() -> None:
    """The worst vertices of the set that a nominal controller loses its grip on."""
    told = {"mass": (0.8, 1.2), "com": (-0.005, 0.005), "inertia": (0.8, 1.2), "mu": (0.25, 0.8)}
    loop = {"worlds_at": "vertices", "seconds": 1.0, "hold": 0.1, "theta_end": 60.0}
    careless = simulate("pivot-3d", 64, **told, **loop, guarantee="none")
    assert careless.measures.slip_max_m.max() > 1e-3
    held = simulate("pivot-3d", 64, **told, **loop)
    assert held.measures.slip_max_m.max() < 2e-5
    assert (held.log.answers.status == 0).all()
