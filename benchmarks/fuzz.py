"""Every public entry with 50,000 hostile inputs in all: each ends in a documented error or in a certified answer."""

import sys
import tempfile
import traceback
import warnings
from collections import Counter
from pathlib import Path

from harness import main
from hypothesis import HealthCheck, Phase, given, settings
from rich.progress import track

sys.path.insert(0, str(Path(__file__).parent.parent))  # the same entries as the tests
from tests.fuzzed_entries import Entry, documented, entries

QUICK = 12  # times fewer examples
ASKED = 50_000


def tried(name: str, entry: Entry, examples: int) -> dict[str, float]:
    """How many examples and answers there were, and undocumented errors, of which the first of each kind is shown."""
    outcomes: Counter[str] = Counter()
    seen: set[str] = set()

    @settings(
        max_examples=examples, deadline=None, database=None, derandomize=True, phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(entry.drawn)
    def call(drawn: object) -> None:
        outcomes["examples"] += 1
        try:
            with documented():
                entry.called(drawn)
                outcomes["answers"] += 1
        except Exception as error:
            outcomes["undocumented errors"] += 1
            where = traceback.extract_tb(error.__traceback__)[-1]
            if (place := f"{type(error).__name__} {where.filename}:{where.lineno}") not in seen:
                seen.add(place)
                print(f"{name}: {drawn!r:.400}", *traceback.format_exception(error)[-6:], file=sys.stderr)

    call()
    return {f"{name}: {what}": float(outcomes[what]) for what in ("examples", "answers", "undocumented errors")}


def measure(quick: bool) -> dict[str, float]:
    """The figures of all entries; of the quick profile a fiftieth of the examples."""
    found: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        for name, entry in track(entries(Path(folder)).items(), "entries", transient=True):
            found |= tried(name, entry, max(2, entry.share // (QUICK if quick else 1)))
    sums = {what: sum(value for name, value in found.items() if name.endswith(f": {what}")) for what in
            ("examples", "undocumented errors")}  # fmt: skip
    return {**found, **sums}


if __name__ == "__main__":
    floors = {} if "--quick" in sys.argv else {"examples": float(ASKED)}
    main(__doc__ or "", measure, {"undocumented errors": 0.0}, floors=floors, brief=lambda name: True)
