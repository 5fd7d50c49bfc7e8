"""Picture of the memory of each process over a soak."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from soaking.samples import Soak
from uam_lab.report.figures import style


def draw(soak: Soak, file: Path) -> None:
    """Write soak.png."""
    with style.styled():
        figure = Figure(figsize=(style.WIDTH, 3.6), layout="constrained")
        axes = figure.subplots()
        for number, (name, samples) in enumerate(soak.usage.items()):
            times = np.array([time for time, _ in samples]) / 60.0
            axes.plot(
                times,
                [used.memory for _, used in samples],
                color=style.FLIGHTS[number % len(style.FLIGHTS)],
                linestyle="-" if number < len(style.FLIGHTS) else "--",
                label=name,
            )
        axes.set(xlabel=f"{soak.unit} [min]", ylabel="own memory [MB]", ylim=(0.0, None))
        axes.set_title(soak.title, loc="left")
        figure.legend(loc="outside right center")
        figure.savefig(file, dpi=style.PIXELS_PER_INCH)
