"""`solve`: right on random problems against independent solvers, certified, and loud when it is not."""

import numpy as np
import pytest
from pivoting.controller import Solution, SolveError, WrenchProblem, methods, solve
from pivoting.errors import PivotingError

from tests.conftest import random_problem
from tests.draws import PROBLEMS, RARE

J = np.array([[1.0, 0.0], [0.0, 1.0], [0.5, -0.5]])
SHIPPED = ("clarabel", "qp:clarabel", "qp:daqp", "qp:piqp", "qp:quadprog")  # with the project's own dependencies


def test_closed_form_on_random_problems() -> None:
    """Residual <= 1e-11, objective within 1e-9 of an independent solver, no failure; every piece of the cone is met."""
    rng = np.random.default_rng(20)
    met = {"inside": 0, "edge": 0, "floor": 0, "apex": 0}
    for _ in range(PROBLEMS):
        problem = random_problem(rng)
        solution = solve(problem, tolerance=1e-11)
        other = solve(problem, "qp:quadprog", tolerance=1e-6)
        assert abs(solution.objective - other.objective) <= 1e-9 * solution.objective, problem
        met[piece(problem, solution)] += 1
    assert min(met.values()) > RARE, met


def piece(problem: WrenchProblem, solution: Solution) -> str:
    """Which part of the truncated cone the optimum lies on."""
    f_t, f_n = solution.force[0]
    if f_n == problem.f_min[0]:
        return "floor" if f_n > 0.0 else "apex"
    return "edge" if abs(abs(f_t) - problem.mu_planned[0] * f_n) <= 1e-12 * f_n else "inside"


@pytest.mark.parametrize("method", SHIPPED)
def test_every_method_finds_the_same(method: str) -> None:
    rng = np.random.default_rng(7)
    for _ in range(60):
        problem = random_problem(rng)
        mine = solve(problem)
        other = solve(problem, method, tolerance=1e-5)
        assert other.objective == pytest.approx(mine.objective, rel=1e-4)
        assert other.method == method
        assert other.residual == pytest.approx(problem.residual(other.wrench, other.force), abs=1e-15)


def test_the_shipped_methods_are_installed() -> None:
    assert {"closed-form", *SHIPPED} <= set(methods())


def test_nothing_required_nothing_done() -> None:
    """Without gravity the block lies there: w = 0, f = 0, exactly."""
    for method in ("closed-form", *SHIPPED):
        solution = solve(WrenchProblem(J, np.zeros(3), 0.3), method)
        assert not solution.force.any()
        assert not solution.wrench.any()
        assert solution.residual == 0.0


def test_always_feasible_whatever_is_required() -> None:
    """Erratum 6: f = (0, f_min), w = required - J f satisfies every constraint, so the optimum costs no more."""
    rng = np.random.default_rng(3)
    for _ in range(500):
        problem = random_problem(rng)
        f = np.array([0.0, problem.f_min[0]])
        w = problem.required - problem.jacobian @ f
        assert solve(problem).objective <= problem.objective(w, f) * (1.0 + 1e-12)


def test_reduced_program_of_the_notes_drops_a_constraint() -> None:
    """Erratum 6: f = -(J'J)^-1 J' w_hat leaves J f + w_hat != 0 for a general wrench; J has full COLUMN rank only."""
    w_hat = np.array([0.3, -9.0, 1.0])
    f = -np.linalg.solve(J.T @ J, J.T @ w_hat)
    assert np.linalg.norm(J @ f + w_hat) > 0.1
    assert np.linalg.matrix_rank(J) == 2


def test_an_answer_above_tolerance_is_refused_with_its_evidence() -> None:
    problem = WrenchProblem(J, [1.0, 9.0, 2.0], 0.3)
    with pytest.raises(SolveError, match="KKT residual") as caught:
        solve(problem, "clarabel", tolerance=1e-15)
    assert caught.value.problem is problem
    assert caught.value.solution.status == "inaccurate"
    assert caught.value.solution.residual > 1e-15


def test_a_solver_that_gives_up_is_a_failure_not_a_zero() -> None:
    with pytest.raises(SolveError) as caught:
        solve(WrenchProblem(J, [1.0, 9.0, 2.0], 0.3), "clarabel", max_iter=1)
    assert caught.value.solution.status in ("inaccurate", "failed")
    assert "MaxIterations" in str(caught.value)


@pytest.mark.parametrize(("method", "word"), [("gurobi", "closed-form"), ("qp:nope", "quadprog"), ("", "clarabel")])
def test_unknown_methods_are_named(method: str, word: str) -> None:
    with pytest.raises(ValueError, match=rf"method = '{method}'.*{word}"):
        solve(WrenchProblem(J, [0.0, 9.0, 0.0], 0.3), method)


@pytest.mark.parametrize("method", ["closed-form", "clarabel", "qp:quadprog"])
def test_options_that_a_solver_does_not_have_are_named(method: str) -> None:
    with pytest.raises(ValueError, match=r"options = .*precision"):
        solve(WrenchProblem(J, [0.0, 9.0, 0.0], 0.3), method, precision=1e-3)


@pytest.mark.parametrize("method", ["closed-form", *SHIPPED])
def test_what_fails_is_caught_as_an_error_of_this_package(method: str) -> None:
    problem = WrenchProblem(J, [1.0, 9.0, 2.0], 0.3)
    with pytest.raises(PivotingError):
        solve(problem, method, tolerance=1e-300)
    with pytest.raises(PivotingError):
        solve(problem, method, edges=8)


def test_several_contacts_are_solved_by_every_method() -> None:
    """A flat block on its two corners, g = 10: by symmetry each carries a third, and the wrench the last."""
    flat = np.hstack([np.vstack([np.eye(2), [[0.5, -0.5]]]), np.vstack([np.eye(2), [[0.5, 0.5]]])])
    problem = WrenchProblem(flat, [0.0, 10.0, 0.0], [0.3, 0.3])
    for method in ("closed-form", "clarabel", "qp:daqp", "qp:quadprog"):
        np.testing.assert_allclose(solve(problem, method).force, [[0.0, 10.0 / 3.0], [0.0, 10.0 / 3.0]], atol=1e-6)


def test_answers_cannot_be_changed() -> None:
    solution = solve(WrenchProblem(J, [0.0, 9.0, 0.0], 0.3))
    with pytest.raises(ValueError, match="read-only"):
        solution.wrench[0] = 1.0
    with pytest.raises(AttributeError):
        solution.status = "solved"  # type: ignore[misc]
