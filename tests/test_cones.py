"""Cones in space and several contacts: right, certified, and with every symmetry that the problem has."""

import itertools
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pivoting.controller import ClarabelWorkspace, SolveError, WrenchProblem, pyramid_excess, solve
from pivoting.controller.kernels import interior_point
from pivoting.controller.kernels.interior_point import EXACT
from pivoting.controller.kernels.planar_closed_form import balancing_wrench, planar_force, reduce
from pivoting.controller.kernels.workspace import workspace
from scipy.linalg import block_diag

from tests.draws import (
    PIECES,
    PROBLEMS,
    RARE,
    SETS,
    Data,
    closed_form_residuals,
    draw,
    rotation,
    solve_all,
    stack,
    stated,
    trivial_cost,
    wedge,
    whitened_objective,
)

SIZES = [(1, 3), (2, 3), (4, 3), (2, 2), (4, 2)]  # (contacts, dim); one planar contact has tests of its own
seeds = st.integers(0, 2**32 - 1)
sizes = st.sampled_from(SIZES)


def costs(many: Data, wrench: np.ndarray, force: np.ndarray) -> np.ndarray:
    """(N,) objectives."""
    return 0.5 * (
        np.einsum("ni,nij,nj->n", wrench, many.Q_w, wrench) + np.einsum("ni,nij,nj->n", force, many.Q_f, force)
    )


@pytest.mark.parametrize(("K", "dim"), SIZES)
def test_random_problems(K: int, dim: int) -> None:
    """KKT residual <= 1e-10 on all, every piece met, and by 1e-7 never dearer than Clarabel, nor far from it."""
    rng = np.random.default_rng(100 * K + dim)
    many = stack([draw(rng, K, dim) for _ in range(PROBLEMS)])
    answers = solve_all(many)
    assert answers.residual.max() <= 1e-10, np.sort(answers.residual)[-5:]
    loaded = answers.force[answers.force.any(axis=1)]
    assert len(loaded) > PROBLEMS // 2
    # Where all are at the apex at once no piece is recorded; in the plane an edge and its rim have no arc.
    met = dict(zip(PIECES, np.bincount(answers.piece[answers.force.any(axis=1)].ravel(), minlength=5), strict=True))
    assert met["apex"] + (len(answers.force) - len(loaded)) > RARE, met
    assert min(count for name, count in met.items() if name != "apex") > RARE, met
    mine = costs(many, answers.wrench, answers.force)
    refused = 0
    for i in range(150):
        problem = stated(Data(*(array[i] for array in many)))
        try:
            other = solve(problem, "clarabel", tolerance=1e-8).objective
        except SolveError:
            refused += 1
            continue
        assert mine[i] <= other * (1.0 + 1e-7), i  # never dearer
        assert abs(mine[i] - other) <= 1e-6 * trivial_cost(problem), i  # what Clarabel's own accuracy allows
    assert refused <= 30  # Clarabel is the one that cannot certify to 1e-8


@pytest.mark.parametrize("kind", SETS)
@pytest.mark.parametrize("dim", [2, 3])
def test_degenerate_contact_sets(kind: str, dim: int) -> None:
    """Edges, faces, colinear and coincident points: J'J is singular, only Q_f decides, and the answer is certified."""
    rng = np.random.default_rng(SETS.index(kind) * 10 + dim)
    problems = [draw(rng, 4, dim, kind=kind) for _ in range(500)]
    ranks = [np.linalg.matrix_rank(data.jacobian) for data in problems[:50]]
    assert max(ranks) < problems[0].jacobian.shape[1]
    assert solve_all(stack(problems)).residual.max() <= 1e-10
    for data in problems[:10]:
        mine, other = solve(stated(data)), solve(stated(data), "clarabel", tolerance=1e-5)
        assert other.objective == pytest.approx(mine.objective, rel=1e-6)


def test_beyond_a_condition_of_1e6() -> None:
    """Weights with condition numbers of up to 1e9 each, so that H reaches 1e11 and more."""
    rng = np.random.default_rng(9)
    for K in (1, 2, 4):
        many = stack([draw(rng, K, decades=9.0) for _ in range(2_000)])
        assert solve_all(many).residual.max() <= 1e-10


@settings(max_examples=60, deadline=None)
@given(seeds, sizes)
def test_rotating_the_problem_rotates_the_wrench(seed: int, size: tuple[int, int]) -> None:
    rng = np.random.default_rng(seed)
    data = draw(rng, *size, decades=3.0)
    if size[1] == 3:
        R = rotation(rng)
        turn = block_diag(R, R)
    else:
        c, s = np.cos(1.0), np.sin(1.0)
        turn = block_diag([[c, -s], [s, c]], 1.0)
    turned = data._replace(jacobian=turn @ data.jacobian, required=turn @ data.required, Q_w=turn @ data.Q_w @ turn.T)
    before, after = solve(stated(data)), solve(stated(turned))
    close = 1e-9 * max(np.abs(data.required).max(), np.abs(before.wrench).max(), np.abs(before.force).max())
    np.testing.assert_allclose(after.wrench, turn @ before.wrench, rtol=0.0, atol=close)
    np.testing.assert_allclose(after.force, before.force, rtol=0.0, atol=close)


@settings(max_examples=60, deadline=None)
@given(seeds, st.sampled_from([1, 2, 4]))
def test_turning_the_tangents_turns_the_forces_alone(seed: int, K: int) -> None:
    """The cone is round: tangents turned about their normals, contact by contact, change nothing that can be felt."""
    rng = np.random.default_rng(seed)
    data = draw(rng, K, decades=3.0)
    turns = []
    for angle in rng.uniform(-np.pi, np.pi, K):
        c, s = np.cos(angle), np.sin(angle)
        turns.append(np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]))
    turn = block_diag(*turns)
    turned = data._replace(jacobian=data.jacobian @ turn, Q_f=turn.T @ data.Q_f @ turn)
    before, after = solve(stated(data)), solve(stated(turned))
    close = 1e-9 * max(np.abs(data.required).max(), np.abs(before.wrench).max(), np.abs(before.force).max())
    np.testing.assert_allclose(after.wrench, before.wrench, rtol=0.0, atol=close)
    np.testing.assert_allclose(turn @ after.force.ravel(), before.force.ravel(), rtol=0.0, atol=close)


@settings(max_examples=60, deadline=None)
@given(seeds, sizes, st.floats(1e-6, 1e6), st.floats(1e-6, 1e6))
def test_scaling_laws(seed: int, size: tuple[int, int], load: float, weights: float) -> None:
    """Load and floors times a: answers times a. All weights times a: the same answers."""
    data = draw(np.random.default_rng(seed), *size, decades=3.0)
    scaled = data._replace(
        required=load * data.required, f_min=load * data.f_min, Q_w=weights * data.Q_w, Q_f=weights * data.Q_f
    )
    before, after = solve(stated(data)), solve(stated(scaled))
    close = 1e-9 * max(np.abs(data.required).max(), np.abs(before.wrench).max(), np.abs(before.force).max())
    np.testing.assert_allclose(after.wrench / load, before.wrench, rtol=0.0, atol=close)
    np.testing.assert_allclose(after.force / load, before.force, rtol=0.0, atol=close)


@settings(max_examples=60, deadline=None)
@given(seeds, st.sampled_from([1, 2, 4]))
def test_a_planar_problem_in_space_has_the_planar_answer(seed: int, K: int) -> None:
    """x-z-moment about -y; weights that do not couple the plane to the rest, so nothing leaves it."""
    rng = np.random.default_rng(seed)
    flat = draw(rng, K, 2, decades=3.0)
    rows, columns = [0, 2, 4], [3 * (j // 2) + 2 * (j % 2) for j in range(2 * K)]
    J, Q_w, Q_f = rng.normal(size=(6, 3 * K)), np.diag(rng.uniform(0.5, 2.0, 6)), np.diag(rng.uniform(0.5, 2.0, 3 * K))
    outside, across = [1, 3, 5], [3 * i + 1 for i in range(K)]
    J[np.ix_(rows, across)] = 0.0
    J[np.ix_(outside, columns)] = 0.0
    J[np.ix_(rows, columns)] = flat.jacobian
    Q_w[np.ix_(rows, rows)] = flat.Q_w
    Q_f[np.ix_(columns, columns)] = flat.Q_f
    b = np.zeros(6)
    b[rows] = flat.required
    planar, spatial = solve(stated(flat)), solve(stated(Data(J, b, Q_w, Q_f, flat.mu, flat.f_min)))
    close = 1e-9 * max(np.abs(b).max(), np.abs(planar.force).max())
    np.testing.assert_allclose(spatial.force[:, [0, 2]], planar.force, rtol=0.0, atol=close)
    np.testing.assert_allclose(spatial.force[:, 1], 0.0, atol=close)
    np.testing.assert_allclose(spatial.wrench[rows], planar.wrench, rtol=0.0, atol=close)


def no_closed_form(*args: Any) -> tuple[int, float]:
    """Leaves nothing that could be used."""
    return 0, np.inf


def test_one_contact_in_closed_form_and_by_the_interior_point(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two methods that share only the polish find the same force."""
    iterated, w, scratch = np.empty(3), np.empty(6), workspace(6, 1, 3)[1]
    monkeypatch.setattr(interior_point, "_closed_form", no_closed_form)
    for seed in range(40):
        data = draw(np.random.default_rng(seed), 1, decades=4.0)
        assert interior_point.contact_wrench.py_func(*data, iterated, w, scratch) <= 1e-12
        closed = solve(stated(data)).force[0]
        np.testing.assert_allclose(iterated, closed, rtol=0.0, atol=1e-9 * (np.abs(closed).max() + data.f_min[0]))


def test_what_rounding_made_indefinite_is_left_to_the_interior_point() -> None:
    """The closed form takes roots of H, which here is J'Q_w J of rank 2 and next to nothing."""
    rng = np.random.default_rng(2)
    R, p = rotation(rng), rng.normal(size=3)
    J = np.vstack([R, wedge(p) @ R])
    Q_w = np.diag([1e-18] * 3 + [1.0] * 3)
    for _ in range(20):
        problem = WrenchProblem(J, rng.normal(size=6), [0.5], f_min=[0.0], Q_w=Q_w, Q_f=1e-17 * np.eye(3))
        assert solve(problem).residual < 1e-12


def test_the_closed_form_needs_no_second_try() -> None:
    """`contact_wrench` would go on to the interior point if the closed form failed, and hide it."""
    rng = np.random.default_rng(103)
    many = stack([draw(rng, 1) for _ in range(PROBLEMS)])
    assert closed_form_residuals(many).max() <= EXACT


@pytest.mark.parametrize("K", [2, 4])
def test_planar_contacts_against_an_active_set_solver(K: int) -> None:
    """Quadprog is exact where Clarabel is not: objectives within 1e-7, both ways, wherever quadprog is certified."""
    rng = np.random.default_rng(200 + K)
    compared = 0
    for _ in range(1_000):
        problem = stated(draw(rng, K, 2))
        try:
            other = solve(problem, "qp:quadprog", tolerance=1e-9).objective
        except SolveError:
            continue
        compared += 1
        assert abs(solve(problem).objective - other) <= 1e-7 * other
    assert compared > 900


POINT = np.vstack([np.eye(3), np.zeros((3, 3))])  # one contact at the centre of mass


@pytest.mark.parametrize(
    ("load", "f_min", "force"),
    [
        ([0.0, 0.0, 10.0], 0.0, [0.0, 0.0, 5.0]),  # inside: contact and wrench share the load
        ([0.6, 0.8, 10.0], 0.0, [0.3, 0.4, 5.0]),
        ([6.0, 8.0, 10.0], 0.0, np.array([0.3, 0.4, 1.0]) * 5.0 * 1.5 / 1.25),  # edge: nearest point of the cone
        ([6.0, 8.0, 10.0], 7.0, [2.1, 2.8, 7.0]),  # rim
        ([0.6, 0.8, 10.0], 7.0, [0.3, 0.4, 7.0]),  # floor
        ([0.6, 0.8, -10.0], 0.0, [0.0, 0.0, 0.0]),  # apex: the cone cannot pull
        ([3.0, 4.0, -2.5], 0.0, [0.0, 0.0, 0.0]),  # on the polar cone's edge
        ([0.0, 0.0, 0.0], 2.0, [0.0, 0.0, 2.0]),
    ],
)
def test_known_answers_of_one_contact(load: list[float], f_min: float, force: list[float]) -> None:
    """Q = I and mu = 0.5: the optimum is the point of the truncated cone that is nearest to half the load."""
    solution = solve(WrenchProblem(POINT, [*load, 0.0, 0.0, 0.0], 0.5, f_min=f_min))
    np.testing.assert_allclose(solution.force[0], force, rtol=0.0, atol=1e-14)


def test_a_box_on_its_face_is_carried_equally() -> None:
    """Four corners, Q = I: of 10 N each corner carries a fifth and the wrench the last, and nothing else acts."""
    corners = np.array([[-1.0, -1.0, -1.0], [1.0, -1.0, -1.0], [1.0, 1.0, -1.0], [-1.0, 1.0, -1.0]])
    J = np.hstack([np.vstack([np.eye(3), np.cross(np.eye(3), -corner)]) for corner in corners])
    solution = solve(WrenchProblem(J, [0.0, 0.0, 10.0, 0.0, 0.0, 0.0], [0.4] * 4))
    np.testing.assert_allclose(solution.force, [[0.0, 0.0, 2.0]] * 4, atol=1e-14)
    np.testing.assert_allclose(solution.wrench, [0.0, 0.0, 2.0, 0.0, 0.0, 0.0], atol=1e-14)


@pytest.mark.parametrize(("K", "dim"), SIZES)
def test_nothing_required_nothing_done(K: int, dim: int) -> None:
    data = draw(np.random.default_rng(1), K, dim)
    idle = stated(data._replace(required=np.zeros(3 * dim - 3), f_min=np.zeros(K)))
    for method in ("closed-form", "clarabel", "qp:daqp"):
        solution = solve(idle, method)
        assert not solution.force.any()
        assert not solution.wrench.any()
        assert solution.residual == 0.0


@pytest.mark.parametrize(("K", "dim"), SIZES)
@pytest.mark.parametrize("name", Data._fields)
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_not_finite_gives_nan_and_ends(K: int, dim: int, name: str, bad: float) -> None:
    data = draw(np.random.default_rng(2), K, dim)
    values = np.array(getattr(data, name))
    values.flat[-1] = bad
    answers = solve_all(stack([data._replace(**{name: values})]))
    assert np.isnan(answers.force).all()
    assert np.isnan(answers.wrench).all()
    assert np.isnan(answers.residual).all()


def test_one_planar_contact_keeps_its_closed_form_to_the_last_bit() -> None:
    rng = np.random.default_rng(4)
    H, h, row, f, w = np.empty((2, 2)), np.empty(2), np.empty(2), np.empty(2), np.empty(3)
    for _ in range(200):
        data = draw(rng, 1, 2)
        reduce(data.jacobian, data.required, data.Q_w, data.Q_f, H, h, row)
        planar_force(H, h, data.mu[0], data.f_min[0], f)
        balancing_wrench(data.jacobian, data.required, f, w)
        solution = solve(stated(data))
        np.testing.assert_array_equal(solution.force[0], f)
        np.testing.assert_array_equal(solution.wrench, w)


@pytest.mark.parametrize(("K", "dim"), [(1, 2), *SIZES])
def test_clarabel_in_place_is_clarabel_afresh(K: int, dim: int) -> None:
    """Other weights, cones and floors (also none) replace the first ones; zeros that fill up later are kept."""
    rng = np.random.default_rng(6)
    sparse = draw(rng, K, dim)
    first = sparse._replace(
        Q_w=np.eye(len(sparse.Q_w)), Q_f=np.eye(len(sparse.Q_f)), jacobian=np.eye(*sparse.jacobian.shape)
    )
    workspace_ = ClarabelWorkspace(stated(first))
    for _ in range(15):
        problem = stated(draw(rng, K, dim, decades=3.0))
        workspace_.update(problem)
        mine, exact = workspace_.solve(tolerance=1e-5), solve(problem)
        assert mine.problem is problem
        assert mine.objective == pytest.approx(exact.objective, rel=1e-6)
    with pytest.raises(ValueError, match=r"problem = .*shape"):
        workspace_.update(stated(draw(rng, K + 1, dim)))


def test_a_workspace_never_returns_what_it_cannot_certify() -> None:
    one = ClarabelWorkspace(stated(draw(np.random.default_rng(1), 2)))
    with pytest.raises(SolveError, match="KKT residual"):
        one.solve(tolerance=1e-17)


@pytest.mark.parametrize("K", [1, 2, 4])
def test_inscribed_pyramids_are_feasible_dearer_and_say_so(K: int) -> None:
    rng = np.random.default_rng(K)
    dearer = 0
    for _ in range(40):
        problem = stated(draw(rng, K, decades=3.0))
        best = solve(problem)
        for edges in (3, 4, 8):
            for backend in ("daqp", "quadprog"):
                found = solve(problem, f"qp:{backend}", edges=edges, tolerance=1e-6)
                assert (found.status, found.edges) == ("inscribed", edges)
                slack = problem.mu_planned * found.force[:, 2] - np.hypot(*found.force[:, :2].T)
                size = np.abs(problem.required).max() + np.abs(found.force).max()
                assert slack.min() >= -1e-7 * size
                assert (found.force[:, 2] - problem.f_min).min() >= -1e-7 * size
                assert found.objective >= best.objective * (1.0 - 1e-7)
            if found.objective > best.objective * 1.001:
                dearer += 1
                assert problem.residual(found.wrench, found.force) > 1e-6  # not the optimum of the cones
                assert problem.residual(best.wrench, best.force, edges=edges) > 1e-6  # nor the cones' one theirs
    assert dearer > 10


def test_excess_falls_with_the_edges() -> None:
    """By the square of 1 / edges, as 1 - cos(pi / edges) does, in the direction that is worst for each."""
    excess = []
    for edges in (4, 16, 64, 256):
        worst = np.pi / edges  # half-way between two vertices
        load = [np.cos(worst), np.sin(worst), 0.5, 0.0, 0.0, 0.0]
        excess.append(pyramid_excess(WrenchProblem(POINT, load, 0.5, Q_w=1e3 * np.eye(6)), edges))
    for before, after in itertools.pairwise(excess):
        assert before / 20.0 < after < before / 12.0, excess
    assert excess[0] > 1e-2
    inside = WrenchProblem(POINT, [0.0, 0.0, 10.0, 0.0, 0.0, 0.0], 0.5)
    assert pyramid_excess(inside, 3) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("edges", [0, 2, -8, 3.5, True])
def test_bad_edges_are_named(edges: object) -> None:
    with pytest.raises(ValueError, match="edges"):
        solve(stated(draw(np.random.default_rng(1), 1)), "qp:daqp", edges=edges)


def test_edges_where_they_mean_nothing_are_refused() -> None:
    planar, spatial = (stated(draw(np.random.default_rng(1), 1, dim)) for dim in (2, 3))
    for problem, method in ((planar, "qp:daqp"), (spatial, "clarabel"), (spatial, "closed-form")):
        with pytest.raises(ValueError, match="edges"):
            solve(problem, method, edges=8)


@pytest.mark.parametrize("K", [1, 2, 4])
def test_against_clarabel_in_whitened_variables(K: int) -> None:
    """Both ways within 1e-7; forces pressed into their cones by 1e-4 are further off. `make evidence` does 20,000."""
    rng = np.random.default_rng(300 + K)
    compared = loaded = caught = 0
    for _ in range(300):
        problem = stated(draw(rng, K))
        answer, other = solve(problem), whitened_objective(problem)
        if not np.isfinite(other):
            continue
        compared += 1
        assert abs(answer.objective - other) <= 1e-7 * max(answer.objective, other)
        pressed = answer.force.copy()
        pressed[:, -1] += 1e-4 * np.abs(pressed).max()
        dearer = problem.objective(problem.required - problem.jacobian @ pressed.ravel(), pressed)
        loaded += answer.force.any()
        caught += abs(dearer - other) > 1e-7 * max(dearer, other)
    assert compared >= 297
    assert caught > 0.8 * loaded > 150


def test_against_clarabel_where_the_optimum_is_a_millionth_of_its_terms() -> None:
    """Two of the 20,000 of `make evidence`, where a gap of 1e-12 of the terms is above 1e-7 of the optimum."""
    rng = np.random.default_rng(2069)
    drawn = [draw(rng, 4) for _ in range(4724)]
    for problem in (stated(drawn[1126]), stated(drawn[4723])):
        answer = solve(problem)
        assert answer.objective < 3e-6 * problem.objective(problem.required, np.zeros((4, 3)))
        assert answer.objective == pytest.approx(whitened_objective(problem), rel=1e-9)
