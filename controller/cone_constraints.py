"""Friction cones and bounds on the wrench, written as the constraint rows of a conic program."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.friction_pyramid import polygon
from pivoting.controller.validate import Array
from pivoting.controller.wrench_bounds import WrenchBounds

Flags = NDArray[np.bool_]
UNBOUNDED = 1e3  # of the weight: in place of a bound on the change from a wrench that is not known


class ConeConstraints(NamedTuple):
    """Linear and second-order cone constraints on a wrench or on contact forces x.

    They are linear_side - linear x >= 0, and cone_side - cone x in second-order cones of the sizes `orders`. In rows
    that are marked in `linear_rate` or `cone_rate`, x is the change since the previous step; `rated` says whether there
    are such rows.
    """

    linear: Array
    linear_side: Array
    linear_rate: Flags
    cone: Array
    cone_side: Array
    cone_rate: Flags
    orders: tuple[int, ...]
    rated: bool

    def place(self, sides: Array, first: tuple[int, int], before: Array | None) -> None:
        """Write the right-hand sides of a program's first step, whose changes are counted from the wrench `before`.

        Args:
            sides: the right-hand sides of the program.
            first: where the linear rows and the cone rows of its first step begin.
            before: (nw,) the wrench before the first step; None if it is not known.
        """
        if not self.rated:
            return
        for begin, rows, side, rate in (
            (first[0], self.linear, self.linear_side, self.linear_rate),
            (first[1], self.cone, self.cone_side, self.cone_rate),
        ):
            if before is None:
                sides[begin : begin + len(side)] = np.where(rate & (side > 0.0), UNBOUNDED, side)
            else:
                sides[begin : begin + len(side)] = side + rate * (rows @ before)


def friction_limits(mu: Array, floors: Array, dim: int, edges: int = 0, apex: Array | None = None) -> ConeConstraints:
    """The truncated friction cones |f_t| <= mu f_n, f_n >= floor of K contacts, as constraints on forces (K d,).

    For each contact the linear rows contain its floor and then the flat sides of its cone. In the plane a cone has two
    sides. In space they are the faces of the inscribed pyramid with this number of `edges`; with 0 edges the round cone
    itself is a second-order cone. The sides of all further cones come last.

    Args:
        apex: (V, K, d) of the V cones of each contact [N]; None: one at 0.
    """
    K, second_order = len(mu), dim == 3 and not edges
    faces = np.zeros((0, 2))
    if dim == 2:
        faces = np.array([[1.0], [-1.0]])
    elif edges:
        faces = polygon(edges).facets
    tall = 1 + len(faces)  # half-lines of a contact
    linear, side = np.zeros((K * tall, K * dim)), np.zeros(K * tall)
    cone = np.zeros((K * dim * second_order, K * dim))
    side[::tall] = -floors
    for i, friction in enumerate(mu.tolist()):
        floor, normal = tall * i, dim * (i + 1) - 1
        linear[floor, normal] = -1.0
        linear[floor + 1 : floor + tall, dim * i : normal] = faces
        linear[floor + 1 : floor + tall, normal] = -friction
        if second_order:
            cone[dim * i, normal] = -friction
            cone[dim * i + 1, normal - 2] = cone[dim * i + 2, normal - 1] = -1.0
    tips = np.zeros((1, K * dim)) if apex is None else apex.reshape(len(apex), K * dim)
    sides = np.arange(len(side)) % tall > 0
    side[sides] = linear[sides] @ tips[0]
    linear = np.concatenate([linear, *[linear[sides]] * (len(tips) - 1)])
    side = np.concatenate([side, *(linear[: K * tall][sides] @ tip for tip in tips[1:])])
    cone, cone_side = np.concatenate([cone] * len(tips)), np.concatenate([cone @ tip for tip in tips])
    still = np.zeros(len(linear), dtype=bool), np.zeros(len(cone), dtype=bool)
    orders = (dim,) * K * len(tips) if second_order else ()
    return ConeConstraints(linear, side, still[0], cone, cone_side, still[1], orders, False)


def wrench_limits(bounds: WrenchBounds, nw: int, edges: int, unit: Array, h: float) -> ConeConstraints:
    """Bounds as constraints on a wrench (nw,), expressed in units (nw,), and on its change over a step of `h` [s].

    A bound on the length of two components is a disc. With `edges` > 0 the inscribed polygon replaces it.
    """
    linear: list[Array] = []
    cone: list[Array] = []
    sides: tuple[list[float], list[float]] = ([], [])
    rates: tuple[list[bool], list[bool]] = ([], [])
    orders = []
    for ball in bounds.balls(nw):
        kept = np.flatnonzero(np.abs(ball.rows).max(axis=0))
        scale = float(unit[kept[0]])
        radius = ball.radius * (h if ball.rate else 1.0) / scale
        rows = ball.rows * unit / scale
        if len(rows) == 1 or (len(rows) == 2 and edges):
            facets = np.array([[1.0], [-1.0]]) if len(rows) == 1 else polygon(edges).facets
            linear += list(facets @ rows)
            sides[0].extend([radius] * len(facets))
            rates[0].extend([ball.rate] * len(facets))
        else:
            cone += [np.zeros(nw), *-rows]
            sides[1].extend([radius] + [0.0] * len(rows))
            rates[1].extend([ball.rate] * (len(rows) + 1))
            orders.append(len(rows) + 1)
    return ConeConstraints(
        np.reshape(linear, (-1, nw)), np.array(sides[0]), np.array(rates[0], dtype=bool),
        np.reshape(cone, (-1, nw)), np.array(sides[1]), np.array(rates[1], dtype=bool), tuple(orders),
        bounds.rated,
    )  # fmt: skip


def cone_slack(force: Array, apex: Array, mu: Array, floors: Array) -> float:
    """The least of f_n - |f_t| / mu and f_n - f_min of contact forces (K, d), all along the normals [N].

    Args:
        apex: (V, K, d) from which the forces count in each of the cones.  mu: (K,).  floors: (K,), from 0 [N].
    """
    above = force - apex
    along = np.linalg.norm(above[..., :-1], axis=-1) / mu
    return float(min((above[..., -1] - along).min(), (force[:, -1] - floors).min()))
