"""What every benchmark shares: arguments, the machine it ran on, saving and comparing."""

import argparse
import json
import os
import platform
from collections.abc import Callable, Iterator
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from math import isnan
from pathlib import Path
from time import perf_counter
from typing import Any

PACKAGES = ("mujoco", "numpy", "numba", "clarabel", "qpsolvers", "daqp", "quadprog", "piqp")
PEERS = ("casadi", "cvxopt", "cvxpy", "drake", "ecos", "highspy", "osqp", "proxsuite", "qoco", "scs")  # may be missing


def machine() -> dict[str, Any]:
    """Processor, cores and versions, kept with every result."""
    model = platform.processor()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        names = [line.partition(":")[2].strip() for line in cpuinfo.read_text().splitlines() if "model name" in line]
        model = names[0] if names else model
    versions = {name: version(name) for name in PACKAGES}
    for name in PEERS:
        with suppress(PackageNotFoundError):
            versions[name] = version(name)
    return {
        "processor": model,
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "versions": versions,
    }


def timed(run: Callable[..., Any], args: tuple[Any, ...], repeats: int) -> tuple[float, Any]:
    """Least seconds of so many calls, and the last answer, None where there was none."""
    least = float("inf")
    for _ in range(repeats):
        start = perf_counter()
        try:
            answer = run(*args)
        except Exception:  # each solver has its own
            answer = None
        least = min(least, perf_counter() - start)
    return least, answer


def peer_table(figures: dict[str, float], name: str, columns: dict[str, str]) -> list[str]:
    """The lines of a table of one family: its figures are called "name: peer, column", the first column is the time."""
    time = next(iter(columns))
    lines = ["", f"| {name} | " + " | ".join(columns) + " |", "|---|" + "--:|" * len(columns)]
    for key in figures:
        if not (key.startswith(f"{name}: ") and key.endswith(f", {time}")):
            continue
        peer = key.removesuffix(f", {time}")
        row = ((figures.get(f"{peer}, {column}", float("nan")), form) for column, form in columns.items())
        cells = ("-" if isnan(value) else f"{value:{form}}".rstrip(".") for value, form in row)
        lines.append(f"| {peer.removeprefix(name + ': ')} | " + " | ".join(cells) + " |")
    return lines


def main(
    description: str,
    measure: Callable[[bool], dict[str, float] | Iterator[dict[str, float]]],
    bounds: dict[str, float],
    *,
    floors: dict[str, float] | None = None,
    markdown: Callable[[dict[str, float]], str] | None = None,
    draw: Callable[[dict[str, float], Path], None] | None = None,
    brief: Callable[[str], bool] = lambda name: True,
) -> None:
    """Run a benchmark from the command line.

    Args:
        description: what it measures.
        measure: called with True for a quick run; gives its figures by name, all at once or in parts that are saved
            as they come.
        bounds: greatest value of a figure that is asked for; the exit code is 1 if one is exceeded.
        floors: least value of a figure that is asked for; likewise.
        markdown: renders the figures of a saved run, for `--markdown FILE`.
        draw: draws them into a picture, for `--figure FILE PICTURE`.
        brief: which figures are printed; all are saved.
    """
    floors = floors or {}
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--quick", action="store_true", help="fewer repetitions")
    parser.add_argument("--json", type=Path, metavar="FILE", help="save figures and machine")
    parser.add_argument("--compare", type=Path, metavar="FILE", help="show the figures of a saved run beside these")
    if markdown is not None:
        parser.add_argument(
            "--markdown", type=Path, metavar="FILE", help="print a saved run as tables, measure nothing"
        )
    if draw is not None:
        parser.add_argument(
            "--figure", type=Path, nargs=2, metavar=("FILE", "PICTURE"), help="draw a saved run, measure nothing"
        )
    args = parser.parse_args()
    if draw is not None and args.figure is not None:
        draw(_figures(parser, "--figure", args.figure[0]), args.figure[1])
        return
    if markdown is not None and args.markdown is not None:
        print(markdown(_figures(parser, "--markdown", args.markdown)))
        return
    saved = {} if args.compare is None else _figures(parser, "--compare", args.compare)
    measured, figures = measure(args.quick), dict[str, float]()

    def save(**more: bool) -> None:
        if args.json is not None:
            asked = {"bounds": bounds, "floors": floors, "quick": args.quick}
            args.json.write_text(
                json.dumps({"figures": figures, **asked, **more, "machine": machine()}, indent=1) + "\n"
            )

    for part in [measured] if isinstance(measured, dict) else measured:
        figures |= part
        save(complete=False)
    save()
    width = max(len(name) for name in figures if brief(name))
    print(f"{'':{width}}  {'now':>10}" + (f"  {'saved':>10}" if saved else "") + "   asked")
    for name, value in figures.items():
        if not brief(name):
            continue
        row = f"{name:{width}}  {value:10.4g}"
        if saved:
            row += f"  {saved[name]:10.4g}" if name in saved else f"  {'-':>10}"
        if name in bounds:
            row += f"   <= {bounds[name]:g}" + ("" if value <= bounds[name] else "  EXCEEDED")
        if name in floors:
            row += f"   >= {floors[name]:g}" + ("" if value >= floors[name] else "  MISSED")
        print(row)
    exceeded = any(figures[name] > bound for name, bound in bounds.items())
    raise SystemExit(exceeded or any(figures[name] < floor for name, floor in floors.items()))


def _figures(parser: argparse.ArgumentParser, option: str, path: Path) -> dict[str, float]:
    """The figures of a saved run, or a line that says what is wrong with the file."""
    try:
        figures: dict[str, float] = json.loads(path.read_text())["figures"]
    except (OSError, ValueError, KeyError) as error:
        parser.error(f"{option} {path}: not a saved result ({error})")
    return figures
