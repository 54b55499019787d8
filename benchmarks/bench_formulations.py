"""How fast can one pivot before static, quasi-dynamic and dynamic part? One arc from 10 to 80 deg, 4 s down to 0.15 s.

Every formulation turns the same block (1 m, 1 kg, mu = 0.3) with the same margin (1/6) and the same floor under the
normal force, once none and once 50 N. The world starts up to 0.01 deg off and rests 0.25 s before and after the arc.
It sticks where the contact is never lost and the corner slips at most 1.25 of what MuJoCo's own contact model predicts,
plus a micrometre. The shortest duration is found by bisection below the shortest of the grid down to which all pass.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from harness import main
from pivoting.controller import Body, Contact, Law, MinimumJerk, Motion, WrenchController, solve
from pivoting.sim import Run, simulate
from rich.progress import track

FLOORS = (0.0, 50.0)  # [N]
DURATIONS = np.geomspace(4.0, 0.15, 12)
RMS = (0.1, 1.0)  # [deg] of the two thresholds
BEYOND, ROUNDING = 1.25, 1e-6  # of the predicted slip, and [m]
H, DT = 0.025, 0.001  # [s]
MEASURES = {
    "angle, RMS": "deg",
    "angle, greatest": "deg",
    "slip": "mm",
    "slip, predicted": "mm",
    "without contact": "ms",
    "greatest force": "N",
    "greatest moment": "N m",
}


class Formulation(NamedTuple):
    """What `simulate` is told, and how it is drawn."""

    overrides: dict[str, Any]
    style: str
    colour: str


FORMULATIONS = {
    "static": Formulation({"law": "static"}, ":", "#888888"),
    "quasi-dynamic, as written": Formulation({"law": "quasi-dynamic", "bandwidth": 1.0 / H}, "-", "#c0392b"),
    "quasi-dynamic, as written, h = dt": Formulation({"law": "quasi-dynamic", "bandwidth": 1.0 / DT}, "--", "#c0392b"),
    "quasi-dynamic, velocity": Formulation({"law": "quasi-dynamic-velocity", "bandwidth": 1.0 / H}, "-", "#e08a1e"),
    "quasi-dynamic, velocity, h = dt": Formulation(
        {"law": "quasi-dynamic-velocity", "bandwidth": 1.0 / DT}, "--", "#e08a1e"
    ),
    "dynamic": Formulation({"law": "dynamic"}, "-", "#2f6db3"),
    "horizon": Formulation({"plan_hz": 100.0}, "-", "#2e8b57"),
    "horizon, fine": Formulation({"plan_hz": 200.0, "plan_step": 0.005, "track": 1e6}, "--", "#2e8b57"),
    "horizon, quasi-dynamic": Formulation({"plan_hz": 100.0, "integrator": "quasi-dynamic"}, ":", "#2e8b57"),
}


def pivot(name: str, floor: float, seconds: float) -> Run:
    """The arc in so many seconds, floor in [N]."""
    return simulate("pivot-2d", reference="arc", seconds=seconds, f_min=floor, **FORMULATIONS[name].overrides)


def measured(run: Run) -> dict[str, float]:
    """One run in numbers, units as in `MEASURES`."""
    of = {key: float(value[0]) for key, value in vars(run.measures).items()}
    wrench = np.nan_to_num(run.wrench[0])
    values = (
        of["angle_error_rms_deg"],
        of["angle_error_max_deg"],
        1e3 * of["slip_max_m"],
        1e3 * of["slip_floor_m"],
        1e3 * of["contact_lost_s"],
        float(np.linalg.norm(wrench[:, :2], axis=1).max()),
        float(np.abs(wrench[:, 2]).max()),
    )
    return dict(zip(MEASURES, values, strict=True))


def sticks(row: dict[str, float]) -> bool:
    """Nothing but the simulator's own slip, and always in contact."""
    return row["without contact"] == 0.0 and row["slip"] <= BEYOND * row["slip, predicted"] + 1e3 * ROUNDING


def passes(row: dict[str, float], rms: float) -> bool:
    """It sticks and follows."""
    return sticks(row) and row["angle, RMS"] <= rms


def shortest(name: str, floor: float, rows: dict[float, dict[str, float]], rms: float, halvings: int) -> float:
    """The shortest duration [s] that passes: inf if the longest of the grid does not, its shortest if that does."""
    good = float("inf")
    for seconds, row in rows.items():
        if passes(row, rms):
            good = seconds
            continue
        if not np.isfinite(good):
            return good
        bad = seconds
        for _ in range(halvings):
            middle = round(float(np.sqrt(good * bad)), 3)
            if passes(measured(pivot(name, floor, middle)), rms):
                good = middle
            else:
                bad = middle
        return good
    return good


def ring(law: str, h: float) -> dict[str, float]:
    """Erratum 7: a block in balance, started 0.01 deg off at rest, 50 N on the table; 1 s.

    Frequency [Hz] and ratio of the amplitudes in the last quarter and the first, and the predicted ones.
    """
    run = simulate("balance-2d", law=law, bandwidth=1.0 / h, spread=0.5, seed=1, seconds=1.0, f_min=FLOORS[1])
    error = run.angle_error[0]
    before = np.flatnonzero(np.diff(np.sign(error)))
    crossings = before + error[before] / (error[before] - error[before + 1])
    quarter = len(error) // 4
    first, last = (float(np.abs(part).max()) for part in (error[:quarter], error[-quarter:]))
    x, damping = DT / h, float(law.endswith("velocity"))
    z = np.roots([1.0, -(2.0 - damping * x - x**2), 1.0 - damping * x])[0]
    return {
        "frequency, Hz": float((len(crossings) - 1) / (2.0 * DT * (crossings[-1] - crossings[0]))),
        "frequency predicted, Hz": abs(float(np.angle(z))) / (2.0 * np.pi * DT),
        "eigenvalue": float(abs(z)),
        "amplitude, last quarter over first": last / first,
    }


def neglected(floor: float) -> float:
    """The shortest duration [s] at which neglecting the velocity terms leaves the contact in its cone, without MuJoCo.

    The reference is met exactly, but no wrench makes the centripetal force m omega^2 rho towards the contact; the
    contact does, besides the force that was planned.
    """
    law, corner = Law("dynamic", 0.0, 0.0, 1.0, 0.0), Contact((-0.5, -0.5), 0.3, f_min=floor)
    controller = WrenchController(Body(1.0, 1.0 / 6.0), [corner], law, (0.0, -10.0), margin=1.0 / 6.0)

    def holds(seconds: float) -> bool:
        arc = MinimumJerk((np.deg2rad(10.0), np.deg2rad(80.0)), seconds)
        for angle, rate, acceleration in zip(*arc(np.linspace(0.0, seconds, 201)), strict=True):
            planned = solve(controller.problem(Motion(angle, rate), Motion(angle, rate, acceleration))).force[0]
            lever = np.sqrt(0.5) * np.array([np.cos(angle + np.pi / 4), np.sin(angle + np.pi / 4)])
            tangential, normal = planned - 1.0 * rate**2 * lever
            if abs(tangential) > corner.mu * normal:
                return False
        return True

    low, high = 0.1, 4.0
    while high > 1.002 * low:
        middle = np.sqrt(low * high)
        low, high = (low, middle) if holds(middle) else (middle, high)
    return float(high)


def measure(quick: bool) -> dict[str, float]:
    """The figures; see the head of this file."""
    out = {}
    for h in (H, 0.01, 0.002, DT):
        out |= {
            f"ring, as written, h = {1e3 * h:g} ms: {key}": value for key, value in ring("quasi-dynamic", h).items()
        }
    damped = ring("quasi-dynamic-velocity", H)
    out |= {f"ring, velocity, h = {1e3 * H:g} ms: {key}": damped[key] for key in ("eigenvalue", list(damped)[-1])}
    for floor in FLOORS:
        out[f"velocity neglected, predicted; floor {floor:g} N: shortest that sticks, s"] = neglected(floor)
    grid = [round(float(seconds), 3) for seconds in (DURATIONS[[0, 5, 11]] if quick else DURATIONS)]
    for name in track(FORMULATIONS, "formulations", transient=True):
        for floor in FLOORS:
            rows = {seconds: measured(pivot(name, floor, seconds)) for seconds in grid}
            for seconds, row in rows.items():
                label = f"{name}; floor {floor:g} N; {seconds:g} s"
                out |= {f"{label}: {key}, {unit}": row[key] for key, unit in MEASURES.items()}
                out[f"{label}: sticks"] = float(sticks(row))
            for rms in RMS:
                found = shortest(name, floor, rows, rms, 1 if quick else 5)
                if np.isfinite(found):
                    out[f"{name}; floor {floor:g} N: shortest with RMS <= {rms:g} deg, s"] = found
    return out


def series(figures: dict[str, float], name: str, floor: float, key: str) -> tuple[list[float], list[float]]:
    """Durations and values of one measure, from saved figures."""
    head, tail = f"{name}; floor {floor:g} N; ", f" s: {key}"
    found = {float(k[len(head) : -len(tail)]): v for k, v in figures.items() if k.startswith(head) and k.endswith(tail)}
    return list(found), list(found.values())


def tables(figures: dict[str, float]) -> str:
    """The shortest durations, every formulation at two durations with the floor, and the rings."""
    lines = ["| shortest duration, s | RMS 0.1 deg | RMS 1 deg | RMS 0.1 deg, 50 N | RMS 1 deg, 50 N |"]
    lines += ["|---|--:|--:|--:|--:|"]
    for name in FORMULATIONS:
        cells = []
        for floor in FLOORS:
            least = min(series(figures, name, floor, "sticks")[0])
            for rms in RMS:
                value = figures.get(f"{name}; floor {floor:g} N: shortest with RMS <= {rms:g} deg, s")
                cells.append("never" if value is None else f"< {value:.2f}" if value <= least else f"{value:.2f}")
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    keys = [f"{key}, {unit}" for key, unit in MEASURES.items()]
    lines += ["", f"| floor {FLOORS[1]:g} N | s | {' | '.join(keys)} | sticks |", "|---|" + "--:|" * (len(keys) + 2)]
    for name in FORMULATIONS:
        for seconds in series(figures, name, FLOORS[1], "sticks")[0][5:9:3]:
            label = f"{name}; floor {FLOORS[1]:g} N; {seconds:g} s: "
            cells = [f"{figures[label + key]:.3g}" for key in keys]
            cells.append("yes" if figures[label + "sticks"] else "no")
            lines.append(f"| {name} | {seconds:g} | " + " | ".join(cells) + " |")
    rings = {key.split(": ")[0]: None for key in figures if key.startswith("ring")}
    keys = ["frequency, Hz", "frequency predicted, Hz", "eigenvalue", "amplitude, last quarter over first"]
    lines += ["", f"| {' | '.join(['law', *keys])} |", "|---|" + "--:|" * len(keys)]
    for label in rings:
        cells = [f"{figures[f'{label}: {key}']:.5g}" if f"{label}: {key}" in figures else "" for key in keys]
        lines.append(f"| {label.removeprefix('ring, ')} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def draw(figures: dict[str, float], path: Path) -> None:
    """The sweep as a picture: a column for each floor, a row for each measure, a line for each formulation."""
    from matplotlib.figure import Figure

    rows = (
        ("angle, RMS, deg", "angle error, RMS [deg]", 3e-5),
        ("slip, mm", "slip of the corner [mm]", 1e-4),
        ("without contact, ms", "without contact [ms]", 0.5),
        ("greatest force, N", "greatest force [N]", 4.0),
    )
    figure = Figure(figsize=(12.0, 14.0), layout="constrained")
    grid = figure.subplots(len(rows), len(FLOORS), sharex=True, sharey="row")
    for column, floor in enumerate(FLOORS):
        for axes, (key, label, least) in zip(grid[:, column], rows, strict=True):
            for name, (_, style, colour) in FORMULATIONS.items():
                seconds, values = series(figures, name, floor, key)
                shown = np.maximum(values, least)
                axes.loglog(seconds, shown, style, color=colour, marker=".", linewidth=1.6, label=name)
            if key.startswith("slip"):
                seconds, values = series(figures, "dynamic", floor, "slip, predicted, mm")
                axes.loglog(seconds, values, color="black", linewidth=5, alpha=0.2, label="MuJoCo's own, predicted")
            if key.startswith("angle"):
                for rms in RMS:
                    axes.axhline(rms, color="black", linewidth=0.8, linestyle=(0, (2, 3)))
            axes.grid(which="major", alpha=0.3)
            if column == 0:
                axes.set_ylabel(label)
        grid[0, column].set_title(
            f"normal force kept above {floor:g} N" if floor else "no floor under the normal force"
        )
        grid[-1, column].set_xlabel("duration of the arc, 10 to 80 deg [s]")
        ticks = [4.0, 2.0, 1.0, 0.5, 0.3, 0.2, 0.15]
        grid[-1, column].set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        grid[-1, column].minorticks_off()
    grid[0, 0].set_ylim(3e-5, 200.0)
    grid[1, 0].set_ylim(1e-4, 2e3)
    grid[2, 0].set_ylim(0.5, 1e3)
    grid[2, 0].annotate("0", (0.0, 0.0), xycoords="axes fraction", xytext=(-14, -3), textcoords="offset points")
    grid[3, 0].set_ylim(4.0, 2e3)
    handles, labels = grid[1, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=9)
    figure.savefig(path, dpi=100)


if __name__ == "__main__":
    bounds = {
        **{f"ring, as written, h = {1e3 * h:g} ms: amplitude, last quarter over first": 1.02 for h in (H, DT)},
        f"ring, velocity, h = {1e3 * H:g} ms: amplitude, last quarter over first": 1e-3,
        "dynamic; floor 50 N: shortest with RMS <= 1 deg, s": 0.16,
        "velocity neglected, predicted; floor 50 N: shortest that sticks, s": 0.35,
    }
    floors = {
        **{f"ring, as written, h = {1e3 * h:g} ms: amplitude, last quarter over first": 0.98 for h in (H, DT)},
        "quasi-dynamic, as written; floor 50 N: shortest with RMS <= 1 deg, s": 0.3,
    }
    main(
        __doc__ or "", measure, bounds, floors=floors, markdown=tables, draw=draw, brief=lambda name: " s: " not in name
    )
