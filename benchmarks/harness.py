"""What every benchmark shares: arguments, the machine it ran on, saving and comparing."""

import argparse
import json
import os
import platform
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

PACKAGES = ("mujoco", "numpy", "numba", "clarabel", "qpsolvers", "daqp", "quadprog", "piqp")


def machine() -> dict[str, Any]:
    """Processor, cores and versions, kept with every result."""
    model = platform.processor()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        names = [line.partition(":")[2].strip() for line in cpuinfo.read_text().splitlines() if "model name" in line]
        model = names[0] if names else model
    return {
        "processor": model,
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "versions": {name: version(name) for name in PACKAGES},
    }


def main(description: str, measure: Callable[[bool], dict[str, float]], bounds: dict[str, float]) -> None:
    """Run a benchmark from the command line.

    Args:
        description: what it measures.
        measure: called with True for a quick run; gives its figures by name.
        bounds: greatest value of a figure that is asked for; the exit code is 1 if one is exceeded.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--quick", action="store_true", help="fewer repetitions")
    parser.add_argument("--json", type=Path, metavar="FILE", help="save figures and machine")
    parser.add_argument("--compare", type=Path, metavar="FILE", help="show the figures of a saved run beside these")
    args = parser.parse_args()
    saved: dict[str, float] = {}
    if args.compare is not None:
        try:
            saved = json.loads(args.compare.read_text())["figures"]
        except (OSError, ValueError, KeyError) as error:
            parser.error(f"--compare {args.compare}: not a saved result ({error})")
    figures = measure(args.quick)
    width = max(map(len, figures))
    print(f"{'':{width}}  {'now':>10}" + (f"  {'saved':>10}" if saved else "") + "   asked")
    for name, value in figures.items():
        row = f"{name:{width}}  {value:10.4g}"
        if saved:
            row += f"  {saved[name]:10.4g}" if name in saved else f"  {'-':>10}"
        if name in bounds:
            row += f"   <= {bounds[name]:g}" + ("" if value <= bounds[name] else "  EXCEEDED")
        print(row)
    if args.json is not None:
        result = {"figures": figures, "bounds": bounds, "quick": args.quick, "machine": machine()}
        args.json.write_text(json.dumps(result, indent=1) + "\n")
    raise SystemExit(any(figures[name] > bound for name, bound in bounds.items()))
