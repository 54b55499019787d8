"""The options of commands that run a scenario, or an object of the user's own."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

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
    """Give a command the `OPTIONS`, of which `asked_run.ask` makes a scenario."""
    for option in reversed(OPTIONS):  # as decorators are applied
        command = option(command)
    return command


def own_scenario(
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


def pairs(option: str, given: tuple[str, ...]) -> dict[str, str]:
    """KEY=VALUE by key."""
    out: dict[str, str] = {}
    for pair in given:
        key, equals, value = pair.partition("=")
        if not equals or not key or not value or not pair.isprintable():
            raise click.BadParameter(f"{option} {pair!r}: must be KEY=VALUE")
        if key in out:
            raise click.BadParameter(f"{option} {pair!r}: {key} is already given as {out[key]}")
        out[key] = value
    return out
