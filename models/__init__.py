"""MJCF scenes and what reads them: from a model to what a controller needs to know about a body in it."""

from pivoting.models.reading import ModelError, PlanarBody, place, read_body, read_friction, read_support, turn
from pivoting.models.scenes import WORLD_KEYS, corner, instrument, load, scene_path

__all__ = [
    "WORLD_KEYS",
    "ModelError",
    "PlanarBody",
    "corner",
    "instrument",
    "load",
    "place",
    "read_body",
    "read_friction",
    "read_support",
    "scene_path",
    "turn",
]
