"""The result of a flight, and the errors of the library; the text of each is one line."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from uam_lab.records.results.outcome import Outcome
from uam_lab.records.results.timeseries import PHASE_COLUMN, Series

if TYPE_CHECKING:
    import pandas


class FlightError(RuntimeError):
    """A flight cannot do what was requested."""


class FlightEnded(FlightError):
    """The flight has ended without what was waited for."""


class NotInTime(FlightError, TimeoutError):
    """The flight did not do in time what was waited for."""


class CommandRefused(FlightError):
    """The flight refused a command or a parameter; the text is the reason."""


@dataclass(frozen=True)
class FlightResult:
    """Result of a flight."""

    folder: Path  # with metrics.json, timeseries.parquet, log.mcap and logs/
    metrics: dict[str, Any] | None  # content of metrics.json, None if no control tick was recorded
    outcome: Outcome  # facts of the engine, such as transitions and faults

    @property
    def completed(self) -> bool:
        """Whether the mission was completed, without a failure."""
        done = self.metrics is not None and self.metrics["mission_completed"]
        return bool(done) and not self.outcome.failure

    @property
    def reason(self) -> str:
        """Why the mission was not completed, "" if it was."""
        if self.completed:
            return ""
        shortfalls = (self.metrics or {}).get("shortfalls", ())
        return self.outcome.reason or "; ".join(shortfalls) or "nothing was recorded"

    @property
    def series(self) -> Series:
        """The recorded table, one row per control tick. Raises FlightError if there is none."""
        if self.outcome.series is None:
            raise FlightError(f"nothing was recorded: {self.reason}")
        return self.outcome.series

    @property
    def units(self) -> dict[str, str]:
        """Name → unit of each column. Raises FlightError if nothing was recorded."""
        return dict(self.series.columns.units)

    def __getitem__(self, column: str) -> np.ndarray:
        """Return a column (ticks,), for instance "time" or "error.x", in SI units.

        Raises KeyError for an unknown name, FlightError if nothing was recorded.
        """
        return self.series[column]

    def phase(self) -> np.ndarray:
        """Return the name of the phase at each tick (ticks,)."""
        return np.array(self.series.phase_names)[self.series.phases]

    def frame(self) -> pandas.DataFrame:
        """Return the table as a pandas.DataFrame: columns by name, and the phase. Needs pandas."""
        import pandas

        series = self.series
        table = pandas.DataFrame(series.values, columns=list(series.columns.names), copy=True)
        table.insert(1, PHASE_COLUMN, pandas.Categorical(self.phase()))
        return table

    def report(self, video: bool = False) -> Path:
        """Write figures and report.html; return the page. Takes up to a minute with video.

        Raises FlightError if nothing was recorded.
        """
        from uam_lab.report.build import build_report

        if self.metrics is None:
            raise FlightError(f"no report: {self.reason}")
        return build_report(self.folder, video=video).page


class FlightFailed(FlightError):
    """A technical failure ended the flight, for instance the loss of a node."""

    def __init__(self, reason: str, result: FlightResult) -> None:
        super().__init__(reason)
        self.result = result  # of the flight up to then
