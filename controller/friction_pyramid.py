"""The regular polygon inscribed in the unit circle: the cross-section of the pyramid that replaces a round cone."""

from typing import NamedTuple

import numpy as np
from pivoting.controller.validate import Array, fail


class Polygon(NamedTuple):
    """A polygon inscribed in the unit circle.

    Attributes:
        vertices: (m, 2) on the unit circle.
        facets: (m, 2) rows, one for each side; a point p is inside if facet . p <= 1 for all of them.
    """

    vertices: Array
    facets: Array


def polygon(edges: int) -> Polygon:
    """The polygon with this number of edges (at least 3), whose first vertex is in the direction of the first tangent.

    Raises:
        ValueError: `edges` is less than 3 or not a whole number.
    """
    check_edges(edges)
    angle = 2.0 * np.pi / edges * np.arange(edges)
    vertices = np.column_stack([np.cos(angle), np.sin(angle)])
    sums = vertices + np.roll(vertices, -1, axis=0)
    return Polygon(vertices, sums / np.sum(sums * vertices, axis=1, keepdims=True))


def check_edges(edges: object) -> int:
    """Return `edges` if a polygon can have this number of edges.

    Raises:
        ValueError: `edges` is less than 3 or not a whole number.
    """
    if not isinstance(edges, int | np.integer) or isinstance(edges, bool) or edges < 3:
        raise fail("edges", edges, "a whole number >= 3")
    return int(edges)
