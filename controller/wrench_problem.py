"""The wrench problem: find the smallest wrench that, with contact forces inside their cones, makes what is required."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pivoting.controller.cone_constraints import friction_limits
from pivoting.controller.friction_pyramid import Polygon, polygon
from pivoting.controller.kkt_residual import kkt_residual
from pivoting.controller.validate import Array, array, fail, for_each, number, positive_definite


class StandardForm(NamedTuple):
    """The notes' standard form: min 1/2 x'P x s.t. A x = b, C x <= d, with x = (f, w) (erratum 1: f comes first)."""

    P: Array
    A: Array
    b: Array
    C: Array
    d: Array


@dataclass(frozen=True, eq=False)
class WrenchProblem:
    """The problem of the smallest wrench w, together with contact forces f, that makes the required wrench.

    min 1/2 w'Q_w w + 1/2 f'Q_f f  s.t.  J f + w = required, each contact force in its truncated friction cone(s).

    Balance, quasi-dynamic and dynamic pivoting are this one problem with different right-hand sides: `required` is
    -m g for balance and M a - m g for motion. In the plane nw = 3 and d = 2, in space nw = 6 and d = 3. Contact forces
    are ordered (f_t, f_n) or (f_t, f_o, f_n), contact after contact; wrenches are (force, moment about the CoM). J and
    `required` are in the same frame, which is that of the object in the notes and in this package.

    The problem is always feasible: f = (0, f_min) is in the cones, and w = required - J f balances it (erratum 6).
    Where forces have to be in the cones for every member of an uncertain set, the members' cones are moved: `apex`.

    Attributes:
        jacobian: (nw, K d) contact Jacobian J_c.
        required: (nw,) the wrench that contacts and applied wrench must make together [N, N m].
        mu: (K,) friction coefficients, > 0.
        f_min: (K,) least normal forces [N], >= 0.
        margin: share of each mu that is kept in reserve, in [0, 1): the cones have (1 - margin) mu.
        Q_w: (nw, nw) and Q_f: (K d, K d), symmetric positive definite weights.
        apex: (V, K, d) where the apex of each contact's cone is, for V cones in all of which the force has to be [N];
            one at 0 unless something is uncertain. The floor counts from 0 all the same.

    Raises:
        ValueError: an argument is not finite, has the wrong shape or is out of range; it is named with its value.
    """

    jacobian: Array
    required: Array
    mu: Array
    f_min: Array
    margin: float
    Q_w: Array
    Q_f: Array
    apex: Array

    def __init__(
        self,
        jacobian: ArrayLike,
        required: ArrayLike,
        mu: ArrayLike,
        *,
        f_min: ArrayLike = 0.0,
        margin: float = 0.0,
        Q_w: ArrayLike | None = None,
        Q_f: ArrayLike | None = None,
        apex: ArrayLike | None = None,
    ):
        J = array("jacobian", jacobian, (None, None))
        nw, n = J.shape
        if nw not in (3, 6):
            raise fail("jacobian", J, "with 3 rows (plane) or 6 rows (space)")
        dim = 2 if nw == 3 else 3
        if n == 0 or n % dim:
            raise fail("jacobian", J, f"with {dim} columns for each contact, at least one contact")
        K = n // dim
        mu_all = for_each("mu", mu, K)
        if (mu_all <= 0.0).any():
            raise fail("mu", mu_all if K > 1 else float(mu_all[0]), "> 0")
        floors = for_each("f_min", f_min, K)
        if (floors < 0.0).any():
            raise fail("f_min", floors if K > 1 else float(floors[0]), ">= 0 [N]")
        put = object.__setattr__
        put(self, "jacobian", J)
        put(self, "required", array("required", required, (nw,)))
        put(self, "mu", mu_all)
        put(self, "f_min", floors)
        put(self, "margin", number("margin", margin, at_least=0.0, below=1.0))
        put(self, "Q_w", positive_definite("Q_w", np.eye(nw) if Q_w is None else Q_w, nw))
        put(self, "Q_f", positive_definite("Q_f", np.eye(n) if Q_f is None else Q_f, n))
        tips = array("apex", np.zeros((1, K, dim)) if apex is None else apex, (None, K, dim))
        if len(tips) == 0:
            raise fail("apex", tips, "of at least one cone for each contact")
        put(self, "apex", tips)

    @property
    def dim(self) -> int:
        """2 in the plane, 3 in space."""
        return 2 if self.jacobian.shape[0] == 3 else 3

    @property
    def contacts(self) -> int:
        """Number of contacts K."""
        return self.jacobian.shape[1] // self.dim

    @cached_property
    def mu_planned(self) -> Array:
        """(K,) friction that the answer may use: (1 - margin) mu."""
        return (1.0 - self.margin) * self.mu

    def objective(self, wrench: Array, force: Array) -> float:
        """The cost 1/2 w'Q_w w + 1/2 f'Q_f f of an answer; force is (K, d) or (K d,)."""
        f = np.ravel(force)
        return float(0.5 * (wrench @ self.Q_w @ wrench + f @ self.Q_f @ f))

    def residual(self, wrench: Array, force: Array, *, edges: int = 0) -> float:
        """The relative KKT residual of an answer, see `kkt_residual.kkt_residual`; nan if the answer is not finite.

        With `edges` > 0 it is the residual of the problem whose cones in space are replaced by inscribed pyramids.

        Raises:
            ValueError: of several cones at one contact, of which only who solves the problem knows the multipliers.
        """
        w, f = np.array(wrench, dtype=float), np.array(force, dtype=float).ravel()
        shape = self._pyramid(edges) if edges else ()
        if not self.moved:
            stated = self.jacobian, self.required, self.Q_w, self.Q_f, self.mu_planned, self.f_min
            return float(kkt_residual(*stated, w, f, np.empty((2, w.size)), None, *shape))
        apex, moved = self.from_apex
        return float(kkt_residual(*moved[:-1], w, f - apex, np.empty((2, w.size)), moved[-1], *shape))

    @property
    def moved(self) -> bool:
        """Whether any cone's apex is not at 0."""
        return len(self.apex) > 1 or bool(self.apex.any())

    @property
    def several(self) -> bool:
        """Whether a contact has several cones; in the plane they are one, their intersection."""
        return len(self.apex) > 1 and self.dim == 3

    @cached_property
    def from_apex(self) -> tuple[Array, tuple[Array, ...]]:
        """The apex a (K d,), and the same problem in f - a: J, required, Q_w, Q_f, mu, floors and a linear cost.

        Raises:
            ValueError: there are several cones at one contact in space.
        """
        if self.several:
            raise fail("apex", self.apex, "one for each contact: with several, take the residual of the `Solution`")
        tips, mu = self.apex, self.mu_planned
        if len(tips) > 1:  # right and left edge of the intersection: mu f_n + f_t and mu f_n - f_t are at least these
            right, left = (mu * tips[..., 1] + tips[..., 0]).max(axis=0), (mu * tips[..., 1] - tips[..., 0]).max(axis=0)
            tips = np.stack([0.5 * (right - left), 0.5 * (right + left) / mu], axis=-1)[None]
        a = tips[0].ravel()
        floors = np.maximum(self.f_min - tips[0, :, -1], 0.0)
        b, linear = self.required - self.jacobian @ a, self.Q_f @ a
        data = self.jacobian, b, self.Q_w, self.Q_f, mu, floors, linear
        return a, tuple(np.array(values) for values in data)  # that may be written: kernels tell the two apart

    def _pyramid(self, edges: int) -> Polygon:
        if self.dim != 3:
            raise fail("edges", edges, "left out in the plane, where the cones are linear")
        return polygon(edges)

    def standard_form(self, *, edges: int = 0) -> StandardForm:
        """The problem as the quadratic program of the notes, in x = (f, w).

        For each contact, the rows of C are the floor and the sides of the cone; those of further cones come last. In
        the plane these are the right and
        the left side. In space the cone is replaced by the inscribed pyramid with `edges` faces; an answer is then
        feasible for the cone but, in general, not optimal.

        Raises:
            ValueError: in space without `edges`, where the cones are not linear; in the plane with them.
        """
        if self.dim != 2 and not edges:
            raise fail("edges", edges, "at least 3 in space, where cones are not linear (inscribed pyramids)")
        if edges:
            self._pyramid(edges)  # refused in the plane
        nw, n = self.jacobian.shape
        P = np.zeros((n + nw, n + nw))
        P[:n, :n], P[n:, n:] = self.Q_f, self.Q_w
        cones = friction_limits(self.mu_planned, self.f_min, self.dim, edges, self.apex)
        C = np.hstack([cones.linear, np.zeros((len(cones.linear), nw))])
        return StandardForm(P, np.hstack([self.jacobian, np.eye(nw)]), self.required, C, cones.linear_side)


def wrench_weight(dim: int, length: float = 1.0) -> Array:
    """The weight Q_w = diag(1, ..., 1 / length^2), with which moments count like forces at a lever of `length` [m].

    With length = 1 it is the identity of the notes, for which "smallest" depends on the unit of length. The distance
    from the CoM to the contact is the natural choice. Returns (3, 3) for dim 2 and (6, 6) for dim 3.
    """
    lever = number("length", length, above=0.0, unit="m")
    return np.diag([1.0] * dim + [lever**-2] * (1 if dim == 2 else 3))
