"""What people read of a sweep: how many worlds failed, what that bounds, the worst of them, and what it hangs on."""

import numpy as np
from pivoting.sim.sweeping.swept import Swept
from rich.console import Console
from rich.table import Table

_SHOWN = 10  # failed worlds
_MEASURES = {  # name: what people read, factor, unit
    "slip_max_m": ("slip of the contact", 1e3, "mm"),
    "angle_error_rms_deg": ("angle error, RMS", 1.0, "deg"),
    "angle_error_max_deg": ("angle error, greatest", 1.0, "deg"),
    "friction_use_max": ("friction used, |f_t| / (mu f_n)", 1.0, ""),
    "force_mismatch_rel": ("contact force, expected against measured", 100.0, "%"),
}


def print_swept(console: Console, swept: Swept) -> None:
    """The worlds of a sweep in a few lines and tables."""
    console.print(f"[bold]{swept.scenario.label}[/]", soft_wrap=True, highlight=False)
    console.print(_measures(swept))
    failed = len(swept.failed)
    console.print(f"failed: {failed} of {swept.worlds} worlds ({swept.sampling})", highlight=False)
    if swept.bound is not None:
        told = f"with 95 % confidence fewer than {100.0 * swept.bound:.3g} % of all worlds of the set fail"
        console.print(f"{told} (Clopper and Pearson)", highlight=False, soft_wrap=True)
    else:
        console.print("these worlds are no independent draws: their share bounds nothing", style="dim")
    if failed:
        more = f" and {failed - _SHOWN} more" * (failed > _SHOWN)
        console.print("those that failed: " + ", ".join(map(str, swept.failed[:_SHOWN])) + more, highlight=False)
    _print_sensitivities(console, swept)


def _measures(swept: Swept) -> Table:
    table = Table()
    for heading in ("measured in MuJoCo", "median", "worst", "in world"):
        table.add_column(heading, justify="left" if heading.startswith("measured") else "right")
    for name, (words, factor, unit) in _MEASURES.items():
        values = swept.rows[name].astype(float)
        worst = int(np.argmax(np.where(np.isnan(values), np.inf, values)))
        shown = [
            f"{factor * value:.3g} {unit}".strip() for value in (float(np.nanmedian(values)), float(values[worst]))
        ]
        table.add_row(words, *shown, str(worst))
    return table


def _print_sensitivities(console: Console, swept: Swept) -> None:
    """How much of each measure hangs on each key, where it can be told."""
    try:
        found = swept.sensitivities()
    except ModuleNotFoundError:
        console.print("sensitivities need SALib: pip install 'pivoting[sweep]'", style="dim", markup=False)
        return
    if not found:
        return
    table = Table(title="what it hangs on: the share of the variance of its rank")
    table.add_column("")
    for key in swept.keys:
        table.add_column(key.removeprefix("world."), justify="right")
    for name, shares in found.items():
        table.add_row(_MEASURES[name][0], *(f"{shares[key]:.2f}" for key in swept.keys))
    console.print(table)
