"""Wrench problems within bounds: against another modelling layer, and what is given up where they are too small."""

import warnings

import cvxpy as cp
import numpy as np
import pytest
from pivoting.controller import Body, Contact, Law, Motion, WrenchBounds, WrenchController, solve
from pivoting.controller.belief import for_worlds
from pivoting.controller.bounded_solver import BREAK, GIVE_UP, BoundedSolver
from pivoting.controller.kernels.compiled_step import step_worlds
from pivoting.controller.solvers.clarabel_backend import POOR, ClarabelWithRetry
from pivoting.controller.validate import frozen

G = 10.0


def planar() -> WrenchController:
    """The notes' block."""
    return WrenchController(Body(1.0, 1.0 / 6.0), [Contact([-0.5, -0.5], 0.3)], Law.dynamic(), [0.0, -G], margin=1 / 6)


def spatial(contacts: int = 2) -> WrenchController:
    """A block on an edge, or on a vertex."""
    points = [[-0.5, -0.35, -0.7], [-0.5, 0.35, -0.7]][:contacts]
    body = Body(2.0, np.diag([0.4, 0.5, 0.3]))
    return WrenchController(body, [Contact(p, 0.5, 0.2) for p in points], Law.dynamic(), [0.0, 0.0, -G], margin=0.1)


def tilted(angle: float) -> np.ndarray:
    """Turned about -y."""
    return np.array([np.cos(0.5 * angle), 0.0, -np.sin(0.5 * angle), 0.0])


CASES = [(planar(), "plane"), (spatial(), "edge"), (spatial(1), "vertex")]
BOUNDS = {
    "wide": WrenchBounds(),
    "force": WrenchBounds(force=6.0),
    "moment": WrenchBounds(moment=0.9),
    "both": WrenchBounds(force=4.0, moment=0.5),
    "tiny": WrenchBounds(force=0.5, moment=0.5),
    "rates": WrenchBounds(force=20.0, force_rate=30.0, moment_rate=20.0),
}


def stated(controller: WrenchController, angle: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Orientation, Jacobian and required wrench at rest."""
    q = tilted(angle)
    problem = controller.problem(Motion(angle) if controller.space.dim == 2 else Motion(q, np.zeros(3)))
    return q, problem.jacobian, problem.required


@pytest.mark.parametrize("name", BOUNDS)
@pytest.mark.parametrize(("controller", "kind"), CASES, ids=[kind for _, kind in CASES])
def test_another_modelling_layer_agrees(controller: WrenchController, kind: str, name: str) -> None:
    """In units of the weight and the lever, as the penalties are.

    Two solvers that stop at 1e-10 of a cost of order 10 are sqrt(1e-9) = 3e-5 apart at most, where the cost is flat.
    """
    bounds, dt = BOUNDS[name], 0.05
    q, J, required = stated(controller, 0.3)
    dim, nw, n = controller.space.dim, *J.shape
    before = np.linspace(-0.4, 0.4, nw)
    answer = BoundedSolver(controller, bounds, dt)(q, required, before)
    weight, lever = controller.body.mass * G, np.linalg.norm(controller.belief.contacts.pivot)
    unit = weight * np.array([1.0] * dim + [lever] * (nw - dim))
    f, w, s = cp.Variable(n), cp.Variable(nw), cp.Variable(nw)
    # of a turn about the contacts: everywhere about a vertex, about the edge, in the plane
    axes = {"plane": [[0.0, -1.0, 0.0]], "edge": [[0.0, 1.0, 0.0]], "vertex": np.eye(3)}[kind]
    arm, inertia = -controller.belief.contacts.pivot, controller.belief.object.inertia
    moves = [np.r_[controller.body.mass * np.cross(e, arm), inertia @ np.asarray(e, dtype=float)] for e in axes]
    B = controller.belief.source.map @ np.array(moves).T / unit[:, None]
    B /= np.abs(B).max()
    a = cp.Variable(B.shape[1])
    limits = [(J @ f * weight + cp.multiply(unit, w - B @ a - s) - required) / unit == 0]
    for i, contact in enumerate(controller.contacts):
        own = f[dim * i : dim * (i + 1)]
        limits += [own[-1] >= contact.f_min / weight]
        limits += [cp.norm(own[:-1]) <= controller.belief.contacts.mu[i] * own[-1]]
    F, M = weight * w[:dim], weight * lever * w[dim:]
    for value, most in ((F, bounds.force), (M, bounds.moment)):
        limits += [cp.norm(value) <= most] if np.isfinite(most) else []
    for value, old, most in ((F, before[:dim], bounds.force_rate), (M, before[dim:], bounds.moment_rate)):
        limits += [cp.norm(value - old) <= most * dt] if np.isfinite(most) else []
    Q_w = unit[:, None] * controller.Q_w * unit / weight**2
    cost = 0.5 * cp.quad_form(w, Q_w) + 0.5 * cp.quad_form(f, controller.Q_f)
    problem = cp.Problem(cp.Minimize(cost + GIVE_UP * cp.norm(a) + BREAK * cp.norm(s)), limits)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Solution may be inaccurate")  # how inaccurate, is what follows
        problem.solve(solver=cp.CLARABEL, tol_gap_abs=1e-9, tol_gap_rel=1e-9, tol_feas=1e-9)
    np.testing.assert_allclose(answer.wrench / unit, w.value, atol=3e-5)
    np.testing.assert_allclose(answer.force.ravel() / weight, f.value, atol=3e-5)
    np.testing.assert_allclose(answer.lacking / unit, -(B @ a.value + s.value), atol=3e-5)
    assert answer.residual < 1e-8
    assert bounds.excess(answer.wrench, before, dt) < 1e-8
    assert answer.exact == (np.abs(answer.lacking / unit).max() < 1e-6)


@pytest.mark.parametrize(("controller", "kind"), CASES, ids=[kind for _, kind in CASES])
def test_wide_bounds_change_nothing(controller: WrenchController, kind: str) -> None:
    q, _, required = stated(controller, 0.2)
    problem = controller.problem(Motion(0.2) if controller.space.dim == 2 else Motion(q, np.zeros(3)))
    smallest = solve(problem)
    answer = BoundedSolver(controller, WrenchBounds(force=100.0, moment=100.0), 1e-3)(q, required)
    assert answer.exact
    np.testing.assert_allclose(answer.wrench, smallest.wrench, atol=1e-6 * np.abs(required).max())
    np.testing.assert_allclose(answer.force, smallest.force, atol=1e-6 * np.abs(required).max())


def test_what_is_given_up_is_a_turn_about_the_contact_where_that_is_enough() -> None:
    """A force that is too small to hold the block lets it turn about its corner, not slide or lift."""
    controller = planar()
    q, _, required = stated(controller, np.deg2rad(40.0))
    answer = BoundedSolver(controller, WrenchBounds(force=0.3, moment=0.1), 1e-3)(q, required)
    assert not answer.exact
    turn = np.r_[np.cross([0.0, -1.0, 0.0], -controller.belief.contacts.pivot)[[0, 2]], 1.0 / 6.0]
    np.testing.assert_allclose(answer.lacking, answer.lacking[2] / turn[2] * turn, atol=1e-6)


@pytest.mark.parametrize(
    ("argument", "message"),
    [
        ({"force": 0.0}, "force = 0.0: must be > 0"),
        ({"moment": -1.0}, "moment = -1.0: must be > 0"),
        ({"force_rate": "fast"}, "force_rate = 'fast': must be > 0"),
        ({"moment_rate": float("nan")}, "moment_rate = nan: must be > 0"),
        ({"component": [1.0, 2.0]}, "component = .*: must be 3 .plane. or 6"),
        ({"component": [1.0, 2.0, 0.0]}, "component = .*: must be 3 .plane. or 6"),
    ],
)
def test_bounds_that_are_none_are_refused(argument: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        WrenchBounds(**argument)


def test_excess_is_relative_to_the_bound() -> None:
    bounds = WrenchBounds(force=5.0, component=[4.0, np.inf, 1.0], force_rate=10.0)
    assert bounds.any
    assert not WrenchBounds().any
    assert bounds.excess(np.array([3.0, 4.0, 0.5])) == pytest.approx(0.0)
    assert bounds.excess(np.array([3.0, 4.0, 1.5])) == pytest.approx(0.5)
    assert bounds.excess(np.array([3.0, 4.0, 0.5]), np.zeros(3), 0.25) == pytest.approx(1.0)
    with pytest.raises(ValueError, match="component"):
        bounds.balls(6)


def test_an_answer_is_asked_for_again_with_the_users_own_options() -> None:
    """With four iterations there is no good answer: the careful try has four as well, and the better one counts."""
    solver = BoundedSolver(planar(), WrenchBounds(force=6.0), 0.05)
    few = ClarabelWithRetry(max_iter=4)
    programs = []
    solver._solve = lambda program: (programs.append(program), few(program))[1]
    q, _, required = stated(planar(), 0.3)
    poor = solver(q, required)
    (program,) = programs
    assert POOR < poor.residual == min(few(program).residual, ClarabelWithRetry(max_iter=4)(program).residual)
    assert ClarabelWithRetry()(program).residual <= POOR
    assert "MaxIterations" in few(program).message


def test_contacts_on_all_sides_of_the_centre_have_a_length() -> None:
    """Their mean is not quite the centre, by rounding: no unit of length."""
    points = [(0.1, 0.0), (0.2, 0.0), (-0.3, 0.0)]
    contacts = [Contact(point, 0.3) for point in points]
    assert 0.0 < np.linalg.norm(np.mean(points, axis=0)) < 1e-16
    with pytest.raises(ValueError, match="away from the centre of mass, or Q_w given"):
        WrenchController(Body(1.0, 0.1), contacts, Law.static(), [0.0, -G])
    controller = WrenchController(Body(1.0, 0.1), contacts, Law.static(), [0.0, -G], Q_w=np.eye(3))
    assert controller.units.length == pytest.approx(0.3)
    q, _, required = stated(controller, 0.0)
    assert BoundedSolver(controller, WrenchBounds(force=5.0), 0.05)(q, required).residual < POOR


@pytest.mark.parametrize(("controller", "kind"), CASES, ids=[kind for _, kind in CASES])
def test_a_bound_is_a_heavier_weight(controller: WrenchController, kind: str) -> None:
    """The loop's own answers within a bound are those of the cone program, and not dearer; what it cannot hold is left.

    Clarabel stops at 1e-12 of the cost, so that its wrenches are 1e-5 off where the cost is flat.
    """
    rng, still, held, left = np.random.default_rng(5), np.zeros((1, 3)), 0, 0
    nw, n, dim = len(controller.Q_w), len(controller.Q_f), controller.space.dim
    belief, work, units = for_worlds([controller.belief]), controller.workspace(), controller.units

    def step(bounds: WrenchBounds, angle: float, wanted: float) -> tuple[np.ndarray, ...]:
        out, status = np.empty((1, 2 * nw + n + 1)), np.empty(1, np.int8)
        q, q_d = tilted(angle)[None], tilted(wanted)[None]
        own, none = tuple(bounds.stacked(nw)), np.zeros((1, nw))
        state, desired = frozen(np.hstack([still, q, still, still])), np.hstack([q_d, still, still])
        step_worlds(*belief, own, *work, 1e-9, state, desired, none, out, status)
        assert status[0] == 0
        return tuple(np.split(out[0, :-1], [nw, 2 * nw]))

    def cost(wrench: np.ndarray, force: np.ndarray) -> float:
        return float(wrench @ controller.Q_w @ wrench + force @ controller.Q_f @ force)

    for case in range(100):
        angle = rng.uniform(0.05, 1.4)
        wanted = angle + rng.normal() * 0.02
        required, free, force = step(WrenchBounds(), angle, wanted)
        most = np.linalg.norm(free[:dim]) if case % 2 else np.linalg.norm(free[dim:])
        bounds = WrenchBounds(**{"force" if case % 2 else "moment": rng.uniform(0.6, 0.99) * most})
        same, wrench, pushed = step(bounds, angle, wanted)
        np.testing.assert_array_equal(same, required)
        missing = controller.jacobian(tilted(angle)) @ force + free - required
        assert np.abs(missing / units.wrench).max() <= 1e-12
        if bounds.excess(wrench) > 1e-9:
            left += 1
            np.testing.assert_array_equal(wrench, free)
            continue
        other = BoundedSolver(controller, bounds, 0.05)(tilted(angle), required)
        assert other.exact
        assert np.abs((wrench - other.wrench) / units.wrench).max() <= 3e-5
        assert cost(wrench, pushed) <= cost(other.wrench, other.force.ravel()) * (1.0 + 1e-8)
        balance = controller.jacobian(tilted(angle)) @ pushed + wrench - required
        assert np.abs(balance / units.wrench).max() <= 1e-12
        held += 1
    assert held >= 50
    assert left >= 1
