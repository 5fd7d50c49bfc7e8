"""Pictures of a recorded flight: the plant's model with camera, light and paths.

MuJoCo reads MUJOCO_GL at import, so this runs in a separate process with MUJOCO_GL=egl; see
`rendering`.
"""

import math
from collections.abc import Callable
from functools import cache
from pathlib import Path

import imageio_ffmpeg
import matplotlib
import mujoco
import numpy as np
from PIL import Image, ImageDraw, ImageFont
from scipy.ndimage import uniform_filter1d

from uam_control.settings.atomic import replacing
from uam_lab.records.results.timeseries import Series
from uam_lab.report.figures.panels import MARGIN_S
from uam_lab.report.figures.path_figure import Poses

FOLLOW = 0.62  # camera motion / vehicle motion; below 1, so that the motion is visible
SMOOTHING_S = 2.0
CAMERA = {"azimuth": 108.0, "elevation": -11.0, "distance": 2.0, "height": 0.52}
HEADROOM = 0.6  # [m] height of the vehicle above the camera's target that is in the picture
TRAIL_RGBA = (0.12, 0.37, 0.66, 0.95)
REFERENCE_RGBA = (0.35, 0.40, 0.45, 0.55)
SEGMENTS = 140  # of a path; of the reference every second one is drawn
GEOMS = 2000
# Pixels of the shadow map, samples per pixel; coarse: pictures of up to LOW rows, as in a video.
# Without a GPU smooth edges double the time of a picture, and the video's compression hides them.
COARSE, FINE, LOW = (1024, 0), (2048, 4), 600
STRIP_COLUMNS, STRIP_WIDTH, STRIP_GAP = 3, 1560, 6  # the last two in pixels
WHITE = (255, 255, 255)
SHADE = (20, 30, 40, 150)
SIZE = (848, 480)  # pixels; H.264 needs even numbers
RATE = 18  # pictures per second
LONGEST_S = 15.0
BITS_PER_SECOND = 1_600_000  # keeps the longest video below 4 MB


class Scene:
    """Renders any row of a series at a fixed size."""

    def __init__(self, series: Series, width: int, height: int):
        """width, height: pixels. Without OpenGL the errors of `mujoco.Renderer` are raised."""
        self.poses = Poses(series)
        self.series = series
        self._thickness = height / 480  # lines are measured in pixels
        _light(self.poses.model, *(COARSE if height <= LOW else FINE))
        vis = self.poses.model.vis
        vis.global_.offwidth, vis.global_.offheight = width, height
        self._renderer = mujoco.Renderer(self.poses.model, height, width, GEOMS)
        self._camera = mujoco.MjvCamera()
        self._camera.azimuth, self._camera.elevation = CAMERA["azimuth"], CAMERA["elevation"]
        self._camera.distance = CAMERA["distance"]
        highest = float(np.nanmax(series["truth.z"]))
        self._height = max(CAMERA["height"], highest - HEADROOM)
        self._look_at = FOLLOW * _smooth(series)
        self._path_rows = _path_rows(series)

    def close(self) -> None:
        """Release the OpenGL context."""
        self._renderer.close()

    def picture(self, row: int) -> np.ndarray:
        """Return the image (height, width, 3) uint8 of a row, with flown path and reference."""
        self.poses.put(row)
        # the renderer also needs the poses of cameras and lights
        mujoco.mj_camlight(self.poses.model, self.poses.data)
        x, y = self._look_at[row]
        self._camera.lookat[:] = x, y, self._height
        self._renderer.update_scene(self.poses.data, self._camera)
        self._draw_path("reference.", self._path_rows, REFERENCE_RGBA, 1.5, dashed=True)
        flown = self._path_rows[self._path_rows <= row]
        self._draw_path("truth.", np.append(flown, row), TRAIL_RGBA, 2.5, dashed=False)
        return self._renderer.render()

    def _draw_path(
        self, group: str, rows: np.ndarray, rgba: tuple[float, ...], pixels: float, dashed: bool
    ) -> None:
        columns = [f"{group}{axis}" for axis in "xyz"]
        points = np.column_stack([self.series[c][rows] for c in columns])
        scene = self._renderer.scene
        for i in range(0, len(points) - 1, 2 if dashed else 1):
            if scene.ngeom >= scene.maxgeom or np.isnan(points[i : i + 2]).any():
                continue
            geom = scene.geoms[scene.ngeom]
            line = mujoco.mjtGeom.mjGEOM_LINE
            mujoco.mjv_initGeom(
                geom, line, np.zeros(3), np.zeros(3), np.zeros(9), np.array(rgba, np.float32)
            )
            mujoco.mjv_connector(geom, line, self._thickness * pixels, points[i], points[i + 1])
            geom.category = mujoco.mjtCatBit.mjCAT_DECOR  # no shadow
            scene.ngeom += 1


def _light(model: mujoco.MjModel, shadow: int, samples: int) -> None:
    """Set bright surroundings and light shadows; no floor reflection (one render pass less).

    shadow: pixels of the shadow map; samples: per pixel, 0 for edges that are not smooth.
    """
    model.vis.headlight.ambient[:] = 0.50
    model.vis.headlight.diffuse[:] = 0.22
    model.light_diffuse[:] = 0.42
    model.light_specular[:] = 0.25
    model.mat_reflectance[:] = 0.0
    model.vis.quality.offsamples = samples
    model.vis.quality.shadowsize = shadow
    model.vis.map.fogstart, model.vis.map.fogend = 4.0, 12.0


def _smooth(series: Series) -> np.ndarray:
    """Return the vehicle's path x, y (ticks, 2) [m, world], averaged over SMOOTHING_S."""
    path = np.column_stack([series["truth.x"], series["truth.y"]])
    path = np.nan_to_num(path)
    time = series.time
    half = int(0.5 * SMOOTHING_S * (len(time) - 1) / max(time[-1] - time[0], 1e-9))
    if half < 1 or 2 * half + 1 > len(path):
        return path
    return uniform_filter1d(path, 2 * half + 1, axis=0, mode="nearest")


def _path_rows(series: Series) -> np.ndarray:
    """Return airborne rows, evenly spaced along the path of the reference, not over time."""
    flown = np.flatnonzero(series.flown)
    if len(flown) < 2:
        return flown
    points = np.column_stack([series[f"reference.{axis}"][flown] for axis in "xyz"])
    way = np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1) + 1e-9)
    marks = np.linspace(0.0, way[-1], SEGMENTS + 1)
    return flown[np.minimum(np.searchsorted(way, marks), len(flown) - 1)]


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


def strip(pictures: list[Image.Image]) -> Image.Image:
    """Return the pictures side by side in rows."""
    width, gap = STRIP_WIDTH, STRIP_GAP
    columns = min(STRIP_COLUMNS, len(pictures))
    each = (width - gap * (columns - 1)) // columns
    height = round(each * pictures[0].height / pictures[0].width)
    rows = -(-len(pictures) // columns)
    sheet = Image.new("RGB", (width, rows * height + gap * (rows - 1)), WHITE)
    for number, picture in enumerate(pictures):
        row, column = divmod(number, columns)
        place = (column * (each + gap), row * (height + gap))
        sheet.paste(picture.resize((each, height), Image.Resampling.LANCZOS), place)
    return sheet
