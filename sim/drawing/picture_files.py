"""Pictures in files: one as .png, moving ones as .gif or .mp4."""

from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

Picture = NDArray[np.uint8]
TICK = Fraction(1, 100)  # in which a .gif counts [s]
SAMPLES = 8  # frames that the colours of a .gif are taken from
QUALITY = "18"  # of a .mp4: the constant rate factor of H.264, at which differences can hardly be seen


def write_png(picture: Picture, path: Path) -> None:
    """Write a picture (H, W, 3)."""
    Image.fromarray(picture).save(path, format="PNG", optimize=True)


def write_gif(frames: Sequence[Picture], fps: int, path: Path) -> None:
    """Write frames (H, W, 3) that are repeated for ever, in 256 colours that all of them share.

    A frame is shown up to the hundredth of a second that is nearest to where it ends, so that none adds to another's
    error.
    """
    some = [frames[k] for k in np.unique(np.linspace(0, len(frames) - 1, SAMPLES).astype(int))]
    palette = Image.fromarray(np.concatenate(some)).quantize(dither=Image.Dither.NONE)
    pictures = (Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames)
    ends = [round(k / (fps * TICK)) for k in range(len(frames) + 1)]
    milliseconds = [10 * (end - start) for start, end in pairwise(ends)]
    first = next(pictures)
    first.save(path, format="GIF", save_all=True, append_images=pictures, duration=milliseconds, loop=0, optimize=False)


def write_mp4(frames: Sequence[Picture], fps: int, path: Path) -> None:
    """Write frames (H, W, 3), H and W even, as H.264; it needs the package av."""
    import av

    with av.open(str(path), "w", format="mp4", options={"movflags": "faststart"}) as file:
        stream = file.add_stream("libx264", rate=fps, options={"crf": QUALITY})
        stream.height, stream.width = frames[0].shape[:2]
        stream.pix_fmt = "yuv420p"
        for frame in frames:
            file.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))
        file.mux(stream.encode(None))
