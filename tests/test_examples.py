"""The examples run, each as a user would, and do what their first line says."""

import re
from pathlib import Path

import pytest

from tests.page_blocks import ROOT, started

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
PRINTED = {
    "attach_to_an_unknown_object": r"known: the corner moves by [1-9]\.\d+ mm\n.*set: the corner moves by 0\.00\d mm",
    "attach_to_your_loop": r"at 45\.00 deg; never off by more than 0\.00\d deg",
    "balance_own_box": r"pass: slip 0\.00\d\d mm\nat rest the wrench carries \d\d% of the weight",
    "compare_solvers": r"(?s)closed-form +25\.89303098 .*qp:daqp +25\.89303098 ",
    "fleet_of_256": r"(?s)pass: 256 of 256 .* bit for bit: True",
    "mpc_within_a_force_bound": r"(\|F\| <= [\d.]+w: pass, .*\n){3}",
    "own_control": r"constant contact force +pass, .*\nsmallest wrench +pass, ",
    "own_reference": r"of its own formula +pass.*\nfrom samples +pass",
    "sweep_on_a_cluster": r"0 of 24 worlds fail; the file has 24\n.* is the same: True",
    "test_pivot": r"3 passed",
}


def test_every_example_is_known() -> None:
    assert {path.stem for path in EXAMPLES} == set(PRINTED)


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example(path: Path, tmp_path: Path) -> None:
    assert len(path.read_text().splitlines()) <= 40
    collected = ["-m", "pytest", "-q", "-p", "no:cacheprovider"] if path.stem.startswith("test_") else []
    done = started([*collected, str(path)], tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(PRINTED[path.stem], done.stdout), done.stdout
    assert list(tmp_path.iterdir()) == []
