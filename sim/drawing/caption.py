"""The caption above a picture of a run: what each colour stands for, the time and the angle."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from pivoting.sim.drawing.colours import DARK, WHITE, Colour

LEAST = 11  # smallest font size [pixels]
SHARE = 38  # shorter side of the picture divided by the font size, where that is larger


class Caption(NamedTuple):
    """A legend of coloured entries, set in rows of `width` pixels in a font of this size [pixels]."""

    width: int
    size: float
    rows: list[list[tuple[str, Colour]]]

    @property
    def height(self) -> int:
        """Of the strip that it takes [pixels]."""
        return round((1.7 * len(self.rows) + 0.5) * self.size)

    def above(self, picture: NDArray[np.uint8], when: str) -> NDArray[np.uint8]:
        """(height + H, width, 3) a picture (H, width, 3) below the caption, with `when` at the end of its last row."""
        strip = Image.new("RGB", (self.width, self.height), DARK)
        draw, font = ImageDraw.Draw(strip), ImageFont.load_default(self.size)
        for k, row in enumerate(self.rows):
            x, y = self.size, (1.7 * k + 1.1) * self.size
            for words, colour in row:
                box = x, y - 0.35 * self.size, x + 0.7 * self.size, y + 0.35 * self.size
                draw.rectangle(box, fill=colour)
                draw.text((x + self.size, y), words, WHITE, font, anchor="lm")
                x += _wide(words, self.size)
        draw.text((self.width - self.size, y), when, WHITE, font, anchor="rm")
        return np.concatenate([np.asarray(strip), picture])


def caption(legend: list[tuple[str, Colour]], when: str, width: int, height: int) -> Caption:
    """Set a legend for pictures of `width` x `height` pixels, with room for `when`."""
    size = max(LEAST, min(width, height) / SHARE)
    rows: list[list[tuple[str, Colour]]] = [[]]
    left = width - size
    for entry in legend:
        left -= _wide(entry[0], size)
        if left < 0 and rows[-1]:
            rows.append([])
            left = width - size - _wide(entry[0], size)
        rows[-1].append(entry)
    if left < _wide(when, size):
        rows.append([])
    return Caption(width, size, rows)


def _wide(words: str, size: float) -> float:
    """Width of an entry with its coloured square and the space after it [pixels]."""
    return float(ImageFont.load_default(size).getlength(words)) + 2.2 * size
