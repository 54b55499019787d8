"""The optimum for one contact in space, in closed form up to one scalar root of a concave function.

min 1/2 f'H f - h'f over {|(f_t, f_o)| <= mu f_n, f_n >= f_min}. With H = L L' and D = diag(1, 1, -mu^2), the
eigenvectors V of L^-1 D L^-T turn it (y = V'L'f) into the projection of a point onto an elliptic cone
{k_1 y_1^2 + k_2 y_2^2 <= y_3^2, y_3 >= 0}, whose only unknown is t = y_3 > 0. The equations (H + lambda D) f = h are
equivalent, but in lambda they have a pole, and a hard case at h_3 = 0; in t they have neither.
"""

import numpy as np
from pivoting.controller.kernels.compilation import subroutine

INSIDE, EDGE, FLOOR, RIM, APEX = 0, 1, 2, 3, 4  # the pieces of a truncated cone
SWEEPS, ROOTS = 12, 40  # bounds of the two iterations, which need about 4 each


@subroutine
def spatial_force(H, h, mu, f_min, f):  # type: ignore[no-untyped-def]
    """Write the minimiser (f_t, f_o, f_n) into f (3,) and return its piece.

    The result is accurate to about eps cond(H); `polish` improves it to rounding.
    """
    h0, h1, h2 = h[0], h[1], h[2]
    l00 = np.sqrt(H[0, 0])
    l10, l20 = H[1, 0] / l00, H[2, 0] / l00
    l11 = np.sqrt(H[1, 1] - l10 * l10)
    l21 = (H[2, 1] - l20 * l10) / l11
    l22 = np.sqrt(H[2, 2] - l20 * l20 - l21 * l21)
    g0 = h0 / l00  # L^-1 h
    g1 = (h1 - l10 * g0) / l11
    g2 = (h2 - l20 * g0 - l21 * g1) / l22
    f[2] = g2 / l22  # the free minimum
    f[1] = (g1 - l21 * f[2]) / l11
    f[0] = (g0 - l10 * f[1] - l20 * f[2]) / l00
    piece = INSIDE
    if np.hypot(f[0], f[1]) > mu * f[2]:
        if -h2 >= mu * np.hypot(h0, h1):
            f[0] = f[1] = f[2] = 0.0
            piece = APEX
        else:
            # Rows of L^-1, for C = L^-1 D L^-T.
            a00, a11, a22 = 1.0 / l00, 1.0 / l11, 1.0 / l22
            a10 = -l10 * a00 * a11
            a20, a21 = -(l20 * a00 + l21 * a10) * a22, -l21 * a11 * a22
            c00, c01, c02 = a00 * a00, a00 * a10, a00 * a20
            c11, c12 = a10 * a10 + a11 * a11, a10 * a20 + a11 * a21
            c22 = a20 * a20 + a21 * a21 - (mu * a22) ** 2
            _edge(c00, c01, c02, c11, c12, c22, g0, g1, g2, f)
            f[2] *= a22
            f[1] = (f[1] - l21 * f[2]) * a11
            f[0] = (f[0] - l10 * f[1] - l20 * f[2]) * a00
            piece = EDGE
            shrink = mu * f[2] / np.hypot(f[0], f[1])
            f[0] *= shrink
            f[1] *= shrink
    if f[2] >= f_min:
        return piece
    if not np.isfinite(f[0] + f[1] + f[2]):
        f[0] = f[1] = f[2] = np.nan
        return piece
    if f_min == 0.0:  # an apex up to rounding
        f[0] = f[1] = f[2] = 0.0
        return APEX
    # The optimum of the whole cone is below the floor, so by convexity the optimum lies on the floor.
    f[2] = f_min
    return _disc(
        H[0, 0], H[0, 1], H[1, 1], h0 - H[0, 2] * f_min, h1 - H[1, 2] * f_min, mu * f_min, f
    )  # fmt: skip


@subroutine
def _edge(c00, c01, c02, c11, c12, c22, g0, g1, g2, y):  # type: ignore[no-untyped-def]
    """Write into y (3,) the point of the cone {y'C y <= 0, upper half} that is nearest to g, a point outside."""
    v00 = v11 = v22 = 1.0
    v01 = v02 = v10 = v12 = v20 = v21 = 0.0
    for _ in range(SWEEPS):  # Jacobi: rotate the off-diagonal entries away, one after another
        if abs(c01) + abs(c02) + abs(c12) <= 1e-15 * min(abs(c00), abs(c11), abs(c22)):
            break
        c, s = _rotation(c00, c01, c11)
        c00, c11, c01 = c00 - s / c * c01, c11 + s / c * c01, 0.0
        c02, c12 = c * c02 - s * c12, s * c02 + c * c12
        v00, v01 = c * v00 - s * v01, s * v00 + c * v01
        v10, v11 = c * v10 - s * v11, s * v10 + c * v11
        v20, v21 = c * v20 - s * v21, s * v20 + c * v21
        c, s = _rotation(c00, c02, c22)
        c00, c22, c02 = c00 - s / c * c02, c22 + s / c * c02, 0.0
        c01, c12 = c * c01 - s * c12, s * c01 + c * c12
        v00, v02 = c * v00 - s * v02, s * v00 + c * v02
        v10, v12 = c * v10 - s * v12, s * v10 + c * v12
        v20, v22 = c * v20 - s * v22, s * v20 + c * v22
        c, s = _rotation(c11, c12, c22)
        c11, c22, c12 = c11 - s / c * c12, c22 + s / c * c12, 0.0
        c01, c02 = c * c01 - s * c02, s * c01 + c * c02
        v01, v02 = c * v01 - s * v02, s * v01 + c * v02
        v11, v12 = c * v11 - s * v12, s * v11 + c * v12
        v21, v22 = c * v21 - s * v22, s * v21 + c * v22
    # C has one negative eigenvalue: the cone's axis. Put it last.
    if c00 <= c11 and c00 <= c22:
        c00, c22 = c22, c00
        v00, v10, v20, v02, v12, v22 = v02, v12, v22, v00, v10, v20
    elif c11 <= c22:
        c11, c22 = c22, c11
        v01, v11, v21, v02, v12, v22 = v02, v12, v22, v01, v11, v21
    if v22 < 0.0:  # f_n = y_n / l22: the upper half is the one where the axis points up
        v02, v12, v22 = -v02, -v12, -v22
    p0 = v00 * g0 + v10 * g1 + v20 * g2
    p1 = v01 * g0 + v11 * g1 + v21 * g2
    p2 = v02 * g0 + v12 * g1 + v22 * g2
    k0, k1 = max(c00 / -c22, 0.0), max(c11 / -c22, 0.0)
    t = _nearest(np.sqrt(k0) * abs(p0), k0, np.sqrt(k1) * abs(p1), k1, p2)
    q0, q1 = p0 * t / (t + k0 * (t - p2)), p1 * t / (t + k1 * (t - p2))
    y[0] = v00 * q0 + v01 * q1 + v02 * t
    y[1] = v10 * q0 + v11 * q1 + v12 * t
    y[2] = v20 * q0 + v21 * q1 + v22 * t


@subroutine
def _rotation(a, b, d):  # type: ignore[no-untyped-def]
    """(cos, sin) of the Jacobi rotation that diagonalises [[a, b], [b, d]]."""
    if b == 0.0:
        return 1.0, 0.0
    tau = 0.5 * (d - a) / b
    t = 1.0 / (abs(tau) + np.hypot(1.0, tau))
    if tau < 0.0:
        t = -t
    c = 1.0 / np.sqrt(1.0 + t * t)
    return c, t * c


@subroutine
def _nearest(a0, k0, a1, k1, p):  # type: ignore[no-untyped-def]
    """t > max(p, 0) with (a0 / x0)^2 + (a1 / x1)^2 = 1, x_i = t + k_i (t - p).

    1 / |(a0 / x0, a1 / x1)| is concave and increasing in t (a power mean of affine functions), so that Newton on it
    climbs to its root from the left and cannot overshoot.
    """
    t = max(max(p, 0.0), max((a0 + k0 * p) / (1.0 + k0), (a1 + k1 * p) / (1.0 + k1)))
    for _ in range(ROOTS):
        x0, x1 = t + k0 * (t - p), t + k1 * (t - p)
        u0, u1 = a0 / x0, a1 / x1
        size = u0 * u0 + u1 * u1
        slope = u0 * u0 * (1.0 + k0) / x0 + u1 * u1 * (1.0 + k1) / x1
        step = (np.sqrt(size) - 1.0) * size / slope
        if not step > 1e-15 * t:  # also when nan
            break
        t += step
    return t


@subroutine
def _disc(a, b, d, g0, g1, radius, f):  # type: ignore[no-untyped-def]
    """Write the minimiser of 1/2 p'[[a, b], [b, d]] p - g'p over |p| <= radius into f[:2]; return FLOOR or RIM."""
    det = a * d - b * b
    f[0], f[1] = (g0 * d - g1 * b) / det, (g1 * a - g0 * b) / det
    if np.hypot(f[0], f[1]) <= radius:
        return FLOOR
    c, s = _rotation(a, b, d)
    e0, e1 = a - s / c * b, d + s / c * b
    p0, p1 = c * g0 - s * g1, s * g0 + c * g1
    # (e_i + x) y_i = p_i with |y| = radius: the secular equation of a trust region, concave in x as `_nearest` is in t.
    x = max(0.0, max(abs(p0) / radius - e0, abs(p1) / radius - e1))
    for _ in range(ROOTS):
        y0, y1 = p0 / (e0 + x), p1 / (e1 + x)
        size = y0 * y0 + y1 * y1
        step = (np.sqrt(size) / radius - 1.0) * size / (y0 * y0 / (e0 + x) + y1 * y1 / (e1 + x))
        if not step > 1e-15 * (x + max(e0, e1)):
            break
        x += step
    y0, y1 = p0 / (e0 + x), p1 / (e1 + x)
    shrink = radius / np.hypot(y0, y1)
    f[0], f[1] = shrink * (c * y0 + s * y1), shrink * (c * y1 - s * y0)
    return RIM
