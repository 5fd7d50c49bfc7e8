"""Picture of the places that an end effector reaches: from the left, from behind, from above."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from uam_lab.report.figures import style

VIEWS = (("x", "z"), ("y", "z"), ("x", "y"))


def draw(file: Path, name: str, places: np.ndarray) -> None:
    """Write the picture of places (m, 3) [m] in the base frame as PNG."""
    with style.styled():
        figure = Figure(figsize=(11.0, 4.0), layout="constrained")
        for axes, (across, up) in zip(figure.subplots(1, 3), VIEWS, strict=True):
            shown = places[:, "xyz".index(across)], places[:, "xyz".index(up)]
            axes.plot(*shown, ".", color=style.FLIGHTS[0], markersize=1)
            axes.plot(0.0, 0.0, "+", color=style.INK)
            axes.set_xlabel(f"{across} [m]")
            axes.set_ylabel(f"{up} [m]")
            axes.set_aspect("equal", adjustable="datalim")
        figure.suptitle(f"{name}: reach of the end effector; +: origin of the base")
        style.save(figure, file)
