"""Whether any wrench within bounds will do: an answer that arithmetic checks, either way.

Sought are contact forces f and a wrench w with

    J f + w = required,   f in all friction cones and above all floors,   w within its bounds.

Solved is the program that asks how much all inequalities have to be relaxed, or can be tightened, at once:

    min t   s.t.   A x + s = b + t e,   s in the cones,   t >= -1,   e = 1 for a half-line, (1, 0, ...) for a round cone

It always has an answer, in the interior of the cones, and so have its multipliers y: A'y = 0, e'y <= 1. Where t > 0
they prove that nothing will do, since y'b = -t (Farkas). Where t < 0 the forces will do, with something to spare.
Neither is believed of the solver: the forces are put into the constraints, and the multipliers into the inequality.
"""

from typing import NamedTuple

import numpy as np
from pivoting.controller.cone_constraints import friction_limits, wrench_limits
from pivoting.controller.solvers.block_matrix import BlockMatrix, Part, Sparse
from pivoting.controller.solvers.clarabel_backend import ClarabelWithRetry
from pivoting.controller.solvers.conic_program import Cones, ConicProgram
from pivoting.controller.uncertainty.farkas_certificate import FarkasCertificate
from pivoting.controller.validate import Array, frozen
from pivoting.controller.wrench_bounds import WrenchBounds
from pivoting.controller.wrench_problem import WrenchProblem

MOST = 1e3  # of the load: normal forces that are considered, where bounds do not limit them
YES, NO, UNDECIDED = "yes", "no", "undecided"


class Feasibility(NamedTuple):
    """Whether any wrench will do.

    Attributes:
        answer: "yes", "no", or "undecided", where arithmetic accepts neither, as it happens to problems on the border.
        margin: by how much all inequalities can be tightened at once [N], moments at the contacts' lever, at most the
            load; negative: by how much they would have to be relaxed. nan: the solver found nothing.
        wrench: (nw,) object axes [N, N m] and force: (K, d) contact axes [N], of one that will do; None if not "yes".
        certificate: that nothing will do; None if not "no".
    """

    answer: str
    margin: float
    wrench: Array | None = None
    force: Array | None = None
    certificate: FarkasCertificate | None = None


class _Stated(NamedTuple):
    """The constraints A x + s = b, in units of force and length; columns of f come first, then w."""

    A: Array
    b: Array
    cones: Cones
    radius: float
    limit: float
    force: float
    length: float


def feasibility(problem: WrenchProblem, bounds: WrenchBounds) -> Feasibility:
    """Whether there is any wrench within bounds that solves a problem; bounds on rates are not considered.

    Args:
        problem: as `WrenchController.problem` makes it; of an uncertain set with the cones of all members.
    """
    stated = _state(problem, bounds)
    n, nw = problem.jacobian.shape[1], len(problem.required)
    answer = ClarabelWithRetry()(_relaxed(stated))
    if not (np.isfinite(answer.x).all() and np.isfinite(answer.z).all()):
        return Feasibility(UNDECIDED, np.nan)
    x, t = answer.x[:-1].copy(), float(answer.x[-1])
    x[n:] = stated.b[:nw] - stated.A[:nw, :n] @ x[:n]
    margin = -t * stated.force
    if _slack(stated, x) >= 0.0:
        force = frozen(stated.force * x[:n].reshape(-1, problem.dim))
        wrench = frozen(problem.required - problem.jacobian @ force.ravel())
        return Feasibility(YES, margin, wrench, force)
    last = stated.cones.zero + stated.cones.linear
    y = _in_dual_cone(np.delete(answer.z, last), stated.cones)
    y[:nw] = -(stated.A[nw:, n:].T @ y[nw:])  # A'y is 0 in the columns of w, to the last bit
    certificate = FarkasCertificate(y, *stated)
    if certificate.holds():
        return Feasibility(NO, margin, certificate=certificate)
    return Feasibility(UNDECIDED, margin)


def _state(problem: WrenchProblem, bounds: WrenchBounds) -> _Stated:
    """The constraints in units of the load."""
    dim, K, nw = problem.dim, problem.contacts, len(problem.required)
    loads = np.concatenate([problem.required[:dim], problem.f_min, problem.apex.ravel()])
    force = float(np.abs(loads).max()) or 1.0
    length = float(np.linalg.norm(problem.jacobian[dim:], axis=0).max()) or 1.0
    unit = force * np.array([1.0] * dim + [length] * (nw - dim))
    J, b = problem.jacobian * force / unit[:, None], problem.required / unit
    apex, floors, mu = problem.apex / force, problem.f_min / force, problem.mu_planned
    still = bounds.without_rates
    own, bound = friction_limits(mu, floors, dim, 0, apex), wrench_limits(still, nw, 0, unit, 1.0)
    sizes, limited = greatest_size(J, b, mu, apex, still, unit)
    normals = np.eye(K * dim)[dim - 1 :: dim] if limited else np.zeros((0, K * dim))
    rows = [
        (J, np.eye(nw)),
        (own.linear, np.zeros((len(own.linear), nw))),
        (normals, np.zeros((len(normals), nw))),
        (np.zeros((len(bound.linear), K * dim)), bound.linear),
        (own.cone, np.zeros((len(own.cone), nw))),
        (np.zeros((len(bound.cone), K * dim)), bound.cone),
    ]
    most = np.full(len(normals), MOST)
    sides = [b, own.linear_side, most, bound.linear_side, own.cone_side, bound.cone_side]
    cones = Cones(nw, len(own.linear) + len(normals) + len(bound.linear), own.orders + bound.orders)
    A = np.concatenate([np.hstack(blocks) for blocks in rows])
    return _Stated(A, np.concatenate(sides), cones, sizes, MOST * force if limited else np.inf, force, length)


def greatest_size(J: Array, b: Array, mu: Array, apex: Array, bounds: WrenchBounds, unit: Array) -> tuple[float, bool]:
    """A bound on |x| = |(f, w)| for all that satisfies the constraints, and whether a limit on f_n is needed for it.

    Let the force F of w be bounded by F_max, and let u be a direction, object axes, in which every force of every
    friction cone points: u . f_i >= c_i f_n,i with c_i = u . n_i - mu_i |u along the contact| > 0. With a_i the apex of
    a cone and f_i = a_i + f'_i, the balance of forces bounds the sum of all c_i f'_n,i by u . (b - F - sum a_i), and so
    each of them: f'_n,i <= (|b - sum a_i| + F_max) / c_i. In a cone, |f'_i| <= sqrt(1 + mu^2) f'_n,i. For one contact,
    u is its normal, and c = 1. For u the mean of all normals is taken.

    Where forces are not bounded, or where contacts can squeeze each other (no c_i > 0), nothing bounds the normal
    forces; then f_n <= MOST is stated as a constraint. Moments follow from the equations, or from their bounds.

    Args:
        J: (nw, K d).  b: (nw,).  mu: (K,).  apex: (V, K, d).  All in units of force and length.
        bounds: without rates, in SI units.  unit: (nw,) of a wrench.
    """
    K, dim = apex.shape[1:]
    each = np.full(len(b), np.inf) if bounds.component is None else bounds.component
    F = min(bounds.force, float(np.linalg.norm(each[:dim]))) / unit[0]
    M = min(bounds.moment, float(np.linalg.norm(each[dim:]))) / unit[-1]
    axes = J[:dim].reshape(dim, K, dim)  # of each contact, as columns
    mean = axes[:, :, -1].mean(axis=1)
    u = mean / max(float(np.linalg.norm(mean)), 1e-300)
    along = np.einsum("a,akj->kj", u, axes)
    share = along[:, -1] - mu * np.linalg.norm(along[:, :-1], axis=1)
    limited = not (np.isfinite(F) and (share > 1e-6).all())
    tips = np.linalg.norm(apex, axis=2)
    if limited:
        across = np.linalg.norm(apex[0, :, :-1], axis=1) + mu * np.maximum(MOST - apex[0, :, -1], 0.0)
        forces = np.hypot(MOST, across)
    else:
        left = np.linalg.norm(b[:dim] - np.einsum("akj,vkj->va", axes, apex), axis=1)  # (V,)
        forces = (tips + np.sqrt(1.0 + mu**2) * (left[:, None] + F) / share)[np.argmin(left)]
    turning = np.linalg.norm(J[dim:].reshape(-1, K, dim), axis=(0, 2)) @ forces
    F = min(F, float(np.linalg.norm(b[:dim]) + forces.sum()))
    M = min(M, float(np.linalg.norm(b[dim:]) + turning))
    return float(np.sqrt(forces @ forces + F**2 + M**2)), limited


def _relaxed(stated: _Stated) -> ConicProgram:
    """The program in (x, t), whose last half-line is t >= -1."""
    zero, linear, orders = stated.cones
    m, n = stated.A.shape
    A, b = np.zeros((m + 1, n + 1)), np.insert(stated.b, zero + linear, 1.0)
    kept = np.delete(np.arange(m + 1), zero + linear)
    A[kept, :n] = stated.A
    A[zero : zero + linear + 1, n] = -1.0
    A[np.cumsum([zero + linear + 1, *orders[:-1]])[: len(orders)], n] = -1.0
    q = np.zeros(n + 1)
    q[n] = 1.0
    P = BlockMatrix((n + 1, n + 1), [_whole(np.zeros((n + 1, n + 1)))])
    return ConicProgram(P.filled(()), q, _sparse(A), b, Cones(zero, linear + 1, orders))


def _sparse(A: Array) -> Sparse:
    return BlockMatrix(A.shape, [_whole(A)]).filled(())


def _whole(A: Array) -> Part:
    rows, columns = A.shape
    return Part(np.arange(rows)[None], np.arange(columns)[None], A != 0.0, A)


def _slack(stated: _Stated, x: Array) -> float:
    """How far the inequalities are from being violated by x; negative where one is."""
    s = stated.b - stated.A @ x
    zero, linear, orders = stated.cones
    least, first = float(s[zero : zero + linear].min(initial=np.inf)), zero + linear
    for order in orders:
        least = min(least, float(s[first] - np.linalg.norm(s[first + 1 : first + order])))
        first += order
    return least


def _in_dual_cone(z: Array, cones: Cones) -> Array:
    """The multipliers, moved into the dual cone where rounding has left them outside."""
    zero, linear, orders = cones
    y, first = z.copy(), zero + linear
    y[zero:first] = np.maximum(y[zero:first], 0.0)
    for order in orders:
        length = float(np.linalg.norm(y[first + 1 : first + order]))
        y[first] = max(y[first], length * (1.0 + 1e-15))
        first += order
    return y
