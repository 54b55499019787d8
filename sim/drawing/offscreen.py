"""Pictures of MuJoCo scenes by MuJoCo's own renderer, off screen: it needs OpenGL, but no display.

MUJOCO_GL says through what, as everywhere in MuJoCo: egl (the default on Linux), osmesa, glfw (which needs a display),
cgl. It is read when the first picture is made, not when mujoco is imported.
"""

import os
import sys
import warnings
from importlib import import_module
from types import TracebackType
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]
DEFAULT = {"linux": "egl", "darwin": "cgl"}  # elsewhere glfw
BACKENDS = ("egl", "osmesa", "glfw", "cgl")
HELP = (
    "on Debian and Ubuntu: apt-get install libegl1 libgl1, with MUJOCO_GL unset or egl;"
    " or apt-get install libosmesa6, and set MUJOCO_GL=osmesa"
)


class GraphicsError(OSError):
    """This machine has no OpenGL to draw with; the message says what to install and which variable to set."""


class OffScreen:
    """Where scenes of one model are drawn; as a context, which gives back what the graphics library holds.

    Raises:
        GraphicsError: there is no OpenGL.
    """

    def __init__(self, model: mujoco.MjModel, width: int, height: int):
        """Of `width` x `height` pixels, which are not more than the model's `offwidth` and `offheight`."""
        self._picture = np.empty((height, width, 3), np.uint8)
        self._all = mujoco.MjrRect(0, 0, width, height)
        self._context = _context(width, height)
        try:
            self._renderer = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
            mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._renderer)
        except mujoco.FatalError as error:
            self._context.free()
            raise _error(error) from error

    def draw(self, scene: mujoco.MjvScene) -> Picture:
        """(height, width, 3) the scene, red, green and blue of 255; black where there is nothing."""
        mujoco.mjr_render(self._all, scene, self._renderer)
        mujoco.mjr_readPixels(self._picture, None, self._all, self._renderer)
        return self._picture[::-1].copy()

    def __enter__(self) -> "OffScreen":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._renderer.free()
        self._context.free()


def check_graphics() -> None:
    """Find out before the work that there is something to draw with.

    Raises:
        GraphicsError: there is not.
    """
    with OffScreen(mujoco.MjModel.from_xml_string("<mujoco/>"), 1, 1):
        pass


def _backend() -> str:
    given = os.environ.get("MUJOCO_GL", "").strip().lower()
    return given or DEFAULT.get(sys.platform, "glfw")


def _context(width: int, height: int) -> Any:
    """An OpenGL context of this size, the current one."""
    name = _backend()
    if name not in BACKENDS:
        raise GraphicsError(f"MUJOCO_GL = {name!r}: must be one of {', '.join(BACKENDS)} to draw with")
    try:
        with warnings.catch_warnings(action="ignore"):  # GLFW's: the error says it
            context = import_module(f"mujoco.{name}").GLContext(width, height)
            context.make_current()
    except Exception as error:  # whatever PyOpenGL, GLFW and the drivers raise where something is missing
        raise _error(error) from error
    return context


def _error(error: Exception) -> GraphicsError:
    why = f"{type(error).__name__}: {' '.join(str(error).split())[:120]}"
    return GraphicsError(f"there is no OpenGL to draw with through {_backend()} ({why}); {HELP}")
