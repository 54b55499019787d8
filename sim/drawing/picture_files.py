"""Writing pictures to files: a single one as .png, an animation as .gif or .mp4."""

from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

Picture = NDArray[np.uint8]
TICK = Fraction(1, 100)  # unit of time of a .gif [s]
SAMPLES = 8  # frames from which the palette of a .gif is chosen
QUALITY = "18"  # constant rate factor of H.264, at which compression is hardly visible


def write_png(picture: Picture, path: Path) -> None:
    """Write a picture (H, W, 3)."""
    Image.fromarray(picture).save(path, format="PNG", optimize=True)


def write_gif(frames: Sequence[Picture], fps: int, path: Path) -> None:
    """Write frames (H, W, 3) as an endless loop with one palette of 256 colours for all of them.

    Each frame ends at the hundredth of a second nearest to its exact end, so rounding errors do not add up.
    """
    some = [frames[k] for k in np.unique(np.linspace(0, len(frames) - 1, SAMPLES).astype(int))]
    palette = Image.fromarray(np.concatenate(some)).quantize(dither=Image.Dither.NONE)
    pictures = (Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames)
    ends = [round(k / (fps * TICK)) for k in range(len(frames) + 1)]
    milliseconds = [10 * (end - start) for start, end in pairwise(ends)]
    first, moving = next(pictures), {"save_all": True, "duration": milliseconds, "loop": 0, "optimize": False}
    with path.open("wb") as file:  # which Pillow would leave open when it is interrupted
        first.save(file, format="GIF", append_images=pictures, **moving)


def write_mp4(frames: Sequence[Picture], fps: int, path: Path) -> None:
    """Write frames (H, W, 3), with H and W even, as H.264 video; this needs the package av."""
    import av

    with av.open(str(path), "w", format="mp4", options={"movflags": "faststart"}) as file:
        stream = file.add_stream("libx264", rate=fps, options={"crf": QUALITY})
        stream.height, stream.width = frames[0].shape[:2]
        stream.pix_fmt = "yuv420p"
        for frame in frames:
            file.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))
        file.mux(stream.encode(None))
