"""`pivoting check`: whether a reference can be followed within the bounds, found out before it is tried."""

import json
from pathlib import Path
from typing import Any

import click
from pivoting.sim.console.scenario_options import scenario_options
from pivoting.sim.console.stdout import JsonOutput, console, json_option

POINTS = 50  # of sim.reference_check, which imports what takes long


@click.command()
@click.argument("scenario", required=False)
@scenario_options
@click.option(
    "--points", type=click.IntRange(2, 10**6), default=POINTS, show_default=True, help="How many moments are checked."
)
@click.option("--out", type=click.Path(path_type=Path), help="Also write the certificate of a no to a .json file.")
@json_option("Print one JSON object and nothing else.")
def check(
    scenario: str | None,
    settings: tuple[str, ...],
    points: int,
    out: Path | None,
    as_json: JsonOutput | None,
    **own: Any,
) -> int:
    """Find out, before it starts, whether SCENARIO's reference can be followed within its bounds on the wrench.

    At each of some moments along the reference: is there a wrench within force_max and moment_max that moves the object
    as it is to move, and whose contact forces hold in every world of the set that the keys tell? A no comes with a
    certificate that arithmetic checks. Nothing is simulated. Exit 1 unless all moments are a yes.
    """
    from pivoting.sim.console.asked_run import ask
    from pivoting.sim.console.check_tables import print_check
    from pivoting.sim.console.json_values import jsonable
    from pivoting.sim.reference_check import check_reference
    from pivoting.sim.whole_files import whole

    if scenario is None and own["model"] is None:
        raise click.UsageError("Missing argument 'SCENARIO', or --model FILE.xml --body NAME.")
    asked = ask(scenario or "pivot", None, worlds=1, seed=0, settings=settings, limits=(), open_loop=False, **own)
    found = check_reference(asked.scenario, points)
    proof = None if found.first is None else found.first.certificate
    if out is not None and proof is not None:
        with whole(out) as part:
            part.write_text(json.dumps(proof.as_dict()) + "\n", encoding="utf-8")
    if as_json:
        as_json(jsonable(found.summary()))
    else:
        print_check(console(), found)
        if out is not None:
            click.echo("no certificate, and so no file" if proof is None else f"wrote {out}")
    return 0 if found.answer == "yes" else 1
