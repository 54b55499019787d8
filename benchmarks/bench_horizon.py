"""The horizon, N = 20: a pass, its solver, a whole plan; and the same convex program through cvxpy and casadi.

A block of 1 m and 1 kg turns by 20 degrees in 1 s, about a corner in the plane and about an edge, with two contacts, in
space; the contacts stick. "bounded": the force and its rate are held below what is wanted, and are at their bounds for
half of the steps and more; otherwise no inequality is met. Every state is another one, and every solver gets every
program in turn, so that noise hits all alike; of three calls the least counts, of states the median. Ours is one pass
about a warm guess: rows stated, solved, certified, checked against the nonlinear equations. The peers get the matrices
ready: cvxpy sets sparse parameters of a problem that is compiled once (DPP) and solves it anew, at our tolerances.
Errors are the greatest difference from our contact forces and wrenches, over the weight. Peers not installed are
skipped; "cvxpy / ours" is that of its fastest solver.
"""

import warnings
from collections.abc import Callable
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np
from harness import main, peer_table, timed
from pivoting.controller import Body, BodyState, Contact, Horizon, Law, Plan, Planner, WrenchBounds, WrenchController
from pivoting.controller.validate import Array
from rich import print as show
from rich.markdown import Markdown
from rich.progress import track
from scipy.sparse import block_diag, csc_matrix, triu

N, H = 20, 0.05
FORCE, RATE = {2: 5.0, 3: 4.0}, 10.0  # [N], [N/s]: more is wanted, and faster
FAMILIES = {
    f"{place}, {integrator}{', bounded' * bounded}": (dim, integrator, bounded)
    for place, dim in (("plane", 2), ("space", 3))
    for integrator in ("quasi-dynamic", "semi-implicit")
    for bounded in (False, True)
}
ASKED = {name: dim for name, (dim, _, bounded) in FAMILIES.items() if not bounded}
OURS = "ours, one pass"
REPEATS, ACCURATE = 3, 1e-4
TIGHT: dict[str, dict[str, Any]] = {
    "CLARABEL": {"tol_gap_abs": 1e-12, "tol_gap_rel": 1e-12, "tol_feas": 1e-10},
    "PIQP": {"eps_abs": 1e-10, "eps_rel": 1e-10, "eps_duality_gap_abs": 1e-12, "eps_duality_gap_rel": 1e-12},
    "OSQP": {"eps_abs": 1e-7, "eps_rel": 1e-7, "max_iter": 20_000},  # tighter, it does not arrive
}
COLUMNS = {"ms": "#.3g", "times ours": "#.3g", "error, median": ".0e", "error, max": ".0e", "failures": ".0f"}

# The timed call, which gives x or None, from what is prepared outside the clock.
Route = tuple[Callable[[Any], tuple[Any, ...]], Callable[..., Any]]


def turn(theta: float) -> Array:
    return np.array([np.cos(0.5 * theta), 0.0, -np.sin(0.5 * theta), 0.0])


def planner(dim: int, integrator: str, bounded: bool) -> Planner:
    """Sticking contacts at the block's corner or edge, mu = 0.3."""
    if dim == 2:
        contacts, inertia, gravity = [Contact((-0.5, -0.5), 0.3)], 1.0 / 6.0, (0.0, -9.81)
    else:
        contacts = [Contact((-0.5, side, -0.5), 0.3) for side in (-0.5, 0.5)]
        inertia, gravity = np.eye(3) / 6.0, (0.0, 0.0, -9.81)
    controller = WrenchController(Body(1.0, inertia), contacts, Law.static(), gravity)
    weight = 1e3 * np.eye(len(controller.Q_w))
    bounds = WrenchBounds(force=FORCE[dim], force_rate=RATE) if bounded else None
    return Planner(Horizon(controller, N, H, integrator=integrator, Q=weight, bounds=bounds, stick=True))


def state(rng: np.random.Generator) -> tuple[BodyState, Array]:
    """At 5 to 20 degrees, about to turn or already turning; and the orientations (N, 4) of the arc."""
    theta, rate = np.deg2rad(rng.uniform(5.0, 20.0)), rng.uniform(-0.1, 0.3)
    c, s = np.cos(theta), np.sin(theta)
    arm = 0.5 * np.array([c - s, 0.0, c + s])  # from the contacts to the CoM
    now = BodyState(arm, turn(theta), rate * np.array([-arm[2], 0.0, arm[0]]), np.array([0.0, -rate, 0.0]))
    u = np.arange(1, N + 1) / N
    rise = np.deg2rad(20.0) * u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    return now, np.array([turn(theta + r) for r in rise])


def cvxpy(first: Any, solver: str) -> Route:
    """min 1/2 |L x|^2 + q'x over the rows, with L, q, A and b as parameters, the matrices sparse."""
    import cvxpy as cp

    if solver not in cp.installed_solvers():
        raise ImportError(f"{solver} is not installed")
    zero, linear, orders = first.cones
    x = cp.Variable(len(first.q))

    def parameter(matrix: csc_matrix) -> Any:
        rows = matrix.tocoo()
        return cp.Parameter(matrix.shape, sparsity=(rows.row, rows.col))

    parts = prepared(first)
    L, A = parameter(parts[0]), parameter(parts[2])
    q, b = cp.Parameter(len(first.q)), cp.Parameter(len(first.b))
    s = b - A @ x
    limits, start = [s[:zero] == 0.0, s[zero : zero + linear] >= 0.0], zero + linear
    for order in orders:
        limits.append(cp.SOC(s[start], s[start + 1 : start + order]))
        start += order
    problem = cp.Problem(cp.Minimize(0.5 * cp.sum_squares(L @ x) + q @ x), limits)

    def run(*values: Any) -> Any:
        L.value_sparse, q.value, A.value_sparse, b.value = values
        problem.solve(solver=solver, **TIGHT[solver])
        return x.value if problem.status in ("optimal", "optimal_inaccurate") else None

    def prepare(program: Any) -> tuple[Any, ...]:
        L, q, A, b = prepared(program)
        return L.tocoo(), q, A.tocoo(), b

    return prepare, run


def prepared(program: Any) -> tuple[Any, ...]:
    """L with P = L'L, q, A and b; L has the pattern of dense blocks, so that all programs share it."""
    upper = program.P.csc()
    whole = (upper + triu(upper, 1).T).toarray()
    wide = len(whole) // N
    blocks = [np.linalg.cholesky(whole[i : i + wide, i : i + wide]).T for i in range(0, len(whole), wide)]
    L = block_diag([csc_matrix((part.ravel(), np.indices(part.shape).reshape(2, -1))) for part in blocks])
    return L.tocsc(), program.q, program.A.csc(), program.b


def casadi(first: Any) -> Route:
    """Its conic interface, sparse, over the QP solver that its wheel has for such sizes."""
    from casadi import DM, Sparsity, conic

    def sparsity(matrix: csc_matrix) -> Any:
        return Sparsity(*matrix.shape, matrix.indptr.tolist(), matrix.indices.tolist())

    def parts(program: Any) -> tuple[csc_matrix, csc_matrix, Array]:
        upper = program.P.csc()
        P, A = csc_matrix(upper + triu(upper, 1).T), program.A.csc()
        P.sort_indices()
        lower = np.where(np.arange(len(program.b)) < program.cones.zero, program.b, -np.inf)
        return P, A, lower

    P, A, _ = parts(first)
    hessian, rows = sparsity(P), sparsity(A)
    options = {"error_on_fail": False, "osqp": {"verbose": False, **TIGHT["OSQP"]}}
    solver = conic("plan", "osqp", {"h": hessian, "a": rows}, options)

    def prepare(program: Any) -> tuple[Any, ...]:
        P, A, lower = parts(program)
        return DM(hessian, P.data), DM(program.q), DM(rows, A.data), DM(lower), DM(program.b)

    def run(h: Any, g: Any, a: Any, lower: Any, upper: Any) -> Any:
        answer = solver(h=h, g=g, a=a, lba=lower, uba=upper)["x"]
        return np.ravel(answer) if solver.stats()["success"] else None

    return prepare, run


PEERS: dict[int, dict[str, Callable[[Any], Route]]] = {
    2: {f"cvxpy (DPP) + {name}": partial(cvxpy, solver=name) for name in TIGHT} | {"casadi conic + OSQP": casadi},
    3: {"cvxpy (DPP) + CLARABEL": partial(cvxpy, solver="CLARABEL")},  # it alone takes the cones
}


def family(name: str, count: int) -> dict[str, float]:
    """The figures of all on `count` states."""
    dim = FAMILIES[name][0]
    mine = planner(*FAMILIES[name])
    horizon, rng = mine.horizon, np.random.default_rng(2026)
    units = horizon.controller.units
    spent: dict[str, list[float]] = {OURS: [], "its solver": [], "whole plan": []}
    passes, defects, changes, tied, errors, routes = [], [], [], [], {}, {}
    for i in track(range(-1, count), name, transient=True):
        now, orientations = state(rng)
        wanted = horizon.arc(orientations, now)
        whole: Plan = mine.plan(now, wanted)
        # Where the last plan of a receding horizon would be: near, not there
        guess = mine.plan(now, wanted, passes=2).guess
        program = mine.program.stated(horizon.desired(*wanted), guess)
        if i < 0:  # warm
            for peer, route in PEERS[dim].items():
                try:
                    start = perf_counter()
                    prepare, run = routes[peer] = route(program)
                    run(*prepare(program))
                    print(f"{name}: {peer} compiled in {perf_counter() - start:.2f} s")
                    spent[peer], errors[peer] = [], []
                except ImportError as error:
                    print(f"{name}: {peer} skipped: {error}")
            continue
        seconds, plan = timed(partial(mine.plan, guess=guess, passes=1), (now, wanted), REPEATS)
        spent[OURS].append(1e3 * seconds)
        spent["its solver"].append(1e3 * plan.solver_seconds)
        spent["whole plan"].append(1e3 * timed(mine.plan, (now, wanted), REPEATS)[0])
        passes.append(whole.passes)
        changes.append(plan.changes[0])
        tied.append(np.mean(np.linalg.norm(plan.wrench[:, :dim], axis=1) >= 0.98 * horizon.bounds.force))
        defects.append(max(whole.motion_defect, whole.stick_defect))
        if whole.status != "solved":
            raise RuntimeError(f"{name}: {whole.status}")
        for peer, (prepare, run) in routes.items():
            seconds, x = timed(run, prepare(program), REPEATS)
            spent[peer].append(1e3 * seconds)
            if x is None:
                errors[peer].append(np.nan)
                continue
            other, _ = mine.program.corrected(guess, np.asarray(x))
            off = (
                np.abs((other.wrench - plan.wrench) / units.wrench).max(),
                np.abs(other.force.ravel() - plan.force.ravel()).max() / units.force,
            )
            errors[peer].append(max(off))
    out = {f"{name}: {what}, ms": float(np.median(ms)) for what, ms in spent.items() if what not in routes}
    out[f"{name}: whole plan, passes"] = float(np.median(passes))
    out[f"{name}: whole plan, greatest defect"] = float(np.max(defects))
    out[f"{name}: change of the pass"] = float(np.median(changes))
    out[f"{name}: share of steps at the bound on the force"] = float(np.mean(tied))
    ratios = []
    for peer in routes:
        error, ratio = np.array(errors[peer]), float(np.median(np.array(spent[peer]) / np.array(spent[OURS])))
        good = error[np.isfinite(error)]
        values = [float(np.median(spent[peer])), ratio]
        values += [float(np.median(good)), float(good.max())] if len(good) else [np.nan] * 2
        values.append(float(len(error) - len(good)))
        out |= {f"{name}: {peer}, {column}": value for column, value in zip(COLUMNS, values, strict=True)}
        if peer.startswith("cvxpy") and len(good) == len(error) and np.median(good) <= ACCURATE:
            ratios.append(ratio)
    if ratios:
        out[f"{name}: cvxpy / ours"] = min(ratios)
        out[f"{name}: cvxpy / our solver"] = min(ratios) * float(np.median(np.array(spent[OURS]) / spent["its solver"]))
    return {key: value for key, value in out.items() if not np.isnan(value)}


def markdown(figures: dict[str, float]) -> str:
    """The figures as tables."""
    lines = []
    for name in FAMILIES:
        lines += peer_table(figures, name, COLUMNS)
        lines += ["", f"{figures[f'{name}: whole plan, passes']:.0f} passes to a plan (median)"]
    return "\n".join(lines[1:])


def measure(quick: bool) -> dict[str, float]:
    """The figures; see the head of this file."""
    out: dict[str, float] = {}
    for name in FAMILIES:
        out |= family(name, 5 if quick else 50)
    show(Markdown(markdown(out)))
    return out


if __name__ == "__main__":
    warnings.simplefilter("ignore")  # those of the peers
    main(
        __doc__ or "",
        measure,
        {f"{name}: its solver, ms": 1.0 if dim == 2 else 5.0 for name, dim in ASKED.items()},
        floors={f"{name}: cvxpy / ours": 3.0 for name in ASKED},
        markdown=markdown,
    )
