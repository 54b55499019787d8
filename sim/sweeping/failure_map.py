"""A map of two keys of a sweep: where in their ranges worlds fail."""

from pathlib import Path

from pivoting.controller.validate import fail, one_of
from pivoting.sim.scenarios.scenario_keys import KEYS
from pivoting.sim.sweeping.swept import Swept
from pivoting.sim.whole_files import whole


def draw_map(swept: Swept, path: Path, keys: tuple[str, str] | None = None) -> None:
    """Draw each world at its values of two keys, those that failed over those that passed.

    Args:
        path: of the picture, .png, .svg or .pdf.
        keys: as world.KEY; None: the first two in which the worlds differ.

    Raises:
        ValueError: the worlds do not differ in two keys, or not in these.
    """
    from matplotlib.figure import Figure

    across = keys or swept.keys[:2]
    if len(across) < 2:
        raise fail("map", swept.keys, "of two keys in which the worlds differ")
    for key in across:
        one_of("map", key, swept.keys)
    figure = Figure(figsize=(6.4, 4.8), layout="constrained")
    axes = figure.add_subplot()
    x, y = (swept.rows[key] for key in across)
    passed = swept.rows["passed"].astype(bool)
    for some, colour, label in ((passed, "0.7", "passed"), (~passed, "tab:red", "failed")):
        axes.scatter(x[some], y[some], s=8.0, c=colour, label=f"{label}: {int(some.sum())}")
    axes.set_xlabel(_label(across[0]))
    axes.set_ylabel(_label(across[1]))
    axes.set_title(f"{swept.scenario.name}: {swept.worlds} worlds, {swept.sampling}")
    figure.legend(loc="outside lower center", ncols=2)
    with whole(path) as part:
        figure.savefig(part, format=path.suffix.removeprefix("."), dpi=150)


def _label(name: str) -> str:
    key = name.removeprefix("world.")
    return key + f" [{KEYS[key].unit}]" * bool(KEYS[key].unit)
