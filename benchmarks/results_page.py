"""The pages of measured figures: docs/PAGE.template.md with every figure and table from benchmarks/results/*.json.

    python benchmarks/results_page.py results > docs/results.md
    python benchmarks/results_page.py engines > docs/engines.md

In a template {{FILE max PATTERN FORMAT}} is the greatest of the figures whose names match, and min and sum are what
they say; {{machine FILE}} says on what it was measured, with the versions of the packages that follow; {{..._table}} is
a table. An unknown name is an error.
"""

import json
import re
import subprocess
import sys
from collections.abc import Callable
from fnmatch import fnmatchcase
from functools import cache
from math import isfinite
from pathlib import Path

BENCHMARKS = Path(__file__).parent
DOCS = BENCHMARKS.parent / "docs"
REDUCE: dict[str, Callable[[list[float]], float]] = {
    "max": max,
    "min": min,
    "sum": sum,
    "mm": lambda values: 1e3 * max(values),
}
SCENARIO_COLUMNS = {
    "slip, mm": ("slip_max_m", 1e3),
    "of which MuJoCo's own, predicted, mm": ("slip_floor_m", 1e3),
    "angle RMS, deg": ("angle_error_rms_deg", 1.0),
    "friction used": ("friction_use_max", 1.0),
    "contact force, predicted against measured, %": ("force_mismatch_rel", 100.0),
}


@cache
def saved(name: str) -> dict:
    """A saved run: figures, machine and bounds."""
    found = json.loads((BENCHMARKS / f"results/{name}.json").read_text())
    if not found.get("complete", True):
        raise ValueError(f"{name}.json is part of a run that did not come to its end")
    return found


def figures(name: str) -> dict[str, float]:
    """Its figures."""
    return saved(name)["figures"]


def matching(name: str, how: str, pattern: str, form: str) -> str:
    """One figure out of those whose names match."""
    values = [value for key, value in figures(name).items() if fnmatchcase(key, pattern)]
    if not values:
        raise KeyError(f"{name}: {pattern}")
    return format(REDUCE[how](values), form)


def machine(name: str, *more: str) -> str:
    """On what it was measured, in a line; `more`: packages beside the usual ones."""
    given = saved(name)["machine"]
    packages = ("mujoco", "numpy", "numba", "clarabel", *more)
    versions = ", ".join(f"{package} {given['versions'][package]}" for package in packages)
    return f"{given['processor']}, {given['cores']} cores, Python {given['python']}, {versions}."


def table(head: list[str], rows: list[list[str]], left: int = 1) -> str:
    """In markdown, numbers to the right."""
    lines = [head, ["---"] * left + ["--:"] * (len(head) - left), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def evidence_table() -> str:
    """The worst world of each scenario."""
    values = figures("evidence")
    names = [key.removesuffix(": slip_max_m") for key in values if key.endswith(": slip_max_m")]
    rows = [
        [f"`{name}`", *(f"{factor * values[f'{name}: {key}']:.3g}" for key, factor in SCENARIO_COLUMNS.values())]
        for name in names
    ]
    return table(["scenario", *SCENARIO_COLUMNS], rows)


def pyramid_table() -> str:
    """The price of pyramids in place of cones."""
    values = figures("evidence_space")
    edges = [key.split()[2] for key in values if key.startswith("pyramids") and key.endswith("refused")]
    rows = [
        [words, *(f"{100.0 * values[f'pyramids of {n} edges: {key}']:.3g}" for n in edges)]
        for words, key in (("median excess, %", "median excess"), ("greatest excess, %", "greatest excess"))
    ]
    return table(["edges of the pyramid", *edges], rows)


def formulations_table() -> str:
    """Two columns of the study's first table."""
    first = measured_tables("formulations").split("\n\n")[0].splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in first[2:]]
    return table(["", "no floor", "50 N"], [[row[0], row[2], row[4]] for row in cells])


def learning_table() -> str:
    """How much narrower the intervals are after one pivot."""
    values, rows = figures("learning"), []
    for kind in dict.fromkeys(key.partition(": ")[0] for key in values if key.endswith(": runs")):
        own = {key.removeprefix(f"{kind}: "): value for key, value in values.items() if key.startswith(f"{kind}: ")}
        moments = [value for key, value in own.items() if key.startswith("m c_") and key.endswith("median")]
        cells = ", ".join(f"{value:.2f}" for value in moments)
        inertia, mass = (
            own["I_P: after / before, greatest median"],
            own["m: after / before, with contact forces, median"],
        )
        rows.append(
            [kind, cells, f"{inertia:.2f}", f"{mass:.2f}", f"{own['the truth was lost']:.0f} of {own['runs']:.0f}"]
        )
    return table(["", "m c, each component", "inertia about the contact", "mass", "truth lost"], rows)


def sweep_table() -> str:
    """Of the worlds of a sweep that were run in three ways: how many fail, and what it costs."""
    values, rows = figures("sweep"), []
    for name in ("pivot-2d", "pivot-3d"):
        floor = values[f"{name}: smallest constant floor without a failure, N"]
        ways = {
            "guaranteed": "with the guarantee",
            "not guaranteed": "without it",
            "constant floor": f"with the smallest constant floor without a failure, {floor:.3g} N, found in hindsight"
            if isfinite(floor)
            else "with a constant floor of 64 N; none of up to 4,096 N holds all of them",
        }
        for how, words in ways.items():
            names = "failures of those drawn", "failures of the vertices", "objective, mean, N^2", "force, RMS, N"
            drawn, vertices, objective, force = (values[f"{name} compared, {how}: {each}"] for each in names)
            rows.append([f"{name}, {words}", f"{drawn:.0f} + {vertices:.0f}", f"{objective:,.0f}", f"{force:,.1f}"])
    return table(["", "fail, drawn + vertices", "objective, N²", "force, RMS, N"], rows)


def guarantee_table() -> str:
    """Of random sets: what a search for their worst members finds, and how much more than needed is asked for."""
    values, rows = figures("guarantee"), []
    for kind, words in (
        ("plane, contact", "plane, inertia about the contact"),
        ("plane, com", "plane, inertia about the centre of mass"),
        ("space", "space, on a vertex"),
        ("edge", "space, on an edge"),
    ):
        worst, median, most = (
            values[f"{kind}: {what} over the load{end}"]
            for what, end in (("worst violation", ""), ("excess", ", median"), ("excess", ", greatest"))
        )
        rows.append([words, f"{values[f'{kind}: sets']:.0f}", f"{worst:.0e}", f"{median:.1%}", f"{most:.1%}"])
    return table(["", "sets", "worst violation / load", "excess / load, median", "greatest"], rows)


def guarantee_cost_table() -> str:
    """What a set costs in time."""
    values, rows = figures("guarantee"), []
    for kind, words in (("plane", "plane"), ("space", "space, one contact"), ("edge", "space, two contacts")):
        rows.append([
            words,
            f"{values[f'{kind}: step with a set over one without']:.1f} x",
            f"{values[f'{kind}: step with a set, us, 99th percentile']:.1f}",
            f"{values[f'{kind}: Clarabel in place over the step']:.0f} x",
        ])  # fmt: skip
    return table(["", "step with a set over one without", "µs, 99th percentile", "Clarabel over the step"], rows)


def loop_table() -> str:
    """Closed loop against physics alone."""
    values = figures("loop")
    rows = []
    for words, closed, bare, ratio in (
        ("one world, µs a step", "closed, us a step", "bare mj_step, us", "closed / bare mj_step"),
        (
            "256 worlds, µs a step and world",
            "closed, us a step and world",
            "open, us a step and world",
            "closed / open Batch.step",
        ),
    ):
        found = [values[f"{words.partition(',')[0]}: {key}"] for key in (closed, bare, ratio)]
        rows.append([words, f"{found[0]:.1f}", f"{found[1]:.1f}", f"{found[2]:.2f} x"])
    return table(["", "closed loop", "physics alone", "ratio"], rows)


def horizon_table() -> str:
    """One pass of each kind of program."""
    values = figures("horizon")
    kinds = [key.removesuffix(": ours, one pass, ms") for key in values if key.endswith(": ours, one pass, ms")]
    rows = [
        [
            kind,
            f"{values[f'{kind}: ours, one pass, ms']:.2f}",
            f"{values[f'{kind}: whole plan, ms']:.1f}",
            f"{values[f'{kind}: whole plan, passes']:.0f}",
            f"{values[f'{kind}: cvxpy / ours']:.1f} x",
        ]
        for kind in kinds
    ]
    return table(["program", "one pass, ms", "whole plan, ms", "passes", "cvxpy against one pass"], rows)


def compile_table() -> str:
    """Seconds of each scenario's first run."""
    rows = [[f"`{key.removesuffix(': s')}`", f"{value:.0f}"] for key, value in figures("compile").items()]
    return table(["scenario", "s"], rows)


def _spread(values: dict[str, float], name: str) -> str:
    """The least and the greatest of a figure, or one number if their two digits are the same."""
    least, greatest = (f"{values[f'{name}, {end}']:.2g}" for end in ("least", "greatest"))
    return least if least == greatest else f"{least} to {greatest}"


def _engine_scenarios() -> list[str]:
    mark = ": MuJoCo, slip, mm"
    return [key.removesuffix(mark) for key in figures("engines") if key.endswith(mark)]


def engines_table() -> str:
    """Slip [mm] and, in brackets, RMS of the angle error [deg] of each scenario in MuJoCo and in Drake."""
    values, rows = figures("engines"), []
    for name in _engine_scenarios():
        cells = [f"{values[f'{name}: MuJoCo, slip, mm']:.2g} ({values[f'{name}: MuJoCo, angle error, RMS, deg']:.2g})"]
        cells.append(f"{values[f'{name}: integration alone, slip, mm']:.2g}")
        for kind in ("point", "hydroelastic"):
            head = f"{name}: Drake, {kind}, "
            error = values[f"{head}angle error, RMS, deg, greatest"]
            cells.append(f"{_spread(values, head + 'slip, mm')} ({error:.2g})")
        rows.append([f"`{name}`", *cells])
    return table(["scenario", "MuJoCo", "integration alone", "Drake, point", "Drake, hydroelastic"], rows)


def engines_agreement_table() -> str:
    """How far Drake's angles and contact forces are from MuJoCo's, at most."""
    values, rows = figures("engines"), []
    for name in _engine_scenarios():
        heads = [f"{name}: Drake, {kind}, " for kind in ("point", "hydroelastic")]
        whats = "angle against MuJoCo's, greatest, deg", "contact force against MuJoCo's, RMS, %"
        rows.append([f"`{name}`", *(f"{values[f'{head}{what}, greatest']:.1g}" for what in whats for head in heads)])
    return table(["scenario", "angle, deg: point", "hydroelastic", "force, %: point", "hydroelastic"], rows)


def converged() -> str:
    """Of how many problems Clarabel found the optimum, for each number of contacts."""
    values = figures("evidence_space")
    short = "whitened Clarabel not converged to 1e-10 of the optimum"
    counts = [values[f"{K} contacts, space: problems"] - values[f"{K} contacts, space: {short}"] for K in (1, 2, 4)]
    return "{:,.0f}, {:,.0f} and {:,.0f}".format(*counts)


@cache
def measured_tables(name: str) -> str:
    """The tables that a benchmark itself makes of its saved figures."""
    call = [sys.executable, BENCHMARKS / f"bench_{name}.py", "--markdown", BENCHMARKS / f"results/{name}.json"]
    return subprocess.run(call, capture_output=True, text=True, check=True).stdout.strip()


PARTS: dict[str, Callable[[], str]] = {
    part.__name__: part
    for part in (
        evidence_table,
        pyramid_table,
        formulations_table,
        guarantee_cost_table,
        guarantee_table,
        learning_table,
        sweep_table,
        loop_table,
        horizon_table,
        compile_table,
        converged,
        engines_table,
        engines_agreement_table,
    )
}
PARTS["solve_table"] = lambda: measured_tables("solve")


def page(name: str) -> str:
    """The whole page of that name."""

    def filled(match: re.Match[str]) -> str:
        words = match[1].split()
        if words[0] in PARTS:
            return PARTS[words[0]]()
        if words[0] == "machine":
            return machine(*words[1:])
        return matching(words[0], words[1], " ".join(words[2:-1]), words[-1])

    return re.sub(r"\{\{(.+?)\}\}", filled, (DOCS / f"{name}.template.md").read_text(), flags=re.DOTALL)


if __name__ == "__main__":
    sys.stdout.write(page(sys.argv[1]))
