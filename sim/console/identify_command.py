"""`pivoting identify`: what a log of an object's motion tells of it."""

from math import isfinite
from pathlib import Path
from typing import Any

import click
from pivoting.sim.console.stdout import JsonOutput, console, json_option


class _Identify(click.Command):
    """Whose help ends with the columns that a log may have, from their declaration."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Called by click last of all."""
        from pivoting.sim.identification.log_columns import column_help

        for title, rows in column_help():
            with formatter.section(title):
                formatter.write_dl(rows)


class _Interval(click.ParamType):
    """LO:HI."""

    name = "LO:HI"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, float]:
        """(low, high) of text, or of what was converted already."""
        if isinstance(value, tuple):
            return value
        parts = value.split(":")
        try:
            low, high = (float(part) for part in parts)
        except ValueError:
            self.fail(f"{value!r}: must be LO:HI, such as 0.8:1.2", param, ctx)
        if not (isfinite(low) and isfinite(high) and low <= high):
            self.fail(f"{value!r}: must be finite, with LO <= HI", param, ctx)
        return low, high


class _Numbers(click.ParamType):
    """A,B,..."""

    name = "A,B,..."

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """(n,) of text."""
        import numpy as np  # which a list of commands needs not

        try:
            found = np.array([float(part) for part in value.split(",")])
        except ValueError:
            self.fail(f"{value!r}: must be numbers, separated by commas", param, ctx)
        if not np.isfinite(found).all():
            self.fail(f"{value!r}: must be finite", param, ctx)
        return found


class _Box(click.ParamType):
    """LO:HI, or one for each axis, separated by commas."""

    name = "LO:HI,..."

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """(n, 2) of text."""
        import numpy as np

        return np.array([_Interval().convert(part, param, ctx) for part in value.split(",")])


def _bound(name: str, help: str, default: float | None = 0.0) -> Any:
    return click.option(
        name, type=click.FloatRange(min=0.0), default=default, show_default=default is not None, help=help
    )


@click.command(cls=_Identify)
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--lever", type=_Numbers(), help="From the contact to the believed centre of mass, object axes, m.")
@click.option(
    "--inertia", type=_Numbers(), help="Believed, about the centre of mass, kg m^2: I, or Ixx,Iyy,Izz[,Ixy,Ixz,Iyz]."
)
@click.option("--mass", type=_Interval(), help="In which it is, kg.  [of a saved run: 20 % either way]")
@click.option(
    "--com",
    type=_Box(),
    help="In which the centre of mass is, from where it is believed to be, m.  [of a saved run: 10 % of the lever]",
)
@click.option(
    "--factor",
    type=_Interval(),
    default="0.8:1.2",
    show_default=True,
    help="In which the factor on the believed inertia is.",
)
@click.option("--mu", type=_Interval(), help="In which the friction coefficient is.  [default: anything]")
@click.option(
    "--gravity", type=click.FloatRange(min=0.0), default=9.81, show_default=True, help="m/s^2; of a saved run its own."
)
@click.option(
    "--incline",
    type=float,
    default=0.0,
    show_default=True,
    help="By which the table rises to the right, in the plane, deg.",
)
@click.option("--edge", type=_Numbers(), help="Direction, world axes, of an edge that is held at both ends.")
@_bound("--theta-error", "Of a measured orientation, about each axis, deg.", 0.1)
@_bound("--omega-error", "Of a measured angular velocity, rad/s; without it they are not used.", None)
@_bound("--shove", "Impulse of unknown forces in the whole log, N s per kg of the object.")
@_bound("--rate", "Greatest rate of turn, rad/s.  [default: 1.5 times what is measured]", None)
@_bound("--wrench-error", "Of the known wrench, as a share of it.")
@_bound("--force-error", "Of a measured contact force, N.  [default: 1 % of the greatest]", None)
@_bound("--position-error", "Of a measured position, m.")
@click.option("--world", type=click.IntRange(min=0), default=0, show_default=True, help="Of a saved run.")
@json_option("Print one JSON object and nothing else.")
def identify(file: Path, world: int, as_json: JsonOutput | None, **given: Any) -> int:
    """Learn mass, centre of mass, inertia and friction from FILE, a log of an object that turns about a contact.

    FILE is a table of your own, .csv or .parquet, with the columns below; --lever, --inertia, --mass and --com say what
    is believed. Or it is the .nc file of a run that `pivoting run --out` or `Run.save` kept, which says so itself.

    It prints each parameter's interval before and after, and what told it, or why nothing could. The intervals hold the
    truth if the bounds given here do. Exit 1: the log contradicts them.
    """
    from pivoting.controller.learning.identification import identify as learn
    from pivoting.sim.console.asked_identification import asked_errors, asked_log
    from pivoting.sim.console.identification_tables import described, print_identification
    from pivoting.sim.console.json_values import jsonable

    log, unknowns, several = asked_log(file, world, given)
    errors = asked_errors(log, given)
    found = learn(log, errors, unknowns, several=several)
    if as_json:
        as_json(jsonable({"file": str(file), **described(found, log, errors)}))
    else:
        print_identification(console(), file, found, log, errors)
    return 0 if found.consistent else 1
