"""Picture of the ratios to the paper's row, one mark per row and column."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from table1_flights.table import COLUMNS, FACTOR, Flown

MARKS = "osD^v<>p"


def draw(flown: Sequence[tuple[str, Flown]], file: Path) -> None:
    """Write the picture of (label, row) to `file`; the band is the factor of two."""
    figure, axes = plt.subplots(figsize=(8.0, 3.6), layout="constrained")
    axes.axhspan(1.0 / FACTOR, FACTOR, color="0.9", label="within a factor of two")
    axes.axhline(1.0, color="0.5", linewidth=0.8)
    places = np.arange(len(COLUMNS))
    for i, (label, one) in enumerate(flown):
        shift = 0.08 * (i - 0.5 * (len(flown) - 1))
        axes.semilogy(places + shift, one.ratios, MARKS[i % len(MARKS)], markersize=5, label=label)
    axes.set_xticks(places, [name.split(" [")[0] for name in COLUMNS])
    axes.set_ylabel("RMS error / the paper's")
    axes.legend(fontsize="small", loc="best")
    figure.savefig(file, metadata={"Date": None})
    plt.close(figure)
