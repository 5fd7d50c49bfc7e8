"""Progress of a flight: a live panel on a terminal, otherwise plain lines."""

import math
import re
import time
from collections.abc import Iterable, Sequence
from typing import Self

from rich.console import Group
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from uam_lab.flights.observer import STARTING, DeviceState, FlightStatus, Observer
from uam_lab.records.results.terminal import Terminal

PLAIN_INTERVAL = 10.0  # [s] of mission time between two plain lines within a phase


class Progress(Observer):
    """Shows messages and the newest status. A context manager."""

    def __init__(self, console: Terminal | None = None, duration: float | None = None):
        """duration: planned duration of the mission [s], if known."""
        self.console = console or Terminal()
        self._duration = duration
        self._live: Live | None = None
        self._shown: tuple[str, float, str] = ("", -math.inf, "")
        self._begin = time.monotonic()
        self._autopilot = ""
        self._devices: dict[str, DeviceState] = {}
        self._status: FlightStatus | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception) -> None:
        self.finish()

    def message(self, text: str) -> None:
        """Print one permanent line."""
        self.console.print(text, soft_wrap=True)

    def bring_up(self, devices: Sequence[DeviceState]) -> None:
        """Show the devices: as a table until all are there, without a terminal each change."""
        known, self._devices = self._devices, {one.name: one for one in devices}
        if self.console.is_terminal:
            self._show()
            return
        for one in devices:
            before = known.get(one.name)
            shown = before is not None and before.present == one.present
            same = shown and (one.present or gist(before.text) == gist(one.text))
            if one.text != STARTING and not same:
                check = "" if one.present else f"; check: {one.advice}"
                state = "present" if one.present else "missing"
                self.message(f"{one.name}: {state}: {one.text}{check}")

    def update(self, status: FlightStatus) -> None:
        if not self.console.is_terminal:
            self._plain(status)
            return
        self._status = status
        self._show()

    def _show(self) -> None:
        if self._live is None:
            self._live = Live(
                console=self.console, refresh_per_second=4, transient=True, redirect_stderr=False
            )
            self._live.start()
        devices = self._devices.values()
        parts = [device_table(devices)] if not all(one.present for one in devices) else []
        if self._status is not None:
            parts.append(self._panel(self._status))
        self._live.update(Group(*parts))

    def finish(self) -> None:
        """Remove the live panel."""
        if self._live is not None:
            self._live.stop()
            self._live = None

    def _plain(self, status: FlightStatus) -> None:
        if status.time < 0.0 and status.autopilot != self._autopilot:
            self._autopilot = status.autopilot
            self.message(f"autopilot {status.autopilot}")
        phase, last, control = self._shown
        known = (status.phase, status.released_to) == (phase, control)
        if known and status.time < last + PLAIN_INTERVAL:
            return
        self._shown = (status.phase, status.time, status.released_to)
        self.message(
            f"{self._when(status):>15}  {status.phase:<9} "
            f"errors {status.position_error:.3f} m, {math.degrees(status.attitude_error):.1f} deg, "
            f"arm {math.degrees(status.arm_error):.1f} deg; "
            f"tilt {math.degrees(status.tilt):.1f} deg; "
            f"{status.real_time_factor:.2f}x real time{released(status)}"
        )

    def _when(self, status: FlightStatus) -> str:
        if status.time < 0.0:
            return "before take-off"
        if self._duration is None:
            return f"{status.time:.1f} s"
        return f"{status.time:.1f} of {self._duration:.0f} s"

    def _panel(self, status: FlightStatus) -> Table:
        table = Table.grid(padding=(0, 3))
        bar = ""
        if self._duration is not None:
            bar = ProgressBar(self._duration, max(status.time, 0.0), width=40)
        table.add_row("phase", Text(status.phase, "bold"), bar)
        table.add_row("mission time", self._when(status))
        table.add_row(
            "errors",
            f"{status.position_error:.3f} m",
            f"attitude {math.degrees(status.attitude_error):.2f}°   "
            f"arm {math.degrees(status.arm_error):.2f}°",
        )
        table.add_row("tilt", f"{math.degrees(status.tilt):.2f}°")
        if status.released_to:
            table.add_row("control", Text(status.released_to, "bold yellow"))
        table.add_row("real time", f"{status.real_time_factor:.2f}x", status.autopilot)
        return table


def gist(text: str) -> str:
    """Return the text without its numbers, of which some grow: ages, counts."""
    return re.sub(r"\d+", "", text)


def device_table(devices: Iterable[DeviceState]) -> Table:
    table = Table("device", "", "found", "check by", box=None, padding=(0, 2), header_style="dim")
    for one in devices:
        state = Text("present", "green") if one.present else Text("missing", "bold yellow")
        table.add_row(one.name, state, Text(one.text), Text("" if one.present else one.advice))
    return table


def released(status: FlightStatus) -> str:
    """Return who has control if it is not the companion computer, for the end of a line."""
    return f"; {status.released_to}, has control" if status.released_to else ""
