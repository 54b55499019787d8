"""The options of commands that run a scenario, or an object of the user's own."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from pivoting.sim.scenarios.scenario import Scenario


OPTIONS = (
    click.option(
        "--set", "settings", multiple=True, metavar="KEY=VALUE", help="Change a key, or world.KEY for the world alone."
    ),
    click.option("--model", type=click.Path(path_type=Path), help="An MJCF file of your own, for the scenario pivot."),
    click.option("--body", help="Name of the body in it that is pivoted, or '#1' of one without a name."),
    click.option(
        "--contact", help='What it turns about: vertex, edge, lowest, or "x,y,z" or "x,y,z; x,y,z" in its frame, m.'
    ),
    click.option("--support", help="Name (or '#id') of the geom that it stands on; by default what is under it."),
    click.option("--as-modelled", is_flag=True, help="Keep the file's contact and solver parameters."),
)


def scenario_options(command: Callable[..., int]) -> Callable[..., int]:
    """Add the `OPTIONS` to a command; `chosen_scenario` takes their values."""
    for option in reversed(OPTIONS):  # as decorators are applied
        command = option(command)
    return command


def chosen_scenario(scenario: str, settings: tuple[str, ...], limits: tuple[str, ...], **own: Any) -> "Scenario":
    """The scenario of this name, or of the user's own object, with the changes of --set and --limit."""
    from pivoting.sim.scenarios.shipped_scenarios import scenario as find

    changes: dict[str, Any] = _pairs("--set", settings)
    if "limits" in changes:
        raise click.BadParameter("--set limits: must be --limit KEY=VALUE")
    changes["limits"] = _pairs("--limit", limits)
    case = (_own(**own) if scenario == "pivot" else find(scenario)).change(**changes)
    given = [key for key, value in own.items() if value is not None and value is not False]
    if scenario != "pivot" and given:
        raise click.BadParameter(f"--{given[0].replace('_', '-')}: only the scenario pivot takes it, not {scenario!r}")
    return case


def _own(
    model: Path | None, body: str | None, contact: str | None, support: str | None, as_modelled: bool
) -> "Scenario":
    """The scenario of an object of one's own."""
    from pivoting.sim.scenarios.shipped_scenarios import own_object

    for option, value in (("--model", model), ("--body", body)):
        if value is None:
            raise click.BadParameter(f"{option} is missing: pivot needs --model FILE.xml --body NAME")
    assert model is not None
    assert body is not None
    where: str | list[list[float]] = "lowest" if contact is None else contact
    if contact is not None and "," in contact:
        try:
            where = [[float(number) for number in point.split(",")] for point in contact.split(";")]
        except ValueError:
            raise click.BadParameter(f'--contact {contact!r}: must be "x,y,z" or "x,y,z; x,y,z"') from None
    return own_object(model, body, where, support=support, chosen=not as_modelled)


def _pairs(option: str, pairs: tuple[str, ...]) -> dict[str, str]:
    out: dict[str, str] = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not equals or not key or not value:
            raise click.BadParameter(f"{option} {pair!r}: must be KEY=VALUE")
        if key in out:
            raise click.BadParameter(f"{option} {pair!r}: {key} is already given as {out[key]}")
        out[key] = value
    return out
