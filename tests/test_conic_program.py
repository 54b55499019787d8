"""The certificate of a horizon's program: what is not finite is never hidden by a comparison."""

import numpy as np
import pytest
from pivoting.controller.conic_program import Cones, ConicProgram, kkt_residual
from pivoting.controller.planning.block_matrix import Sparse


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
    assert kkt_residual(PROGRAM, np.array([1.0]), np.zeros(2)) == 0.0
    assert kkt_residual(PROGRAM, np.array([1.5]), np.zeros(2)) == pytest.approx(0.5 / 1.5)


@pytest.mark.parametrize("x", [0.0, 1.0, np.nan, np.inf, 1e200])
@pytest.mark.parametrize("z", [0.0, np.nan, np.inf, 1e300])
def test_what_is_not_finite_is_no_optimum(x: float, z: float) -> None:
    steep = PROGRAM._replace(P=sparse([[0.0]]), q=np.zeros(1), A=sparse([[1e10], [1.0]]), b=np.zeros(2))
    for program in (PROGRAM, steep):
        residual = kkt_residual(program, np.array([x]), np.array([z, 0.0]))
        with np.errstate(all="ignore"):
            pulled = program.A.data[0] * z
        if not np.isfinite([x * x, z, pulled]).all():
            assert not residual < 1.0
