"""Rendering MuJoCo scenes off screen with MuJoCo's own renderer, which needs OpenGL but no display.

As everywhere in MuJoCo, the environment variable MUJOCO_GL selects the OpenGL backend: egl (the default on Linux),
osmesa, glfw (which needs a display) or cgl. Here it is read when it is needed, not when mujoco is imported.
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
from pivoting.errors import PivotingError

Picture = NDArray[np.uint8]
DEFAULT = {"linux": "egl", "darwin": "cgl"}  # elsewhere glfw
BACKENDS = ("egl", "osmesa", "glfw", "cgl")
HELP = (
    "on Debian and Ubuntu: apt-get install libegl1 libgl1, with MUJOCO_GL unset or egl;"
    " or apt-get install libosmesa6, and set MUJOCO_GL=osmesa"
)


class GraphicsError(PivotingError, OSError):
    """This machine has no OpenGL to render with; the message says what to install and which variable to set."""


class OffScreen:
    """A context manager that renders scenes of one model.

    Raises:
        GraphicsError: OpenGL is missing.
    """

    def __init__(self, model: mujoco.MjModel, width: int, height: int):
        """Pictures have `width` x `height` pixels, at most the model's `offwidth` x `offheight`."""
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
        """(height, width, 3) red, green and blue of the scene from 0 to 255; the background is black."""
        mujoco.mjr_render(self._all, scene, self._renderer)
        mujoco.mjr_readPixels(self._picture, None, self._all, self._renderer)
        return self._picture[::-1].copy()

    def __enter__(self) -> "OffScreen":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._renderer.free()
        self._context.free()


def check_graphics() -> None:
    """Find out before the work whether this machine can render.

    Raises:
        GraphicsError: OpenGL is missing.
    """
    with OffScreen(mujoco.MjModel.from_xml_string("<mujoco/>"), 1, 1):
        pass


def _backend() -> str:
    given = os.environ.get("MUJOCO_GL", "").strip().lower()
    return given or DEFAULT.get(sys.platform, "glfw")


def _context(width: int, height: int) -> Any:
    """A new OpenGL context, made current."""
    name = _backend()
    if name not in BACKENDS:
        raise GraphicsError(f"MUJOCO_GL = {name!r}: must be one of {', '.join(BACKENDS)} to render")
    try:
        with warnings.catch_warnings(action="ignore"):  # GLFW warns before it fails
            context = import_module(f"mujoco.{name}").GLContext(width, height)
            context.make_current()
    except Exception as error:  # PyOpenGL, GLFW and drivers raise all kinds where something is missing
        raise _error(error) from error
    return context


def _error(error: Exception) -> GraphicsError:
    why = f"{type(error).__name__}: {' '.join(str(error).split())[:120]}"
    return GraphicsError(f"OpenGL is not available through {_backend()} ({why}); {HELP}")
