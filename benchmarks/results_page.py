"""The page of results: docs/results.template.md with every figure and table taken from benchmarks/results/*.json.

    python benchmarks/results_page.py > docs/results.md

In the template {{FILE max PATTERN FORMAT}} is the greatest of the figures whose names match, and min and sum are what
they say; {{machine FILE}} says on what it was measured; {{..._table}} is a table. An unknown name is an error.
"""

import json
import re
import subprocess
import sys
from collections.abc import Callable
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path

BENCHMARKS = Path(__file__).parent
TEMPLATE = BENCHMARKS.parent / "docs/results.template.md"
REDUCE: dict[str, Callable[[list[float]], float]] = {"max": max, "min": min, "sum": sum}
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
    return json.loads((BENCHMARKS / f"results/{name}.json").read_text())


def figures(name: str) -> dict[str, float]:
    """Its figures."""
    return saved(name)["figures"]


def matching(name: str, how: str, pattern: str, form: str) -> str:
    """One figure out of those whose names match."""
    values = [value for key, value in figures(name).items() if fnmatchcase(key, pattern)]
    if not values:
        raise KeyError(f"{name}: {pattern}")
    return format(REDUCE[how](values), form)


def machine(name: str) -> str:
    """On what it was measured, in a line."""
    given = saved(name)["machine"]
    versions = ", ".join(
        f"{package} {given['versions'][package]}" for package in ("mujoco", "numpy", "numba", "clarabel")
    )
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
    for part in (evidence_table, pyramid_table, formulations_table, loop_table, horizon_table, compile_table, converged)
}
PARTS["solve_table"] = lambda: measured_tables("solve")


def page() -> str:
    """The whole page."""

    def filled(match: re.Match[str]) -> str:
        words = match[1].split()
        if words[0] in PARTS:
            return PARTS[words[0]]()
        if words[0] == "machine":
            return machine(words[1])
        return matching(words[0], words[1], " ".join(words[2:-1]), words[-1])

    return re.sub(r"\{\{(.+?)\}\}", filled, TEMPLATE.read_text(), flags=re.DOTALL)


if __name__ == "__main__":
    sys.stdout.write(page())
