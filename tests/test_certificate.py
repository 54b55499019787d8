"""The certificate itself: it is zero at optima, sees every way of being wrong, and is not fooled by scale."""

import numpy as np
import pytest
from pivoting.controller import WrenchProblem, solve
from scipy.optimize import minimize

from tests.conftest import random_problem


def test_it_agrees_with_a_general_purpose_optimiser() -> None:
    """SLSQP knows nothing of cones or certificates; where it ends, the certificate is small and the cost no less."""
    rng = np.random.default_rng(1)
    J = np.array([[0.9, 0.43], [-0.43, 0.9], [0.3, -0.6]])
    for _ in range(20):
        problem = WrenchProblem(J, rng.normal(size=3) * 5.0, rng.uniform(0.1, 1.0), f_min=rng.uniform(0.0, 3.0))
        mu, floor = problem.mu_planned[0], problem.f_min[0]
        end = minimize(
            lambda f, problem=problem: problem.objective(problem.required - J @ f, f),
            [0.0, floor + 1.0],
            method="SLSQP",
            constraints=[
                {"type": "ineq", "fun": lambda f, mu=mu: [mu * f[1] - f[0], mu * f[1] + f[0]]},
                {"type": "ineq", "fun": lambda f, floor=floor: f[1] - floor},
            ],
            options={"ftol": 1e-15, "maxiter": 500},
        )
        assert problem.residual(problem.required - J @ end.x, end.x) < 1e-5
        assert solve(problem).objective <= end.fun * (1.0 + 1e-9)


@pytest.mark.parametrize("kind", ["wrench", "along", "outside", "scaled", "idle"])
def test_every_kind_of_error_shows(kind: str) -> None:
    rng = np.random.default_rng(5)
    for _ in range(300):
        problem = random_problem(rng)
        solution = solve(problem)
        w, f = np.array(solution.wrench), np.array(solution.force[0])
        size = max(np.abs(f).max(), np.abs(problem.required[:2]).max())
        if kind == "wrench":
            w = w + 1e-3 * np.abs(problem.required).max()
        elif kind == "along":  # a feasible, balanced answer that is not the cheapest
            f = f + np.array([0.0, 0.01 * size])
            w = problem.required - problem.jacobian @ f
        elif kind == "outside":
            f = f + np.array([2.0 * problem.mu_planned[0] * f[1] + 0.01 * size, 0.0])
            w = problem.required - problem.jacobian @ f
        elif kind == "idle":  # the floor alone, where the optimum carries more: only the dual cone tells
            if f[1] <= problem.f_min[0] + 0.01 * size:
                continue
            f = np.array([0.0, problem.f_min[0]])
            w = problem.required - problem.jacobian @ f
        else:
            w, f = 1.001 * w, 1.001 * f
        assert problem.residual(w, f) > 1e-9


def test_its_own_scale_does_not_matter() -> None:
    rng = np.random.default_rng(6)
    for _ in range(100):
        p = random_problem(rng)
        s = 10.0 ** rng.uniform(-8.0, 8.0)
        big = WrenchProblem(
            p.jacobian, s * p.required, p.mu, f_min=s * p.f_min, margin=p.margin, Q_w=s * p.Q_w, Q_f=s * p.Q_f
        )
        f = p.required[:2] * 0.3
        w = p.required - p.jacobian @ f
        assert big.residual(s * w, s * f) == pytest.approx(p.residual(w, f), rel=1e-9)


def test_not_a_number_is_not_a_small_residual() -> None:
    problem = WrenchProblem(np.eye(3)[:, :2], [0.0, 9.0, 0.0], 0.3)
    for bad in (np.nan, np.inf):
        assert not np.isfinite(problem.residual([bad, 0.0, 0.0], [0.0, 1.0]))
        assert not np.isfinite(problem.residual([0.0, 0.0, 0.0], [0.0, bad]))


def test_space_and_several_contacts() -> None:
    """Two unit forces straight up carry a load of 2 + w: the optimum by symmetry, in 3-D, with floors."""
    J = np.zeros((6, 6))
    J[:3, :3] = J[:3, 3:] = np.eye(3)
    J[3, 2], J[3, 5] = 1.0, -1.0  # levers of opposite sign
    problem = WrenchProblem(J, [0.0, 0.0, 3.0, 0.0, 0.0, 0.0], [0.5, 0.5], f_min=[0.0, 0.0])
    assert problem.residual([0, 0, 1.0, 0, 0, 0], [0, 0, 1.0, 0, 0, 1.0]) < 1e-15
    assert problem.residual([0, 0, 0.8, 0, 0, 0], [0, 0, 1.1, 0, 0, 1.1]) > 1e-2
    floored = WrenchProblem(J, [0.0, 0.0, 3.0, 0.0, 0.0, 0.0], [0.5, 0.5], f_min=[2.0, 2.0])
    assert floored.residual([0, 0, -1.0, 0, 0, 0], [0, 0, 2.0, 0, 0, 2.0]) < 1e-15
    assert floored.residual([0, 0, 1.0, 0, 0, 0], [0, 0, 1.0, 0, 0, 1.0]) > 0.1
