"""The picture of what a guarantee costs: price against the size of the set, for some angles and friction coefficients.

Called with the picture's file. The object is that of pivot-2d, at rest, with the scenario's reserve of friction.
"""

import sys
from pathlib import Path

import numpy as np
from pivoting.controller import Motion, Price, price
from pivoting.sim import scenario
from pivoting.sim.run_setup import set_up

SCALES = np.linspace(0.0, 2.0, 41)
ANGLES, FRICTION = (10.0, 25.0, 45.0), (0.25, 0.35, 0.5, 0.8)
MASS, INERTIA, COM = 0.2, 0.2, 0.05  # at scale 1: shares of what is believed, and of the side of 1 m
COLOURS = ("#b3402e", "#c98a1b", "#2e8b57", "#2f6db3")


def prices(angle: float, mu: float) -> list[Price]:
    """At rest at one angle [deg], for the set at every scale."""
    out = []
    for scale in SCALES:
        told = {
            "mass": (1.0 - MASS * scale, 1.0 + MASS * scale),
            "inertia": (1.0 - INERTIA * scale, 1.0 + INERTIA * scale),
            "com": (-COM * scale, COM * scale),
        }
        case = scenario("pivot-2d").change(mu=mu, **told)
        controller = set_up(case, None, worlds=1, seed=0, first_world=0).belief.attached.controller
        out.append(price(controller, Motion(np.deg2rad(angle))))
    return out


def draw(path: Path) -> None:
    """A column for each angle: the price in the objective above, in the size of the wrench below."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 6.0), layout="constrained")
    axes = figure.subplots(2, len(ANGLES), sharex=True, sharey="row")
    for column, angle in enumerate(ANGLES):
        for mu, colour in zip(FRICTION, COLOURS, strict=True):
            found = prices(angle, mu)
            for row, values in enumerate(([each.objective for each in found], [each.wrench for each in found])):
                axes[row, column].plot(SCALES, values, color=colour, label=f"mu = {mu:g}")
        axes[0, column].set_title(f"theta = {angle:g} deg")
        axes[1, column].set_xlabel("scale of the set [1]")
        for each in axes[:, column]:
            each.grid(alpha=0.3)
            each.axvline(1.0, color="black", linewidth=0.6)
    axes[0, 0].set_ylabel("price in the objective [1]")
    axes[1, 0].set_ylabel("price in the size of the wrench [1]")
    axes[0, 0].legend(fontsize=9, loc="upper left")
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
