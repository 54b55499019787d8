"""The command `pivoting sweep`: thousands of worlds that differ, on this machine or a cluster, kept in one file."""

import json
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from pivoting.sim.console.scenario_options import scenario_options
from pivoting.sim.console.stdout import JsonOutput, console, json_option

if TYPE_CHECKING:
    from pivoting.sim.sweeping.sweep import Report, SweepProgress
    from pivoting.sim.sweeping.swept import Swept

SAMPLING = ("drawn", "sobol", "lhs", "vertices")  # of sim.sweeping.sampling, which imports what takes long


@click.command()
@click.argument("scenario", required=False)
@click.option("--worlds", type=click.IntRange(min=1), required=True, help="How many worlds.")
@click.option(
    "--vary",
    multiple=True,
    required=True,
    metavar="KEY=LOW:HIGH",
    help="What differs: mass, inertia, mu, com, com_x, ...; as world.KEY the controller is not told.",
)
@click.option(
    "--sampling", type=click.Choice(SAMPLING), default="drawn", show_default=True, help="Where the worlds are."
)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Of what is drawn.")
@click.option("--limit", "limits", multiple=True, metavar="KEY=VALUE", help="Change a limit of the verdict.")
@scenario_options
@click.option("--out", type=click.Path(path_type=Path), help="A Parquet file, with a row for each world.")
@click.option("--resume", is_flag=True, help="Go on with the sweep that was begun in that file.")
@click.option("--chunk", type=click.IntRange(min=1), help="Worlds at once; by default what 250 MB hold.")
@click.option("--executor", default="local", show_default=True, metavar="local|dask:ADDRESS", help="Where it is run.")
@click.option(
    "--map", "figure", type=click.Path(path_type=Path), help="Also draw what fails over two keys, a .png file."
)
@click.option("--worst", type=click.Path(path_type=Path), help="Also write the worst world's scenario, a .json file.")
@json_option("Print the summary as one JSON object and nothing else.")
def sweep(
    scenario: str | None,
    *,
    worlds: int,
    vary: tuple[str, ...],
    sampling: str,
    seed: int,
    settings: tuple[str, ...],
    limits: tuple[str, ...],
    out: Path | None,
    resume: bool,
    chunk: int | None,
    executor: str,
    figure: Path | None,
    worst: Path | None,
    as_json: JsonOutput | None,
    **own: Any,
) -> int:
    """Run many worlds of SCENARIO that differ in what is not known of the object; exit 0 if all of them pass.

    Each is measured as it runs, and what is kept of it is a row. A sweep that was killed is gone on with by --resume,
    to the same rows. A world is run again alone by what its row says: pivoting.read_sweep, or --worst FILE and then
    pivoting run --scenario FILE --out FOLDER.
    """
    from pivoting.sim.console.asked_run import ask
    from pivoting.sim.console.json_values import jsonable
    from pivoting.sim.console.scenario_options import pairs
    from pivoting.sim.console.sweep_tables import print_swept
    from pivoting.sim.sweeping.failure_map import draw_map
    from pivoting.sim.sweeping.sweep import sweep as run

    if scenario is None and own["model"] is None:
        raise click.UsageError("Missing argument 'SCENARIO', or --model FILE.xml --body NAME.")
    asked = ask(
        scenario or "pivot", None, worlds=1, seed=seed, settings=settings, limits=limits, open_loop=False, **own
    )
    with _executor(executor) as pool, _reported(f"{asked.scenario.name}, {worlds} worlds") as report:
        swept = run(
            asked.scenario,
            worlds,
            pairs("--vary", vary),
            seed=seed,
            sampling=sampling,
            out=out,
            resume=resume,
            chunk=chunk,
            executor=pool,
            progress=report,
        )
    if figure is not None:
        draw_map(swept, figure)
    if worst is not None:
        _write_worst(swept, worst)
    if as_json:
        as_json(jsonable(swept.summary()))
    else:
        print_swept(console(), swept)
        for path in filter(None, (out, figure, worst)):
            click.echo(f"wrote {path}")
    return 1 if len(swept.failed) else 0


def _write_worst(swept: "Swept", path: Path) -> None:
    """Write the scenario of the worst world alone, as `pivoting run --scenario` takes it."""
    from pivoting.sim.scenarios.scenario_file import written
    from pivoting.sim.whole_files import whole

    with whole(path) as part:
        part.write_text(json.dumps(written(swept.file_of(swept.worst)), indent=1) + "\n", encoding="utf-8")


@contextmanager
def _executor(asked: str) -> Iterator[Executor | None]:
    """What runs the chunks: None for this process."""
    kind, _, address = asked.partition(":")
    if asked == "local":
        yield None
        return
    if kind != "dask" or not address:
        raise click.BadParameter(f"--executor {asked!r}: must be local, or dask: and the address of a scheduler")
    try:
        from distributed import Client
    except ModuleNotFoundError:
        told = "a sweep on Dask needs distributed, which is not installed: pip install 'pivoting[sweep]'"
        raise click.ClickException(told) from None
    try:
        client = Client(address, timeout=10)
    except (OSError, ValueError) as error:
        told = f"must be the address of a Dask scheduler that answers ({' '.join(str(error).split())})"
        raise click.BadParameter(f"--executor {asked!r}: {told}") from None
    with client:
        yield client.get_executor(pure=False)


@contextmanager
def _reported(title: str) -> "Iterator[Report]":
    """A line on stderr after each chunk: how far it is, the rate, failures so far, and the time that is left."""
    from rich.console import Console

    stderr = Console(stderr=True)

    def report(progress: "SweepProgress") -> None:
        failed = f"{progress.failed} failed" if progress.failed else "none failed"
        left = f"{progress.left:.0f} s left" if progress.done < progress.worlds else "done"
        line = f"{title}: {progress.done} done, {progress.rate:.3g} a second, {failed}, {left}"
        stderr.print(line, highlight=False, soft_wrap=True, end="\r" if stderr.is_terminal else "\n")

    yield report
    if stderr.is_terminal:
        stderr.print()
