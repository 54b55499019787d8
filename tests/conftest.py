"""Runs that several tests look at, made once; and problems drawn at random."""

from collections.abc import Callable

import numpy as np
import pytest
from pivoting.controller import WrenchProblem
from pivoting.sim import Run, simulate


@pytest.fixture(scope="session")
def shipped() -> Callable[[str], Run]:
    """A shipped scenario's run, as `pivoting run NAME` makes it."""
    runs: dict[str, Run] = {}

    def run(name: str) -> Run:
        if name not in runs:
            runs[name] = simulate(name)
        return runs[name]

    return run


def random_weight(rng: np.random.Generator, size: int) -> np.ndarray:
    """A full symmetric positive definite matrix with a condition number of up to 1e6."""
    axes, _ = np.linalg.qr(rng.normal(size=(size, size)))
    spread = rng.uniform(0.0, 6.0)
    eigenvalues = 10.0 ** np.concatenate([[0.0, spread], rng.uniform(0.0, spread, size - 2)])
    matrix = axes @ np.diag(eigenvalues * 10.0 ** rng.uniform(-1.0, 1.0)) @ axes.T
    return 0.5 * (matrix + matrix.T)


def random_problem(rng: np.random.Generator) -> WrenchProblem:
    """A planar problem: any angle and lever, full weights, mu 0.05 to 1.5, half of them with a normal-force floor."""
    theta = rng.uniform(-np.pi, np.pi)
    r = rng.normal(size=2) * 10.0 ** rng.uniform(-2.0, 0.5)
    R = np.array([[np.cos(theta), np.sin(theta)], [-np.sin(theta), np.cos(theta)]])
    return WrenchProblem(
        np.vstack([R, np.array([-r[1], r[0]]) @ R]),
        rng.normal(size=3) * 10.0 ** rng.uniform(-2.0, 3.0),
        np.exp(rng.uniform(np.log(0.05), np.log(1.5))),
        f_min=10.0 ** rng.uniform(-1.0, 2.0) if rng.random() < 0.5 else 0.0,
        margin=rng.uniform(0.0, 0.3),
        Q_w=random_weight(rng, 3),
        Q_f=random_weight(rng, 2),
    )


LONG = ("test_fleet", "test_wheel", "test_view", "test_kernel", "test_scenario_file")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The files that take longest come first, so that no worker is left alone with one of them at the end.

    Of the first two only one fills the cache: two workers that need the same kernels would both compile them.
    """
    items.sort(key=lambda item: (*LONG, item.path.stem).index(item.path.stem))
