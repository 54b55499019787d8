"""A finished run as a rerun recording: the scene with its forces, the wrench space, the time series and the verdict.

Nothing is recorded while the loop runs: `record` reads the arrays of a `Run` and sends whole columns. Entities:

    /world/table, /world/block            the solids, posed by transforms
    /world/path/{corner,com}              where the contacts and the CoM went
    /world/wrench/{force,moment,weight}   applied wrench w and weight at the CoM, world axes
    /world/contact/{predicted,measured}   contact forces f at the contact point, table axes
    /world/contact/cone/{planned,world}   (1 - margin) mu with the floor f_min, and the mu of the world
    /wrench_space/...                     the notes' second figure, object axes; of a planar run
    /wrench_space/lacking/<status>        from w + J f to what was required, where that is not the same
    /plots/<plot>/<series>                those of `_series`
    /plots/{slack,set}/...                how well the wrench holds the set of an uncertain controller, see `Margins`
    /plots/solve_us                       the only entity that holds wall-clock time
    /report                               verdict and checks

Of several contacts each has its own /world/contact/<i> and series <name>_<i>. In the plane the block is solid and the
arrows are before it; in space it is half transparent and they are where they act. What is not finite is left out: a gap
in a plot, nothing in a view.
"""

import os
from pathlib import Path
from typing import Any

import numpy as np
from pivoting.controller.solution import BOUNDED, FAILED, INACCURATE, REPEATED, SAFE, STATUS, UNGUARANTEED
from pivoting.controller.solution_space import SolutionSpace
from pivoting.controller.validate import fail
from pivoting.errors import PivotingError
from pivoting.sim.drawing.colours import (
    BLOCK,
    BLUE,
    DARK,
    EDGES,
    GLASS,
    GREEN,
    GREY,
    LIME,
    MINT,
    ORANGE,
    PINK,
    PURPLE,
    RED,
    TABLE,
    TEAL,
    VIOLET,
    WHITE,
    YELLOW,
    Colour,
)
from pivoting.sim.drawing.drawn_world import BOLD, THIN, UP, Array, Rows
from pivoting.sim.drawing.recorded_world import PLOTS, SCENE, Film, xyzw
from pivoting.sim.drawing.recording_id import digest
from pivoting.sim.judging.margins_over_time import margins_over_time
from pivoting.sim.judging.measures import predicted_slip
from pivoting.sim.run import Run
from pivoting.sim.whole_files import whole

OFF = ("off", "false", "0")  # of RERUN, as rerun reads it
QUAD = [[0, 1, 2], [0, 2, 3]]  # triangles of four corners
FINE, WIDE = 1.5, 4.0  # line widths: what was measured shows under what was predicted
CROWDED = 2  # contacts: the legend of more would cover their plots
LACKING = {  # status of an answer that does not give what is required -> what is said of that
    BOUNDED: "bounded: lacking",
    INACCURATE: "inaccurate: lacking",
    FAILED: "no answer, nothing applied: lacking",
    REPEATED: "the last answer again: lacking",
    SAFE: "safe state: lacking",
    UNGUARANTEED: "unguaranteed: lacking",
}
TITLES = {  # plot -> title, where the legend is
    "angle": ("angle [deg]", "LeftTop"),
    "slip": ("contact slip [mm]", "LeftTop"),
    "friction_use": ("friction use |f_t| / (mu f_n)", "RightBottom"),
    "force": ("contact force [N]", "RightTop"),
    "f_n": ("normal force f_n [N]", "RightTop"),
    "f_t": ("tangential force |f_t| [N]", "RightTop"),
    "wrench": ("applied wrench [N, N m]", "RightTop"),
    "solve_us": ("time to solve [us]", "RightTop"),
    "error": ("orientation error [deg]", "RightTop"),
    "slack": ("slack of the worst member [N]", "RightTop"),
    "set": ("slack over f_n, scale of the set", "RightTop"),
}
COMPONENTS = {  # of w by dimension
    2: {"F_u": GREEN, "F_v": LIME, "M": TEAL},
    3: {"F_x": GREEN, "F_y": LIME, "F_z": MINT, "M_x": TEAL, "M_y": BLUE, "M_z": VIOLET},
}


class RecordingOffError(PivotingError, RuntimeError):
    """The environment says that nothing is to be recorded."""


def refuse_if_off() -> None:
    """Raise RecordingOffError if nothing is to be recorded."""
    if os.environ.get("RERUN", "").lower() in OFF:
        raise RecordingOffError(f"RERUN={os.environ['RERUN']} is set in the environment")


def record(run: Run, path: str | os.PathLike[str], *, world: int | None = None) -> Path:
    """Write one world of a finished run to `path` (.rrd) and return it; `rerun PATH` shows it.

    All of it is what happened: nothing is solved again. Views hold 200 Hz of simulated time at most, and 2,000 frames
    at most; the wrench space 50 Hz and 500; plots every step up to 20,000 rows, and then every second, third... The
    last is always kept.
    A world that diverges is recorded up to there. Equal runs give files that `rerun rrd compare --unordered` calls
    equal, but for /plots/solve_us.

    Args:
        run: of `simulate`.
        path: of the file, in a folder that exists. It appears, or is replaced, when it is whole.
        world: which one; None: the worst, see `Run.worst_world`.

    Raises:
        ValueError: there is no such world.
        RecordingOffError: RERUN=off is set in the environment.
        OSError: the file cannot be written.
    """
    path = Path(path)
    world = run.worst_world if world is None else world
    if isinstance(world, bool) or not isinstance(world, int | np.integer) or not 0 <= world < run.worlds:
        raise fail("world", world, f"a whole number in [0, {run.worlds})")
    refuse_if_off()
    import rerun as rr  # takes a second

    strict = rr.strict_mode()
    rr.set_strict_mode(True)  # it raises where it would only warn
    try:
        with whole(path) as partial:
            partial.write_bytes(_encoded(run, int(world), rr))
    finally:
        rr.set_strict_mode(strict)
    return path


@np.errstate(over="ignore", invalid="ignore")  # of what diverges: `Film.send` leaves it out
def _encoded(run: Run, world: int, rr: Any) -> bytes:
    """The file, made in memory: rerun's own file sink can hang on a full disk."""
    # fixed, without properties: files can be compared
    name = f"{run.scenario.label} seed={run.seed} world={run.first_world + world} {digest(run)}"
    stream = rr.RecordingStream("pivoting", recording_id=name, send_properties=False)
    memory = stream.memory_recording()
    film = Film(run, world, rr, stream)
    series, (steps, held) = _series(film), _margins(film)
    plots = [plot for plot in TITLES if any(line.split("/")[0] == plot for line in (*series, *held))]
    stream.send_blueprint(_blueprint(film, plots), make_active=False, make_default=True)
    film.still("report", rr.TextDocument(_report(film), media_type="text/markdown"))
    for send in (_solids, _wrench, _contacts, _wrench_space):
        send(film)
    for line, (colour, width, values) in series.items():
        film.still(f"plots/{line}", rr.SeriesLines(colors=[colour], widths=[width]))
        rows = film.rows(values.size, PLOTS)
        film.send(f"plots/{line}", rows, rr.Scalars, scalars=values[rows])
    for line, (colour, width, values) in held.items():
        film.still(f"plots/{line}", rr.SeriesLines(colors=[colour], widths=[width]))
        film.send(f"plots/{line}", steps, rr.Scalars, scalars=values)
    return memory.drain_as_bytes()


def _solids(film: Film) -> None:
    """Table, body, and the paths of its contact points and CoM."""
    rr, run = film.rr, film.run
    thin = rr.Radius.ui_points(1.0)
    film.still("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    pose = rr.Transform3D(translation=run.truth.origin, quaternion=xyzw(run.truth.table))
    film.still("world/table", pose, _table(film))
    vertices, normals, lines = (np.concatenate(parts) for parts in zip(*film.solids, strict=True))
    if film.block:
        half = np.array([1.0, 0.0, 1.0]) * np.abs(vertices).max(axis=0) + [0.0, film.depth, 0.0]
        film.still("world/block/solid", rr.Boxes3D(half_sizes=[half], colors=[BLOCK], fill_mode="solid"))
        film.still("world/block/edges", rr.Boxes3D(half_sizes=[half], colors=[EDGES], radii=thin))
    else:
        colour = BLOCK if film.dim == 2 else (*BLOCK, GLASS)
        solid = rr.Mesh3D(vertex_positions=vertices, vertex_normals=normals, albedo_factor=colour)
        film.still("world/block/solid", solid)
        film.still("world/block/edges", rr.LineStrips3D(lines, colors=[EDGES], radii=thin))
    rows = film.rows(film.states, SCENE)
    position, quaternion = run.position[film.world, rows], run.quaternion[film.world, rows]
    film.send("world/block", rows, rr.Transform3D, translation=position, quaternion=xyzw(quaternion))
    for name, paths in (("com", position[None]), ("corner", np.moveaxis(film.corner[rows], 1, 0))):
        film.still(f"world/path/{name}", rr.LineStrips3D(paths + film.front, colors=[GREY], radii=thin))


def _table(film: Film) -> Any:
    """What the object stands on, in the table's frame: the whole geom, or, as planes have no end, a slab of it."""
    rr, surface, style = film.rr, film.run.truth.surface, {"colors": [TABLE], "fill_mode": "solid"}
    if film.dim == 2 or np.isinf(surface.thick):
        return rr.Boxes3D(centers=[film.start - film.slab * UP], half_sizes=[film.slab], **style)
    middle = -0.5 * surface.thick * UP
    if surface.disc:
        return rr.Cylinders3D(centers=[middle], radii=[surface.half[0]], lengths=[surface.thick], **style)
    return rr.Boxes3D(centers=[middle], half_sizes=[[*surface.half, 0.5 * surface.thick]], **style)


def _wrench(film: Film) -> None:
    """At the CoM: the weight, and the applied wrench as an arrow and an arc, in space as two arrows."""
    rr, run, side = film.rr, film.run, film.side
    rows = film.rows(film.answers, SCENE)
    weight = film.weight * film.scale
    right = np.cross(film.away, UP)
    film.send("world/wrench", rows, rr.Transform3D, translation=run.position[film.world, rows] + film.front)
    arrow = rr.Arrows3D(vectors=[weight], colors=[GREY], radii=[THIN * side])
    film.still("world/wrench/weight", arrow, film.label("m g", GREY, 0.5 * weight + 0.1 * side * right))
    if film.dim == 2:
        arc = rr.LineStrips3D.from_fields(colors=[TEAL], radii=[THIN * side])
        film.still("world/wrench/moment", arc, film.label("w: moment", TEAL, -0.42 * side * right))
        film.send("world/wrench/moment", rows, rr.LineStrips3D, strips=film.moment_arcs(rows))
    else:
        film.arrows("world/wrench/moment", rows, film.moment(rows), TEAL, BOLD * side, "w: moment")
    film.arrows("world/wrench/force", rows, film.applied(rows), GREEN, BOLD * side, "w: force")


def _contacts(film: Film) -> None:
    """At each contact point, in the table's frame: its forces, and the friction cones that they have to be in."""
    rr, run, side, plane = film.rr, film.run, film.side, film.dim == 2
    thin, thick = rr.Radius.ui_points(1.0), film.thick
    rows = film.rows(film.answers, SCENE)
    pose = np.tile(xyzw(run.truth.table), (rows.size, 1))
    measured, predicted = film.measured(rows), film.predicted(rows)
    nearest = np.argmin(run.corner[film.world, 0, :, 1])
    for i, tag in enumerate(film.tags):
        entity, name = f"world/contact/{tag}".rstrip("/"), f"f {tag}".strip()
        film.send(entity, rows, rr.Transform3D, translation=film.corner[rows, i] + film.front, quaternion=pose)
        film.arrows(f"{entity}/measured", rows, measured[:, i], RED, 2.0 * thick, "")
        film.arrows(f"{entity}/predicted", rows, predicted[:, i], ORANGE, thick, name, at=1.0 if plane else 1.2)
        film.still(f"{entity}/predicted", rr.Arrows3D.from_fields(origins=[[0.0, -8.0 / 3.0 * thick, 0.0]]))
        aside = 0.35 if plane else 0.2
        for name, colour, at in (("world", GREY, -aside), ("planned", PURPLE, aside)):
            vertices, triangles, lines = film.cone(i, planned=name == "planned")
            film.still(f"{entity}/cone/{name}", rr.LineStrips3D(lines, colors=[colour], radii=thin))
            if name == "planned":
                fill = rr.Mesh3D(vertex_positions=vertices, triangle_indices=triangles, albedo_factor=(*colour, GLASS))
                film.still(f"{entity}/cone/{name}", fill)
            if i == nearest:
                label = film.label(f"cone, {name}", colour, side * np.array([at, 0.0, -0.05]))
                film.still(f"{entity}/cone/{name}", label)


def _wrench_space(film: Film) -> None:
    """The notes' second figure over time: contact cone {J f}, admissible w, and the w that was applied.

    w + J f = required; where the bounds did not allow it, or there was no answer, an arrow says what is lacking.
    Moments are drawn as M / length, with the length [m] that makes Q_w weigh all axes of the picture alike.
    """
    if film.dim == 3 or not film.answers:
        return
    rr, run, rows, size = film.rr, film.run, film.space_rows, film.reach
    length, thin, axes = film.length, rr.Radius.ui_points(1.0), 0.8 * size * np.eye(3)
    film.still("wrench_space", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    film.still("wrench_space/axes", rr.Arrows3D(vectors=2.0 * axes, origins=-axes, colors=[GREY], radii=0.006 * size))
    for name, unit, axis in zip(("F_u", "F_v", "M"), ("", "", f" / {length:.3g} m"), axes, strict=True):
        film.still(f"wrench_space/axes/{name}", film.label(f"{name}{unit} [N]", WHITE, 1.1 * axis))
    space = SolutionSpace(*(part / [1.0, 1.0, length] for part in film.space))
    for name, polygon, colour in (("cone", space.cone, ORANGE), ("admissible", space.admissible, GREEN)):
        fill, edge = f"wrench_space/{name}/fill", f"wrench_space/{name}/edge"
        film.still(fill, rr.Mesh3D.from_fields(triangle_indices=QUAD, albedo_factor=(*colour, 90)))
        film.send(fill, rows, rr.Mesh3D, each=polygon.shape[1], vertex_positions=polygon.reshape(-1, 3))
        film.still(edge, rr.LineStrips3D.from_fields(colors=[colour], radii=[thin]), film.label(name, colour))
        film.send(edge, rows, rr.LineStrips3D, strips=polygon[:, [0, 1, 2, 3, 0]])
        film.send(edge, rows, rr.Points3D, positions=polygon[:, 1:3].mean(axis=1))
    film.arrows("wrench_space/required", rows, space.required, WHITE, 0.02 * size, "required")
    film.arrows("wrench_space/wrench", rows, space.wrench, GREEN, 0.02 * size, "w")
    film.arrows("wrench_space/contact", rows, space.contact, ORANGE, 0.02 * size, "J f", at=0.5)
    made = space.wrench + np.nan_to_num(space.contact)
    film.still("wrench_space/sum", rr.LineStrips3D.from_fields(colors=[GREY], radii=[thin]))
    film.send("wrench_space/sum", rows, rr.LineStrips3D, strips=np.stack([space.wrench, made, space.contact], axis=1))
    for code, label in LACKING.items():
        short = (run.status[film.world, rows] == code)[:, None]
        if short.any():
            lacking = np.where(short, space.required - made, np.nan)
            name = f"wrench_space/lacking/{STATUS[code]}"
            film.arrows(name, rows, lacking, RED, 0.02 * size, label, at=0.5, origins=made)


def _series(film: Film) -> dict[str, tuple[Colour, float, Array]]:
    """The lines of the plots: <plot>/<series> -> colour, width, values (states,) or (answers,).

    What is along the table is in the plane a component with its sign, in space a magnitude.
    """
    run, i, n, N, plane = film.run, film.world, film.states, film.answers, film.dim == 2
    slips = 1e3 * run.unit * run.slip[i, :n], 1e3 * run.unit * predicted_slip(run)[i, :n]
    forces = run.force_measured[i, :N], film.force[:N]

    def along(vectors: Array) -> Array:
        return vectors[:, 0] if plane else np.linalg.norm(vectors, axis=1)

    f_n, f_t = ("force/{}_f_n", "force/{}_f_t") if plane else ("f_n/{}", "f_t/{}")
    out = {
        "angle/reference": (WHITE, WIDE, np.rad2deg(run.reference[0][:n])),
        "angle/theta": (GREEN, FINE, np.rad2deg(run.theta[i, :n])),
        "friction_use/limit": (WHITE, FINE, np.ones(N)),
        "solve_us": (YELLOW, FINE, run.control_us[:N]),
    }
    if not plane:
        out["error/orientation"] = (RED, FINE, np.rad2deg(run.angle_error[i, :n]))
    for (name, colour), values in zip(COMPONENTS[film.dim].items(), run.wrench[i, :N].T, strict=True):
        out[f"wrench/{name}"] = (colour, FINE, values)
    for k, tag in enumerate(film.tags):
        tail, fade = f"_{tag}" * bool(tag), 1.0 - 0.7 * k / len(film.tags)
        planned = np.full(N, film.planned_mu[k] / film.truth.mu)
        for name, colour, width, values in (
            ("slip/measured", RED, WIDE, along(slips[0][:, k])),
            ("slip/predicted", WHITE, FINE, along(slips[1][:, k])),
            ("friction_use/measured", RED, WIDE, run.friction_use[i, :N, k]),
            ("friction_use/planned", PURPLE, FINE, planned),
            (f_n.format("measured"), RED, WIDE, forces[0][:, k, -1]),
            (f_t.format("measured"), PINK, WIDE, along(forces[0][:, k, :-1])),
            (f_n.format("predicted"), ORANGE, FINE, forces[1][:, k, -1]),
            (f_t.format("predicted"), YELLOW, FINE, along(forces[1][:, k, :-1])),
        ):
            red, green, blue = (round(fade * part) for part in colour)
            out[f"{name}{tail}"] = ((red, green, blue), width, values)
    return out


def _margins(film: Film) -> tuple[Rows, dict[str, tuple[Colour, float, Array]]]:
    """Steps (M,) and the lines of the margins there, as `_series` has them; none of a controller without a set."""
    run = film.run
    found = run.margins if film.world == run.worst_world else margins_over_time(run, film.world)
    if found is None:
        return np.zeros(0, dtype=int), {}
    there = found.steps < film.answers
    lines = {
        "slack/worst_member": (PURPLE, FINE, found.slack[there]),
        "set/share": (PURPLE, FINE, found.share[there]),
        "set/wrench_scale": (TEAL, FINE, found.wrench_scale[there]),
    }
    return found.steps[there], lines


def _report(film: Film) -> str:
    """Verdict, checks and how to read the picture, as Markdown."""
    run, i = film.run, film.world
    lines = [f"# {run.scenario.name}: {'FAIL' if i in run.failed_worlds else 'pass'}", run.scenario.summary, ""]
    lines += [f"World {i} of {run.worlds}, seed {run.seed}: {run.time[-1]:g} s, dt = {run.dt:g} s.", ""]
    if film.states < run.time.size:
        lines += [f"**It diverged at {run.time[film.states]:g} s and is recorded up to there.**", ""]
    lines += ["| check | value | limit | |", "|---|---|---|---|"]
    for check in run.checks:
        value = getattr(run.measures, check.name)[i]
        lines.append(f"| {check.name} | {value:.3g} | {check.limit:.3g} | {'FAIL' if check.failed[i] else 'ok'} |")
    lines += ["", f"Green: applied w. Orange: contact force f predicted, red: measured. {1e3 * film.scale:.3g} mm / N."]
    if film.dim == 3:
        lines += [f"Teal: its moment, {1e3 * film.scale / film.length:.3g} mm / (N m)."]
    if len(film.tags) > 1:
        lines += ["Of several contacts the first has the brightest lines; thick: measured, thin: predicted or planned."]
    return "\n".join(lines)


def _blueprint(film: Film, plots: list[str]) -> Any:
    """What is shown on opening: scene, wrench space and report on the left, the plots on the right."""
    import rerun.blueprint as rrb

    def view(origin: str, name: str, eye: Array, centre: Array) -> Any:
        eyes = rrb.EyeControls3D(position=eye, look_target=centre, eye_up=UP)
        return rrb.Spatial3DView(origin=origin, name=name, eye_controls=eyes, background=DARK, line_grid=False)

    lines = []
    for name in plots:
        title, corner = TITLES[name]
        if name == "slip" and film.dim == 3:
            title = "size of the contact slip [mm]"
        legend = rrb.PlotLegend(corner, visible=len(film.tags) <= CROWDED)
        lines.append(rrb.TimeSeriesView(origin=f"plots/{name}", name=title, plot_legend=legend))
    if film.dim == 2:
        around, middle = film.reach * np.array([[0.35, 1.9, 1.2], [0.15, 0.15, 0.0]])
        second = view("wrench_space", "wrench space, object axes", around, middle)
    else:
        second = rrb.Vertical(*lines[6:])
    below = rrb.Horizontal(second, rrb.TextDocumentView(origin="report", name="verdict"), column_shares=[5, 4])
    scene = view("world", "side view" if film.dim == 2 else "scene", film.centre + film.eye(film.away), film.centre)
    left = rrb.Vertical(scene, below, row_shares=[10, 9])
    speed = min(1.0, 0.25 * float(film.run.time[-1]))  # four seconds to watch, at least
    return rrb.Blueprint(
        rrb.Horizontal(left, rrb.Grid(*lines[: 6 if film.dim == 3 else None], grid_columns=2), column_shares=[6, 5]),
        rrb.TimePanel(state="collapsed", timeline="sim_time", loop_mode="all", playback_speed=speed),
        collapse_panels=True,
    )
