"""What benchmarks/replay.py makes of failed runs: every reason that is given is one that it can bear out or deny."""

import ast
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pivoting.sim import Run, simulate
from pivoting.sim.judging import advice
from pivoting.sim.judging.verdict import Limits

from tests.own_files import mjcf, own
from tests.test_advice import CASES

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
LEVER = 0.1
LIMITS = vars(Limits(contacts_end=4))
FINE: dict[str, Any] = {
    "slip_m": 0.0, "lost_s": 0.0, "slides_s": 0.0, "others": {}, "deepest_m": 0.0, "angle_rms_deg": 0.0,
    "angle_max_deg": 0.0, "mismatch": 0.0, "unanswered": 0, "diverged_s": np.inf, "touching": (2, 2, 4, 4),
}  # fmt: skip
SHOWN: dict[str, dict[str, Any]] = {  # by how a reason begins, what bears it out, each of several ways
    "the object diverged": {"diverged_s": 0.1},
    "geom": {"others": {"g and wall": 0.1}},
    "the contact let go": {"lost_s": 0.1},
    "one of the contacts left": {"lost_s": 0.1},
    "the contact slid": {"slides_s": 0.1},
    "the contact crept": {"slip_m": 1.0},
    "its contact and solver parameters": {"slip_m": 1.0},
    "the angle was off": {"angle_max_deg": 1.0},
    "the contact force was not": {"mismatch": np.nan},
    "1 steps had no certified": {"unanswered": 1},
    "the object was pressed": {"deepest_m": 1.0},
    "the object did not come to lie": {"touching": (2, 4, 2, 4)},
}


@pytest.fixture(scope="module")
def bench() -> Any:
    """benchmarks/foreign_objects.py, which is a script beside the modules that it imports."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(BENCHMARKS)
        import foreign_objects

        yield foreign_objects
    for name in ("foreign_objects", "object_list", "brute_force", "harness", "replay"):
        sys.modules.pop(name, None)


def sentences() -> list[str]:
    """The reasons that there are, read from the source, with a 1 in place of all that is filled in."""
    source = ast.parse(Path(advice.__file__).read_text())
    (where,) = [node for node in source.body if isinstance(node, ast.FunctionDef) and node.name == "_reasons"]
    given = [node.value for node in ast.walk(where) if isinstance(node, ast.Yield)]
    found = [
        "".join(str(part.value) if isinstance(part, ast.Constant) else "1" for part in value.values)
        if isinstance(value, ast.JoinedStr)
        else ast.literal_eval(value)
        for value in given
        if value is not None
    ]
    assert len(found) > 8
    return [*found, "geom 'a' touches 'b' at 1 s in world 0"]  # which advice takes from `strays`


@pytest.mark.parametrize("reason", sentences())
def test_of_every_reason_it_can_tell_whether_it_is_so(reason: str, bench: Any) -> None:
    """Where all is fine none is borne out, and each by what it says alone."""
    module = sys.modules["replay"]
    (begins,) = [how for how in SHOWN if reason.startswith(how)]
    for how, changed in SHOWN.items():
        facts = module.Facts(**{**FINE, **changed})
        assert module.confirms([reason], facts, LIMITS, LEVER) is (changed == SHOWN[begins]), how
    assert not module.confirms([reason], module.Facts(**FINE), LIMITS, LEVER)
    assert set(SHOWN) == {how for how in SHOWN for one in sentences() if one.startswith(how)}


def test_a_reason_that_it_does_not_know_or_none_is_not_borne_out(bench: Any) -> None:
    module = sys.modules["replay"]
    wrong = module.Facts(**{**FINE, **{key: value for shown in SHOWN.values() for key, value in shown.items()}})
    assert module.confirms(["the contact slid at 1 s"], wrong, LIMITS, LEVER)
    assert not module.confirms(["the moon was full"], wrong, LIMITS, LEVER)
    assert not module.confirms(["the contact slid at 1 s", "the moon was full"], wrong, LIMITS, LEVER)
    assert not module.confirms([], wrong, LIMITS, LEVER)


def heavier(folder: Path) -> Any:
    return own(folder, mjcf()).change(world={"mass": 1.2})


@pytest.mark.parametrize("case", [*CASES, heavier], ids=lambda case: case.__name__)
def test_what_failed_runs_say_is_borne_out(case: Any, bench: Any, tmp_path: Path) -> None:
    """And not by the replay of a run that passes."""
    run, fine = simulate(case(tmp_path)), simulate(own(tmp_path, mjcf()))
    assert run.verdict == "fail"
    assert replayed(bench, run, run)
    assert not replayed(bench, run, fine)


def replayed(bench: Any, said: Run, shown: Run) -> bool:
    facts = bench.replay(bench.taped(shown))
    lever = float(np.linalg.norm(shown.points, axis=1).max())
    return bool(bench.confirms(said.summary()["reasons"], facts, said.summary()["limits"], lever))
