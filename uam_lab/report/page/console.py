"""Terminal output: progress of the report, and the table at the end of a flight."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Group
from rich.table import Table
from rich.text import Text

from uam_control.laws import catalogue
from uam_lab.records.results.terminal import Terminal
from uam_lab.report.facts import flight_summary

NUMBER = 6  # [characters] of a column of numbers, at least


@contextmanager
def reporting(console: Terminal) -> Iterator[Callable[[str], None]]:
    """Progress for `build_report`: a live line on a terminal, otherwise one line per kind of step.

    with reporting(console) as progress:
        build_report(directory, progress)
    """
    if console.is_terminal:
        with console.status("report") as status:
            yield lambda text: status.update(Text(f"report: {text}"))
        return
    printed: set[str] = set()

    def show(text: str) -> None:
        kind = text.split()[0]
        if kind not in printed:
            printed.add(kind)
            console.print(f"report: {text}")

    yield show


def summary(metrics: Mapping[str, Any], directory: Path | None = None) -> Group:
    """Return verdict, RMS errors beside the paper's, payload, landing and folder for rich."""
    done = metrics["mission_completed"]
    headline = Text(flight_summary.verdict(metrics), style="bold green" if done else "bold red")
    for shortfall in metrics.get("shortfalls") or []:
        headline.append(f"\n  {shortfall}", style="red")
    return Group(headline, error_table(metrics), phase_table(metrics), facts(metrics, directory))


def error_table(metrics: Mapping[str, Any]) -> Table:
    """Return the table of the RMS errors of the whole flight beside the paper's."""
    table = Table(title="RMS error, take-off to touchdown command", title_justify="left")
    table.caption, table.caption_justify = flight_summary.not_compared(metrics) or None, "left"
    table.add_column("")
    for heading in ("this flight", "paper", "largest"):
        table.add_column(heading, justify="right")
    table.add_column("")
    group = None
    for row in flight_summary.error_rows(metrics):
        if group is not None and row.group != group:
            table.add_section()
        group = row.group
        good = {True: ("green", "better"), False: ("yellow", "worse"), None: ("dim", "")}
        colour, word = good[row.better]
        if row.better and row.rms == row.paper:
            word = "equal"
        table.add_row(
            row.name,
            Text(row.shown(row.rms), style=f"bold {colour}"),
            row.shown(row.paper),
            row.shown(row.largest),
            Text(word, style=colour),
        )
    return table


def phase_table(metrics: Mapping[str, Any]) -> Table:
    table = Table(title="RMS error by phase", title_justify="left", padding=(0, 0, 0, 1))
    for heading in flight_summary.PHASE_HEADINGS:
        if heading == "phase":  # a long name is folded, no number is cut
            table.add_column(heading, overflow="fold")
        else:
            table.add_column(heading, justify="right", min_width=NUMBER)
    for row in flight_summary.phase_rows(metrics):
        table.add_row(*row.texts, style="bold" if row.whole else "")
    return table


def facts(metrics: Mapping[str, Any], directory: Path | None) -> Table:
    """Return the table of payload, landing, times and folder, one per line."""
    table = Table.grid(padding=(0, 2))
    table.add_column(style="dim")
    table.add_column(overflow="fold")
    table.add_row("controller", catalogue.label(metrics["controller"]))
    if metrics.get("layout"):
        table.add_row("layout", metrics["layout"])
    table.add_row("payload", flight_summary.payload_story(metrics))
    table.add_row("landing", flight_summary.landing_story(metrics))
    hand = flight_summary.hand_story(metrics)
    if hand:
        table.add_row("end effector", hand)
    interventions = flight_summary.supervision_story(metrics)
    if interventions:
        table.add_row("supervisor", interventions)
    factor = metrics.get("real_time_factor")
    speed = f", {factor:.2f} × real time" if factor else ""
    table.add_row("flown", f"{metrics['duration_s']:.1f} s{speed}")
    latency = metrics.get("latency_ms")
    if latency and latency.get("p50") is not None:
        figures = ", ".join(f"{name} {latency[name]:.1f} ms" for name in ("p50", "p99", "max"))
        table.add_row("latency", figures)
    if metrics.get("missed_ticks") is not None:
        table.add_row("missed", f"{metrics['missed_ticks']} control ticks")
    if metrics.get("clamps"):
        table.add_row("clamps", flight_summary.clamp_story(metrics))
    if directory is not None:
        table.add_row("results", str(directory))
        if (directory / "report.html").exists():
            table.add_row("report", str(directory / "report.html"))
    return table
