"""What is learned from one pivot of 10 to 80 deg: whether the set holds the truth, and how much smaller it becomes.

A thousand objects, boxes of 5 cm to 1 m, half of them in the plane and half about a vertex in space. What is known of
them: mass and inertia to 20 %, the centre of mass to 5 % of each side. Orientations are measured to 0.1 deg about each
axis, and nothing else of the motion; half of the logs have a shove of up to 0.2 N s per kg that nobody measures.
Contact forces are measured to 1 % of the weight; the first moment m c is looked at before they are used.
"""

import sys
from pathlib import Path
from time import perf_counter

import numpy as np
from harness import main
from pivoting.controller.learning.identification import force_cuts, moment_cuts
from pivoting.controller.learning.least_squares import RecursiveLeastSquares
from pivoting.controller.learning.set_membership import RESET, SetMembership
from rich.progress import track

sys.path.insert(0, str(Path(__file__).parent.parent))  # the same random objects as the tests
from tests.pivot_runs import PivotRun, pivot_runs

BATCH = 50
SHOVES = {"no shove": 0.0, "shove of 0.2 N s/kg": 0.2}
KINDS = {2: "plane", 3: "space"}
SIGMAS = 3.0


def learned(run: PivotRun) -> tuple[bool, np.ndarray, np.ndarray, bool, tuple[float, float]]:
    """Of one run: whether the set holds the truth; widths of the box after over before, by motion alone and with
    contact forces; whether least squares have the first moment within three standard deviations; and seconds to make
    the cuts of the motion, and to intersect with them."""
    estimator, squares = SetMembership(run.unknowns), RecursiveLeastSquares(run.unknowns)
    before = estimator.set.high - estimator.set.low
    start = perf_counter()
    cuts = moment_cuts(run.log, run.errors, run.unknowns)
    made = perf_counter()
    statuses = [estimator.update(cuts).status]
    done = perf_counter()
    held, moved = estimator.set.holds(run.truth), estimator.set.high - estimator.set.low
    squares.update(cuts)
    statuses.append(estimator.update(force_cuts(run.log, run.errors, run.unknowns)).status)
    held = held and estimator.set.holds(run.truth) and RESET not in statuses
    places = slice(1, 1 + run.unknowns.space.dim)
    sigma = np.sqrt(np.maximum(np.diag(squares.covariance), 0.0))[places]
    near = (np.abs(squares.mean - run.truth)[places] <= SIGMAS * sigma).all()
    after = estimator.set.high - estimator.set.low
    return held, moved / before, after / before, bool(near), (made - start, done - made)


def runs(count: int, dim: int, shove: float) -> dict[str, float]:
    """The figures of so many runs of one kind."""
    rows, names = [], []
    for seed in track(range(-(-count // BATCH)), f"{KINDS[dim]}, {shove:g} N s/kg", transient=True):
        for run in pivot_runs(1000 + seed, min(BATCH, count - BATCH * seed), dim, shove):
            rows.append(learned(run))
            names = run.unknowns.names
    moved, after = (np.array([row[i] for row in rows]) for i in (1, 2))
    out = {"runs": float(len(rows)), "the truth was lost": float(sum(not row[0] for row in rows))}
    for i, name in enumerate(names[1 : 1 + dim], 1):
        out[f"{name}: after / before, median"] = float(np.median(moved[:, i]))
        out[f"{name}: after / before, 9 of 10 below"] = float(np.quantile(moved[:, i], 0.9))
    out["m: after / before, with contact forces, median"] = float(np.median(after[:, 0]))
    inertias = [i for i, name in enumerate(names) if name.startswith("I_P")]
    out["I_P: after / before, greatest median"] = float(np.median(moved[:, inertias], axis=0).max())
    out["least squares: the truth is beyond 3 sigma, share"] = float(np.mean([not row[3] for row in rows]))
    times = np.median([row[4] for row in rows], axis=0)
    return out | {"ms to make the cuts": 1e3 * float(times[0]), "ms to intersect": 1e3 * float(times[1])}


def measure(quick: bool) -> dict[str, float]:
    """The figures; see the head of this file."""
    count, out = (10 if quick else 250), {}
    for dim, kind in KINDS.items():
        for what, shove in SHOVES.items():
            out |= {f"{kind}, {what}: {name}": value for name, value in runs(count, dim, shove).items()}
    return out


if __name__ == "__main__":
    components = {2: "uv", 3: "xyz"}
    bounds = {f"{kind}, {what}: the truth was lost": 0.0 for kind in KINDS.values() for what in SHOVES}
    bounds |= {
        f"{KINDS[dim]}, no shove: m c_{axis}: after / before, median": 1.0 / 3.0
        for dim, axes in components.items()
        for axis in axes
    }
    main(__doc__ or "", measure, bounds)
