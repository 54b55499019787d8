from .friction_coefficient import read_friction as read_friction
from .errors import ModelError as ModelError
from .rigid_body import RigidBody as RigidBody, place as place, read_body as read_body, turn as turn
from .scenes import WORLD_KEYS as WORLD_KEYS, Scene as Scene, corner as corner, load as load
from .shipped_files import scene_path as scene_path
