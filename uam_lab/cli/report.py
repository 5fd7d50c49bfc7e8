"""`uam report`: rebuild figures and report from the log alone; overlay several flights.

Rebuild table, metrics, figures and report of a flight from its log.mcap, or draw several flights in
the same figures.

examples:
  uam report results/latest                rebuild everything from its log.mcap, also after a flight
                                           that was killed
  uam report results/latest --ulog a.ulg   with the log of PX4 beside ours
  uam report results/latest --out again    write to another folder
  uam report results/a results/b           both flights in the same figures
"""

import argparse
from pathlib import Path

from uam_lab.cli.command import Command, path
from uam_lab.flights.flight_settings import require_ros
from uam_lab.records.results.result_folder import LOG, ResultFolderError, make_folder, read_json
from uam_lab.records.results.terminal import Terminal, say

# of metrics.json, without which there is no summary
SHOWN = ("controller", "mission_completed", "duration_s", "rms", "max")


def add(command: Command) -> None:
    text = f"result folder of a flight, or its {LOG}"
    command.option("directories", "DIR", text, nargs="+", type=_folder)
    text = "result folder (default: the given one; for several flights results/<time>-report)"
    command.option("--out", "DIR", text, type=path)
    command.option("--scenario", "NAME|FILE", "the flown scenario, for a log without one")
    text = "log of PX4 to show beside ours (default: px4.ulg of the folder); needs pyulog"
    command.option("--ulog", "FILE", text, type=path)
    command.switch("--no-video", "leave out the video, which takes longest")
    command.switch("--no-pictures", "leave out snapshots and video")


def _folder(text: str) -> Path:
    given = path(text)
    return given.parent if given.name == LOG else given


def run(options: argparse.Namespace) -> int:
    return several(options) if len(options.directories) > 1 else one(options)


def one(options: argparse.Namespace) -> int:
    """Rebuild the report of one flight; return the exit status."""
    from uam_lab.records.rebuild import copy_flight, rebuild
    from uam_lab.report.build import build_report
    from uam_lab.report.page.console import reporting, summary

    (directory,) = options.directories
    out = options.out or directory
    if (directory / LOG).exists():
        require_ros()
        metrics = rebuild(directory, out, options.scenario)
    elif (directory / "metrics.json").exists():  # of the direct engine
        metrics = read_json(directory / "metrics.json")
        if missing := [name for name in SHOWN if name not in metrics]:
            raise ResultFolderError(f"{directory / 'metrics.json'}: {missing[0]} is missing")
        make_folder(out, shared=True)
        if out.resolve() != directory.resolve():
            copy_flight(directory, out)
    else:
        raise ResultFolderError(f"{directory} has neither {LOG} nor metrics.json for a report")
    console = Terminal()
    with reporting(console) as show:
        report = build_report(
            out, show, video=options.video, pictures=options.pictures, ulog=options.ulog
        )
    console.print(summary(metrics, out))
    info = out / "info.json"
    notes = read_json(info).get("notes") if info.exists() else None
    for note in [*(notes or ()), report.problem]:
        if note:
            say(f"note: {note}")
    return 0


def several(options: argparse.Namespace) -> int:
    """Write figures and page with several flights overlaid; return the exit status."""
    from uam_lab.records.rebuild import series_of
    from uam_lab.report.figures.panels import DrawnFlight
    from uam_lab.report.page.console import reporting
    from uam_lab.report.page.pages import build_overlay, labelled

    names = labelled(options.directories)
    flights = [
        DrawnFlight(name, series_of(directory))
        for name, directory in zip(names, options.directories, strict=True)
    ]
    out = make_folder(options.out, "report")
    with reporting(Terminal()) as show:
        page = build_overlay(flights, out, show)
    say(f"report: {page}")
    return 0
