"""The notes' solution space at this moment, as a small drawing (SVG): it moves as the object turns."""

from collections.abc import Iterable

import numpy as np
from pivoting.sim.drawing.drawn_world import Array
from pivoting.sim.viewing.live_world import LiveWorld

WIDE, HIGH = 360.0, 236.0  # pixels
AZIMUTH, ELEVATION = np.deg2rad(-72.0), np.deg2rad(28.0)  # from which it is seen
CONE, BALANCE, WRENCH, LOAD, AXES = "#e08a1e", "#3a86c8", "#2ca02c", "#555555", "#999999"
LEGEND = (
    (CONE, "what the contact can do, J f"),
    (BALANCE, "wrenches that do, required &minus; J f"),
    (WRENCH, "the smallest of them, w: applied"),
    (LOAD, "required in all, w + J f"),
)
ONLY_PLANE = (
    "<p style='font-size:0.85em;opacity:0.8'>The picture of the solution space is of a planar scene with one contact, "
    "where it has three dimensions: try <code>pivoting view pivot-2d</code>.</p>"
)


def wrench_space_picture(world: LiveWorld) -> str:
    """HTML of the wrench space, object axes, at the last step of a planar run with one contact.

    Moments are drawn as M / length, with the length that makes Q_w weigh all axes alike.
    """
    if world.dim == 3 or len(world.run.points) != 1:
        return ONLY_PLANE
    reach, length = world.grown, world.length
    space = world.solution_space(np.array([world.answers - 1]), reach)
    flat = [1.0, 1.0, length]
    cone, admissible, required, wrench, contact = (part[0] / flat for part in space[:5])
    parts = [_axes(reach, f" / {length * world.run.unit:.3g} m")]
    parts += [_polygon(cone, reach, CONE), _polygon(admissible, reach, BALANCE)]
    origin = np.zeros(3)
    parts.append(_line([wrench, wrench + contact], reach, CONE, 1.5, dashed=True))
    parts.append(_line([contact, wrench + contact], reach, WRENCH, 1.5, dashed=True))
    for end, colour in ((required, LOAD), (contact, CONE), (wrench, WRENCH)):
        parts.append(_line([origin, end], reach, colour, 3.0))
        parts.append(_dot(end, reach, colour))
    words = "".join(
        f"<div><span style='display:inline-block;width:0.9em;height:0.9em;background:{colour};margin-right:0.5em'>"
        f"</span>{word}</div>"
        for colour, word in LEGEND
    )
    return (
        f"<svg viewBox='0 0 {WIDE:g} {HIGH:g}' style='width:100%;display:block'>{''.join(parts)}</svg>"
        f"<div style='font-size:0.8em;line-height:1.35;padding:0 0.5em 0.5em'>{words}</div>"
    )


def _seen(points: Array | Iterable[Array], reach: float) -> Array:
    """(P, 2) pixels of points (P, 3) in the wrench space."""
    a, e = AZIMUTH, ELEVATION
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    up = np.array([-np.sin(e) * np.cos(a), -np.sin(e) * np.sin(a), np.cos(e)])
    flat = np.array(list(points)) @ np.stack([right, up], axis=1) * (0.34 * WIDE / reach)
    return flat * [1.0, -1.0] + [0.5 * WIDE, 0.5 * HIGH]


def _axes(reach: float, per: str) -> str:
    parts = []
    for name, axis in zip(("F_u [N]", "F_v [N]", f"M{per} [N]"), np.eye(3), strict=True):
        parts.append(_line([-reach * axis, reach * axis], reach, AXES, 1.0))
        x, y = _seen([1.1 * reach * axis], reach)[0]
        x, y = min(max(x, 24.0), WIDE - 30.0), min(max(y, 12.0), HIGH - 6.0)
        parts.append(f"<text x='{x:.0f}' y='{y:.0f}' font-size='12' fill='{AXES}' text-anchor='middle'>{name}</text>")
    return "".join(parts)


def _text(points: Array) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)


def _polygon(points: Array, reach: float, colour: str) -> str:
    if not np.isfinite(points).all():
        return ""
    seen = _text(_seen(points, reach))
    return f"<polygon points='{seen}' fill='{colour}' fill-opacity='0.3' stroke='{colour}' stroke-width='1'/>"


def _line(points: Iterable[Array], reach: float, colour: str, width: float, *, dashed: bool = False) -> str:
    ends = np.array(list(points))
    if not np.isfinite(ends).all():
        return ""
    style = " stroke-dasharray='4 3'" if dashed else ""
    seen = _text(_seen(ends, reach))
    return f"<polyline points='{seen}' stroke='{colour}' stroke-width='{width:g}' fill='none'{style}/>"


def _dot(point: Array, reach: float, colour: str) -> str:
    if not np.isfinite(point).all():
        return ""
    x, y = _seen([point], reach)[0]
    return f"<circle cx='{x:.1f}' cy='{y:.1f}' r='4' fill='{colour}'/>"
