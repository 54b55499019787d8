"""Slow evidence for cones in space: against Clarabel, the cost of a solve, the price of pyramids."""

import sys
from pathlib import Path
from time import perf_counter

import numpy as np
from harness import main
from pivoting.controller import SolveError, pyramid_excess, solve
from rich.progress import track

sys.path.insert(0, str(Path(__file__).parent.parent))  # the same random problems as the tests
from tests.draws import draw, solve_all, stack, stated, trivial_cost, whitened_objective

SIZES = [(1, 3), (2, 3), (4, 3), (2, 2), (4, 2)]  # (contacts, dim)
EDGES = (4, 8, 16, 32, 64)
CERTIFIED = 1e-8  # of Clarabel, for its objective to count as a second opinion


def problems(K: int, dim: int, count: int) -> dict[str, float]:
    """Worst residual, worst disagreement with Clarabel where that certifies, what Clarabel fails, microseconds."""
    rng = np.random.default_rng(2026 + 10 * K + dim)
    drawn = [draw(rng, K, dim) for _ in range(count)]
    many = stack(drawn)
    answers = solve_all(many)
    rounds = []
    for _ in range(5):
        start = perf_counter()
        solve_all(many)
        rounds.append(perf_counter() - start)
    gap = dearer = relative = close = 0.0
    refused = failed = unconverged = 0
    for i, data in enumerate(track(drawn if dim == 3 else [], f"{K} contacts, dim {dim}: whitened", transient=True)):
        problem = stated(data)
        mine, other = problem.objective(answers.wrench[i], answers.force[i]), whitened_objective(problem)
        if not np.isfinite(other):
            unconverged += 1
            continue
        close = max(close, abs(mine - other) / max(mine, other))
    for i, data in enumerate(track(drawn, f"{K} contacts, dim {dim}: Clarabel", transient=True)):
        problem = stated(data)
        try:
            answer = solve(problem, "clarabel", tolerance=CERTIFIED)
        except SolveError as error:
            refused += 1
            failed += not error.solution.residual <= 1e-5
            continue
        mine, other = problem.objective(answers.wrench[i], answers.force[i]), answer.objective
        gap = max(gap, abs(mine - other) / trivial_cost(problem))
        relative = max(relative, abs(mine - other) / max(mine, other))
        dearer = max(dearer, (mine - other) / max(mine, other))
    name = f"{K} contacts, {'space' if dim == 3 else 'plane'}: "
    whitened = {
        name + "whitened Clarabel not converged to 1e-10 of the optimum": float(unconverged),
        name + "greatest objective difference from whitened Clarabel / optimum": close,
    }
    return {
        name + "problems": float(count),
        name + "greatest KKT residual": float(np.nan_to_num(answers.residual, nan=np.inf).max()),
        name + "greatest objective difference from Clarabel / trivial cost": gap,
        name + "greatest objective difference from Clarabel / optimum": relative,
        name + "greatest relative cost above Clarabel": dearer,
        name + f"Clarabel not certified to {CERTIFIED:g}": float(refused),
        name + "Clarabel not certified to 1e-05": float(failed),
        name + "us per solve, compiled": 1e6 * min(rounds) / count,
        **(whitened if dim == 3 else {}),
    }


def pyramids(count: int) -> dict[str, float]:
    """Median and greatest excess cost of inscribed pyramids, by the number of edges."""
    rng = np.random.default_rng(7)
    drawn = [stated(draw(rng, 1, decades=3.0)) for _ in range(count)]
    out = {}
    for edges in EDGES:
        excess, refused = [], 0
        for problem in track(drawn, f"{edges} edges", transient=True):
            try:
                excess.append(pyramid_excess(problem, edges))
            except SolveError:  # daqp above 1e-7 of its own program
                refused += 1
        out[f"pyramids of {edges} edges: refused"] = float(refused)
        out[f"pyramids of {edges} edges: median excess"] = float(np.median(excess))
        out[f"pyramids of {edges} edges: greatest excess"] = float(np.max(excess))
    return out


def measure(quick: bool) -> dict[str, float]:
    """The figures; see the head of this file."""
    out: dict[str, float] = {}
    for K, dim in SIZES:
        out |= problems(K, dim, 1_000 if quick else 20_000)
    return out | pyramids(100 if quick else 1_000)


if __name__ == "__main__":
    bounds = {}
    for K, dim in SIZES:
        name = f"{K} contacts, {'space' if dim == 3 else 'plane'}: "
        bounds[name + "greatest KKT residual"] = 1e-10
        bounds[name + "greatest relative cost above Clarabel"] = 1e-7
        if dim == 3:
            bounds[name + "whitened Clarabel not converged to 1e-10 of the optimum"] = 100  # of 20,000
            bounds[name + "greatest objective difference from whitened Clarabel / optimum"] = 1e-7
    main(__doc__ or "", measure, bounds)
