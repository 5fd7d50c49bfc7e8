"""Snapshots and video: content, times, and behaviour without a renderer."""

import json
import os
import subprocess

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

from uam_lab.records.results.timeseries import Series
from uam_lab.report import build
from uam_lab.report.build import build_report
from uam_lab.report.figures import figures
from uam_lab.report.figures.path_figure import Poses
from uam_lab.report.video import flight_pictures, flight_video, opengl


def cut(series, end):
    """Return the flight up to mission time `end` [s], with one snapshot."""
    rows = series.time < end
    info = series.info | {"snapshots": [[0.5 * end, "(a) take-off"], [80.0, "never reached"]]}
    return Series(
        series.values[rows], series.phases[rows], series.phase_names, info, series.columns
    )


def test_a_pose_reproduces_the_recorded_positions(flight):
    poses = Poses(flight)
    row = flight.row_at(50.0)
    poses.put(row)
    np.testing.assert_allclose(poses.data.body("base").xpos, flight.block("truth.")[row, :3])
    np.testing.assert_allclose(poses.data.body("payload").xpos, flight.block("payload.")[row, :3])
    chi = flight.block("truth.")[row].copy()
    # link 1 by hand, at the recorded attitude: 0.1 m at alpha_1 from straight down
    link_2 = poses.data.body("link_2").xpos - poses.data.body("link_1").xpos
    assert np.linalg.norm(link_2) == pytest.approx(0.1)
    down = np.array([np.sin(chi[6] - chi[4]), 0.0, -np.cos(chi[6] - chi[4])])
    np.testing.assert_allclose(link_2 / 0.1, down, atol=0.03)


def test_without_payload_its_body_is_out_of_sight(flight):
    info = flight.info | {"payload_mass_kg": 0.0}
    poses = Poses(Series(flight.values, flight.phases, flight.phase_names, info, flight.columns))
    poses.put(flight.row_at(50.0))
    assert np.linalg.norm(poses.data.body("payload").xpos) > 20.0


def test_snapshots_are_those_of_the_scenario_up_to_the_end_of_the_flight(flight):
    times = flight_video.snapshot_times(flight)
    assert [caption[:3] for _, caption in times] == ["(a)", "(b)", "(c)", "(d)", "(e)", "(f)"]
    assert flight_video.snapshot_times(cut(flight, 3.0)) == [(1.5, "(a) take-off")]
    plain = Series(flight.values, flight.phases, flight.phase_names, {}, flight.columns)
    spread = flight_video.snapshot_times(plain)
    assert len(spread) == 6
    assert spread[0][1] == "(a) approach"


def test_a_video_has_a_limited_length_and_an_integer_speed_factor(flight):
    rows, speed = flight_pictures.frame_rows(flight)
    assert speed == 6
    assert 12.0 < len(rows) / flight_pictures.RATE <= flight_pictures.LONGEST_S
    steps = np.diff(flight.time[rows])
    assert steps.mean() == pytest.approx(speed / flight_pictures.RATE, rel=0.01)
    assert flight_pictures.speed_up(14.0) == 1
    assert flight_pictures.speed_up(15.1) == 2


def test_without_a_renderer_the_report_is_written_with_advice(flight_folder, monkeypatch):
    for screen in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(screen, raising=False)
    monkeypatch.setattr(opengl, "FALLBACKS", ("glfw",))
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr(figures, "FIGURES", {})
    report = build_report(flight_folder)
    assert report.problem.startswith(flight_video.HOW_TO_GET_ONE)
    assert "\n" not in report.problem
    html = report.page.read_text()
    assert "apt install libegl1 libgl1-mesa-dri" in html
    assert "<video" not in html


def test_a_platform_of_the_user_that_does_not_draw_is_followed_by_the_others(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    assert opengl.platforms() == ("osmesa", "egl")
    monkeypatch.setenv("MUJOCO_GL", "")
    assert opengl.platforms() == ("egl", "osmesa")
    opengl.choose()
    assert opengl.environment("glfw")["MUJOCO_GL"] == "glfw"
    assert os.environ["MUJOCO_GL"] == "egl"


def rendered_in(folder, progress=lambda text: None):
    with flight_video.Rendering(folder) as rendering:
        return rendering.result(progress)


def test_a_folder_without_a_flight_is_one_line(tmp_path):
    rendered = rendered_in(tmp_path)
    assert rendered.problem.startswith("rendering failed: ")
    assert "timeseries.parquet" in rendered.problem


def test_snapshots_and_video_are_rendered_without_a_screen(tmp_path, flight):
    short = cut(flight, 1.0)
    short.write(tmp_path / "timeseries.parquet")
    (tmp_path / "metrics.json").write_text(json.dumps({}))
    steps = []
    rendered = rendered_in(tmp_path, progress=steps.append)
    if rendered.problem.startswith(flight_video.HOW_TO_GET_ONE):
        pytest.skip(rendered.problem)
    assert rendered.problem == ""
    assert steps[-1] == "video 100 %"
    assert [file.name for file in rendered.snapshots] == ["a.png"]
    with Image.open(rendered.snapshots[0]) as picture:
        assert picture.size == flight_video.SNAPSHOT_SIZE
        pixels = np.asarray(picture.convert("RGB"), dtype=float)
    # blue sky at the top, dark pixels of the vehicle in the middle
    assert pixels[20, :, 2].mean() > pixels[20, :, 0].mean() + 20.0
    assert (pixels[:600].sum(axis=2) < 150.0).sum() > 500
    probe = subprocess.run(
        [imageio_ffmpeg.get_ffmpeg_exe(), "-i", str(rendered.video)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert "h264" in probe.stderr
    assert "yuv420p" in probe.stderr
    assert "848x480" in probe.stderr
    frames, _ = imageio_ffmpeg.count_frames_and_secs(str(rendered.video))
    assert frames == len(flight_pictures.frame_rows(short)[0])


def test_an_error_of_the_figures_ends_the_rendering(flight_folder, monkeypatch):
    started = []

    class Noted(flight_video.Rendering):
        def _start(self, platform):
            started.append(super()._start(platform))
            return started[-1]

    def fail(*_):
        assert started[0].poll() is None  # the pictures are rendered meanwhile
        raise ValueError("no figure")

    monkeypatch.setattr(build, "Rendering", Noted)
    monkeypatch.setattr(figures, "draw", fail)
    with pytest.raises(ValueError, match="no figure"):
        build_report(flight_folder)
    assert len(started) == 1 and started[0].poll() is not None
