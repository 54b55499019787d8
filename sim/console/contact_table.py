"""`pivoting contacts`: what an object may be turned about, read from its file and printed."""

from pathlib import Path
from typing import Any

import numpy as np
from pivoting.models.errors import ModelError
from pivoting.models.placement.contact_listing import Candidate, contacts
from pivoting.models.placement.refusals import bounds, option
from pivoting.models.placement.tilt_range import Arc
from pivoting.models.rigid_body import file_frame, read_body
from pivoting.models.scenes import load
from pivoting.sim.scenarios.scenario_keys import LOWEST
from rich.console import Console

ROWS = 30  # that people are shown
GAP = Arc(0.0, 0.0, float(np.deg2rad(LOWEST)))


def read_contacts(model: Path, body: str, support: str | None, least: float) -> dict[str, Any]:
    """What `pivoting contacts --json` says: the contacts with a range of at least `least` [deg], as they are searched.

    Raises:
        ModelError: the file or the body cannot be served, or has no such contact.
    """
    scene = load(model, body=body, support=support, chosen=True)
    compiled = scene.compile()
    read = read_body(compiled, scene.body, scene.support)
    origin, axes = file_frame(compiled, read.index)
    found = contacts(compiled, read, float(np.deg2rad(least)), lambda points: (points - origin) @ axes)
    if not found:
        told = f"about nothing of it can it be turned by {least:g} deg or more with nothing else touching"
        raise ModelError(f"body = {body!r}: {told}; try a smaller --least, or an object that is less smooth")
    rows = [_row(one) for one in found]
    return {"model": str(model), "body": scene.body, "support": scene.support, "least_deg": least, "contacts": rows}


def print_contacts(console: Console, said: dict[str, Any]) -> None:
    """The first of them for people, a line each, which ends with what `run` is to be given."""
    console.print(f"{said['body']} of {Path(said['model']).name}, on {said['support']}:", highlight=False, markup=False)
    console.print(f"{'face':>4}  {'theta, deg':>18}  {'balance':>8}  what", style="bold", highlight=False)
    for row in said["contacts"][:ROWS]:
        low, high = row["range_deg"]
        face = "-" if row["face"] is None else row["face"]
        line = f"{face:>4}  {f'{low:g} to {high:g}':>18}  {row['balance_deg']:8.2f}  {row['kind']}"
        console.print(f"{line:<46}  {option(row['contact'])}", soft_wrap=True, highlight=False, markup=False)
    more = len(said["contacts"]) - ROWS
    if more > 0:
        console.print(f"and {more} more, which --json lists", highlight=False)


def _row(one: Candidate) -> dict[str, Any]:
    """As the command says it."""
    return {
        "kind": one.kind,
        "contact": one.contact,
        "face": one.face,
        "range_deg": bounds(GAP, one.most),
        "balance_deg": float(np.rad2deg(one.balance)),
        "radius_m": one.radius,
    }
