"""A finished run as a picture or a video of its scene, drawn by MuJoCo's own renderer.

Nothing is solved or simulated again: each frame shows the arrays of the `Run` at the step that begins at that time.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from math import floor, log10
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pivoting.controller.validate import fail, number
from pivoting.sim.drawing.caption import Caption, caption
from pivoting.sim.drawing.colours import DARK
from pivoting.sim.drawing.drawn_world import FAR, DrawnWorld
from pivoting.sim.drawing.mujoco_scene import LEGEND, MujocoScene
from pivoting.sim.drawing.offscreen import OffScreen
from pivoting.sim.drawing.picture_files import write_gif, write_mp4, write_png
from pivoting.sim.run import Run
from pivoting.sim.whole_files import whole

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]
FPS = 25
FASTEST = {".gif": 50, ".mp4": 120}  # frames a second at most; browsers slow a .gif with more down to 10
PIXELS = 240, 4096  # smallest and largest side of a picture
FRAMES = 20_000  # at most
HELD = 1_000_000_000  # pixels of all frames of a .gif at most; they are held in memory, a byte each


@dataclass(frozen=True)
class Output:
    """The file to write and what it shows.

    Attributes:
        path: of the file, in a folder that exists: .gif or .mp4, or .png for one picture.
        size: width and height in pixels.
        fps: frames a second of a video; None: 25.
        speed: of a video, 1 is real time and 0.5 half as fast; None: 1.
        time: that a single picture shows, from the start of the run [s]; None: the middle of the run.

    Raises:
        InputError: one of them is not allowed, or the package for .mp4 files is missing.
    """

    path: Path
    size: tuple[int, int] = (640, 480)
    fps: int | None = None
    speed: float | None = None
    time: float | None = None

    def __post_init__(self) -> None:
        """Check everything that can be checked before the run."""
        kind, name = self.path.suffix, str(self.path)
        if kind not in (*FASTEST, ".png"):
            raise fail("out", name, "a .gif, .mp4 or .png file")
        if not self.path.parent.is_dir():
            raise fail("out", name, "in a folder that exists")
        if self.path.is_dir():
            raise fail("out", name, "a file, not a folder")
        if kind == ".mp4" and find_spec("av") is None:
            raise fail("out", name, "a .gif or .png file: for a .mp4 file, pip install 'pivoting[video]'")
        if not all(PIXELS[0] <= side <= PIXELS[1] for side in self.size):
            raise fail("size", "{}x{}".format(*self.size), f"WIDTHxHEIGHT, each from {PIXELS[0]} to {PIXELS[1]} pixels")
        if kind == ".mp4" and any(side % 2 for side in self.size):
            raise fail("size", "{}x{}".format(*self.size), "two even numbers, for a .mp4 file")
        if kind == ".png":
            for key, value in (("fps", self.fps), ("speed", self.speed)):
                if value is not None:
                    raise fail(key, value, "left out: a .png file is one picture, at --time")
        elif self.time is not None:
            raise fail("time", self.time, f"left out: a {kind} file shows all of the run; a .png file one moment")
        elif self.fps is not None and not 1 <= self.fps <= FASTEST[kind]:
            raise fail("fps", self.fps, f"a whole number from 1 to {FASTEST[kind]}, for a {kind} file")
        if self.speed is not None:
            number("speed", self.speed, above=0.0)

    def times(self, duration: float) -> Array:
        """(F,) the simulated times [s] that the frames for a run of this duration [s] show.

        Raises:
            InputError: the time of the picture is after the end, or there are too many frames.
        """
        if self.path.suffix == ".png":
            time = 0.5 * duration if self.time is None else number("time", self.time, at_least=0.0, at_most=duration)
            return np.array([time])
        fps, speed = self.rate
        count = max(1, round(fps * duration / speed))
        if count > FRAMES:
            raise fail("speed", speed, f"at least {1.05 * fps * duration / FRAMES:.2g}, for {FRAMES} frames at most")
        if self.path.suffix == ".gif" and count * self.size[0] * self.size[1] > HELD:
            raise fail("out", str(self.path), f"a .mp4 file: {count} frames of this size are too many for a .gif file")
        return np.arange(count) * speed / fps

    @property
    def rate(self) -> tuple[int, float]:
        """Frames a second and speed of a video."""
        return self.fps or FPS, self.speed or 1.0


def render(
    run: Run, output: Output, *, world: int | None = None, progress: Callable[[int, int], None] | None = None
) -> int:
    """Write a picture or a video of one world of a finished run; return the number of frames.

    A world that diverges is shown up to where it does.

    Args:
        run: of `simulate`.
        output: the file, which is written whole or not at all.
        world: which one; None: the worst, see `Run.worst_world`.
        progress: called with (frames done, frames).

    Raises:
        InputError: there is no such world, or the output cannot be made of a run of this duration.
        GraphicsError: OpenGL is missing.
        OSError: the file cannot be written.
    """
    world = run.worst_world if world is None else world
    if isinstance(world, bool) or not isinstance(world, int | np.integer) or not 0 <= world < run.worlds:
        raise fail("world", world, f"a whole number in [0, {run.worlds})")
    film = DrawnWorld(run, int(world))
    if not film.answers:
        raise fail("world", world, f"one that begins within {FAR:g} m of the origin")
    times = output.times(float(run.time[film.answers]))
    width, height = output.size
    words = caption(LEGEND[film.dim], _when(film, film.answers - 1, output), width, height)
    scene = MujocoScene(film, width, height - words.height)
    with OffScreen(scene.model, width, height - words.height) as screen, whole(output.path) as partial:
        frames = _Frames(film, scene, screen, words, output, times, progress)
        if output.path.suffix == ".png":
            write_png(frames[0], partial)
        else:
            write = write_gif if output.path.suffix == ".gif" else write_mp4
            write(frames, output.rate[0], partial)
    return len(frames)


@dataclass(frozen=True, eq=False)
class _Frames(Sequence[Picture]):
    """The frames (height, width, 3), each rendered when it is indexed."""

    film: DrawnWorld
    scene: MujocoScene
    screen: OffScreen
    words: Caption
    output: Output
    times: Array
    progress: Callable[[int, int], None] | None

    def __len__(self) -> int:
        return self.times.size

    def __getitem__(self, k: int) -> Picture:  # type: ignore[override]
        if not 0 <= k < len(self):
            raise IndexError(k)
        row = min(round(self.times[k] / self.film.run.dt), self.film.answers - 1)
        drawn = np.maximum(self.screen.draw(self.scene.show(row)), np.array(DARK, np.uint8))
        if self.progress:
            self.progress(k + 1, len(self))
        return self.words.above(drawn, _when(self.film, row, self.output))


def _when(film: DrawnWorld, row: int, output: Output) -> str:
    """Time and angle at the beginning of step `row`, and the speed unless it is real time."""
    run, speed = film.run, output.rate[1]
    digits = max(0, 2 - floor(log10(run.time[-1])))
    time, angle = run.time[row], np.rad2deg(run.theta[film.world, row])
    return f"{time:.{digits}f} s   {angle:.1f}°" + f"   {speed:g} x" * (speed != 1.0)
