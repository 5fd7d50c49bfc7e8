"""Captions on pictures, and the strip of snapshots."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import matplotlib
import numpy as np
from PIL import Image, ImageDraw, ImageFont

INK = (34, 48, 60)
WHITE = (255, 255, 255)
SHADE = (20, 30, 40, 150)


@cache
def font(size: int, bold: bool = False) -> ImageFont.FreeTypeFont:
    """Return DejaVu Sans, as shipped with matplotlib, at `size` pixels."""
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(str(Path(matplotlib.get_data_path()) / "fonts/ttf" / name), size)


def labelled(pixels: np.ndarray, left: str, right: str, part: float = 0.07) -> Image.Image:
    """Return the picture (h, w, 3) uint8 with a translucent caption bar, `part` of its height."""
    picture = Image.fromarray(pixels)
    height = round(part * picture.height)
    bar = Image.new("RGBA", (picture.width, height), SHADE)
    pen = ImageDraw.Draw(bar)
    size = int(0.52 * height)
    middle, margin = height // 2, height // 3
    pen.text((margin, middle), left, font=font(size, bold=True), fill=WHITE, anchor="lm")
    pen.text((bar.width - margin, middle), right, font=font(size), fill=WHITE, anchor="rm")
    picture.paste(bar, (0, picture.height - height), bar)
    return picture


def strip(pictures: list[Image.Image], columns: int = 3, width: int = 1560) -> Image.Image:
    """Return the pictures side by side in rows, `width` pixels in total."""
    gap = 6
    columns = min(columns, len(pictures))
    each = (width - gap * (columns - 1)) // columns
    height = round(each * pictures[0].height / pictures[0].width)
    rows = -(-len(pictures) // columns)
    sheet = Image.new("RGB", (width, rows * height + gap * (rows - 1)), WHITE)
    for number, picture in enumerate(pictures):
        row, column = divmod(number, columns)
        place = (column * (each + gap), row * (height + gap))
        sheet.paste(picture.resize((each, height), Image.Resampling.LANCZOS), place)
    return sheet
