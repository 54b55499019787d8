"""A finished run as a rerun recording: the scene with its forces, the wrench space, the time series and the verdict.

Nothing is recorded while the loop runs: `record` reads the arrays of a `Run` and sends whole columns. Entities:

    /world/table, /world/block            the solids, posed by transforms
    /world/path/{corner,com}              where the material corner and the CoM went
    /world/wrench/{force,moment,weight}   applied wrench w and weight at the CoM, world axes
    /world/contact/{predicted,measured}   contact forces f at the corner, table axes
    /world/contact/cone/{planned,world}   (1 - margin) mu with the floor f_min, and the mu of the world
    /wrench_space/...                     the notes' second figure, object axes
    /plots/<plot>/<series>                those of `_series`
    /plots/solve_us                       the only entity that holds wall-clock time
    /report                               verdict and checks

What is not finite is left out: a gap in a plot, nothing in a view.
"""

import os
from dataclasses import dataclass
from functools import cached_property
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.solution_space import SolutionSpace, solution_space
from pivoting.controller.solvers import Solution, solve
from pivoting.controller.space import Motion
from pivoting.controller.validate import fail
from pivoting.models.reading import matrix
from pivoting.sim.monitor import predicted_slip
from pivoting.sim.run import Run

Array = NDArray[np.float64]
Rows = NDArray[np.intp]
Colour = tuple[int, int, int]

SCENE, SPACE, PLOTS = (200.0, 2_000), (50.0, 500), (np.inf, 20_000)  # at most [Hz of simulated time], at most rows
FAR = 1e6  # [m, m/s, rad/s]: a state beyond it has diverged
HUGE = 1e30  # beyond it single precision, which views are kept in, ends
DEPTH = 0.4  # of the drawn block, in sides: the plane knows none
QUAD = [[0, 1, 2], [0, 2, 3]]  # triangles of four corners
UP = np.array([0.0, 0.0, 1.0])
FINE, WIDE = 1.5, 4.0  # line widths: what was measured shows under what was predicted
GREEN, LIME, TEAL = (60, 190, 90), (170, 220, 90), (60, 200, 200)  # applied wrench: all or F_u, F_v, M
ORANGE, YELLOW = (255, 150, 40), (250, 215, 90)  # predicted contact force: all or f_n, f_t
RED, PINK = (225, 60, 70), (250, 150, 170)  # measured, likewise
PURPLE, GREY, WHITE = (165, 130, 235), (170, 170, 170), (235, 235, 235)  # planned cone; the world's, weight; the rest
BLOCK, EDGES, TABLE, DARK = (70, 105, 145), (150, 185, 225), (120, 112, 100), (24, 26, 30)
TITLES = {  # plot -> title, where the legend is
    "angle": ("angle [deg]", "LeftTop"),
    "slip": ("slip of the corner [mm]", "LeftTop"),
    "friction_use": ("friction use |f_t| / (mu f_n)", "RightBottom"),
    "force": ("contact force [N]", "RightTop"),
    "wrench": ("applied wrench [N, N m]", "RightTop"),
    "solve_us": ("time to solve [us]", "RightTop"),
}


def record(run: Run, path: Path, *, world: int = 0) -> Path:
    """Write one world of a finished planar run to `path` (.rrd) and return it; `rerun PATH` shows it.

    Views hold 200 Hz of simulated time at most, and 2,000 frames at most; the wrench space 50 Hz and 500, solved again
    for the occasion; plots every step up to 20,000 rows, and then every second, third... The last is always kept.
    A world that diverges is recorded up to there. Equal runs give files that `rerun rrd compare --unordered` calls
    equal, but for /plots/solve_us.

    Args:
        run: of `simulate`.
        path: of the file, in a folder that exists. It appears, or is replaced, when it is whole.
        world: which one.

    Raises:
        ValueError: there is no such world.
        OSError: the file cannot be written.
    """
    if isinstance(world, bool) or not isinstance(world, int | np.integer) or not 0 <= world < run.worlds:
        raise fail("world", world, f"a whole number in [0, {run.worlds})")
    import rerun as rr  # takes a second

    partial = path.with_name(f".{path.name}.{os.getpid()}.part")
    strict = rr.strict_mode()
    rr.set_strict_mode(True)  # it raises where it would only warn
    try:
        partial.write_bytes(_encoded(run, int(world), rr))
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
        rr.set_strict_mode(strict)
    return path


@np.errstate(over="ignore", invalid="ignore")  # of what diverges: `_Film.send` leaves it out
def _encoded(run: Run, world: int, rr: Any) -> bytes:
    """The file, made in memory: rerun's own file sink can hang on a full disk."""
    name = f"{run.scenario.name}-seed{run.seed}-world{world}"  # fixed, and without properties: files can be compared
    stream = rr.RecordingStream("pivoting", recording_id=name, send_properties=False)
    memory = stream.memory_recording()
    film = _Film(run, world, rr, stream)
    stream.send_blueprint(_blueprint(film), make_active=False, make_default=True)
    film.still("report", rr.TextDocument(_report(film), media_type="text/markdown"))
    for send in (_solids, _wrench, _contact, _wrench_space, _plots):
        send(film)
    return memory.drain_as_bytes()


@dataclass(frozen=True, eq=False)
class _Film:
    """One world of a run up to where it diverges, the sizes it is drawn with, and the recording it is sent to."""

    run: Run
    world: int
    rr: Any  # the module
    stream: Any

    def still(self, entity: str, *archetypes: Any) -> None:
        """Send what does not change."""
        for archetype in archetypes:
            self.stream.log(entity, archetype, static=True)

    def send(self, entity: str, rows: Rows, archetype: Any, *, each: int = 1, **values: Array) -> None:
        """Send columns `values` (R each, ...) of an archetype that has `each` instances at each of the R `rows`."""
        drawn = [np.abs(value.reshape(rows.size, -1)) < HUGE for value in values.values()]
        there = np.all(np.hstack(drawn), axis=1)
        columns = archetype.columns(**{key: value[np.repeat(there, each)] for key, value in values.items()})
        seconds = self.rr.TimeColumn("sim_time", duration=self.run.time[rows])
        steps = self.rr.TimeColumn("step", sequence=rows)
        self.stream.send_columns(entity, [seconds, steps], columns.partition(each * there))

    def arrows(
        self, entity: str, rows: Rows, vectors: Array, colour: Colour, width: float, label: str, at: float = 1.0
    ) -> None:
        """Send arrows (R, 3) from the entity's origin, with a label just past the share `at` of their length."""
        self.still(entity, self.rr.Arrows3D.from_fields(colors=[colour], radii=[width]), self.label(label, colour))
        self.send(entity, rows, self.rr.Arrows3D, vectors=vectors)
        past = at + 4.0 * width / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), width)
        self.send(entity, rows, self.rr.Points3D, positions=vectors * past)

    def label(self, text: str, colour: Colour, at: Array | None = None) -> Any:
        """A word at the position `at` (3,), or else at positions that are sent as a column."""
        style = {"labels": [text], "colors": [colour], "radii": [0.0], "show_labels": bool(text)}
        return self.rr.Points3D.from_fields(positions=None if at is None else [at], **style)

    @cached_property
    def states(self) -> int:
        """Number of states before the first that is not finite or is beyond `FAR`."""
        run, i = self.run, self.world
        state = np.hstack([run.position[i], run.quaternion[i], run.velocity[i], run.angular_velocity[i]])
        wrong = ~(np.abs(state) <= FAR).all(axis=1)
        return int(wrong.argmax()) if wrong.any() else wrong.size

    @property
    def answers(self) -> int:
        """Number of steps that began in one of these states."""
        return min(self.states, self.run.time.size - 1)

    def rows(self, count: int, budget: tuple[float, int]) -> Rows:
        """Which of `count` rows are kept within a budget (Hz of simulated time, rows)."""
        rate, most = budget
        stride = max(1, ceil(1.0 / (rate * self.run.dt) - 1e-9), ceil(count / (most - 1)))
        return np.union1d(np.arange(0, count, stride), np.arange(count)[-1:])

    @cached_property
    def side(self) -> float:
        """Side of the block [m]."""
        return 2.0 * float(np.abs(self.run.corner_point).max())

    @cached_property
    def scale(self) -> float:
        """Length of a drawn force [m/N]: m g is half a side, or less if the run's forces would pass 1.25 sides."""
        forces = self.run.wrench[self.world, :, :2], self.run.force[self.world, :, 0]
        largest = max(_usual(np.linalg.norm(force[: self.answers], axis=1)) for force in forces)
        return 0.5 * self.side / max(float(np.linalg.norm(self.weight)), 0.4 * largest, 1e-9)

    @property
    def away(self) -> Array:
        """(3,) the unit vector into the picture, world axes."""
        return matrix(self.run.truth.table)[:, 1]

    @property
    def front(self) -> Array:
        """(3,) from the plane of motion to the one before the block that arrows are drawn in [m]."""
        return -self.away * (0.5 * DEPTH + 0.02) * self.side

    @property
    def weight(self) -> Array:
        """(3,) m g, world axes [N]."""
        return self.run.truth.mass * self.run.truth.gravity

    @property
    def planned_mu(self) -> float:
        """Friction that the controller may use, (1 - margin) mu."""
        return float(self.run.attached.controller.belief.mu[0])

    @cached_property
    def corner(self) -> Array:
        """(states, 3) the material corner, world axes [m]."""
        return self.run.truth.origin + self.run.corner[self.world, : self.states] @ self.run.table_axes.T

    @cached_property
    def solutions(self) -> dict[int, Solution]:
        """Step -> its problem, stated and solved again, for the answered steps whose wrench space is drawn."""
        run, i, problem = self.run, self.world, self.run.attached.controller.problem
        theta, omega, wanted = run.theta[i], run.omega[i], np.transpose(run.reference)
        rows = [k for k in self.rows(self.answers, SPACE) if run.status[i, k] == 0]
        return {k: solve(problem(Motion(theta[k], omega[k]), Motion(*wanted[k]))) for k in rows}

    @cached_property
    def reach(self) -> float:
        """Largest normal force in the picture of the wrench space, and half the picture's size [N]."""
        sizes = [max(np.linalg.norm(each.problem.required[:2]), each.force[0, 1]) for each in self.solutions.values()]
        return 1.25 * float(max(sizes, default=1.0))


def _usual(values: Array) -> float:
    """What 95 % of the magnitudes that are finite stay below; 0 if none is."""
    finite = np.abs(values[np.isfinite(values)])
    return float(np.quantile(finite, 0.95)) if finite.size else 0.0


def _xyzw(quaternion: Array) -> Array:
    """(..., 4) in rerun's order, from MuJoCo's (w, x, y, z)."""
    return np.roll(quaternion, -1, axis=-1)


def _solids(film: _Film) -> None:
    """Table, block, and the paths of its corner and CoM."""
    rr, run, side = film.rr, film.run, film.side
    thin = rr.Radius.ui_points(1.0)
    film.still("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    slab = side * np.array([2.0, 0.5, 0.03])
    pose = rr.Transform3D(translation=run.truth.origin, quaternion=_xyzw(run.truth.table))
    top = rr.Boxes3D(centers=[-slab * UP], half_sizes=[slab], colors=[TABLE], fill_mode="solid")
    film.still("world/table", pose, top)
    half = np.insert(np.abs(run.corner_point), 1, 0.5 * DEPTH * side)
    film.still("world/block/solid", rr.Boxes3D(half_sizes=[half], colors=[BLOCK], fill_mode="solid"))
    film.still("world/block/edges", rr.Boxes3D(half_sizes=[half], colors=[EDGES], radii=thin))
    rows = film.rows(film.states, SCENE)
    position, quaternion = run.position[film.world, rows], run.quaternion[film.world, rows]
    film.send("world/block", rows, rr.Transform3D, translation=position, quaternion=_xyzw(quaternion))
    for name, points in (("com", position), ("corner", film.corner[rows])):
        film.still(f"world/path/{name}", rr.LineStrips3D([points + film.front], colors=[GREY], radii=thin))


def _wrench(film: _Film) -> None:
    """At the CoM: the weight, and the applied wrench as an arrow and an arc."""
    rr, run, side = film.rr, film.run, film.side
    rows = film.rows(film.answers, SCENE)
    applied, weight = run.wrench_world[film.world, rows, :3] * film.scale, film.weight * film.scale
    right = np.cross(film.away, UP)
    film.send("world/wrench", rows, rr.Transform3D, translation=run.position[film.world, rows] + film.front)
    arrow = rr.Arrows3D(vectors=[weight], colors=[GREY], radii=[0.012 * side])
    film.still("world/wrench/weight", arrow, film.label("m g", GREY, 0.5 * weight + 0.1 * side * right))
    arc = rr.LineStrips3D.from_fields(colors=[TEAL], radii=[0.012 * side])
    film.still("world/wrench/moment", arc, film.label("w: moment", TEAL, -0.42 * side * right))
    film.send("world/wrench/moment", rows, rr.LineStrips3D, strips=_arcs(film, rows))
    film.arrows("world/wrench/force", rows, applied, GREEN, 0.02 * side, "w: force")


def _arcs(film: _Film, rows: Rows) -> Array:
    """(R, 28, 3) the applied moment as an arc about the CoM with an arrow head, counter-clockwise if positive [m].

    270 deg stand for what the run's moments usually stay below, or for a tenth of m g at the corner's lever if more.
    """
    moment = film.run.wrench[film.world, : film.answers, 2]
    full = max(_usual(moment), 0.05 * film.side / film.scale * float(np.linalg.norm(film.run.corner_point)))
    sweep = np.deg2rad(np.clip(270.0 * moment[rows, None] / full, -330.0, 330.0))
    shaft = 0.25 * np.pi + sweep * np.linspace(0.0, 1.0, 25)
    tip = shaft[:, -1:]
    barb = tip - np.sign(sweep) * np.minimum(0.35, np.abs(sweep))
    angle, radius = np.hstack([shaft, barb, tip, barb]), film.side * np.array([0.2] * 25 + [0.25, 0.2, 0.15])
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1) @ film.run.table_axes.T


def _contact(film: _Film) -> None:
    """At the corner, in the table's frame: contact forces, and the friction cones that they have to be in."""
    rr, run, side = film.rr, film.run, film.side
    rows = film.rows(film.answers, SCENE)
    pose = np.tile(_xyzw(run.truth.table), (rows.size, 1))
    film.send("world/contact", rows, rr.Transform3D, translation=film.corner[rows] + film.front, quaternion=pose)
    lift = run.attached.controller.space.lift
    measured, predicted = (film.scale * lift(f[film.world, rows, 0]) for f in (run.force_measured, run.force))
    film.arrows("world/contact/measured", rows, measured, RED, 0.03 * side, "")
    film.arrows("world/contact/predicted", rows, predicted, ORANGE, 0.015 * side, "f")
    film.still("world/contact/predicted", rr.Arrows3D.from_fields(origins=[[0.0, -0.04 * side, 0.0]]))
    floor = film.scale * run.attached.controller.contacts[0].f_min
    for name, mu, colour, at in (("world", run.mu_world, GREY, -0.35), ("planned", film.planned_mu, PURPLE, 0.35)):
        entity = f"world/contact/cone/{name}"
        edges = lift(np.array([[-mu, 1.0], [mu, 1.0]]))
        top = edges * max(0.8 * side / np.hypot(mu, 1.0), 1.3 * floor)
        lines = [[top[0], np.zeros(3), top[1]], edges * (floor if name == "planned" else 0.0)]
        film.still(entity, rr.LineStrips3D(lines, colors=[colour] * 2, radii=rr.Radius.ui_points(1.0)))
        if name == "planned":
            corners = np.vstack([edges * floor, top[::-1]])
            film.still(entity, rr.Mesh3D(vertex_positions=corners, triangle_indices=QUAD, albedo_factor=(*colour, 60)))
        film.still(entity, film.label(f"cone, {name}", colour, side * np.array([at, 0.0, -0.05])))


def _wrench_space(film: _Film) -> None:
    """The notes' second figure over time: contact cone {J f}, admissible w, and the optimum, w + J f = required.

    Moments are drawn as M / length, with the length [m] that makes Q_w weigh all axes of the picture alike.
    """
    if not film.solutions:
        return
    rr, rows, size = film.rr, np.array(list(film.solutions)), film.reach
    Q_w, thin, axes = film.run.attached.controller.Q_w, rr.Radius.ui_points(1.0), 0.8 * size * np.eye(3)
    length = float(np.sqrt(Q_w[0, 0] / Q_w[2, 2]))
    film.still("wrench_space", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    film.still("wrench_space/axes", rr.Arrows3D(vectors=2.0 * axes, origins=-axes, colors=[GREY], radii=0.006 * size))
    for name, unit, axis in zip(("F_u", "F_v", "M"), ("", "", f" / {length:.3g} m"), axes, strict=True):
        film.still(f"wrench_space/axes/{name}", film.label(f"{name}{unit} [N]", WHITE, 1.1 * axis))
    spaces = [solution_space(solution, size) for solution in film.solutions.values()]
    over_time = SolutionSpace(*(np.array(parts) / [1.0, 1.0, length] for parts in zip(*spaces, strict=True)))
    for name, polygon, colour in (("cone", over_time.cone, ORANGE), ("admissible", over_time.admissible, GREEN)):
        fill, edge = f"wrench_space/{name}/fill", f"wrench_space/{name}/edge"
        film.still(fill, rr.Mesh3D.from_fields(triangle_indices=QUAD, albedo_factor=(*colour, 90)))
        film.send(fill, rows, rr.Mesh3D, each=polygon.shape[1], vertex_positions=polygon.reshape(-1, 3))
        film.still(edge, rr.LineStrips3D.from_fields(colors=[colour], radii=[thin]), film.label(name, colour))
        film.send(edge, rows, rr.LineStrips3D, strips=polygon[:, [0, 1, 2, 3, 0]])
        film.send(edge, rows, rr.Points3D, positions=polygon[:, 1:3].mean(axis=1))
    film.arrows("wrench_space/required", rows, over_time.required, WHITE, 0.02 * size, "required")
    film.arrows("wrench_space/wrench", rows, over_time.wrench, GREEN, 0.02 * size, "w")
    film.arrows("wrench_space/contact", rows, over_time.contact, ORANGE, 0.02 * size, "J f", at=0.5)
    sides = np.stack([over_time.wrench, over_time.required, over_time.contact], axis=1)
    film.still("wrench_space/sum", rr.LineStrips3D.from_fields(colors=[GREY], radii=[thin]))
    film.send("wrench_space/sum", rows, rr.LineStrips3D, strips=sides)


def _series(film: _Film) -> dict[str, tuple[Colour, float, Array]]:
    """The lines of the plots: <plot>/<series> -> colour, width, values (states,) or (answers,)."""
    run, i, n, N = film.run, film.world, film.states, film.answers
    (F_u, F_v, M), predicted, measured = run.wrench[i, :N].T, run.force[i, :N, 0], run.force_measured[i, :N, 0]
    return {
        "angle/reference": (WHITE, WIDE, np.rad2deg(run.reference[0][:n])),
        "angle/theta": (GREEN, FINE, np.rad2deg(run.theta[i, :n])),
        "slip/measured": (RED, WIDE, 1e3 * run.slip[i, :n]),
        "slip/predicted": (WHITE, FINE, 1e3 * predicted_slip(run)[i, :n]),
        "friction_use/limit": (WHITE, FINE, np.ones(N)),
        "friction_use/measured": (RED, WIDE, run.friction_use[i, :N]),
        "friction_use/planned": (PURPLE, FINE, np.full(N, film.planned_mu / run.mu_world)),
        "force/measured_f_n": (RED, WIDE, measured[:, 1]),
        "force/measured_f_t": (PINK, WIDE, measured[:, 0]),
        "force/predicted_f_n": (ORANGE, FINE, predicted[:, 1]),
        "force/predicted_f_t": (YELLOW, FINE, predicted[:, 0]),
        "wrench/F_u": (GREEN, FINE, F_u),
        "wrench/F_v": (LIME, FINE, F_v),
        "wrench/M": (TEAL, FINE, M),
        "solve_us": (YELLOW, FINE, run.control_us[:N]),
    }


def _plots(film: _Film) -> None:
    """Every line of every plot."""
    for name, (colour, width, values) in _series(film).items():
        film.still(f"plots/{name}", film.rr.SeriesLines(colors=[colour], widths=[width]))
        rows = film.rows(values.size, PLOTS)
        film.send(f"plots/{name}", rows, film.rr.Scalars, scalars=values[rows])


def _report(film: _Film) -> str:
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
    return "\n".join(lines)


def _blueprint(film: _Film) -> Any:
    """What is shown on opening: side view, wrench space and report on the left, the plots on the right."""
    import rerun.blueprint as rrb

    def view(origin: str, name: str, eye: Array, target: Array) -> Any:
        eyes = rrb.EyeControls3D(position=eye, look_target=target, eye_up=UP)
        return rrb.Spatial3DView(origin=origin, name=name, eye_controls=eyes, background=DARK, line_grid=False)

    target = film.run.truth.origin + 0.62 * film.side * UP
    side = view("world", "side view", target + film.side * (0.25 * UP - 2.05 * film.away), target)
    aside, centre = film.reach * np.array([[0.35, 1.9, 1.2], [0.15, 0.15, 0.0]])
    space = view("wrench_space", "wrench space, object axes", aside, centre)
    plots = [
        rrb.TimeSeriesView(origin=f"plots/{name}", name=title, plot_legend=rrb.PlotLegend(corner))
        for name, (title, corner) in TITLES.items()
    ]
    below = rrb.Horizontal(space, rrb.TextDocumentView(origin="report", name="verdict"), column_shares=[5, 4])
    left = rrb.Vertical(side, below, row_shares=[10, 9])
    speed = min(1.0, 0.25 * float(film.run.time[-1]))  # four seconds to watch, at least
    return rrb.Blueprint(
        rrb.Horizontal(left, rrb.Grid(*plots, grid_columns=2), column_shares=[6, 5]),
        rrb.TimePanel(state="collapsed", timeline="sim_time", loop_mode="all", playback_speed=speed),
        collapse_panels=True,
    )
