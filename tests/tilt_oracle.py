"""Slow answers about tilting: a body turned step by step, and every direction of a table tried on it.

Shapes are lists of (kind, size, position, rotation (3, 3)) as MuJoCo has them, a "mesh" with its points for a size.
"""

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

Array = np.ndarray[Any, Any]
Shape = tuple[str, Any, Any, Any]


def mjcf(shapes: Sequence[Shape], com: Sequence[float] | None = None) -> str:
    """A model whose body 1, "thing", is of these shapes, above a plane; with its CoM `com`, if that is given."""
    meshes, geoms = "", ""
    for k, (kind, size, at, turned) in enumerate(shapes):
        quat = np.roll(Rotation.from_matrix(turned).as_quat(), 1)
        text = f'mesh="m{k}"' if kind == "mesh" else f'size="{_words(size)}"'
        geoms += f'<geom name="g{k}" type="{kind}" {text} pos="{_words(at)}" quat="{_words(quat)}"/>'
        meshes += f'<mesh name="m{k}" vertex="{_words(np.ravel(size))}"/>' if kind == "mesh" else ""
    inertial = "" if com is None else f'<inertial pos="{_words(com)}" mass="1" diaginertia="1 1 1"/>'
    return (
        f'<mujoco><asset>{meshes}</asset><worldbody><geom name="table" type="plane" size="9 9 1"/>'
        f'<body name="thing" pos="0 0 2"><freejoint/>{inertial}{geoms}</body></worldbody></mujoco>'
    )


def _words(numbers: Any) -> str:
    return " ".join(f"{x:.9g}" for x in np.ravel(numbers))


def random_shapes(rng: np.random.Generator, kinds: Sequence[str], most: int = 3) -> list[Shape]:
    """Up to `most` shapes about the origin, about 0.1 in size, turned at random."""
    out: list[Shape] = []
    for _ in range(rng.integers(1, most + 1)):
        kind = str(rng.choice(kinds))
        count = {"box": 3, "cylinder": 2, "capsule": 2, "sphere": 1, "ellipsoid": 3}.get(kind, 0)
        size = (
            rng.normal(size=(12, 3)) * rng.uniform(0.03, 0.1, 3) if kind == "mesh" else rng.uniform(0.03, 0.12, count)
        )
        out.append((kind, size, rng.uniform(-0.1, 0.1, 3), Rotation.random(random_state=rng).as_matrix()))
    return out


class Elements:
    """Corners (P, 3), balls (B, 3) with radii, rims as (centre, axis, radius), other ellipsoids as (centre, A)."""

    def __init__(self, shapes: Sequence[Shape]) -> None:
        self.corners: list[Array] = []
        self.balls: list[tuple[Array, float]] = []
        self.rims: list[tuple[Array, Array, float]] = []
        self.eggs: list[tuple[Array, Array]] = []
        for kind, size, at, R in shapes:
            ends = (
                [np.asarray(at) + side * R[:, 2] * size[1] for side in (-1, 1)] if len(size) == 2 else [np.asarray(at)]
            )
            if kind == "box":
                self.corners += [at + R @ (size * np.array(s)) for s in product((-1, 1), repeat=3)]
            elif kind == "mesh":
                self.corners += list(at + size @ R.T)
            elif kind == "cylinder":
                self.rims += [(end, R[:, 2], size[0]) for end in ends]
            elif kind in ("capsule", "sphere"):
                self.balls += [(end, size[0]) for end in ends]
            else:
                self.eggs.append((np.asarray(at), R * size))

    def low(self, normals: Array) -> Array:
        """(K, E) how far each element reaches down along normals (K, 3): corners, balls, rims, ellipsoids."""
        columns = [normals @ point for point in self.corners]
        columns += [normals @ centre - radius for centre, radius in self.balls]
        for centre, axis, radius in self.rims:
            columns.append(normals @ centre - radius * np.sqrt(np.maximum(1.0 - (normals @ axis) ** 2, 0.0)))
        columns += [normals @ centre - np.linalg.norm(normals @ A, axis=1) for centre, A in self.eggs]
        return np.stack(columns, axis=1)


def range_end(elements: Elements, stance: Any, tolerance: float, step: float = 1e-3) -> tuple[float, float]:
    """First and last angle [rad] between which, in steps, nothing is below what a stance turns about."""
    angles = np.arange(-0.2, stance.range[1] + 0.2, step)
    normals = np.array([stance.up(angle) for angle in angles])
    least = elements.low(normals).min(axis=1)
    held = (normals @ stance.points.T).min(axis=1) - stance.radius[0]
    good = angles[held <= least + tolerance]
    return float(good.min()), float(good.max())


def arcs_about_vertices(elements: Elements, count: int = 20000) -> list[tuple[Array, float]]:
    """Of each corner, ball (its centre) and of points around each rim the longest arc [rad], within 0.05, from below.

    Of a corner or ball the normals on which it stands are convex on the sphere: an arc from any of them to any other
    will do. About a point of a rim they turn in the plane of the rim's axis.
    """
    k = np.arange(count) + 0.5
    z, turn = 1.0 - 2.0 * k / count, np.pi * (1.0 + np.sqrt(5.0)) * k
    normals = np.stack([np.sqrt(1.0 - z * z) * np.cos(turn), np.sqrt(1.0 - z * z) * np.sin(turn), z], axis=1)
    lowest, out = elements.low(normals).argmin(axis=1), []
    tips = [*elements.corners, *(centre for centre, _ in elements.balls)]
    for tip, point in enumerate(tips):
        some = normals[lowest == tip]
        if 1 < len(some) < count:  # a ball that is lowest on all is all that there is
            out.append((point, float(np.arccos(np.clip((some @ some[:: len(some) // 200 + 1].T).min(), -1.0, 1.0)))))
    for i, (centre, axis, radius) in enumerate(elements.rims):
        x = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
        x /= np.linalg.norm(x)
        for around in np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False):
            away = np.cos(around) * x + np.sin(around) * np.cross(axis, x)
            lean = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 721)[1:-1]  # normals on which that point of it is lowest
            low = elements.low(-np.cos(lean)[:, None] * away + np.sin(lean)[:, None] * axis)
            mine = lean[low[:, len(tips) + i] <= low.min(axis=1) + 1e-12]
            if mine.size:
                out.append((centre + radius * away, float(np.ptp(mine))))
    return out


def longest_about_edges(points: Array, count: int = 3600) -> float:
    """The longest arc [rad] about a line between two of a cloud's points (P, 3), to within 0.002 rad."""
    longest, angles = 0.0, 2.0 * np.pi * np.arange(count) / count
    for i, one in enumerate(points):
        for other in points[:i]:
            along = (other - one) / np.linalg.norm(other - one)
            x = np.cross(along, np.eye(3)[np.abs(along).argmin()])
            x /= np.linalg.norm(x)
            normals = np.cos(angles)[:, None] * x + np.sin(angles)[:, None] * np.cross(along, x)
            good = ((points - one) @ normals.T).min(axis=0) >= -1e-9
            longest = max(longest, 2.0 * np.pi * np.count_nonzero(good) / count)
    return longest
