"""A finished run as a rerun recording: the scene with its forces, the wrench space and the time series.

Nothing is recorded while the loop runs: `record` reads the arrays of a `Run` and sends whole columns. Entities:

    /world/table, /world/block          the solids, posed by transforms (rerun's quaternions are xyzw, MuJoCo's wxyz)
    /world/path/{corner,com}            where the material corner and the CoM went
    /world/wrench/{force,moment,weight} applied wrench w and weight at the CoM, world axes
    /world/contact/{predicted,measured} contact forces at the corner, table axes, with the cones and the floor f_min
    /wrench_space/...                   the notes' second figure, object axes (F_u, F_v, M / length)
    /plots/<plot>/<series>              the series of `_series`
    /plots/solve_us                     the only entity with wall-clock time: all else is equal when runs are equal
    /report                             verdict and checks

Arrows are drawn in front of the block's front face, at a scale that is constant over the run (`_Drawing.scale`).
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pivoting.controller.solution_space import SolutionSpace, solution_space
from pivoting.controller.solvers import Solution, solve
from pivoting.controller.space import Motion
from pivoting.controller.validate import fail
from pivoting.models.reading import matrix
from pivoting.sim.monitor import predicted_slip
from pivoting.sim.run import Run

Array = NDArray[np.float64]
Rows = NDArray[np.intp]
Colour = tuple[int, ...]

FAR = 1e6  # [m, m/s, rad/s]: a state beyond it has diverged, and the recording stops before it
SCENE, SPACE, PLOTS = (200.0, 2_000), (50.0, 500), (np.inf, 20_000)  # at most [Hz of simulated time, rows]
DEPTH = 0.4  # of the block that is drawn, in sides; the plane knows none
GREEN, LIME, TEAL = (60, 190, 90), (170, 220, 90), (60, 200, 200)  # the applied wrench: F_u or all of it, F_v, M
ORANGE, YELLOW = (255, 150, 40), (250, 215, 90)  # the predicted contact force: normal or all of it, tangential
RED, PINK = (225, 60, 70), (250, 150, 170)  # the measured one, likewise
PURPLE, GREY, WHITE = (165, 130, 235), (170, 170, 170), (235, 235, 235)  # the planned cone, the world's, axes
QUAD = [[0, 1, 2], [0, 2, 3]]  # triangles of four corners
FINE, WIDE = 1.5, 4.0  # lines of the plots: measured under predicted


def record(run: Run, path: Path, *, world: int = 0) -> Path:
    """Write one world of a finished planar run to `path` (.rrd) and return it; open it with `rerun FILE`.

    The scene is kept at 200 Hz of simulated time or less and 2,000 frames at most, the wrench space at 50 Hz and 500, the
    plots at every step up to 20,000 rows, then at every second, third... A world that diverges is recorded up to there.
    Runs that are equal give files that `rerun rrd compare --unordered` calls equal, but for /plots/solve_us.

    Args:
        run: of `simulate`.
        path: of the file; it appears when it is whole. Its folder exists.
        world: which one.

    Raises:
        ValueError: there is no such world.
    """
    if isinstance(world, bool) or not isinstance(world, int | np.integer) or not 0 <= world < run.worlds:
        raise fail("world", world, f"a whole number in [0, {run.worlds})")
    import rerun as rr

    path = Path(path)
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    drawing = _Drawing(run, int(world))
    with _strict():
        name = f"{run.scenario.name}-seed{run.seed}-world{world}"
        stream = rr.RecordingStream("pivoting", recording_id=name, send_properties=False)
        try:
            stream.save(partial, default_blueprint=_blueprint(drawing))
            for send in (_scene, _forces, _wrench_space, _plots):
                send(drawing, stream)
            stream.log("report", rr.TextDocument(_report(drawing), media_type="text/markdown"), static=True)
            stream.flush()
            stream.disconnect()
            partial.replace(path)
        finally:
            stream.disconnect()
            partial.unlink(missing_ok=True)
    return path


@contextmanager
def _strict() -> Iterator[None]:
    """rerun raises what it would else only warn of."""
    import rerun as rr

    before = rr.strict_mode()
    rr.set_strict_mode(True)
    try:
        yield
    finally:
        rr.set_strict_mode(before)


@dataclass(frozen=True, eq=False)
class _Drawing:
    """One world of a run up to where it is finite, and the sizes it is drawn with."""

    run: Run
    world: int

    @cached_property
    def states(self) -> int:
        """Number of states before the first that is not finite or is beyond `FAR`."""
        run, i = self.run, self.world
        state = np.hstack([run.position[i], run.quaternion[i], run.velocity[i], run.angular_velocity[i]])
        wrong = ~(np.abs(state) <= FAR).all(axis=1)
        return int(wrong.argmax()) if wrong.any() else len(wrong)

    @property
    def answers(self) -> int:
        """Number of steps that began in one of these states."""
        return min(self.states, self.run.time.size - 1)

    def rows(self, count: int, budget: tuple[float, int]) -> Rows:
        """Which of `count` steps are kept within a budget (Hz of simulated time, rows); the last one always."""
        rate, most = budget
        stride = max(1, round(1.0 / (rate * self.run.dt)), -(-count // (most - 1)))
        return np.unique(np.append(np.arange(0, count, stride), count - 1))

    @cached_property
    def side(self) -> float:
        """Side of the block [m]."""
        return 2.0 * float(np.abs(self.run.corner_point).max())

    @cached_property
    def weight(self) -> Array:
        """(3,) m g, world axes [N]."""
        return self.run.truth.mass * self.run.truth.gravity

    @cached_property
    def load(self) -> float:
        """Force [N] that is drawn half a side long: m g, or if the run's forces (95 % of them) exceed 2.5 m g, more."""
        forces = [self.applied[:, :3], self.run.force[self.world, : self.answers, 0]]
        largest = max(float(np.nanquantile(np.linalg.norm(force, axis=1), 0.95)) for force in forces)
        return max(float(np.linalg.norm(self.weight)), 0.4 * largest, np.finfo(float).tiny)

    @property
    def scale(self) -> float:
        """Length of a drawn force [m/N]."""
        return 0.5 * self.side / self.load

    @property
    def applied(self) -> Array:
        """(answers, 6) applied wrench, world axes."""
        return self.run.wrench_world[self.world, : self.answers]

    @property
    def table(self) -> Array:
        """(3, 3) tangent, into the picture, normal as columns, world axes."""
        return matrix(self.run.truth.table)

    @property
    def front(self) -> Array:
        """(3,) from the plane of motion to the one that arrows are drawn in [m]."""
        return -self.table[:, 1] * (0.5 * DEPTH + 0.02) * self.side

    @property
    def corner(self) -> Array:
        """(states, 3) the material corner, world axes [m]."""
        corner = self.run.corner[self.world, : self.states]
        return self.run.truth.origin + corner @ self.run.table_axes.T

    @property
    def planned_mu(self) -> float:
        """Friction that the controller may use, (1 - margin) mu."""
        return float(self.run.attached.controller.belief.mu[0])

    @cached_property
    def length(self) -> float:
        """The moment M is drawn in wrench space as M / length [m]: then Q_w weighs all axes of the picture alike."""
        Q_w = self.run.attached.controller.Q_w
        return float(np.sqrt(Q_w[0, 0] / Q_w[2, 2]))

    @cached_property
    def solution_rows(self) -> Rows:
        """The answered steps whose wrench space is drawn."""
        rows = self.rows(self.answers, SPACE)
        return rows[self.run.status[self.world, rows] == 0]

    @cached_property
    def solutions(self) -> list[Solution]:
        """The problem of each of `solution_rows`, stated and solved again."""
        run, i, controller = self.run, self.world, self.run.attached.controller
        theta, omega = run.theta[i], run.omega[i]
        return [
            solve(controller.problem(Motion(theta[k], omega[k]), Motion(*(values[k] for values in run.reference))))
            for k in self.solution_rows
        ]

    @cached_property
    def reach(self) -> float:
        """Largest normal force in the picture of the wrench space, and half its size [N]."""
        sizes = [max(np.linalg.norm(each.problem.required[:2]), each.force[0, 1]) for each in self.solutions]
        return 1.25 * float(max(sizes, default=self.load))


def _send(drawing: _Drawing, stream: Any, entity: str, rows: Rows, columns: Any) -> None:
    """Send columns, one entry for each of `rows`, on both timelines."""
    import rerun as rr

    times = drawing.run.time[rows]
    stream.send_columns(entity, [rr.TimeColumn("sim_time", duration=times), rr.TimeColumn("step", sequence=rows)], columns)


def _xyzw(quaternion: Array) -> Array:
    """rerun's order (..., 4) of quaternions (w, x, y, z)."""
    return np.roll(quaternion, -1, axis=-1)


def _scene(drawing: _Drawing, stream: Any) -> None:
    """Table, block, and the paths of its corner and CoM."""
    import rerun as rr

    run, side = drawing.run, drawing.side
    u, v = np.abs(run.corner_point)
    stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    pose = rr.Transform3D(translation=run.truth.origin, quaternion=_xyzw(run.truth.table))
    slab = np.array([2.0, 0.5, 0.03]) * side
    stream.log("world/table", pose, static=True)
    stream.log(
        "world/table/slab",
        rr.Boxes3D(centers=[[0, 0, -slab[2]]], half_sizes=[slab], colors=[(120, 112, 100)], fill_mode="solid"),
        static=True,
    )
    box = {"half_sizes": [[u, 0.5 * DEPTH * side, v]], "radii": rr.Radius.ui_points(1.0)}
    stream.log("world/block/solid", rr.Boxes3D(**box, colors=[(70, 105, 145)], fill_mode="solid"), static=True)
    stream.log("world/block/edges", rr.Boxes3D(**box, colors=[(150, 185, 225)]), static=True)
    rows = drawing.rows(drawing.states, SCENE)
    position, quaternion = run.position[drawing.world, rows], run.quaternion[drawing.world, rows]
    columns = rr.Transform3D.columns(translation=position, quaternion=_xyzw(quaternion))
    _send(drawing, stream, "world/block", rows, columns)
    for name, points, colour in (("com", position, GREY), ("corner", drawing.corner[rows], WHITE)):
        line = rr.LineStrips3D([points + drawing.front], colors=[colour], radii=rr.Radius.ui_points(1.5))
        stream.log(f"world/path/{name}", line, static=True)


def _forces(drawing: _Drawing, stream: Any) -> None:
    """Weight and applied wrench at the CoM, contact forces and friction cones at the corner."""
    import rerun as rr

    run, i, scale = drawing.run, drawing.world, drawing.scale

    rows = drawing.rows(drawing.answers, SCENE)
    com = run.position[i, rows] + drawing.front
    _send(drawing, stream, "world/wrench", rows, rr.Transform3D.columns(translation=com))
    moment = rr.LineStrips3D.from_fields(colors=[TEAL], radii=[0.012 * drawing.side])
    stream.log("world/wrench/moment", moment, static=True)
    _send(drawing, stream, "world/wrench/moment", rows, rr.LineStrips3D.columns(strips=_arcs(drawing, rows)))
    _label(stream, "world/wrench/moment", -0.42 * drawing.side * drawing.table[:, 0], TEAL, "w: moment")
    applied, weight = drawing.applied[rows, :3], np.tile(drawing.weight, (rows.size, 1))
    _arrows(drawing, stream, "world/wrench/force", rows, applied * scale, GREEN, 0.02 * drawing.side, "w: force")
    _arrows(drawing, stream, "world/wrench/weight", rows, weight * scale, GREY, 0.012 * drawing.side, "")
    _label(stream, "world/wrench/weight", 0.5 * drawing.weight * scale + 0.1 * drawing.side * drawing.table[:, 0], GREY, "m g")

    frame = rr.Transform3D.columns(
        translation=drawing.corner[rows] + drawing.front,
        quaternion=np.tile(_xyzw(run.truth.table), (rows.size, 1)),
    )
    _send(drawing, stream, "world/contact", rows, frame)
    for name, force, colour, width, text in (
        ("measured", run.force_measured, RED, 0.03, ""),
        ("predicted", run.force, ORANGE, 0.015, "f"),
    ):
        drawn = np.nan_to_num(_lift(force[i, rows, 0])) * scale
        _arrows(drawing, stream, f"world/contact/{name}", rows, drawn, colour, width * drawing.side, text)
    problem = run.attached.controller.contacts[0]
    reach = max(0.8 * drawing.side, 1.3 * problem.f_min * scale)
    for name, mu, colour, at, text in (
        ("world", run.mu_world, GREY, 0, "world's mu"),
        ("planned", drawing.planned_mu, PURPLE, 1, "planned"),
    ):
        sides = _lift(np.array([[-mu, 1.0], [mu, 1.0]]))
        floor, top = scale * problem.f_min * sides, reach / np.hypot(mu, 1.0) * sides
        entity = f"world/contact/cone/{name}"
        strips = [[top[0], np.zeros(3), top[1]], *([floor] if name == "planned" else [])]
        lines = rr.LineStrips3D(strips, colors=[colour] * len(strips), radii=rr.Radius.ui_points(1.0))
        stream.log(entity, lines, static=True)
        _label(stream, entity, 1.06 * top[at], colour, text)
        if name == "planned":
            corners = np.vstack([floor, top[::-1]])
            fill = rr.Mesh3D(vertex_positions=corners, triangle_indices=QUAD, albedo_factor=(*colour, 60))
            stream.log(entity, fill, static=True)


def _label(stream: Any, entity: str, at: Array, colour: Colour, text: str) -> None:
    """A word that stays where it is in the entity's frame."""
    import rerun as rr

    stream.log(entity, rr.Points3D([at], labels=[text], colors=[colour], radii=0.0, show_labels=True), static=True)


def _arrows(
    drawing: _Drawing, stream: Any, entity: str, rows: Rows, vectors: Array, colour: Colour, width: float, label: str
) -> None:
    """Send arrows from the entity's origin, (R, 3) and `width` in the view's unit, with a label just past the tip."""
    import rerun as rr

    style = rr.Arrows3D.from_fields(colors=[colour], radii=[width])
    stream.log(entity, style, static=True)
    columns = [*rr.Arrows3D.columns(vectors=vectors)]
    if label:
        stream.log(entity, rr.Points3D.from_fields(colors=[colour], radii=[0.0], labels=[label]), static=True)
        length = np.linalg.norm(vectors, axis=1, keepdims=True)
        past = vectors * (1.0 + 4.0 * width / np.maximum(length, width))
        columns += rr.Points3D.columns(positions=past)
    _send(drawing, stream, entity, rows, columns)


def _lift(planar: Array) -> Array:
    """(..., 3) of (..., 2) table coordinates: nothing along the plane's normal."""
    return np.insert(planar, 1, 0.0, axis=-1)


def _arcs(drawing: _Drawing, rows: Rows) -> Array:
    """(R, 28, 3) the applied moment as an arc about the CoM with an arrow head, counter-clockwise if positive [m].

    270 deg are the run's moments (95 % of them), or a tenth of the load at the contact's lever if that is more.
    """
    run = drawing.run
    moment = drawing.applied[:, 3:] @ run.attached.controller.space.axial(1.0)
    lever = float(np.linalg.norm(run.corner_point))
    full = max(float(np.quantile(np.abs(moment), 0.95)), 0.1 * drawing.load * lever)
    sweep = np.deg2rad(np.clip(270.0 * moment[rows] / full, -330.0, 330.0))
    start = 0.25 * np.pi
    angle = start + sweep[:, None] * np.linspace(0.0, 1.0, 25)
    radius = np.full(angle.shape, 0.2)
    back = np.sign(sweep) * np.minimum(0.35, np.abs(sweep))
    barbs = angle[:, -1] - back
    angle = np.column_stack([angle, barbs, angle[:, -1], barbs])
    radius = np.column_stack([radius, np.full(rows.size, 0.25), radius[:, -1], np.full(rows.size, 0.15)])
    return drawing.side * radius[..., None] * (
        np.cos(angle)[..., None] * drawing.table[:, 0] + np.sin(angle)[..., None] * drawing.table[:, 2]
    )


def _wrench_space(drawing: _Drawing, stream: Any) -> None:
    """The notes' second figure over time: cone {J f}, balancing set, required, and the optimum w + J f = required."""
    import rerun as rr

    rows, units = drawing.solution_rows, np.array([1.0, 1.0, 1.0 / drawing.length])
    spaces = [solution_space(solution, drawing.reach) for solution in drawing.solutions]
    if not spaces:
        return
    names = ("F_u [N]", "F_v [N]", f"M / {drawing.length:.3g} m [N]")
    size = drawing.reach
    axes = 0.8 * size * np.eye(3)
    stream.log("wrench_space", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    thin = rr.Radius.ui_points(1.0)
    arrows = rr.Arrows3D(vectors=2.0 * axes, origins=-axes, colors=[GREY] * 3, radii=0.008 * size)
    stream.log("wrench_space/axes", arrows, static=True)
    ends = rr.Points3D(axes, labels=names, colors=[WHITE] * 3, radii=rr.Radius.ui_points(0.5), show_labels=True)
    stream.log("wrench_space/axes/names", ends, static=True)

    stacked = SolutionSpace(*(np.array(parts) * units for parts in zip(*spaces, strict=True)))
    for name, polygon, colour, label in (
        ("cone", stacked.cone, ORANGE, "contact cone"),
        ("admissible", stacked.admissible, GREEN, "admissible w"),
    ):
        entity = f"wrench_space/{name}"
        fill = rr.Mesh3D.from_fields(triangle_indices=QUAD, albedo_factor=(*colour, 90))
        stream.log(f"{entity}/fill", fill, static=True)
        lengths = np.full(rows.size, polygon.shape[1])
        corners = rr.Mesh3D.columns(vertex_positions=polygon.reshape(-1, 3)).partition(lengths)
        _send(drawing, stream, f"{entity}/fill", rows, corners)
        stream.log(f"{entity}/edge", rr.LineStrips3D.from_fields(colors=[colour], radii=[thin]), static=True)
        closed = np.concatenate([polygon, polygon[:, :1]], axis=1)
        _send(drawing, stream, f"{entity}/edge", rows, rr.LineStrips3D.columns(strips=closed))
        word = rr.Points3D.from_fields(colors=[colour], radii=[0.0], labels=[label], show_labels=True)
        stream.log(f"{entity}/name", word, static=True)
        _send(drawing, stream, f"{entity}/name", rows, rr.Points3D.columns(positions=polygon[:, 1:3].mean(axis=1)))
    for name, vector, colour, label in (
        ("required", stacked.required, WHITE, "required"),
        ("wrench", stacked.wrench, GREEN, "w"),
        ("contact", stacked.contact, ORANGE, "J f"),
    ):
        entity = f"wrench_space/{name}"
        _arrows(drawing, stream, entity, rows, vector, colour, 0.02 * size, label)
    sides = np.stack([stacked.wrench, stacked.required, stacked.contact], axis=1)
    stream.log("wrench_space/sum", rr.LineStrips3D.from_fields(colors=[GREY], radii=[thin]), static=True)
    _send(drawing, stream, "wrench_space/sum", rows, rr.LineStrips3D.columns(strips=sides))


Series = tuple[str, str, Colour, float, Array]  # path, legend, colour, width, values (states,) or (answers,)


def _series(drawing: _Drawing) -> dict[str, tuple[str, list[Series]]]:
    """The plots: key -> (title, series)."""
    run, i, n, N = drawing.run, drawing.world, drawing.states, drawing.answers
    wrench, predicted, measured = run.wrench[i, :N], run.force[i, :N, 0], run.force_measured[i, :N, 0]
    planned = drawing.planned_mu
    with np.errstate(invalid="ignore", divide="ignore"):
        use = np.where(measured[:, 1] > 0.0, np.abs(measured[:, 0]) / (run.mu_world * measured[:, 1]), np.nan)
    return {
        "angle": (
            "angle [deg]",
            [
                ("reference", "reference", WHITE, WIDE, np.rad2deg(run.reference[0][:n])),
                ("theta", "theta", GREEN, FINE, np.rad2deg(run.theta[i, :n])),
            ],
        ),
        "slip": (
            "slip of the corner [mm]",
            [
                ("predicted", "predicted", WHITE, FINE, 1e3 * predicted_slip(run)[i, :n]),
                ("measured", "measured", RED, WIDE, 1e3 * run.slip[i, :n]),
            ],
        ),
        "friction_use": (
            "friction use |f_t| / (mu f_n)",
            [
                ("limit", "slides at 1", WHITE, FINE, np.ones(N)),
                ("planned", "planned up to", PURPLE, FINE, np.full(N, planned / run.mu_world)),
                ("measured", "measured", RED, WIDE, use),
            ],
        ),
        "force": (
            "contact force [N]",
            [
                ("measured_normal", "measured f_n", RED, WIDE, measured[:, 1]),
                ("measured_tangential", "measured f_t", PINK, WIDE, measured[:, 0]),
                ("predicted_normal", "predicted f_n", ORANGE, FINE, predicted[:, 1]),
                ("predicted_tangential", "predicted f_t", YELLOW, FINE, predicted[:, 0]),
            ],
        ),
        "wrench": (
            "applied wrench [N, N m]",
            [
                ("F_u", "F_u [N]", GREEN, FINE, wrench[:, 0]),
                ("F_v", "F_v [N]", LIME, FINE, wrench[:, 1]),
                ("M", "M [N m]", TEAL, FINE, wrench[:, 2]),
            ],
        ),
    }


def _plots(drawing: _Drawing, stream: Any) -> None:
    """Every time series, and the solve time."""
    series = [(f"plots/{key}/{entry[0]}", *entry[1:]) for key, (_, all_of) in _series(drawing).items() for entry in all_of]
    series.append(("plots/solve_us", "one problem", YELLOW, FINE, drawing.run.control_us[: drawing.answers]))
    import rerun as rr

    for entity, legend, colour, width, values in series:
        stream.log(entity, rr.SeriesLines(colors=[colour], names=[legend], widths=[width]), static=True)
        rows = drawing.rows(values.size, PLOTS)
        _send(drawing, stream, entity, rows, rr.Scalars.columns(scalars=values[rows]))


def _report(drawing: _Drawing) -> str:
    """Verdict and checks, as Markdown."""
    run, i = drawing.run, drawing.world
    lines = [f"# {run.scenario.name}: {'FAIL' if i in run.failed_worlds else 'pass'}", run.scenario.summary, ""]
    lines += [f"World {i} of {run.worlds}, seed {run.seed}, {run.time[-1]:g} s at dt = {run.dt:g} s.", ""]
    if drawing.states < run.time.size:
        lines += [f"**It diverged: recorded up to {run.time[drawing.states - 1]:g} s.**", ""]
    lines += ["| check | value | limit | |", "|---|---|---|---|"]
    for check in run.checks:
        value = getattr(run.measures, check.name)[i]
        lines.append(f"| {check.name} | {value:.3g} | {check.limit:.3g} | {'FAIL' if check.failed[i] else 'ok'} |")
    return "\n".join(lines)


def _blueprint(drawing: _Drawing) -> Any:
    """What is shown on opening: side view, wrench space and report on the left, the plots on the right."""
    import rerun.blueprint as rrb

    side, table = drawing.side, drawing.table
    up = np.array([0.0, 0.0, 1.0])
    target = drawing.run.truth.origin + 0.6 * side * up
    view = rrb.Spatial3DView(
        origin="world",
        name="side view",
        background=(24, 26, 30),
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=target - 2.3 * side * table[:, 1] + 0.25 * side * up, look_target=target, eye_up=up
        ),
    )
    reach = drawing.reach
    space = rrb.Spatial3DView(
        origin="wrench_space",
        name="wrench space, object axes",
        background=(24, 26, 30),
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=reach * np.array([1.3, -1.6, 0.4]), look_target=np.zeros(3), eye_up=up
        ),
    )
    plots = [
        rrb.TimeSeriesView(origin=f"plots/{key}", name=title, plot_legend=rrb.PlotLegend(corner="RightTop"))
        for key, (title, _) in _series(drawing).items()
    ]
    plots.append(rrb.TimeSeriesView(origin="plots/solve_us", name="solve time [us]"))
    report = rrb.TextDocumentView(origin="report", name="verdict")
    duration = float(drawing.run.time[-1])
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(view, rrb.Horizontal(space, report, column_shares=[5, 4]), row_shares=[5, 4]),
            rrb.Grid(*plots, grid_columns=2),
            column_shares=[6, 5],
        ),
        rrb.TimePanel(
            state="collapsed", timeline="sim_time", loop_mode="all", playback_speed=min(1.0, 0.25 * duration)
        ),
        collapse_panels=True,
    )
