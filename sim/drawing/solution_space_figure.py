"""The notes' second figure as a picture: wrench space with the cone and the optimum, and the forces that it weighs."""

import os
from pathlib import Path
from typing import Any

import numpy as np
from pivoting.controller.solution import Solution
from pivoting.controller.solution_space import solution_space
from pivoting.sim.whole_files import whole

ORANGE, BLUE, BLACK, RED, GREEN = "#e08a1e", "#2f6db3", "#222222", "#c0392b", "#2e8b57"


def draw_solution_space(solution: Solution, path: str | os.PathLike[str], title: str = "") -> Path:
    """Draw a solved planar problem with one contact; written whole or not at all, in the format of the file's ending.

    Left: wrench space (object axes). Orange, what the contact can do, J f; blue, the applied wrenches that balance,
    required - J f. Right: the same problem in the contact force alone, with level sets of its cost.
    """
    path = Path(path)
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 5.4), layout="constrained")
    FigureCanvasAgg(figure)  # not pyplot, whose backend is the caller's business
    _draw_wrenches(figure.add_subplot(1, 2, 1, projection="3d"), solution)
    _draw_forces(figure.add_subplot(1, 2, 2), solution)
    if title:
        figure.suptitle(title)
    with whole(path) as partial:
        figure.savefig(partial, dpi=110, format=path.suffix[1:] or "png")
    return path


def _draw_wrenches(axes: Any, solution: Solution) -> None:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    problem, force = solution.problem, solution.force[0]
    given = problem.jacobian, float(problem.mu_planned[0]), float(problem.f_min[0]), problem.required
    space = solution_space(*given, solution.wrench, force, reach=1.7 * max(float(force[1]), 1e-9))
    for polygon, colour in ((space.cone, ORANGE), (space.admissible, BLUE)):
        axes.add_collection3d(Poly3DCollection([polygon], facecolor=colour, edgecolor=colour, alpha=0.3))
    origin = np.zeros(3)
    load = space.required
    labels = (
        (origin, load, BLACK, "load to cancel, $-m\\mathbf{g}$"),
        (origin, space.contact, ORANGE, "contact, $J_c\\,f$"),
        (origin, space.wrench, RED, "smallest wrench, $w$"),
        (space.contact, load, RED, None),
    )
    for start, end, colour, label in labels:
        style = "--" if label is None else "-"
        axes.plot(*np.stack([start, end], axis=1), style, color=colour, linewidth=2.0, label=label)
        if label is not None:
            axes.scatter(*end, color=colour, s=28, depthshade=False)
    axes.scatter(*origin, color=BLACK, s=12)
    axes.plot([], [], color=ORANGE, alpha=0.4, linewidth=8, label="composite wrench cone")
    axes.plot([], [], color=BLUE, alpha=0.4, linewidth=8, label="wrenches that cancel gravity")
    axes.set(xlabel="$F_u$ [N]", ylabel="$F_v$ [N]", zlabel="$M$ [N m]", title="wrench space, object axes")
    points = np.vstack([space.cone, space.admissible, origin])
    low, high = points.min(axis=0), points.max(axis=0)
    room = 0.05 * (high - low) + 1e-6
    axes.set(xlim=(low[0] - room[0], high[0] + room[0]), ylim=(low[1] - room[1], high[1] + room[1]))
    axes.set_zlim(low[2] - room[2], high[2] + room[2])
    axes.set_box_aspect((1.0, 1.0, 0.55), zoom=0.95)
    axes.view_init(elev=38.0, azim=-78.0)
    axes.legend(loc="upper left", bbox_to_anchor=(-0.05, 1.02), fontsize=8, framealpha=0.9)


def _draw_forces(axes: Any, solution: Solution) -> None:
    problem = solution.problem
    mu, floor = float(problem.mu_planned[0]), float(problem.f_min[0])
    f_t, f_n = solution.force[0]
    free = _free_minimum(solution)
    top = 1.35 * max(f_n, free[1], floor, 1e-9)
    side = max(1.2 * mu * top, 1.3 * abs(free[0]), 0.5 * top)
    grid_t, grid_n = np.meshgrid(np.linspace(-side, side, 240), np.linspace(-0.1 * top, top, 240))
    forces = np.stack([grid_t, grid_n], axis=-1)
    wrenches = problem.required - forces @ problem.jacobian.T
    cost = 0.5 * np.einsum("...i,ij,...j", wrenches, problem.Q_w, wrenches)
    cost += 0.5 * np.einsum("...i,ij,...j", forces, problem.Q_f, forces)
    steps = solution.objective + (cost.max() - solution.objective) * np.linspace(0.0, 1.0, 12) ** 2
    axes.contour(grid_t, grid_n, cost, levels=np.unique(steps), colors="#888888", linewidths=0.7)
    axes.fill([-mu * floor, -mu * top, mu * top, mu * floor], [floor, top, top, floor], color=ORANGE, alpha=0.3)
    axes.plot([], [], color=ORANGE, alpha=0.4, linewidth=8, label=f"friction cone, $\\mu$ = {mu:g}")
    axes.plot(*free, "x", color=BLACK, label="minimum without friction's limit")
    axes.plot(f_t, f_n, "o", color=RED, label=f"optimum ({f_t:.5g}, {f_n:.5g})")
    axes.plot([], [], color="#888888", linewidth=0.8, label="level sets of the cost")
    axes.set(xlabel="$f_t$ [N]", ylabel="$f_n$ [N]", title="contact force", xlim=(-side, side), ylim=(-0.1 * top, top))
    axes.set_aspect("equal")
    axes.legend(loc="upper left", fontsize=8, framealpha=0.9)


def _free_minimum(solution: Solution) -> np.ndarray:
    problem = solution.problem
    J = problem.jacobian
    return np.linalg.solve(problem.Q_f + J.T @ problem.Q_w @ J, J.T @ problem.Q_w @ problem.required)
