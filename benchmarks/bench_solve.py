"""The solve against its peers and against physics: speed beside error, on the same random problems, in one run.

Every solver gets every problem in turn, so that noise hits all alike; of three calls the least counts, of problems the
median. "native" and "in place" are timed from matrices that are ready, scaled to order one, at 1e-11 (qoco 1e-9);
"solve" and "public" also state the program and certify. Errors are |f - f*| / load, against our certified f*. Failures
are exceptions, what a solver calls failed and what `solve` cannot certify to 1e-7. Peers not installed are skipped.
"""

import sys
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
from harness import main, peer_table, timed
from pivoting.controller import ClarabelWorkspace, WrenchProblem, methods, pyramid_excess, solve
from pivoting.controller.kernels.interior_point import contact_wrench
from pivoting.controller.kernels.planar_closed_form import planar_wrench
from pivoting.controller.kernels.workspace import workspace
from pivoting.controller.solvers.clarabel_backend import SETTINGS
from pivoting.controller.solvers.conic_program import Cones
from pivoting.controller.solvers.wrench_program import wrench_program
from pivoting.controller.validate import Array
from rich import print as show
from rich.markdown import Markdown
from rich.progress import track
from scipy.sparse import csc_matrix

sys.path.insert(0, str(Path(__file__).parent.parent))  # the same random problems as the tests
from tests.draws import Data, draw, solve_all, stack, stated, wedge

FAMILIES = {"plane K=1": (1, 2), "space K=1": (1, 3), "space K=2": (2, 3), "space K=4": (4, 3)}  # (contacts, dim)
LOOP, KERNEL, PUBLIC = "ours, compiled loop", "ours, compiled entry from Python", "ours, solve(problem)"
IN_PLACE, PYRAMID = "Clarabel in place", 'solve(problem, "qp:daqp"), 8-edge pyramid'
BACKENDS = ("daqp", "quadprog", "piqp", "proxqp", "clarabel", "cvxopt", "ecos", "highs", "osqp", "scs")
COLUMNS = {"us": "#.3g", "times ours": "#.3g", "error, median": ".0e", "error, max": ".0e", "failures": ".0f"}
TIGHT = SETTINGS["wrench"]
REPEATS, LOOSE = 3, {"tol_gap_abs": 1e-8, "tol_gap_rel": 1e-8, "tol_feas": 1e-8}


class Instance(NamedTuple):
    """min 1/2 x'P x  s.t.  A x = b,  d - C x in half-lines, then cones;  x = (f, w) / unit; see `WrenchProgram`."""

    data: Data
    problem: WrenchProblem
    P: Array
    A: Array
    b: Array
    C: Array
    d: Array
    upper: csc_matrix  # of P; it and `rows`, A and C, have the pattern that all problems of one shape share
    rows: csc_matrix
    cones: Cones
    unit: float


# What is prepared outside the clock, and the timed call, which gives the forces f [N], or x, or None.
Route = tuple[Callable[[Instance], tuple[Any, ...]], Callable[..., Any]]


def instance(data: Data) -> Instance:
    """`data` in every form."""
    problem = stated(data)
    program, unit = wrench_program(problem.contacts, problem.dim).assemble(problem)
    (A, C), (b, d) = (np.split(whole, [program.cones.zero]) for whole in (program.A.dense(), program.b))
    upper, rows = program.P.csc(), program.A.csc()
    P = program.P.dense(mirrored=True)
    return Instance(data, problem, P, A, b, C, d, upper, rows, program.cones, unit)


def kernel(first: Instance) -> Route:
    """The compiled entry, called with arrays and a workspace that the caller keeps and writes each problem into."""
    nw, n = first.problem.jacobian.shape
    held, f, w = [np.array(values, order="C") for values in first.data], np.empty(n), np.empty(nw)
    planar, several = workspace(nw, first.problem.contacts, first.problem.dim)
    entry, scratch = (contact_wrench, several) if planar is None else (planar_wrench, planar)

    def prepare(it: Instance) -> tuple[Array, ...]:
        for mine, theirs in zip(held, it.data, strict=True):
            mine[...] = theirs
        return tuple(held)

    def run(J: Array, b: Array, Q_w: Array, Q_f: Array, mu: Array, f_min: Array) -> Array:
        entry(J, b, Q_w, Q_f, mu, f_min, f, w, scratch)
        return f

    return prepare, run


def public(method: str, first: Instance) -> Route:
    if method not in methods():
        raise ImportError(f"{method} is not installed")
    return lambda it: (it.problem,), lambda problem: solve(problem, method).force


def clarabel_public(first: Instance) -> Route:
    space = ClarabelWorkspace(first.problem)
    return lambda it: (it.problem,), lambda problem: (space.update(problem), space.solve().force)[1]


def clarabel_in_place(first: Instance, **options: float) -> Route:
    """Nothing but Clarabel's own update and solve, as `ClarabelWorkspace` has set it up."""
    solver = ClarabelWorkspace(first.problem, **options)._clarabel._solver

    def run(P: Array, A: Array, b: Array) -> Any:
        solver.update(P=P.tolist(), A=A.tolist(), b=b.tolist())  # of arrays it takes longer than all of this
        answer = solver.solve()
        return answer.x if str(answer.status) == "Solved" else None

    return lambda it: (it.upper.data, it.rows.data, np.r_[it.b, it.d]), run


def daqp(first: Instance) -> Route:
    import daqp

    m, rows, zero = len(first.d), len(first.d) + len(first.b), np.zeros(len(first.P))
    lower, sense = np.full(rows, -1e30), np.array([0] * m + [5] * (rows - m), dtype=np.int32)

    def run(*args: Array) -> Any:
        x, _, flag, _ = daqp.solve(*args)
        return x if flag > 0 else None

    return lambda it: (it.P, zero, np.vstack([it.C, it.A]), np.r_[it.d, it.b], lower, sense), run


def quadprog(first: Instance) -> Route:
    from quadprog import solve_qp

    def prepare(it: Instance) -> tuple[Any, ...]:
        return it.P, np.zeros(len(it.P)), np.vstack([it.A, -it.C]).T.copy(), np.r_[it.b, -it.d], len(it.b)

    return prepare, lambda *args: solve_qp(*args)[0]


def qoco(first: Instance) -> Route:
    import qoco

    n, nw, m, cones = len(first.P), len(first.b), len(first.d), (len(first.d) - first.cones.linear) // 3
    solver, tight = qoco.QOCO(), {"abstol": 1e-9, "reltol": 1e-9, "verbose": 0}  # below it calls many inaccurate
    parts = first.upper, np.zeros(n), first.rows[:nw], first.b, first.rows[nw:], first.d
    solver.setup(n, m, nw, *parts, first.cones.linear, cones, [3] * cones or None, **tight)

    def run(P: Array, A: Array, b: Array, G: Array, h: Array) -> Any:
        solver.update_matrix_data(P=P, A=A, G=G)
        solver.update_vector_data(b=b, h=h)
        answer = solver.solve()
        return answer.x if answer.status == "QOCO_SOLVED" else None

    return lambda it: (it.upper.data, it.rows[:nw].data, it.b, it.rows[nw:].data, it.d), run


def cvxpy(first: Instance) -> Route:
    import cvxpy as cp

    x, root = cp.Variable(len(first.P)), cp.Parameter(first.P.shape)
    A, b, C, d = (cp.Parameter(values.shape) for values in (first.A, first.b, first.C, first.d))
    linear, s = first.cones.linear, d - C @ x
    cones = [cp.SOC(s[i], s[i + 1 : i + 3]) for i in range(linear, len(first.d), 3)]
    program = cp.Problem(cp.Minimize(0.5 * cp.sum_squares(root @ x)), [A @ x == b, s[:linear] >= 0.0, *cones])

    def run(*values: Array) -> Any:
        for parameter, value in zip((root, A, b, C, d), values, strict=True):
            parameter.value = value
        program.solve(solver="CLARABEL", **TIGHT)
        return x.value if program.status == "optimal" else None

    return lambda it: (np.linalg.cholesky(it.P).T, it.A, it.b, it.C, it.d), run


def casadi(first: Instance) -> Route:
    from casadi import DM, Sparsity, conic

    sizes = {"h": Sparsity.dense(*first.P.shape), "a": Sparsity.dense(*first.rows.shape)}
    quiet = dict.fromkeys(("print_iter", "print_header", "print_info"), False)  # it raises where it fails
    solver, lower = conic("wrench", "qrqp", sizes, quiet), np.full(len(first.d), -np.inf)
    return (
        lambda it: tuple(map(DM, (it.P, np.vstack([it.A, it.C]), np.r_[it.b, lower], np.r_[it.b, it.d]))),
        lambda h, a, lba, uba: solver(h=h, a=a, lba=lba, uba=uba)["x"],
    )


def drake(first: Instance) -> Route:
    """Drake over its own Clarabel; the program is built outside the clock."""
    from pydrake.solvers import ClarabelSolver, MathematicalProgram, SolverOptions

    solver, options = ClarabelSolver(), SolverOptions()
    for name, value in TIGHT.items():
        options.SetOption(solver.solver_id(), name, value)

    def prepare(it: Instance) -> tuple[Any, ...]:
        program, linear = MathematicalProgram(), it.cones.linear
        x = program.NewContinuousVariables(len(it.P))
        program.AddQuadraticCost(it.P, np.zeros(len(it.P)), x, is_convex=True)
        program.AddLinearEqualityConstraint(it.A, it.b, x)
        program.AddLinearConstraint(it.C[:linear], np.full(linear, -np.inf), it.d[:linear], x)
        for row in range(linear, len(it.d), 3):
            program.AddLorentzConeConstraint(-it.C[row : row + 3], np.zeros(3), x)
        return (program,)

    def run(program: Any) -> Any:
        answer = solver.Solve(program, None, options)
        return answer.get_x_val() if answer.is_success() else None

    return prepare, run


COMMON: dict[str, Callable[[Instance], Route]] = {
    KERNEL: kernel,
    PUBLIC: partial(public, "closed-form"),
    IN_PLACE: clarabel_in_place,
    f"{IN_PLACE}, tolerances of 1e-8": partial(clarabel_in_place, **LOOSE),
    f"{IN_PLACE}, public": clarabel_public,
    'solve(problem, "clarabel")': partial(public, "clarabel"),
    "qoco in place": qoco,
    "drake + Clarabel, fresh": drake,
    "cvxpy (DPP) + Clarabel": cvxpy,
}
PLANE = {"daqp native": daqp, "quadprog native": quadprog, "casadi qrqp": casadi}
PLANE |= {f'solve(problem, "qp:{name}")': partial(public, f"qp:{name}") for name in BACKENDS}


def family(name: str, count: int) -> dict[str, float]:
    """The figures of all solvers on `count` problems of one family."""
    K, dim = FAMILIES[name]
    rng = np.random.default_rng(2026 + 10 * K + dim)
    drawn = [draw(rng, K, dim) for _ in range(count)]
    instances, many = [instance(data) for data in drawn], stack(drawn * (2_000 // count))
    best, routes = solve_all(many), {}
    for peer, route in (COMMON | (PLANE if dim == 2 else {PYRAMID: partial(public, "qp:daqp")})).items():
        try:
            prepare, run = routes[peer] = route(instances[0])
            timed(run, prepare(instances[0]), REPEATS)  # warm
        except ImportError as error:
            print(f"{name}: {peer} skipped: {error}")
    spent, errors = ({peer: np.full(count, np.nan) for peer in routes} for _ in range(2))
    loop = []
    for i, it in enumerate(track(instances, name, transient=True)):
        if i % (count // 20) == 0:
            loop.append(1e6 * timed(solve_all, (many,), 1)[0] / len(many.mu))
        load = max(np.linalg.norm(it.problem.required[:dim]), it.problem.f_min.max())
        for peer, (prepare, run) in routes.items():
            seconds, answer = timed(run, prepare(it), REPEATS)
            spent[peer][i] = 1e6 * seconds
            if answer is not None and np.isfinite(answer).all():
                answer = np.ravel(answer)
                f = answer[: K * dim] * (it.unit if answer.size == len(it.P) else 1.0)
                errors[peer][i] = np.linalg.norm(f - best.force[i]) / load
    out = {f"{name}: ours, greatest KKT residual": best.residual.max(), f"{name}: {LOOP}, us": np.median(loop)}
    out[f"{name}: {LOOP}, times ours"] = np.median(loop) / spent[KERNEL].mean()
    for peer, us in spent.items():
        error, failures = errors[peer], np.isnan(errors[peer]).sum()
        values = np.median(us), np.median(us / spent[KERNEL]), np.nanmedian(error), np.nanmax(error), failures
        out |= {f"{name}: {peer}, {column}": value for column, value in zip(COLUMNS, values, strict=True)}
    if dim == 3:
        excess = np.array([timed(pyramid_excess, (it.problem,), 1)[1] for it in instances], dtype=float)  # None: nan
        out[f"{name}: {PYRAMID}, median excess cost"] = np.nanmedian(excess)
        out[f"{name}: {PYRAMID}, greatest excess cost"] = np.nanmax(excess)
    return {key: float(value) for key, value in out.items() if not np.isnan(value)}


def scene(K: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """A block of 1 kg on a vertex, its centre above, or on a face; its contacts have settled."""
    half = np.array([0.5, 0.35, 0.7])
    height = np.linalg.norm(half) if K == 1 else half[2]
    x, y, z = half / height if K == 1 else (0.0, 0.0, 1.0)  # towards the centre from the vertex or face, block axes
    model = mujoco.MjModel.from_xml_string(f"""
    <mujoco><option timestep="0.0005" cone="elliptic" impratio="1000" jacobian="dense"/>
      <default><geom condim="3" friction="0.5 0 0" solref="0.00105 1" solimp="0.5 0.5 0.001"/></default>
      <worldbody>
        <geom type="plane" size="5 5 0.1"/>
        <body pos="0 0 {height}" quat="{1.0 + z} {y} {-x} 0">
          <freejoint/><geom type="box" size="0.5 0.35 0.7" mass="1"/>
        </body>
      </worldbody></mujoco>""")
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=20)
    return model, data


def block(rng: np.random.Generator, data: mujoco.MjData) -> Data:
    """The block of `scene` on the contacts that MuJoCo found, to be accelerated at random; identity weights."""
    J = np.hstack([np.vstack([np.eye(3), wedge(point - data.xipos[1])]) for point in data.contact.pos])
    required = np.array([0.0, 0.0, 9.81, 0.0, 0.0, 0.0]) + rng.normal(size=6)
    return Data(J, required, np.eye(6), np.eye(J.shape[1]), np.full(data.ncon, 0.5), np.zeros(data.ncon))


def physics(K: int, count: int) -> dict[str, float]:
    """One `mj_step`, one solve, in turn, each called once: medians of the ratios of neighbours."""
    (model, data), rng, out = scene(K), np.random.default_rng(2036 + K), {}
    kinds = {"random problems": [instance(draw(rng, K)) for _ in range(count)]}
    kinds["the block's own"] = [instance(block(rng, data)) for _ in range(count)]
    for kind, instances in kinds.items():
        for peer, route in ((KERNEL, kernel), (PUBLIC, partial(public, "closed-form"))):
            (prepare, run), pairs = route(instances[0]), np.empty((count, 2))
            for i, it in enumerate(track(instances, f"mj_step, K={K}", transient=True)):
                if i % 50 == 0:
                    mujoco.mj_resetData(model, data)
                    mujoco.mj_step(model, data, nstep=20)
                args = prepare(it)
                pairs[i] = [1e6 * timed(*call, 1)[0] for call in ((mujoco.mj_step, (model, data)), (run, args))]
                if data.ncon != K:
                    raise RuntimeError(f"the block has {data.ncon} contacts, not {K}")
            out[f"K={K}, {kind}: {peer} / mj_step"] = float(np.median(pairs[:, 1] / pairs[:, 0]))
            out[f"K={K}: mj_step, us"] = float(np.median(pairs[:, 0]))
    return out


def markdown(figures: dict[str, float]) -> str:
    """The figures as the tables of the page of results."""
    lines = []
    for name in FAMILIES:
        lines += peer_table(figures, name, COLUMNS)
    lines += ["", "| one solve against one `mj_step` of a block with as many contacts | ratio |", "|---|--:|"]
    lines += [f"| {key[:-10]} | {value:.2f} |" for key, value in figures.items() if key.endswith(" / mj_step")]
    return "\n".join(lines[1:])


def measure(quick: bool) -> dict[str, float]:
    """The figures; see the head of this file."""
    out: dict[str, float] = {}
    for name in FAMILIES:
        out |= family(name, 100 if quick else 1_000)
    for K in (1, 4):
        out |= physics(K, 500 if quick else 5_000)
    show(Markdown(markdown(out)))
    return out


if __name__ == "__main__":
    warnings.simplefilter("ignore")  # those of the peers
    main(
        __doc__ or "",
        measure,
        {f"K={K}, the block's own: {KERNEL} / mj_step": bound for K, bound in ((1, 0.6), (4, 3.5))},
        floors={f"space K={K}: {IN_PLACE}, times ours": floor for K, floor in ((1, 25.0), (2, 10.0), (4, 7.0))},
        markdown=markdown,
    )
