"""Conic programs: their certificate, which hides nothing that is not finite, and the program of a wrench problem."""

import numpy as np
import pytest
from pivoting.controller.solvers.block_matrix import Sparse
from pivoting.controller.solvers.conic_program import Cones, ConicProgram, program_residual
from pivoting.controller.solvers.wrench_program import wrench_program

from tests.draws import draw, stated


def sparse(dense: list[list[float]]) -> Sparse:
    """With every entry, zero or not."""
    values = np.array(dense)
    rows, columns = values.shape
    indices = np.tile(np.arange(rows, dtype=np.int32), columns)
    return Sparse(values.T.ravel().copy(), indices, np.arange(columns + 1, dtype=np.int32) * rows, values.shape)


PROGRAM = ConicProgram(
    sparse([[1.0]]), np.array([-1.0]), sparse([[1.0], [-1.0]]), np.array([2.0, 0.0]), Cones(0, 2, ())
)


def test_of_an_optimum_and_beside_it() -> None:
    """min 1/2 x^2 - x, 0 <= x <= 2."""
    assert program_residual(PROGRAM, np.array([1.0]), np.zeros(2)) == 0.0
    assert program_residual(PROGRAM, np.array([1.5]), np.zeros(2)) == pytest.approx(0.5 / 1.5)


@pytest.mark.parametrize("x", [0.0, 1.0, np.nan, np.inf, 1e200])
@pytest.mark.parametrize("z", [0.0, np.nan, np.inf, 1e300])
def test_what_is_not_finite_is_no_optimum(x: float, z: float) -> None:
    steep = PROGRAM._replace(P=sparse([[0.0]]), q=np.zeros(1), A=sparse([[1e10], [1.0]]), b=np.zeros(2))
    for program in (PROGRAM, steep):
        residual = program_residual(program, np.array([x]), np.array([z, 0.0]))
        with np.errstate(all="ignore"):
            pulled = program.A.data[0] * z
        if not np.isfinite([x * x, z, pulled]).all():
            assert not residual < 1.0


def test_a_triangle_stands_for_the_symmetric_matrix() -> None:
    upper = [[1.0, 2.0, 0.0], [0.0, 3.0, 4.0], [0.0, 0.0, 5.0]]
    np.testing.assert_array_equal(sparse(upper).dense(), upper)
    np.testing.assert_array_equal(
        sparse(upper).dense(mirrored=True), [[1.0, 2.0, 0.0], [2.0, 3.0, 4.0], [0.0, 4.0, 5.0]]
    )


@pytest.mark.parametrize(("dim", "edges"), [(2, 0), (3, 0), (3, 6)])
def test_the_program_of_a_wrench_problem_is_the_problem(dim: int, edges: int) -> None:
    """Its cost and its constraints are those of the problem, at random forces and wrenches."""
    rng = np.random.default_rng(dim + edges)
    for _ in range(20):
        problem = stated(draw(rng, 2, dim))
        program, unit = wrench_program(2, dim, edges).assemble(problem)
        f, w = rng.normal(size=2 * dim) * unit, rng.normal(size=3 * dim - 3) * unit
        x = np.concatenate([f, w]) / unit
        weight = max(np.abs(problem.Q_f).max(), np.abs(problem.Q_w).max()) * unit**2
        assert 0.5 * x @ program.P.dense(mirrored=True) @ x * weight == pytest.approx(problem.objective(w, f))
        slack = (program.b - program.A.dense() @ x) * unit
        zero, linear, orders = program.cones
        np.testing.assert_allclose(slack[:zero], problem.required - problem.jacobian @ f - w, atol=1e-12 * unit)
        assert orders == ((3, 3) if dim == 3 and not edges else ())
        assert linear == 2 * (1 + (2 if dim == 2 else edges))
        tangent, normal = f.reshape(2, dim)[:, :-1], f.reshape(2, dim)[:, -1]
        np.testing.assert_allclose(slack[zero : zero + linear : linear // 2], normal - problem.f_min, atol=1e-12 * unit)
        if orders:
            s = slack[zero + linear :].reshape(2, 3)
            np.testing.assert_allclose(s[:, 0], problem.mu_planned * normal, atol=1e-12 * unit)
            np.testing.assert_allclose(np.linalg.norm(s[:, 1:], axis=1), np.linalg.norm(tangent, axis=1))
        else:
            kept = (slack[zero : zero + linear].reshape(2, -1)[:, 1:] >= 0.0).all(axis=1)
            inside = np.linalg.norm(tangent, axis=1) <= problem.mu_planned * normal
            assert (kept == inside).all() if dim == 2 else (kept <= inside).all()  # pyramids are inscribed
