"""Random problems with any number of contacts, degenerate sets among them, as arrays for compiled batches."""

import os
from typing import NamedTuple

import clarabel
import numpy as np
from pivoting.controller import WrenchProblem
from pivoting.controller.kernels.compilation import kernel
from pivoting.controller.kernels.interior_point import contact_wrench
from pivoting.controller.kernels.newton_polish import polish
from pivoting.controller.kernels.planar_closed_form import balancing_wrench, planar_wrench, reduce
from pivoting.controller.kernels.spatial_closed_form import spatial_force
from pivoting.controller.kernels.workspace import opened, workspace
from pivoting.controller.kkt_residual import kkt_residual
from scipy import sparse

PROBLEMS = int(os.environ.get("PIVOTING_PROBLEMS", "5000"))  # that are drawn; `make evidence` asks for 20,000
RARE = 3 * PROBLEMS // 200  # of them, that each piece of the cone is to be met in at least
SETS = ("scattered", "line", "point", "face", "plane", "edge")
PIECES = ("inside", "edge", "floor", "rim", "apex")


class Data(NamedTuple):
    """One problem's arrays, or (with a leading axis) those of many."""

    jacobian: np.ndarray
    required: np.ndarray
    Q_w: np.ndarray
    Q_f: np.ndarray
    mu: np.ndarray
    f_min: np.ndarray


def weight(rng: np.random.Generator, size: int, decades: float) -> np.ndarray:
    """A full symmetric positive definite matrix with a condition number of up to 10^decades."""
    axes, _ = np.linalg.qr(rng.normal(size=(size, size)))
    spread = rng.uniform(0.0, decades)
    values = 10.0 ** np.concatenate([[0.0, spread], rng.uniform(0.0, spread, size - 2)])
    matrix = (axes * values) @ axes.T * 10.0 ** rng.uniform(-1.0, 1.0)
    return 0.5 * (matrix + matrix.T)


def rotation(rng: np.random.Generator) -> np.ndarray:
    """(3, 3), uniform."""
    axes, upper = np.linalg.qr(rng.normal(size=(3, 3)))
    axes = axes * np.sign(np.diag(upper))
    return axes * np.linalg.det(axes)


def wedge(r: np.ndarray) -> np.ndarray:
    """r x f = wedge(r) f in space, (1, 2) in the plane (erratum 3 of the notes)."""
    if r.size == 2:
        return np.array([[-r[1], r[0]]])
    return np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])


def contact_points(rng: np.random.Generator, K: int, dim: int, kind: str) -> np.ndarray:
    """(K, dim): scattered, on a line, all at one point, corners of a face, in a plane, or two points repeated."""
    size = 10.0 ** rng.uniform(-2.0, 0.5)
    centre, sides = rng.normal(size=dim) * size, rng.normal(size=(2, dim)) * size
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])[np.arange(K) % 4]
    spans = {
        "scattered": rng.normal(size=(K, dim)) * size,
        "line": np.linspace(-1.0, 1.0, K)[:, None] * sides[0] if K > 1 else np.zeros((1, dim)),
        "point": np.zeros((K, dim)),
        "face": corners @ sides,
        "plane": rng.normal(size=(K, 2)) @ sides,
        "edge": corners[:, :1] * sides[0],
    }
    return centre + spans[kind]


def draw(rng: np.random.Generator, K: int, dim: int = 3, *, kind: str | None = None, decades: float = 6.0) -> Data:
    """Any pose and lever, one contact plane or several, full weights, mu 0.05 to 1.5, with and without floors."""
    points = contact_points(rng, K, dim, kind or SETS[rng.integers(len(SETS))])
    shared = rng.random() < 0.7
    columns: list[np.ndarray] = []
    up = np.zeros(dim)
    for i in range(K):
        if i == 0 or not shared:
            if dim == 3:
                R = rotation(rng)
            else:
                angle = rng.uniform(-np.pi, np.pi)
                R = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
            up = up if i else R[:, -1]
        columns.append(np.vstack([R, wedge(points[i]) @ R]))
    nw = 3 * dim - 3
    required = rng.normal(size=nw) * 10.0 ** rng.uniform(-2.0, 3.0)
    if rng.random() < 0.5:  # otherwise half of all loads would only lift off
        required[:dim] += up * np.linalg.norm(required) * rng.uniform(0.0, 3.0)
    floors = 10.0 ** rng.uniform(-1.0, 2.0, K) * (rng.random(K) < 0.5) * (rng.random() < 0.7)
    mu = np.exp(rng.uniform(np.log(0.05), np.log(1.5), K))
    return Data(np.hstack(columns), required, weight(rng, nw, decades), weight(rng, K * dim, decades), mu, floors)


def stated(data: Data) -> WrenchProblem:
    """The same as a WrenchProblem."""
    return WrenchProblem(data.jacobian, data.required, data.mu, f_min=data.f_min, Q_w=data.Q_w, Q_f=data.Q_f)


def trivial_cost(problem: WrenchProblem) -> float:
    """Of the answer that always exists, f = (0, f_min): the scale of terms that may cancel to little."""
    f = np.zeros((problem.contacts, problem.dim))
    f[:, -1] = problem.f_min
    return problem.objective(problem.required - problem.jacobian @ f.ravel(), f)


def stack(problems: list[Data]) -> Data:
    """Many problems of one shape, leading axis first."""
    return Data(*(np.ascontiguousarray(np.array(arrays)) for arrays in zip(*problems, strict=True)))


class Answers(NamedTuple):
    """force (N, K d), wrench (N, nw), residual (N,), piece (N, K) as an index of PIECES."""

    force: np.ndarray
    wrench: np.ndarray
    residual: np.ndarray
    piece: np.ndarray


def solve_all(many: Data) -> Answers:
    """All problems through the compiled entry, in one compiled loop."""
    N, nw, n = many.jacobian.shape
    K = many.mu.shape[1]
    force, wrench, residual = np.empty((N, n)), np.empty((N, nw)), np.empty(N)
    _loop(*many, force, wrench, residual, *workspace(nw, K, n // K))
    return Answers(force, wrench, residual, _pieces(many, force.reshape(N, K, -1)))


def _pieces(many: Data, force: np.ndarray) -> np.ndarray:
    """(N, K) the piece of its cone that each force (N, K, d) is on, as an index of PIECES."""
    normal, size = force[..., -1], np.linalg.norm(force[..., :-1], axis=-1)
    edge = size >= many.mu * normal * (1.0 - 1e-9)
    floor = (many.f_min > 0.0) & (normal <= many.f_min * (1.0 + 1e-9))
    names = np.select([~normal.astype(bool), edge & floor, floor, edge], ["apex", "rim", "floor", "edge"], "inside")
    return np.array([[PIECES.index(name) for name in row] for row in names])


@kernel
def _loop(J, b, Q_w, Q_f, mu, f_min, f, w, residual, planar, several):  # type: ignore[no-untyped-def]
    for i in range(J.shape[0]):
        if planar is not None:
            residual[i] = planar_wrench(J[i], b[i], Q_w[i], Q_f[i], mu[i], f_min[i], f[i], w[i], planar)
        if several is not None:
            residual[i] = contact_wrench(J[i], b[i], Q_w[i], Q_f[i], mu[i], f_min[i], f[i], w[i], several)


def closed_form_residuals(many: Data) -> np.ndarray:
    """(N,) residuals of one contact in space by closed form and polish alone."""
    out = np.empty(len(many.required))
    _closed_form(*many, out, np.empty(3), np.empty(6), workspace(6, 1, 3)[1])
    return out


@kernel
def _closed_form(J, b, Q_w, Q_f, mu, f_min, residual, f, w, scratch):  # type: ignore[no-untyped-def]
    work = opened(scratch, mu.shape[1])
    for i in range(J.shape[0]):
        reduce(J[i], b[i], Q_w[i], Q_f[i], work.H, work.h, work.x)
        work.piece[0] = spatial_force(work.H, work.h, mu[i, 0], f_min[i, 0], f)
        balancing_wrench(J[i], b[i], f, w)
        polish(J[i], Q_w[i], Q_f[i], work.H, mu[i], f_min[i], work.axes, work.piece, f, w, work, None)
        residual[i] = kkt_residual(J[i], b[i], Q_w[i], Q_f[i], mu[i], f_min[i], w, f, work.pull)


def whitened_objective(problem: WrenchProblem) -> float:
    """The optimum's cost by Clarabel alone, as the least distance to the cones from g, the optimum without them.

    With f = L^-T y, H = Q_f + J'Q_w J = L L', g = L^-1 J'Q_w b the cost is 1/2 |y - g|^2 and what g itself costs, a sum
    of squares. In 1/2 |y|^2 - g'y + 1/2 b'Q_w b all but a millionth may cancel, and Clarabel's gap, relative to such a
    term, says little of the optimum. So g is the origin, and the unit, from a first answer of Clarabel's, such that
    the optimum is 1/2: the gap of 1e-10 is then one of the optimum. nan where Clarabel does not say that it got there.
    """
    n, K = problem.jacobian.shape[1], problem.contacts
    J, b, Q_w = problem.jacobian, problem.required, problem.Q_w
    back = np.linalg.inv(np.linalg.cholesky(problem.Q_f + J.T @ Q_w @ J)).T
    g = back.T @ (J.T @ Q_w @ b)
    floors = [i for i in range(K) if problem.f_min[i] > 0.0]
    rows, sides, cones = [], [], []  # rows y + (slack in cones) = sides
    for i in floors:
        size = np.linalg.norm(back[3 * i + 2])
        rows.append(-back[3 * i + 2] / size)
        sides.append(-problem.f_min[i] / size)
    if floors:
        cones.append(clarabel.NonnegativeConeT(len(floors)))
    for i in range(K):
        cone = -np.array([problem.mu_planned[i] * back[3 * i + 2], back[3 * i], back[3 * i + 1]])
        rows += list(cone / np.abs(cone).max())
        sides += [0.0] * 3
        cones.append(clarabel.SecondOrderConeT(3))
    A, room = np.array(rows), np.array(sides) - np.array(rows) @ g
    unit = float(np.abs(g).max()) or 1.0
    cost, converged = float("nan"), False
    for tolerance in (1e-8, 1e-10):
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
        settings.tol_infeas_abs = settings.tol_infeas_rel = 1e-14  # a small load under great floors is not infeasible
        settings.max_step_fraction = 0.95
        found = clarabel.DefaultSolver(
            sparse.csc_matrix(np.eye(n)), np.zeros(n), sparse.csc_matrix(A), room / unit, cones, settings
        ).solve()
        f = back @ (g + unit * np.array(found.x))
        cost = problem.objective(b - J @ f, f)
        converged = str(found.status) == "Solved"
        unit = np.sqrt(2.0 * cost) or 1.0
    return cost if converged else float("nan")
