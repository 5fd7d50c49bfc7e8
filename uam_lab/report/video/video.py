"""A short video of a flight: H.264, accelerated, with phase and time as caption."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import imageio_ffmpeg
import numpy as np

from uam_lab.report.figures.panels import MARGIN_S
from uam_lab.report.video.captions import labelled
from uam_lab.results.atomic import replacing
from uam_lab.results.timeseries import Series

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
