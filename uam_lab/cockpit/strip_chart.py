"""Strip charts: the last seconds of a few series."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import viser
from viser import uplot

COLOURS = ("#1f5fa8", "#d95f02", "#1b8a5a", "#8e3b9e", "#c0a000", "#666666")
SMALLEST = 1e-9  # shown in place of zero on a logarithmic axis
HEIGHT = 150  # [px]


@dataclass(frozen=True)
class Chart:
    """title: with unit; names: of the series; logarithmic: scale of the y axis."""

    title: str
    names: tuple[str, ...]
    logarithmic: bool = False


class StripChart:
    """One chart of the page: `add` stores samples, `draw` sends them to the page."""

    def __init__(self, gui: viser.GuiApi, chart: Chart, window: float, interval: float):
        """window: shown time [s]; interval: minimum time between two stored samples [s]."""
        self._chart, self._window, self._interval = chart, window, interval
        self._rows: deque[tuple[float, ...]] = deque()
        series = [uplot.Series(label="t [s]")]
        series += [
            uplot.Series(label=name, stroke=colour, width=1.5, points={"show": False})
            for name, colour in zip(chart.names, COLOURS, strict=False)
        ]
        scales = {"x": {"time": False}, "y": {"distr": 3 if chart.logarithmic else 1}}
        axes = ({"size": 34}, {"size": 58})
        self._handle = gui.add_uplot(
            tuple(np.zeros(1) + SMALLEST for _ in series),
            tuple(series),
            title=chart.title,
            scales=scales,
            axes=axes,
            height=HEIGHT,
        )
        self._new = False

    def add(self, time: float, values: Sequence[float]) -> None:
        """Store a sample (n,) at time [s]; ignore it if its length is wrong or it is not finite."""
        rows = self._rows
        if len(values) != len(self._chart.names) or not np.all(np.isfinite(values)):
            return
        if rows and time < rows[-1][0]:  # another flight has begun
            rows.clear()
        if rows and time < rows[-1][0] + self._interval:
            return
        rows.append((time, *values))
        while rows[0][0] < time - self._window:
            rows.popleft()
        self._new = True

    def draw(self) -> None:
        """Send new samples to the page."""
        if not self._new:
            return
        self._new = False
        columns = np.array(self._rows).T
        if self._chart.logarithmic:
            columns[1:] = np.maximum(columns[1:], SMALLEST)
        self._handle.data = tuple(np.ascontiguousarray(column) for column in columns)
