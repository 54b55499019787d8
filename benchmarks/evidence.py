"""Slow evidence: random problems against an independent solver, and fleets of every scenario; worst values."""

import sys
from pathlib import Path

import numpy as np
from harness import main
from pivoting.controller import SolveError, solve
from pivoting.sim import SCENARIOS, simulate
from rich.progress import track

sys.path.insert(0, str(Path(__file__).parent.parent))  # the same random problems as the tests
from tests.conftest import random_problem

ORACLE = "qp:quadprog"


def problems(count: int) -> dict[str, float]:
    """Worst residual of the closed form, worst disagreement with an active-set QP solver, failures of each route."""
    rng = np.random.default_rng(2026)
    residual = gap = 0.0
    failures = {"closed-form": 0, ORACLE: 0, "clarabel": 0}
    for _ in track(range(count), "random problems", transient=True):
        problem = random_problem(rng)
        found = {}
        for method in failures:
            try:
                found[method] = solve(problem, method, tolerance=1e-11 if method == "closed-form" else 1e-5)
            except SolveError:
                failures[method] += 1
        if "closed-form" in found:
            residual = max(residual, found["closed-form"].residual)
            if ORACLE in found:
                mine, other = found["closed-form"].objective, found[ORACLE].objective
                gap = max(gap, abs(mine - other) / mine)
    return {
        "random problems": float(count),
        "closed form: greatest KKT residual": residual,
        f"closed form: greatest objective error against {ORACLE}": gap,
        **{f"{method}: failures": float(number) for method, number in failures.items()},
    }


def fleets(worlds: int) -> dict[str, float]:
    """Every scenario in many worlds, started off the reference by up to 0.05 deg; the worst world of each measure.

    Of those that plan, which takes milliseconds for each world and plan, an eighth as many.
    """
    out = {}
    for name in track(SCENARIOS, "fleets", transient=True):
        count = worlds if SCENARIOS[name].plan_hz is None else max(1, worlds // 8)
        run = simulate(name, worlds=count, seed=1, spread=0.05)
        summary = run.summary()
        for key in (
            "slip_max_m",
            "slip_floor_m",
            "angle_error_rms_deg",
            "angle_error_max_deg",
            "contact_lost_s",
            "friction_use_max",
            "force_mismatch_rel",
            "residual_max",
            *(("plans_failed", "plan_residual_max", "bounded_steps") if "plans" in summary else ()),
        ):
            out[f"{name}: {key}"] = float(summary[key])
        bounds = run.scenario.absolute(run.load).bounds()
        if bounds.any:
            out[f"{name}: wrench above its bounds, of these"] = bounds.excess(run.wrench)
        out[f"{name}: worlds"] = float(count)
        out[f"{name}: failed worlds"] = float(len(summary["failed_worlds"]))
    return out


def measure(quick: bool) -> dict[str, float]:
    """The figures; see the head of this file."""
    return {**problems(2_000 if quick else 200_000), **fleets(8 if quick else 256)}


if __name__ == "__main__":
    bounds = {
        "closed form: greatest KKT residual": 1e-11,
        f"closed form: greatest objective error against {ORACLE}": 1e-9,
        "closed-form: failures": 0.0,
        **{f"{name}: failed worlds": 0.0 for name in SCENARIOS},
        "balance-2d: slip_max_m": 2e-5,
        "pivot-2d: slip_max_m": 2e-5,
        "snap-2d: slip_max_m": 1e-4,
        **{f"{name}: slip_max_m": 1e-4 for name in SCENARIOS if name.endswith("3d")},
        **{f"{name}: angle_error_rms_deg": 0.05 for name in SCENARIOS if name.endswith("3d")},
        **{f"{name}: force_mismatch_rel": 0.03 for name in SCENARIOS if name.endswith("3d")},
        **{f"{name}: contact_lost_s": 0.0 for name in SCENARIOS},
        **{f"mpc-{dim}: wrench above its bounds, of these": 1e-6 for dim in ("2d", "3d")},
        **{f"mpc-{dim}: plans_failed": 0.0 for dim in ("2d", "3d")},
    }
    main(__doc__ or "", measure, bounds)
