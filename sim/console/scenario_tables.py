"""What people read of the scenarios: a line each, and the keys that change them."""

from pivoting.sim.judging.verdict import Limits
from pivoting.sim.scenarios.key_declaration import described
from pivoting.sim.scenarios.scenario import Scenario
from pivoting.sim.scenarios.shipped_scenarios import OWN, SCENARIOS
from rich.console import Console


def print_scenarios(console: Console) -> None:
    """A line for each scenario."""
    width = max(len(name) for name in SCENARIOS)
    for name, case in SCENARIOS.items():
        console.print(f"{name:{width}}  {case.summary}", highlight=False, soft_wrap=True)
    own = "an object of your own, by 20 deg: --model FILE.xml --body NAME --contact vertex"
    console.print(f"{OWN:{width}}  {own}", highlight=False, soft_wrap=True)


def key_help() -> list[tuple[str, list[tuple[str, str]]]]:
    """The keys of `--set` by what they are keys of, and those of `--limit`, each with what it means and may be."""
    options = {"--set": Scenario, "--limit": Limits}
    return [(f"Keys of {option}: {group}", rows) for option, cls in options.items() for group, rows in described(cls)]
