"""README is one screen, and its figures, like those of the studies, are those of the committed results.

`test_site.py` checks for all pages that code runs and prints what it shows, and that links and pictures exist.
"""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "README.md").read_text()
WORDS = " ".join(TEXT.split())


def saved(name: str) -> dict:
    """A committed result."""
    return json.loads((ROOT / f"benchmarks/results/{name}.json").read_text())


def test_it_is_one_screen_with_code_and_its_output() -> None:
    assert len(TEXT.splitlines()) <= 80
    assert TEXT.count("```python") == TEXT.count("```text") == 1
    assert "docs/pivot.gif" in TEXT


def test_make_targets_exist() -> None:
    makefile = (ROOT / "Makefile").read_text()
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")]
    for page in pages:
        for target in re.findall(r"(?:`|\$ )make (\w+)", page.read_text()):
            assert re.search(rf"^{target}:", makefile, flags=re.MULTILINE), f"{page.name}: make {target}"


def test_its_table_is_of_the_committed_results() -> None:
    """Each row with a figure is built again from the results; a row that is not, is not shown."""
    plane, space, objects = (saved(name)["figures"] for name in ("evidence", "evidence_space", "objects"))
    problems = [value for key, value in space.items() if key.endswith("contacts, space: problems")]
    residuals = [value for key, value in space.items() if key.endswith("contacts, space: greatest KKT residual")]
    slip, floor = (1e3 * plane[f"pivot-2d: {key}"] for key in ("slip_max_m", "slip_floor_m"))
    counts = [f"{objects[name]:.0f}" for name in ("objects", "pass", "runs", "fail", "refused")]
    held, swept = saved("guarantee")["figures"], saved("sweep")["figures"]

    def failed(how: str) -> float:
        return swept[f"{how}: failures of those drawn"] + swept[f"{how}: failures of the vertices"]

    deciding = saved("loop")["figures"]["one world: state, solve, certify, us"]
    assert plane["closed-form: failures"] == objects["wrong refusals"] == 0.0
    rows = [
        f"| {plane['random problems']:,.0f} random planar problems | all solved; greatest residual "
        f"{plane['closed form: greatest KKT residual']:.1e} |",
        f"| {sum(problems):,.0f} random spatial problems | all solved; greatest residual {max(residuals):.1e} |",
        f"| a block turned by 70 degrees and back | {slip:.3g} mm of slip in the worst of "
        f"{plane['pivot-2d: worlds']:.0f} worlds, of which MuJoCo's own {floor:.3g} mm |",
        f"| the same arc in 0.3 s | {1e3 * plane['snap-2d: slip_max_m']:.3g} mm |",
        "| the block is not the one that is believed in, all {:.0f} ways | {:.3g} mm with the guarantee for a set, "
        "{:.0f} mm without |".format(
            held["pivot-2d: vertices"],
            1e3 * held["pivot-2d, guarantee=set: slip_max_m"],
            1e3 * held["pivot-2d, guarantee=none: slip_max_m"],
        ),
        "| {:,.0f} worlds in which model, friction and measured pose are wrong, each shoved once | {:.0f} fail with "
        "the guarantee; {:.0f} of {:,.0f} without it |".format(
            swept["pivot-2d: worlds"],
            failed("pivot-2d, guaranteed"),
            failed("pivot-2d compared, not guaranteed"),
            swept["pivot-2d: worlds compared"],
        ),
        "| {} objects from published packages | {} of {} runs pass, {} fail, {} are refused, none wrongly |".format(
            *counts
        ),
        f"| deciding on a wrench, in the loop | {deciding:.1f} us a step |",
    ]
    shown = [line for line in TEXT.splitlines() if line.startswith("|")]
    assert shown[3:] == rows
    assert len(shown) == len(rows) + 3


@pytest.mark.parametrize("study", ["formulations", "effort"])
def test_the_studys_tables_are_those_of_its_results(study: str) -> None:
    benchmarks = ROOT / "benchmarks"
    call = [benchmarks / f"bench_{study}.py", "--markdown", benchmarks / f"results/{study}.json"]
    tables = subprocess.run([sys.executable, *call], capture_output=True, text=True, check=True).stdout
    page = (ROOT / "docs/formulations.md").read_text()
    for table in tables.strip().split("\n\n"):
        assert table in page


def test_recorded_evidence_is_within_its_bounds() -> None:
    for name in ("evidence", "evidence_space", "loop", "formulations", "effort", "objects", "engines"):
        kept = saved(name)
        assert kept["quick"] is False
        assert {"processor", "cores", "python", "versions"} <= set(kept["machine"])
        if name != "loop":  # timings are judged where they are taken, by the benchmark's exit code
            for key, bound in kept["bounds"].items():
                assert kept["figures"][key] <= bound, key
