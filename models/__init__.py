"""MJCF scenes and what reads them: from a model to what a controller needs to know about a body in it."""

from pivoting.models.reading import ModelError, RigidBody, place, read_body, read_friction, read_support, turn
from pivoting.models.scenes import WORLD_KEYS, corner, instrument, load, scene_path

__all__ = [
    "WORLD_KEYS",
    "ModelError",
    "RigidBody",
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
