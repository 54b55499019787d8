"""MJCF scenes and what reads them: from a model to what a controller needs to know about a body in it."""

from pivoting.models.friction_coefficient import read_friction
from pivoting.models.names import ModelError
from pivoting.models.rigid_body import RigidBody, place, read_body, turn
from pivoting.models.scenes import WORLD_KEYS, Scene, corner, load, scene_path

__all__ = [
    "WORLD_KEYS",
    "ModelError",
    "RigidBody",
    "Scene",
    "corner",
    "load",
    "place",
    "read_body",
    "read_friction",
    "scene_path",
    "turn",
]
