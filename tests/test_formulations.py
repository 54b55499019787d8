"""Erratum 7 in MuJoCo: the quasi-dynamic law rings as docs/formulations.md derives, and its velocity term damps it."""

import numpy as np
import pytest
from pivoting.controller import Law
from pivoting.sim import Run, simulate

DT = 1e-3


def balance(law: str, h: float) -> Run:
    """Started off its balance, pressed on the table so that the ring does not open the contact."""
    return simulate("balance-2d", law=law, bandwidth=1.0 / h, spread=0.5, seed=1, seconds=1.0, f_min=50.0)


def recursion(law: Law, error: float, steps: int) -> np.ndarray:
    """(steps + 1,) the error of theta'' = kp e - kd theta' under semi-implicit Euler: MuJoCo left out."""
    out, rate = np.empty(steps + 1), 0.0
    out[0] = error
    for k in range(steps):
        rate += DT * (law.kp * out[k] - law.kd * rate)
        out[k + 1] = out[k] - DT * rate
    return out


@pytest.mark.parametrize("h", [0.025, 0.01, DT])
def test_as_written_it_rings_at_its_own_frequency_and_does_not_decay(h: float) -> None:
    """|z| = 1 with z + 1/z = 2 - (dt/h)^2: a period of 6 steps at h = dt, 2 pi h for h >> dt."""
    error = -balance("quasi-dynamic", h).angle_error[0]
    before = np.flatnonzero(np.diff(np.sign(error)))
    crossings = before + error[before] / (error[before] - error[before + 1])
    measured = 0.5 * (len(crossings) - 1) / (DT * (crossings[-1] - crossings[0]))
    assert measured == pytest.approx(np.arcsin(0.5 * DT / h) / (np.pi * DT), rel=1e-3)
    quarter = len(error) // 4
    first, last = (np.abs(part).max() for part in (error[:quarter], error[-quarter:]))
    assert first == pytest.approx(abs(error[0]), rel=0.06)
    assert last == pytest.approx(first, rel=0.02)


@pytest.mark.parametrize("h", [0.025, 0.01, DT])
def test_with_the_velocity_term_it_decays_as_its_recursion(h: float) -> None:
    """|z| = sqrt(1 - dt/h) a step; at h = dt both eigenvalues are 0, and dead beat is what it says."""
    error = balance("quasi-dynamic-velocity", h).angle_error[0]
    expected = recursion(Law.quasi_dynamic(h, velocity=True), error[0], len(error) - 1)
    np.testing.assert_allclose(error, expected, atol=0.04 * abs(error[0]))  # the contact's own settling at the start
    assert np.abs(error[-250:]).max() < 1e-3 * abs(error[0])


def test_eigenvalues() -> None:
    """Of (error, dt rate) from step to step with dt = x h, as the page derives them."""
    for x in (0.04, 0.1, 0.5, 1.0):
        written = np.array([[1.0 - x**2, -1.0], [x**2, 1.0]])
        np.testing.assert_allclose(np.abs(np.linalg.eigvals(written)), 1.0)
        damped = np.array([[1.0 - x**2, -(1.0 - x)], [x**2, 1.0 - x]])
        np.testing.assert_allclose(np.abs(np.linalg.eigvals(damped)), np.sqrt(1.0 - x), atol=1e-7)
