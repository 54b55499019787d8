"""What people read of a run: what it was, the table of its verdict, times, reasons and events."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from pivoting.models.length_unit import NAMES
from pivoting.sim.experiment import Experiment
from pivoting.sim.fleet import Fleet
from pivoting.sim.run import Run
from pivoting.sim.scenarios.key_declaration import declared_keys
from rich.console import Console
from rich.table import Table

_EVENTS, _FAILED = 5, 10  # events and failed worlds that people are shown
_READ = {"object": "read of the object", "contact_settings": "contact"}  # what was read, in the summary and in words
_SAID = {  # of it otherwise, or not at all
    "replaced": "in place of the file's",
    "contacts": "",
    "coupling": "",
    "f_min_N": "pressed with",
    "laid_over_deg": "laid on another side than in the file, over by",
}
# with which a name in the summary may end
_UNITS = {"kg_m2": "kg m^2", **{unit: unit for unit in ("kg", "m", "s", "N", "deg")}}

# name in the summary: (what people read, factor, unit)
_LINES = {
    "slip_max_m": ("slip of the contact", 1e3, "mm"),
    "angle_error_rms_deg": ("angle error, RMS", 1.0, "deg"),
    "angle_error_max_deg": ("angle error, greatest", 1.0, "deg"),
    "contact_lost_s": ("time without contact", 1.0, "s"),
    "undeclared_contact_s": ("time with an undeclared contact", 1.0, "s"),
    "penetration_rel": ("depth not explained, of the lever", 100.0, "%"),
    "friction_use_max": ("friction used, |f_t| / (mu f_n)", 1.0, ""),
    "force_mismatch_rel": ("contact force, predicted against measured", 100.0, "%"),
    "contacts_missing": ("contacts missing at the end", 1.0, ""),
    "bounce_m": ("height regained after landing", 1e3, "mm"),
    "unsolved_steps": ("steps without a certified answer", 1.0, ""),
    "safe_s": ("time in a safe state", 1.0, "s"),
}


def print_run(console: Console, run: Run | Fleet) -> None:
    """What was run, the table of its verdict, and what there is to say of it."""
    summary = run.summary()
    _print_scenario(console, run, summary)
    console.print(_verdict_table(run, summary))
    _print_verdict(console, run, summary)
    _print_times(console, run, summary)
    _print_notes(console, run, summary)


def _print_scenario(console: Console, run: Experiment, summary: Mapping[str, Any]) -> None:
    """The scenario and what was read of the object."""
    console.print(f"[bold]{run.scenario.label}[/]: {run.scenario.summary}", soft_wrap=True, highlight=False)
    keys = declared_keys(type(run.scenario))
    resolved = [
        f"{key} = {getattr(run.scenario, key)}: {value:.4g} {keys[key].unit}"
        for key, value in summary["resolved"].items()
    ]
    read = [f"{name}: {_words(summary[key])}" for key, name in _READ.items() if summary.get(key)]
    lengths = f"lengths are taken to be in {NAMES[run.unit]}, from the size of gravity; what follows is in m and N"
    for line in [lengths] * (run.unit != 1.0) + [", ".join(resolved)] * bool(resolved) + read:
        console.print(line, highlight=False, markup=False, soft_wrap=True, style="dim")


def _verdict_table(run: Experiment, summary: Mapping[str, Any]) -> Table:
    table = Table()
    for heading in ("measured in MuJoCo" + (", worst world" if run.worlds > 1 else ""), "value", "limit", ""):
        table.add_column(heading, justify="right" if heading in ("value", "limit") else "left")
    for check in run.checks:
        words, factor, unit = _LINES[check.name]
        table.add_row(
            words,
            f"{_short(factor * check.value)} {unit}".strip(),
            f"{_short(factor * check.limit)} {unit}".strip(),
            "[green]pass[/]" if check.passed else "[red]FAIL[/]",
        )
        if check.name == "slip_max_m":
            floor, unknown = 1e3 * summary["slip_floor_m"], summary["slip_floor_unknown"]
            told = f"unknown: {unknown}" if unknown else f"{_short(floor)} mm"
            table.add_row("  of which the simulator's own, predicted", told, "", "", style="dim")
    return table


def _print_verdict(console: Console, run: Experiment, summary: Mapping[str, Any]) -> None:
    failed = run.failed_worlds.size
    certificate = f"   greatest KKT residual: {summary['residual_max']:.1e}" if run.certified else ""
    console.print(
        f"verdict: [bold]{'[green]pass' if not failed else '[red]fail'}[/][/]"
        f"   worlds: {run.worlds - failed} of {run.worlds} within limits{certificate}"
    )
    if run.worlds > 1:
        more = f" and {failed - _FAILED} more" * (failed > _FAILED)
        some = ", ".join(str(i) for i in run.failed_worlds[:_FAILED]) + more
        own = ", ".join(f"{key}={value:.4g}" for key, value in summary.get("worst_world_values", {}).items())
        line = (
            f"the worst world is {run.worst_world}"
            + f" ({own})" * bool(own)
            + f"; those that fail are {some}" * bool(failed)
        )
        console.print(line, highlight=False)


def _print_times(console: Console, run: Run | Fleet, summary: Mapping[str, Any]) -> None:
    """How long the run took, its plans included."""
    console.print(
        f"{summary['sim_s']:g} s simulated in {summary['wall_s']:.2f} s; stating, solving and certifying the problem:"
        f" {summary['solve_us_median']:.1f} us a step (99th percentile {summary['solve_us_p99']:.1f})",
        soft_wrap=True,
    )
    if "plans" in summary:
        console.print(
            f"{summary['plans']:.0f} plans, {summary['plans_failed']:.0f} failed;"
            f" {summary['plan_ms_median']:.2f} ms each (99th percentile {summary['plan_ms_p99']:.2f});"
            f" greatest KKT residual {_short(summary['plan_residual_max'])};"
            f" {summary['real_time_factor']:.1f} times real time",
            soft_wrap=True,
        )
    if isinstance(run, Run) and run.plan is not None:
        console.print(
            f"open loop: a plan of {run.plan.horizon.steps} steps ({run.plan.passes} passes, {run.plan.seconds:.2f} s);"
            f" the object is at most {_short(summary['plan_angle_error_max_deg'])} deg off it",
            soft_wrap=True,
        )


def _print_notes(console: Console, run: Experiment, summary: Mapping[str, Any]) -> None:
    """What a user has to know of: bounds that did not suffice, warnings, reasons, events."""
    if summary["bounded_steps"]:
        steps = run.worlds * (len(run.time) - 1)
        told = f"{summary['bounded_steps']} of {steps} steps: the bounds did not allow what was asked for"
        console.print(told, style="yellow", soft_wrap=True)
    if lost := summary["unguaranteed_steps"]:
        told = f"in {lost} of them they did not allow a grip in all worlds of the set: nothing was guaranteed there"
        console.print(told, style="yellow", soft_wrap=True)
    if repeated := int(run.measures.repeated_steps.sum()):
        steps = run.worlds * (len(run.time) - 1)
        console.print(f"{repeated} of {steps} steps: the last answer again", style="yellow", soft_wrap=True)
    for warning in run.engine_warnings:
        console.print(f"MuJoCo: {warning}", style="yellow", highlight=False, soft_wrap=True)
    for reason in summary["reasons"]:
        console.print(f"why: {reason}", style="yellow", soft_wrap=True, highlight=False)
    shown = [event for event in run.events if not (event.state and event.world == run.worst_world and run.worlds == 1)]
    for event in shown[:_EVENTS]:
        console.print(f"world {event.world}, {event.time:.3f} s: {event.what}", style="yellow", soft_wrap=True)
    left_out = summary.get("events_left_out", 0)
    if more := max(len(shown) - _EVENTS, 0) + left_out:
        there = f"{len(run.events)} of all" if left_out else "all"
        console.print(f"and {more} more events, {there} in summary.json", style="yellow")


def _words(read: Mapping[str, Any], between: str = ", ") -> str:
    """A mapping of the summary as people read it: names, numbers, units; what is empty or zero is left out."""
    said = []
    for key, value in read.items():
        unit = next((unit for unit in _UNITS if key.endswith(f"_{unit}")), "")
        name = _SAID.get(key, key.removesuffix(f"_{unit}").replace("_", " "))
        if not name:
            continue
        if isinstance(value, Mapping):
            said.append(f"{name} ({_words(value, '; ')})" if value else "")
        elif isinstance(value, str) or np.any(value):
            said.append(f"{name} {_shown(value)} {_UNITS.get(unit, '')}".strip())
    return between.join(filter(None, said))


def _shown(value: Any) -> str:
    if not isinstance(value, list | tuple):
        return _plain(value)
    table = np.array(value, dtype=float) if not any(isinstance(item, str) for item in value) else np.empty(0)
    table = np.where(np.abs(table) < 1e-7 * np.abs(table).max(initial=0.0), 0.0, table)  # rounding
    if table.ndim == 2 and table.shape == (3, 3) and not (table - np.diag(np.diag(table))).any():
        return f"diag{_shown(np.diag(table).tolist())}"
    items = value if table.ndim != 1 or not table.size else table.tolist()
    return "(" + ", ".join(_shown(item) for item in items) + ")"


def _plain(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _short(value: float) -> str:
    return f"{value:.3g}" if np.isfinite(value) else "not finite"
