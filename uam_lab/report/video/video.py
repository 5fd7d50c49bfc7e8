"""Captions on pictures, the strip of snapshots, and a short accelerated video (H.264)."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from pathlib import Path

import imageio_ffmpeg
import matplotlib
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from uam_lab.records.results.atomic import replacing
from uam_lab.records.results.timeseries import Series
from uam_lab.report.figures.panels import MARGIN_S

WHITE = (255, 255, 255)
SHADE = (20, 30, 40, 150)
SIZE = (848, 480)  # pixels; H.264 needs even numbers
RATE = 18  # pictures per second
LONGEST_S = 15.0
BITS_PER_SECOND = 1_600_000  # keeps the longest video below 4 MB


def speed_up(duration: float) -> int:
    """Return the integer speed factor of the video for a flight of `duration` [s]."""
    return max(1, math.ceil(duration / LONGEST_S))


def frame_rows(series: Series) -> tuple[np.ndarray, int]:
    """Return the rows (frames,) of the series for the video, and the speed factor."""
    flown = series.time[series.flown]
    start, end = (flown[0], flown[-1]) if len(flown) else (series.time[0], series.time[-1])
    start, end = max(start - MARGIN_S, series.time[0]), min(end + MARGIN_S, series.time[-1])
    speed = speed_up(end - start)
    times = np.arange(start, end, speed / RATE)
    rows = np.searchsorted(series.time, times)
    return np.minimum(rows, len(series) - 1), speed


def write(
    series: Series,
    picture: Callable[[int], np.ndarray],
    path: Path,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> None:
    """Write `path` (.mp4) from picture(row) → uint8 (height, width, 3); progress(done, of)."""
    rows, speed = frame_rows(series)
    with replacing(path) as temporary:
        encoder = imageio_ffmpeg.write_frames(
            str(temporary),
            SIZE,
            fps=RATE,
            codec="libx264",
            pix_fmt_out="yuv420p",
            macro_block_size=1,
            output_params=[
                *("-preset", "slow", "-crf", "22", "-threads", "2"),
                *("-maxrate", str(BITS_PER_SECOND), "-bufsize", str(2 * BITS_PER_SECOND)),
                *("-movflags", "+faststart"),
            ],
            ffmpeg_log_level="error",
        )
        encoder.send(None)
        try:
            for done, row in enumerate(rows, start=1):
                phase = series.phase_names[series.phases[row]]
                when = f"t = {series.time[row]:5.1f} s   ·   {speed}× speed"
                frame = labelled(picture(row), phase, when)
                encoder.send(np.ascontiguousarray(frame))
                progress(done, len(rows))
        finally:
            encoder.close()


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
