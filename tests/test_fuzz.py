"""Every public entry with hostile input, in a hundred examples; `make fuzz` tries 50,000."""

import pytest
from hypothesis import HealthCheck, given, settings

from tests.fuzzed_entries import Entry, documented, entries

EXAMPLES = 125
NAMES = ("solve", "controller", "uncertainty", "keys", "scenario file", "log in CSV", "attach", "vary", "contact",
         "model", "saved run", "log in Parquet", "recording", "sweep's file", "simulate")  # fmt: skip


@pytest.fixture(scope="module")
def all_entries(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Entry]:
    return entries(tmp_path_factory.mktemp("hostile"))


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("name", NAMES)
def test_hostile_input_ends_in_a_documented_error_or_a_certified_answer(
    name: str, all_entries: dict[str, Entry]
) -> None:
    assert tuple(all_entries) == NAMES
    entry = all_entries[name]

    @settings(
        max_examples=max(2, entry.share * EXAMPLES // 50_000), deadline=None, database=None, derandomize=True,
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(entry.drawn)
    def tried(drawn: object) -> None:
        with documented():
            entry.called(drawn)

    tried()
