"""The command line: `pivoting example | list | contacts | check | run | sweep | render | view | identify`.

Exit 0: pass, 1: fail, 2: one line of why.
"""

import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
from pivoting import __version__
from pivoting.errors import PivotingError
from pivoting.sim.console.check_command import check
from pivoting.sim.console.identify_command import identify
from pivoting.sim.console.scenario_options import scenario_options
from pivoting.sim.console.stdout import JsonOutput, console, json_option
from pivoting.sim.console.sweep_command import sweep
from pivoting.sim.keep import KEEP

# What one command alone needs, as rerun and matplotlib, is imported by that.


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, message="pivoting %(version)s")
def cli() -> None:
    """The smallest wrench that balances or pivots an object on a frictional contact, proved in MuJoCo."""


cli.add_command(check)
cli.add_command(sweep)


@cli.command()
@json_option("Print one JSON object and nothing else.")
@click.option(
    "--figure", type=click.Path(path_type=Path), help="Also draw the solution space, a .png, .svg or .pdf file."
)
def example(as_json: JsonOutput | None, figure: Path | None) -> int:
    """Solve the notes' worked example by every method; exit 0 if all printed digits agree."""
    from pivoting.controller.worked_example import EXAMPLES, compare_all
    from pivoting.sim.console.example_tables import print_examples
    from pivoting.sim.console.json_values import jsonable

    if figure is not None:
        _check_figure(figure)
    results = compare_all()
    agree = all(digit.agrees for digits, _ in results for digit in digits)
    if figure is not None:
        from pivoting.sim.drawing.solution_space_figure import draw_solution_space

        draw_solution_space(results[0][1], figure, f"The notes' worked example, {EXAMPLES[0].summary}")
    if as_json:
        rows = [
            {
                "example": digits[0].example,
                "method": digits[0].method,
                "status": solution.status,
                "residual": solution.residual,
                "agrees": all(digit.agrees for digit in digits),
                "digits": {
                    digit.quantity: {
                        "printed": digit.expected,
                        "value": digit.value,
                        "agrees": digit.agrees,
                        "rounds_to_printed": digit.rounds,
                    }
                    for digit in digits
                },
            }
            for digits, solution in results
        ]
        as_json(jsonable({"agrees": agree, "results": rows}))
    else:
        print_examples(console(), results)
        if figure is not None:
            click.echo(f"wrote {figure}")
    return 0 if agree else 1


@cli.command("list")
def list_scenarios() -> int:
    """The scenarios, a line each."""
    from pivoting.sim.console.scenario_tables import print_scenarios

    print_scenarios(console())
    return 0


class _RunCommand(click.Command):
    """`run`, whose help ends with the keys of a scenario, from their declaration."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Called by click last of all."""
        from pivoting.sim.console.scenario_tables import key_help

        for title, rows in key_help():
            with formatter.section(title):
                formatter.write_dl(rows)


@cli.command(cls=_RunCommand)
@click.argument("name", metavar="[SCENARIO]", required=False)
@click.option(
    "--scenario", "file", type=click.Path(path_type=Path), help="Run what this file describes, in place of SCENARIO."
)
@click.option("--worlds", type=click.IntRange(min=1), help="How many worlds; by default 1, or as the file has it.")
@click.option("--seed", type=click.IntRange(min=0), help="Of the initial errors; by default 0, or as the file has it.")
@click.option("--limit", "limits", multiple=True, metavar="KEY=VALUE", help="Change a limit of the verdict.")
@scenario_options
@click.option("--open-loop", is_flag=True, help="Plan the whole motion once and apply that, whatever happens.")
@click.option(
    "--keep",
    type=click.Choice(list(KEEP)),
    help="What is kept of each world; by default all, or as the file has it.",
)
@click.option("--out", type=click.Path(), help="Folder for what is kept: recording, arrays, scenario and summary.")
@click.option("--record-world", type=click.IntRange(min=0), help="Which world is recorded; by default the worst.")
@json_option("Print the summary as one JSON object and nothing else.")
def run(out: str | None, record_world: int | None, as_json: JsonOutput | None, **options: Any) -> int:
    """Run SCENARIO in closed loop in MuJoCo; exit 0 if the verdict passes, 1 if it fails.

    The scenario pivot takes an object of your own: --model FILE.xml --body NAME --contact vertex.

    LOW:HIGH is an interval: the controller knows no more, and each world has a value of its own.

    Below, each key with what it may be and its default, unless the scenario has another. 2w is twice the object's
    weight as it is believed (of a moment at the lever from contact to centre of mass, of a rate per second), 2T twice
    its natural time, sqrt(lever / gravity).
    """
    from pivoting.sim.console.asked_run import ask, changed_since
    from pivoting.sim.run import Run
    from pivoting.sim.simulation import simulate

    asked = ask(**options)
    if record_world is not None and (out is None or record_world >= asked.worlds):
        allowed = "given with --out" if out is None else f"less than {asked.worlds}, the number of worlds"
        raise click.BadParameter(f"--record-world {record_world}: must be {allowed}")
    folder = None if out is None else _make_folder(out)
    case = asked.scenario
    with _progress(f"{case.name}, {asked.worlds} world{'s' * (asked.worlds > 1)}") as report:
        finished = simulate(
            case,
            asked.worlds,
            asked.seed,
            first_world=asked.first_world,
            open_loop=asked.open_loop,
            keep=asked.keep,
            progress=report,
        )
    if told := changed_since(asked, finished):
        click.echo(f"pivoting: {options['file']}: {told}", err=True)

    from pivoting.sim.console.json_values import jsonable
    from pivoting.sim.console.run_tables import print_run

    also: dict[str, Any] = {}
    if finished.verdict == "fail" and not asked.open_loop and isinstance(finished, Run):
        from pivoting.sim.judging.advice import tried

        also["advice"] = tried(finished, simulate)
    saved = None
    if folder is not None:  # before it is told: who is told may have gone
        from pivoting.sim.console.output_files import save

        saved = save(finished, folder, record_world, also=also)
    if as_json:
        as_json(jsonable({**finished.summary(), **also}) if saved is None else saved.summary)
    else:
        print_run(console(), finished)
        if also:
            click.echo(_advised(also["advice"]))
        elif may := finished.findings.remedies:
            click.echo(f"what may hold it, not tried in so many worlds: {'; '.join(may[:3])}")
    for line in () if saved is None else saved.said:
        click.echo(line)  # under --json on stderr, as all else
    return 1 if finished.verdict == "fail" else 0


@cli.command()
@click.argument("scenario", required=False)
@scenario_options
@click.option(
    "--world",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Which world, counted from 0.",
)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Of the initial errors.")
@click.option("--out", type=click.Path(path_type=Path), required=True, help="File to write: .gif, .mp4 or .png.")
@click.option("--size", default="640x480", show_default=True, metavar="WxH", help="Width and height in pixels.")
@click.option("--fps", type=int, help="Frames a second of a video.  [default: 25]")
@click.option("--speed", type=float, help="Speed of a video: 1 is real time, 0.5 half as fast.  [default: 1]")
@click.option("--time", type=float, help="Time that a .png file shows, s.  [default: the middle of the run]")
def render(
    scenario: str | None,
    settings: tuple[str, ...],
    world: int,
    seed: int,
    out: Path,
    *,
    size: str,
    fps: int | None,
    speed: float | None,
    time: float | None,
    **own: Any,
) -> int:
    """Run SCENARIO, or an object of your own, and draw it with MuJoCo's renderer; exit 0 once the file is written.

    It shows the applied force and moment at the centre of mass, the measured force and the friction cone at each
    contact, and the paths of the centre of mass and of a corner. --set takes the keys of `pivoting run`. No display is
    needed.
    """
    from pivoting.sim.console.asked_run import ask
    from pivoting.sim.drawing.offscreen import check_graphics
    from pivoting.sim.drawing.scene_video import Output
    from pivoting.sim.drawing.scene_video import render as write
    from pivoting.sim.simulation import simulate

    scenario = _asked_name(scenario, own)
    asked = ask(scenario, None, worlds=1, seed=seed, settings=settings, limits=(), open_loop=False, **own)
    output = Output(out, _size(size), fps, speed, time)
    check_graphics()
    with _progress(scenario) as report:
        finished = simulate(asked.scenario, 1, seed, first_world=world, progress=report)
    with _progress(str(out)) as report:
        frames = write(finished, output, progress=report)
    told = f"{frames} frame{'s' * (frames > 1)} of a run of {finished.time[-1]:g} s, verdict: {finished.verdict}"
    click.echo(f"wrote {out}: {told}")
    return 0


@cli.command()
@click.argument("scenario", required=False)
@scenario_options
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Of the initial errors.")
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to serve on; 0.0.0.0: to everybody.")
@click.option("--port", type=click.IntRange(0, 65535), default=8080, show_default=True, help="0: any that is free.")
def view(scenario: str | None, settings: tuple[str, ...], seed: int, host: str, port: int, **own: Any) -> int:
    """Run SCENARIO, or an object of your own, in real time on a page in the browser, until Ctrl-C.

    There it can be shoved, sent to another angle, and changed while it runs; the page shows the forces, the verdict so
    far, plots and the solution space. Needs viser: pip install 'pivoting[view]'. --set takes the keys of `pivoting
    run`.
    """
    from pivoting.sim.console.asked_run import ask

    asked = ask(
        _asked_name(scenario, own), None, worlds=1, seed=seed, settings=settings, limits=(), open_loop=False, **own
    )
    if not _installed("viser"):
        raise click.ClickException("view needs viser, which is not installed: pip install 'pivoting[view]'")
    from pivoting.sim.viewing.live_page import view as serve

    serve(asked.scenario, host, port, seed)
    return 0


@cli.command()
@click.option("--model", type=click.Path(path_type=Path), required=True, help="An MJCF file of your own.")
@click.option("--body", required=True, help="Name of the body in it, or '#1' of one without a name.")
@click.option("--support", help="Name (or #id) of the geom that it stands on; by default what is under it.")
@click.option("--least", type=click.FloatRange(min=0.1), default=5.0, show_default=True, help="Least range, deg.")
@json_option("Print them all as one JSON object and nothing else.")
def contacts(model: Path, body: str, support: str | None, least: float, as_json: JsonOutput | None) -> int:
    """What a body may be turned about: each contact as `run pivot --contact` takes it, and the angles it allows."""
    from pivoting.sim.console.contact_table import print_contacts, read_contacts

    with _progress(f"contacts of {body}"):
        found = read_contacts(model, body, support, least)
    if as_json:
        as_json(found)
    else:
        print_contacts(console(), found)
    return 0


cli.add_command(identify)


def _asked_name(scenario: str | None, own: dict[str, Any]) -> str:
    """The scenario's name, which may be left out for an object of one's own."""
    if scenario is None and own["model"] is None:
        raise click.UsageError("Missing argument 'SCENARIO', or --model FILE.xml --body NAME.")
    return scenario or "pivot"


def _installed(package: str) -> bool:
    """Whether it could be imported; None in place of a module says that it cannot."""
    from importlib.util import find_spec

    return sys.modules.get(package, package) is not None and find_spec(package) is not None


def _advised(advice: dict[str, Any]) -> str:
    """What would hold a failing run, or what was tried in vain."""
    if advice["holds"]:
        return f"what would hold it: {advice['setting']} ({advice['why']}; tried, it passes)"
    if not advice["tried"]:
        return "no key is known that would hold it"
    vain = "; ".join(advice["tried"])
    more = f", and {len(advice['untried'])} more were not tried" if advice["untried"] else ""
    return f"nothing was found that would hold it: tried {vain}{more}"


def main() -> int:
    """The exit code: every wrong use ends in one line on stderr and 2; a fault of ours keeps its traceback.

    An interrupt and a reader of stdout that has gone are left to the process: `pivoting.__main__`.
    """
    try:  # not cli.main, which makes of an interrupt an empty line and a RuntimeError, and exits where a pipe breaks
        with cli.make_context("pivoting", sys.argv[1:]) as context:
            code: int = cli.invoke(context)
    except click.exceptions.Exit as error:  # of --help and --version
        return error.exit_code
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message())
        return 2
    except click.ClickException as error:
        return _refuse(error.format_message())
    except BrokenPipeError:
        raise
    except _wrong_uses() as error:
        return _refuse(str(error))
    except PivotingError as error:  # no certified answer: the run ends without a verdict
        click.echo(f"pivoting: {error}", err=True)
        return 1
    except RuntimeError as error:
        if "environment variable MUJOCO_GL" not in str(error):
            raise
        given = os.environ["MUJOCO_GL"]  # at which MuJoCo refuses to be imported at all
        return _refuse(f"MUJOCO_GL = {given!r}: must be one of egl, osmesa, glfw (macOS: cgl, glfw), off, or not set")
    return code


def _wrong_uses() -> tuple[type[Exception], ...]:
    """What is raised of arguments, models and files that cannot be used; any other ValueError is a fault of ours."""
    from pivoting.controller.validate import InputError
    from pivoting.models.errors import ModelError

    return InputError, ModelError, OSError


def _refuse(message: str) -> int:
    click.echo("pivoting: " + " ".join(message.split()), err=True)
    return 2


def _size(text: str) -> tuple[int, int]:
    """Width and height of a picture."""
    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise click.BadParameter(f"--size {text!r}: must be WIDTHxHEIGHT, such as 640x480")
    return int(width), int(height)


def _make_folder(name: str) -> Path:
    """Find out before the work that its results can be kept."""
    out = Path(name)
    if not name or (out.exists() and not out.is_dir()):
        raise click.BadParameter(f"--out {name!r}: must be a folder")
    try:
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=out):
            pass
    except OSError as error:
        raise click.BadParameter(f"--out {name!r}: must be a folder that can be written to ({error})") from None
    return out


def _check_figure(figure: Path) -> None:
    if figure.suffix not in (".png", ".svg", ".pdf"):
        raise click.BadParameter(f"--figure {str(figure)!r}: must end in .png, .svg or .pdf")
    if not figure.parent.is_dir():
        raise click.BadParameter(f"--figure {str(figure)!r}: its folder does not exist")


class _progress:  # noqa: N801
    """A progress bar on stderr, where that is a terminal; as a context, it gives the function that advances it."""

    def __init__(self, title: str):
        from rich.console import Console
        from rich.progress import Progress

        console = Console(stderr=True)
        self._bar = Progress(console=console, transient=True, disable=not console.is_terminal)
        self._task = self._bar.add_task(title, total=None)

    def __enter__(self) -> Callable[[int, int], None]:
        self._bar.start()
        return self._advance

    def _advance(self, done: int, steps: int) -> None:
        self._bar.update(self._task, completed=done, total=steps)

    def __exit__(self, *_: object) -> None:
        self._bar.stop()
