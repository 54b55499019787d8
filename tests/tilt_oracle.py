"""How far a convex body can be tilted about something of it, by trying many normals of the table.

A body is given by corners, balls and rims in its frame; it touches a table of normal n with what is lowest along n.
Nothing of `pivoting.models` is used.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

Array = NDArray[np.float64]
NONE = np.zeros((0, 3))
STEP = 1e-3  # [rad] between normals along a great circle
WAYS = 24  # great circles through a normal


@dataclass(frozen=True)
class Shape:
    """Corners (N, 3); centres (B, 3) and radii (B,) of balls; centres, axes (R, 3) and radii (R,) of rims [m]."""

    corners: Array = field(default_factory=lambda: NONE)
    balls: Array = field(default_factory=lambda: NONE)
    ball_radii: Array = field(default_factory=lambda: np.zeros(0))
    rims: Array = field(default_factory=lambda: NONE)
    rim_axes: Array = field(default_factory=lambda: NONE)
    rim_radii: Array = field(default_factory=lambda: np.zeros(0))

    def heights(self, normals: Array) -> Array:
        """(..., N + B + R) lowest heights of all corners, balls and rims along normals (..., 3)."""
        across = normals[..., None, :] - (normals @ self.rim_axes.T)[..., None] * self.rim_axes
        return np.concatenate(
            [
                normals @ self.corners.T,
                normals @ self.balls.T - self.ball_radii,
                normals @ self.rims.T - self.rim_radii * np.linalg.norm(across, axis=-1),
            ],
            axis=-1,
        )

    def clearance(self, normals: Array, held: list[int]) -> Array:
        """(...) by how much all else is higher than the lowest of what is held, by its numbers."""
        heights = self.heights(normals)
        others = np.delete(heights, held, axis=-1).min(axis=-1)
        return np.asarray(others - heights[..., held].min(axis=-1))

    @property
    def points(self) -> int:
        """Number of its corners and balls."""
        return len(self.corners) + len(self.balls)

    @property
    def size(self) -> float:
        """Of the box around it, roughly."""
        ends = self.heights(np.concatenate([np.eye(3), -np.eye(3)])).min(axis=-1)
        return float(np.linalg.norm(ends[:3] + ends[3:]))


def circle(first: Array, second: Array) -> Array:
    """(M, 3) normals around a great circle through two perpendicular unit vectors, `STEP` apart, from the first on."""
    turn = np.arange(0.0, 2.0 * np.pi, STEP)[:, None]
    return np.asarray(np.cos(turn) * first + np.sin(turn) * second)


def longest(free: NDArray[np.bool_]) -> float:
    """[rad] the longest arc of a circle that is free throughout."""
    if free.all():
        return 2.0 * np.pi
    around = np.roll(free, -int(np.flatnonzero(~free)[0]))
    ends = np.flatnonzero(np.diff(np.concatenate([[0], around.astype(int), [0]])))
    return float((ends[1::2] - ends[::2]).max(initial=0)) * STEP


def edge_range(shape: Shape, i: int, j: int) -> float:
    """[rad] over how much it stands on the edge between two corners alone; 0 if that is no edge."""
    along = shape.corners[j] - shape.corners[i]
    first = np.linalg.svd(along[None])[2][1]
    normals = circle(first, np.cross(along / np.linalg.norm(along), first))
    return longest(shape.clearance(normals, [i, j]) > 0.0)


def rim_range(shape: Shape, rim: int, point: Array) -> float:
    """[rad] over how much it stands on one point (3,) of a rim alone, turned about the tangent there."""
    away = (point - shape.rims[rim]) / shape.rim_radii[rim]
    number = shape.points + rim
    normals = circle(-away, shape.rim_axes[rim])
    lowest = normals @ point <= shape.heights(normals)[:, number] + 1e-9 * shape.size  # not the point across from it
    return longest((shape.clearance(normals, [number]) > 0.0) & lowest)


def vertex_range(shape: Shape, held: int, rng: np.random.Generator) -> float:
    """[rad] over how much it can be tilted about one corner or ball at least, touching with nothing else.

    The longest arc of great circles in many directions through some normals at which it stands on that alone: through
    that at which all else is highest, and others.
    """
    best, starts = 0.0, [middle(shape, held)]
    some = rng.normal(size=(2000, 3))
    some /= np.linalg.norm(some, axis=1, keepdims=True)
    starts += list(some[shape.clearance(some, [held]) > 0.0][:3])
    for start in starts:
        if start is None or shape.clearance(start, [held]) <= 0.0:
            continue
        first = np.linalg.svd(start[None])[2][1]
        second = np.cross(start, first)
        for turn in np.pi * np.arange(WAYS) / WAYS:
            normals = circle(start, np.cos(turn) * first + np.sin(turn) * second)[::5]
            best = max(best, 5.0 * longest(shape.clearance(normals, [held]) > 0.0))
    return best


def middle(shape: Shape, held: int) -> Array | None:
    """(3,) a normal in the midst of those at which a corner is the lowest of corners, by a linear programme."""
    if held >= len(shape.corners):
        return None
    away = np.delete(shape.corners, held, axis=0) - shape.corners[held]
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    found = linprog(
        [0.0, 0.0, 0.0, -1.0],
        A_ub=np.column_stack([-away, np.ones(len(away))]),
        b_ub=np.zeros(len(away)),
        bounds=[(-1.0, 1.0)] * 3 + [(None, 1.0)],
    )
    if found.status != 0 or found.x[3] <= 1e-9:
        return None
    return np.asarray(found.x[:3] / np.linalg.norm(found.x[:3]))
