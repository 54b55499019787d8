"""The plots of the page, over the time of a lap: angle, slip, friction use and wrench."""

from typing import Any, NamedTuple

import numpy as np
from pivoting.models.length_unit import POWERS
from pivoting.sim.drawing.colours import Colour
from pivoting.sim.drawing.drawn_world import Array
from pivoting.sim.judging.measures import predicted_slip
from pivoting.sim.run import Run
from pivoting.sim.run_arrays import WRENCH

POINTS = 300  # of a line, at most
HEIGHT = 125  # of a plot, in pixels
NUDGE = 1e-6  # an axis gets its numbers when a range changes: viser 1.1 fixes them too early for a new client
BLUE, RED_, GREEN_, BLACK, ORANGE_, PURPLE_ = (
    (31, 119, 180), (214, 39, 40), (44, 160, 44), (60, 60, 60), (255, 127, 14), (148, 103, 189),
)  # fmt: skip
OF_WRENCH = (BLUE, GREEN_, RED_, ORANGE_, PURPLE_, BLACK)


class Line(NamedTuple):
    """A line of a plot: its values (R,) at the drawn times."""

    label: str
    colour: Colour
    values: Array
    dashed: bool = False


class Plot(NamedTuple):
    """A plot: its title with the unit, and its lines."""

    title: str
    lines: tuple[Line, ...]


def plots_of(run: Run, world: int = 0) -> tuple[Array, list[Plot]]:
    """The drawn times (R,) [s] of a lap so far, and what is plotted at them.

    Of several contacts the one that is worst off at each time is shown.
    """
    last = run.time.size - 1
    rows = np.unique(np.linspace(1, last, min(POINTS, last)).astype(int))
    same = np.ones(rows.size)
    limits, unit = run.limits, run.unit
    moved = run.slip, predicted_slip(run)
    slips = [1e3 * unit * np.linalg.norm(each[world, rows], axis=-1).max(axis=-1) for each in moved]
    assert limits.slip_m is not None, "limits are for a lever"
    measured = np.nan_to_num(run.friction_use[world, rows - 1], nan=-1.0).max(axis=-1)
    planned = float((run.attached.controller.belief.contacts.mu / run.world.mu).max())
    names = WRENCH[run.truth.dim]
    moment = 3 if run.truth.dim == 3 else 2
    units = ["N" if i < moment else "N m" for i in range(len(names))]
    scaled = [unit ** POWERS[of] * values for of, values in zip(units, run.wrench[world, rows - 1].T, strict=True)]
    return run.time[rows], [
        Plot(
            "angle [deg]",
            (
                Line("object", BLUE, np.rad2deg(run.theta[world, rows])),
                Line("reference", BLACK, np.rad2deg(run.reference[0][rows]), dashed=True),
            ),
        ),
        Plot(
            "slip of the contact [mm]",
            (
                Line("limit", RED_, 1e3 * limits.slip_m * same, dashed=True),
                Line("measured", BLUE, slips[0]),
                Line("predicted of MuJoCo itself", BLACK, slips[1], dashed=True),
            ),
        ),
        Plot(
            "friction used, |f_t| / (mu f_n)",
            (
                Line("slides", RED_, same, dashed=True),
                Line("planned for", PURPLE_, planned * same, dashed=True),
                Line("measured", BLUE, np.where(measured < 0.0, np.nan, measured)),
            ),
        ),
        Plot(
            "applied wrench [N, N m], object axes",
            tuple(
                Line(f"{name} [{of}]", colour, values)
                for name, of, colour, values in zip(names, units, OF_WRENCH, scaled, strict=False)
            ),
        ),
    ]


class LivePlots:
    """The plots as elements of the page."""

    def __init__(self, gui: Any, run: Run, seconds: float):
        """In the container that is open.  seconds: that the lap takes."""
        times, plots = plots_of(run)
        self._nudge = 0.0
        self._handles = [
            gui.add_uplot(
                _data(times, plot),
                ({"label": "time [s]"}, *(_series(line) for line in plot.lines)),
                title=plot.title,
                scales=_scales(plot, seconds, 0.0),
                legend={"show": True, "live": False},
                height=HEIGHT,
                padding=(8, 20, 0, 0),
            )
            for plot in plots
        ]

    def show(self, run: Run, seconds: float) -> None:
        """A lap so far."""
        times, plots = plots_of(run)
        self._nudge = NUDGE - self._nudge
        for handle, plot in zip(self._handles, plots, strict=True):
            handle.data, handle.scales = _data(times, plot), _scales(plot, seconds, self._nudge)


def _series(line: Line) -> dict[str, Any]:
    style = {"dash": (6, 4)} if line.dashed else {}
    return {"label": line.label, "stroke": f"rgb{line.colour}", "width": 2, "points": {"show": False}, **style}


def _data(times: Array, plot: Plot) -> tuple[Array, ...]:
    return (times, *(line.values for line in plot.lines))


def _scales(plot: Plot, seconds: float, nudge: float) -> dict[str, Any]:
    """Axes as long as the lap, and as high as what is finite, in steps; higher by a share `nudge`."""
    values = np.concatenate([line.values for line in plot.lines])
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 1.0)
    step = 0.25 * 10.0 ** np.floor(np.log10(max(high - min(low, 0.0), 1e-9)))
    low, high = step * np.floor(1.05 * min(low, 0.0) / step), step * np.ceil(1.05 * max(high, 0.1 * step) / step)
    return {"x": {"time": False, "range": (0.0, seconds)}, "y": {"range": (float(low), float(high * (1.0 + nudge)))}}
