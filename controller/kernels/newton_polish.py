"""The polish: Newton's method on the optimality conditions, once it is known on which piece of its cone each force is.

On its piece a contact force is a smooth function of its coordinates: (f_t, f_o, f_n) inside, (f_n, arc) on the edge
f = f_n (mu u, 1), (f_t, f_o) on the floor, the arc on the floor's rim, nothing at the apex. In the plane u = +-1 and
there are no arcs. Newton's method then converges quadratically to a point whose residual is a few units of rounding.
"""

import numpy as np
from pivoting.controller.kernels.cholesky import factor, solve_factored
from pivoting.controller.kernels.compilation import subroutine
from pivoting.controller.kernels.spatial_closed_form import APEX, EDGE, FLOOR, INSIDE, RIM

STEPS = 12  # bound of the Newton steps; 2 or 3 suffice once the pieces are right


@subroutine
def gradient(J, Q_w, Q_f, w, f, pull, z, linear):  # type: ignore[no-untyped-def]
    """Write Q_w w into pull[0] (nw,) and Q_f f + linear - J'Q_w w, the gradient of the cost along f, into z (n,)."""
    nw, n = J.shape
    for i in range(nw):
        value = 0.0
        for j in range(nw):
            value += Q_w[i, j] * w[j]
        pull[0, i] = value
    for j in range(n):
        z[j] = 0.0
    if linear is not None:  # a branch that the compiler decides
        for j in range(n):
            z[j] = linear[j]
    for i in range(n):  # rows on the outside: contiguous, so that it vectorises; Q_f is symmetric
        value = f[i]
        for j in range(n):
            z[j] += Q_f[i, j] * value
    for i in range(nw):
        value = pull[0, i]
        for j in range(n):
            z[j] -= J[i, j] * value


@subroutine
def polish(J, Q_w, Q_f, H, mu, f_min, axes, piece, f, w, work, linear):  # type: ignore[no-untyped-def]
    """Improve f (n,) and w (nw,) in place on the pieces `piece` (K,) int, which a blocked step may change.

    The wrench is updated as w - J (change of f) and not recomputed as b - J f. Where w is the small difference of two
    large terms, the gradient Q_f f - J'Q_w w would otherwise contain only their rounding.

    Args:
        H: (n, n) = Q_f + J'Q_w J, see `reduce`.
        work: `Work`; M, x, z, pull, tangent, start and moved are used.
    """
    dim = len(axes)
    K = mu.shape[0]
    M, x, z, tangent, start, moved = work.M, work.x, work.z, work.tangent, work.start, work.moved
    for i in range(K):
        for p in range(i * dim, (i + 1) * dim):
            moved[p] = f[p]
        _land(mu[i], f_min[i], axes, piece, i, f[i * dim : (i + 1) * dim])
    _carry(J, f, moved, w)
    for _ in range(STEPS):
        gradient(J, Q_w, Q_f, w, f, work.pull, z, linear)
        m = 0
        for i in range(K):
            start[i] = m
            m += _tangents(mu[i], axes, piece[i], i * dim, f, tangent)
        start[K] = m
        if m == 0:
            return
        for i in range(K):  # M = T'H T, upper triangle, and x = -T'z
            for a in range(start[i], start[i + 1]):
                value = 0.0
                for p in range(dim):
                    value -= tangent[i * dim + p, a - start[i]] * z[i * dim + p]
                x[a] = value
            for k in range(i, K):
                for a in range(start[i], start[i + 1]):
                    for c in range(start[k], start[k + 1]):
                        value = 0.0
                        for p in range(dim):
                            row = 0.0
                            for q in range(dim):
                                row += H[i * dim + p, k * dim + q] * tangent[k * dim + q, c - start[k]]
                            value += tangent[i * dim + p, a - start[i]] * row
                        M[a, c] = value
            if dim == 3 and (piece[i] == EDGE or piece[i] == RIM):  # the cone's own curvature along the arc
                radius = np.hypot(f[3 * i], f[3 * i + 1])
                out = -(z[3 * i] * f[3 * i] + z[3 * i + 1] * f[3 * i + 1]) / (radius * radius)
                arc = start[i + 1] - 1
                M[arc, arc] += max(out, 0.0)
        factor(M, m)
        solve_factored(M, x, m)
        size = step = 0.0
        changed = False
        for i in range(K):
            for p in range(i * dim, (i + 1) * dim):
                moved[p] = f[p]
            changed |= _move(mu[i], f_min[i], axes, piece, i, start[i], x, tangent, f)
            for p in range(i * dim, (i + 1) * dim):
                size = max(size, abs(f[p]))
                step = max(step, abs(f[p] - moved[p]))
        _carry(J, f, moved, w)
        if not changed and not step > 1e-9 * size:  # the next step would be its square; also when nan
            return


@subroutine
def _carry(J, f, before, w):  # type: ignore[no-untyped-def]
    """w -= J (f - before)."""
    for i in range(J.shape[0]):
        value = 0.0
        for j in range(J.shape[1]):
            value += J[i, j] * (f[j] - before[j])
        w[i] -= value


@subroutine
def _tangents(mu, axes, piece, at, f, tangent):  # type: ignore[no-untyped-def]
    """Write d f / d coordinates of the contact at rows at, at + 1, ... of tangent (n, dim); return how many."""
    dim = len(axes)
    n = at + dim - 1
    if piece == APEX:
        return 0
    if piece in (INSIDE, FLOOR):
        m = dim if piece == INSIDE else dim - 1
        for p in range(dim):
            for q in range(m):
                tangent[at + p, q] = 1.0 if p == q else 0.0
        return m
    size = np.hypot(f[at], f[at + 1]) if dim == 3 else abs(f[at])
    if piece == EDGE:
        for p in range(at, n):
            tangent[p, 0] = mu * f[p] / size
        tangent[n, 0] = 1.0
    if dim == 2:
        return 1 if piece == EDGE else 0
    arc = 1 if piece == EDGE else 0
    tangent[at, arc], tangent[at + 1, arc], tangent[n, arc] = -f[at + 1] / size, f[at] / size, 0.0
    return arc + 1


@subroutine
def _move(mu, f_min, axes, piece, i, first, x, tangent, f):  # type: ignore[no-untyped-def]
    """Move contact i by its step x[first:]; True where it changed its piece, being stopped by another one."""
    dim = len(axes)
    at, n, kind = i * dim, i * dim + dim - 1, piece[i]
    if kind == APEX or (kind == RIM and dim == 2):
        return False
    if kind in (INSIDE, FLOOR):
        for p in range(dim if kind == INSIDE else dim - 1):
            f[at + p] += x[first + p]
    else:
        arc = first + 1 if kind == EDGE else first
        if dim == 3:
            size = np.hypot(f[at], f[at + 1])
            turn = min(max(x[arc] / size, -1.0), 1.0)
            f[at], f[at + 1] = f[at] - turn * f[at + 1], f[at + 1] + turn * f[at]
        if kind == EDGE:
            f[n] += x[first]
    return _land(mu, f_min, axes, piece, i, f[at : at + dim])


@subroutine
def _land(mu, f_min, axes, piece, i, force):  # type: ignore[no-untyped-def]
    """Put a force (dim,) exactly on its piece; True where that is not the piece it was on, which it left."""
    dim = len(axes)
    kind, n = piece[i], dim - 1
    size = np.hypot(force[0], force[1]) if dim == 3 else abs(force[0])
    if kind in (INSIDE, EDGE) and force[n] <= f_min:
        kind = APEX if f_min == 0.0 else RIM if kind == EDGE else FLOOR
    if kind == INSIDE and size > mu * force[n]:
        kind = EDGE
    elif kind == FLOOR and size > mu * f_min:
        kind = RIM
    elif kind in (EDGE, RIM) and size == 0.0:  # it has no direction to keep
        kind = INSIDE if kind == EDGE else FLOOR
    if kind == APEX:
        for p in range(dim):
            force[p] = 0.0
    elif kind in (FLOOR, RIM):
        force[n] = f_min
    if kind in (EDGE, RIM):
        for p in range(n):
            force[p] *= mu * force[n] / size
    changed = kind != piece[i]
    piece[i] = kind
    return changed


@subroutine
def release(mu, axes, piece, f, z):  # type: ignore[no-untyped-def]
    """Leave the pieces whose multipliers have the wrong sign (z (n,) is the gradient); True if there was one."""
    dim = len(axes)
    changed = False
    for i in range(mu.shape[0]):
        at, n, kind = i * dim, i * dim + dim - 1, piece[i]
        size = pull = sideways = 0.0
        for p in range(at, n):
            size += f[p] * f[p]
            pull -= z[p] * f[p]
            sideways += z[p] * z[p]
        pull = pull / np.sqrt(size) if size > 0.0 else 0.0  # of the friction bound
        if (kind == EDGE and pull < 0.0) or (kind == FLOOR and z[n] < 0.0):
            piece[i] = INSIDE
        elif kind == RIM and pull < 0.0:
            piece[i] = FLOOR
        elif (kind == RIM and z[n] < mu[i] * pull) or (kind == APEX and z[n] < mu[i] * np.sqrt(sideways)):
            piece[i] = EDGE
        changed |= piece[i] != kind
    return changed
