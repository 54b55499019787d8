"""The regular polygon inscribed in the unit circle: what a friction cone becomes for a QP solver."""

from typing import NamedTuple

import numpy as np
from pivoting.controller.validate import Array, fail


class Polygon(NamedTuple):
    """vertices: (m, 2), on the unit circle.  facets: (m, 2) rows with facet . p <= 1 inside."""

    vertices: Array
    facets: Array


def polygon(edges: int) -> Polygon:
    """The polygon of `edges` >= 3 edges, its first vertex along the first tangent.

    Raises:
        ValueError: fewer than 3 edges, or not a whole number.
    """
    check_edges(edges)
    angle = 2.0 * np.pi / edges * np.arange(edges)
    vertices = np.column_stack([np.cos(angle), np.sin(angle)])
    sums = vertices + np.roll(vertices, -1, axis=0)
    return Polygon(vertices, sums / np.sum(sums * vertices, axis=1, keepdims=True))


def check_edges(edges: object) -> int:
    """`edges`, if a polygon may have so many.

    Raises:
        ValueError: fewer than 3, or not a whole number.
    """
    if not isinstance(edges, int | np.integer) or isinstance(edges, bool) or edges < 3:
        raise fail("edges", edges, "a whole number >= 3")
    return int(edges)
