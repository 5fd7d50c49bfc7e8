"""Snapshots and video of a flight, rendered without a screen.

    python -m uam_lab.report.video.flight_video DIR [--no-video]

renders the flight in the result folder DIR. `Rendering` does so in a child process: MuJoCo selects
its OpenGL at import, and a broken driver may crash the process. The child writes its progress to
standard output, one line per step; a pipe holds all of them.
"""

import argparse
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np

from uam_control.settings.atomic import replacing
from uam_lab.records.results import timeseries
from uam_lab.records.results.result_folder import TABLE
from uam_lab.records.results.timeseries import Series
from uam_lab.report.video import opengl

SNAPSHOT_SIZE = (1280, 720)
CAPTION_PART = 0.11  # of the height; large enough for the strip
SNAPSHOTS, STRIP, VIDEO = "snapshots", "snapshots.png", "flight.mp4"
PROGRESS = "progress: "
NO_RENDERER = 3  # exit status of the child
HOW_TO_GET_ONE = (
    "no offscreen renderer found, the report has no pictures of the flight; "
    "on Debian or Ubuntu: sudo apt install libegl1 libgl1-mesa-dri"
)


@dataclass(frozen=True)
class Rendered:
    """The existing pictures; `problem` is one line for the user, empty without a problem."""

    snapshots: tuple[Path, ...] = ()
    strip: Path | None = None
    video: Path | None = None
    problem: str = ""


class Rendering:
    """Renders a flight in a child process, while this process does other work.

    A context manager: the child has ended after the `with` block.
    """

    def __init__(self, directory: Path, video: bool = True) -> None:
        """Start to render the flight in `directory` to `directory`/figures."""
        self._directory, self._video = directory, video
        first, *self._further = opengl.platforms()
        self._child = self._start(first)

    def _start(self, platform: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", "uam_lab.report.video.flight_video", str(self._directory)]
        return subprocess.Popen(
            command if self._video else [*command, "--no-video"],
            env=opengl.environment(platform),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            encoding="utf-8",
        )

    def result(self, progress: Callable[[str], None] = lambda text: None) -> Rendered:
        """Wait for the end; return the pictures. Missing OpenGL is no error."""
        status, last_line = self._wait(progress)
        first_line = last_line
        for platform in self._further:
            if status != NO_RENDERER:
                break
            self._child = self._start(platform)
            status, last_line = self._wait(progress)
        problem = ""
        if status == NO_RENDERER:
            problem = f"{HOW_TO_GET_ONE} ({first_line[:120]})"
        elif status != 0:
            problem = f"rendering failed: {last_line or f'exit status {status}'}"
        return replace(existing(self._directory), problem=problem)

    def _wait(self, progress: Callable[[str], None]) -> tuple[int, str]:
        """Return exit status of the child and its last line that is no progress."""
        last_line = ""
        for line in self._child.stdout or ():
            if line.startswith(PROGRESS):
                progress(line.removeprefix(PROGRESS).strip())
            elif line.strip():
                last_line = line.strip()
        return self._child.wait(), last_line

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception) -> None:
        if self._child.poll() is None:
            self._child.terminate()
            self._child.wait()
        if self._child.stdout is not None:
            self._child.stdout.close()


def existing(directory: Path) -> Rendered:
    """Return the existing pictures in `directory`."""
    figures = directory / "figures"
    strip, video = figures / STRIP, figures / VIDEO
    return Rendered(
        tuple(sorted((figures / SNAPSHOTS).glob("*.png"))),
        strip if strip.exists() else None,
        video if video.exists() else None,
    )


def snapshot_times(series: Series) -> list[tuple[float, str]]:
    """Return (mission time [s], caption): the reached ones of the scenario, else six times."""
    flown = series.time[series.flown]
    if not len(flown):
        return [(float(series.time[-1]), "on the ground")]
    planned = [(float(t), str(c)) for t, c in series.info.get("snapshots") or []]
    reached = [(t, c) for t, c in planned if t <= flown[-1]]
    if reached:
        return reached
    times = np.linspace(flown[0], flown[-1], 8)[1:-1]
    return [
        (float(t), f"({letter}) {series.phase_names[series.phases[series.row_at(t)]]}")
        for letter, t in zip("abcdef", times, strict=True)
    ]


def render_here(directory: Path, video: bool, report: Callable[[str], None]) -> None:
    """Render in this process; MUJOCO_GL must be set before its start."""
    series = timeseries.read(directory / TABLE)
    report("opening the renderer")
    figures = directory / "figures"
    _snapshots(series, figures, report)
    if video:
        _video(series, figures / VIDEO, report)


def _snapshots(series: Series, figures: Path, report: Callable[[str], None]) -> None:
    from uam_lab.report.video import flight_pictures

    folder = figures / SNAPSHOTS
    folder.mkdir(parents=True, exist_ok=True)
    scene = _scene(series, SNAPSHOT_SIZE)
    snapshots = snapshot_times(series)
    pictures = []
    for number, (time, caption) in enumerate(snapshots):
        report(f"snapshot {number + 1} of {len(snapshots)}")
        pixels = scene.picture(series.row_at(time))
        pictures.append(
            flight_pictures.labelled(pixels, caption, f"t = {time:.1f} s", CAPTION_PART)
        )
        with replacing(folder / f"{'abcdefghijklmnopqrstuvwxyz'[number % 26]}.png") as temporary:
            pictures[-1].save(temporary)
    scene.close()
    with replacing(figures / STRIP) as temporary:
        flight_pictures.strip(pictures).save(temporary)


def _video(series: Series, path: Path, report: Callable[[str], None]) -> None:
    from uam_lab.report.video import flight_pictures

    scene = _scene(series, flight_pictures.SIZE)

    def show(done: int, of: int) -> None:
        if done % 10 == 0 or done == of:
            report(f"video {100 * done // of} %")

    flight_pictures.write(series, scene.picture, path, show)
    scene.close()


class NoRenderer(RuntimeError):
    """No OpenGL can draw without a screen."""


def _scene(series: Series, size: tuple[int, int]):
    try:
        # The import of MuJoCo fails if the library that MUJOCO_GL selects is missing.
        from uam_lab.report.video.flight_pictures import Scene

        return Scene(series, *size)
    except Exception as error:  # MuJoCo, PyOpenGL and GLFW raise different types
        raise NoRenderer(f"{type(error).__name__}: {error}") from error


def main(arguments: list[str] | None = None) -> int:
    """Run the command line, see the docstring of the module."""
    parser = argparse.ArgumentParser(prog="python -m uam_lab.report.video.flight_video")
    parser.add_argument("directory", type=Path)
    parser.add_argument("--no-video", action="store_true")
    options = parser.parse_args(arguments)
    opengl.choose()

    def report(text: str) -> None:
        print(PROGRESS + text, flush=True)

    try:
        render_here(options.directory, not options.no_video, report)
    except NoRenderer as error:
        print(error, file=sys.stderr)
        return NO_RENDERER
    except timeseries.UnreadableFlight as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
