"""What is learned from one pivot of 10 to 80 deg: whether the set holds the truth, and how much smaller it becomes.

A thousand objects, boxes of 5 cm to 1 m, half of them in the plane and half about a vertex in space. What is known of
them: mass and inertia to 20 %, the centre of mass to 5 % of each side. Orientations are measured to 0.1 deg about each
axis, and nothing else of the motion; half of the logs have a shove of up to 0.2 N s per kg that nobody measures.
Contact forces are measured to 1 % of the weight; the first moment m c is looked at before they are used.

What it is worth is the price of a guarantee: how much more the smallest wrench that lifts the object costs for all
objects that are still possible than for the one in their middle, with a friction coefficient of 0.25.
"""

import sys
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np
from harness import main
from pivoting.controller import Body, Contact, Law, Motion, Uncertainty, WrenchController, price
from pivoting.controller.learning.identification import force_cuts, identify, moment_cuts
from pivoting.controller.learning.least_squares import RecursiveLeastSquares
from pivoting.controller.learning.motion_log import OTHER
from pivoting.controller.learning.set_membership import RESET, SetMembership
from rich.progress import track

sys.path.insert(0, str(Path(__file__).parent.parent))  # the same random objects as the tests
from tests.pivot_runs import STEPS, PivotRun, pivot_runs

BATCH = 50
SHOVES = {"no shove": 0.0, "shove of 0.2 N s/kg": 0.2}
KINDS, COMPONENTS = {2: "plane", 3: "space"}, {2: "uv", 3: "xyz"}
SIGMAS = 3.0
SHARES, PRICED, MU = (0.0, 0.25, 0.5, 0.75, 1.0), 50, 0.25
MEASURED = {"motion alone": False, "motion and contact forces": True}


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


def excess(run: PivotRun, share: float, forces: bool) -> float:
    """The price of a guarantee at the start of a pivot, less one, after so much of another one was seen."""
    unknowns, log, known = run.unknowns, run.log, run.unknowns.prior
    dim, lever = unknowns.space.dim, unknowns.lever[unknowns.axes]
    if share > 0.0:
        contact, force = log.contact.copy(), log.contact_force if forces else np.full_like(log.contact_force, np.nan)
        contact[round(share * STEPS) :] = OTHER
        found = identify(replace(log, contact=contact, contact_force=force), run.errors, unknowns)
        known, lever = found.uncertainty, lever + found.shift
    known = Uncertainty(mass=known.mass, com=known.com, inertia=known.inertia, mu=(MU, 1.0))
    assert known.mass is not None
    inertia = unknowns.inertia if dim == 3 else unknowns.inertia[1, 1]
    body, contact_there = Body(0.5 * sum(known.mass), inertia), Contact(-lever, mu=MU)
    gravity = (*np.zeros(dim - 1), -9.81)
    controller = WrenchController(body, [contact_there], Law.dynamic(), gravity, uncertainty=known)
    return price(controller, Motion(0.0 if dim == 2 else (1.0, 0.0, 0.0, 0.0))).objective - 1.0


def prices(count: int, dim: int) -> dict[str, float]:
    """The median price, less one, the more is seen of pivots with a shove."""
    out, objects = {}, list(pivot_runs(1000, count, dim, max(SHOVES.values())))
    for how, forces in MEASURED.items():
        for share in track(SHARES, f"{KINDS[dim]}: price, {how}", transient=True):
            paid = [100.0 * excess(run, share, forces) for run in objects]
            out[f"{KINDS[dim]}, {how}: price - 1 after {share:g} of a pivot, %"] = float(np.median(paid))
    return out


def draw(figures: dict[str, float], picture: Path) -> None:
    """Prices over how much of a pivot was seen."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.5, 3.6), layout="constrained")
    axes = figure.subplots()
    for kind, colour in zip(KINDS.values(), ("#2f6db3", "#b3402e"), strict=True):
        for how, line in zip(MEASURED, ("-", "--"), strict=True):
            paid = [figures[f"{kind}, {how}: price - 1 after {share:g} of a pivot, %"] for share in SHARES]
            axes.plot(SHARES, paid, line, marker="o", markersize=4, color=colour, label=f"{kind}, {how}")
    axes.set_xlabel("share of a pivot that was seen [1]")
    axes.set_ylabel("what the guarantee costs more [%]")
    axes.set_ylim(bottom=0.0)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=9)
    figure.savefig(picture, dpi=110)


def runs(count: int, dim: int, shove: float) -> tuple[dict[str, float], np.ndarray]:
    """The figures of so many runs of one kind, and the widths of the components of m c, after over before."""
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
    out |= {"ms to make the cuts": 1e3 * float(times[0]), "ms to intersect": 1e3 * float(times[1])}
    return out, moved[:, 1 : 1 + dim]


def measure(quick: bool) -> dict[str, float]:
    """The figures; see the head of this file."""
    count, out = (10 if quick else 250), {}
    for dim, kind in KINDS.items():
        widths = []
        for what, shove in SHOVES.items():
            figures, moved = runs(count, dim, shove)
            widths.append(moved)
            out |= {f"{kind}, {what}: {name}": value for name, value in figures.items()}
        for axis, value in zip(COMPONENTS[dim], np.median(np.vstack(widths), axis=0), strict=True):
            out[f"{kind}, all: m c_{axis}: after / before, median"] = float(value)
        out |= prices(5 if quick else PRICED, dim)
    return out


if __name__ == "__main__":
    bounds = {f"{kind}, {what}: the truth was lost": 0.0 for kind in KINDS.values() for what in SHOVES}
    bounds |= {
        f"{KINDS[dim]}, {what}: m c_{axis}: after / before, median": 1.0 / 3.0
        for dim, axes in COMPONENTS.items()
        for axis in axes
        for what in ("no shove", "all")
    }
    main(__doc__ or "", measure, bounds, draw=draw)
