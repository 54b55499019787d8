"""Words above a picture of a run: what each colour stands for, and when it is."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from pivoting.sim.drawing.colours import DARK, WHITE, Colour

LEAST = 11  # pixels of a letter's height, in however small a picture
SHARE = 38  # of the shorter side that it otherwise has, one in so many


class Caption(NamedTuple):
    """Rows of coloured words, as many as are needed; `room` at the end of the last one."""

    width: int
    size: float
    rows: list[list[tuple[str, Colour]]]

    @property
    def height(self) -> int:
        """Pixels of height."""
        return round((1.7 * len(self.rows) + 0.5) * self.size)

    def above(self, picture: NDArray[np.uint8], when: str) -> NDArray[np.uint8]:
        """(height + H, width, 3) a picture (H, width, 3) under these words, with `when` at the end of the last row."""
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
    """The words of a legend, set for pictures of `width` x `height` pixels, and room for `when`."""
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
    """Of an entry, with what is before and after the words."""
    return float(ImageFont.load_default(size).getlength(words)) + 2.2 * size
