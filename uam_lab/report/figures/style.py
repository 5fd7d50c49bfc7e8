"""Colours and fonts of all figures; writing of a figure, entries of a legend, small notes."""

from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.style
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text

from uam_control.settings import configuration
from uam_control.settings.atomic import replacing

INK = "#22303c"
MUTED = "#74808b"
GRID = "#e3e7eb"
BAND = "#f3f5f7"
# One colour per flight; distinguishable with the common colour-vision deficiencies and in grey.
FLIGHTS = ("#1f5fa8", "#d9822b", "#2a9d8f", "#a63d57", "#7b6bb0", "#6b7680")
GAINS = ("#0b3c6f", "#3f7fbf", "#57a773", "#d9822b", "#7b6bb0", "#a63d57", "#6b7680")
PICK = "#2a8a57"
DROP = "#c2512f"
CHANGE = "#7b4fa3"
REFUSED = "#b3412a"
FAULT = "#c9302c"
PAYLOAD = "#2a8a57"
REFERENCE = "#9aa5af"
Dashes = str | tuple[int, tuple[float, ...]]

WIDTH = 9.6  # [in] of a figure; shown at about 960 pixels
PIXELS_PER_INCH = 160

STYLE = "views/figures.mplstyle"
COLOURED = {"text.color": INK, "axes.labelcolor": INK, "grid.color": GRID}
COLOURED |= {"xtick.color": MUTED, "ytick.color": MUTED}


def styled() -> AbstractContextManager[None]:
    """Return the context in which figures are drawn and saved."""
    return mpl.style.context([configuration.path(STYLE), COLOURED])


def flight_colour(number: int) -> str:
    """Return the colour of a flight by its number in the figure."""
    return FLIGHTS[number % len(FLIGHTS)]


def save(figure: Figure, path: Path, **how: Any) -> None:
    """Write a figure atomically; how: see `Figure.savefig`."""
    _powers(figure)
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=PIXELS_PER_INCH, **how)


def key(label: str, colour: str, width: float = 1.0, dashes: Dashes = "-", **how: Any) -> Line2D:
    """Return an entry of a legend."""
    return Line2D([], [], color=colour, linewidth=width, linestyle=dashes, label=label, **how)


def note(
    axis: Axes, text: str, at: tuple[float, float], shift: tuple[float, float], **how: Any
) -> None:
    """Write a text at (x of the data, height of the panel), shifted by points."""
    how = {"xycoords": ("data", "axes fraction"), **how}
    axis.annotate(text, at, xytext=shift, textcoords="offset points", **how)


def _powers(figure: Figure) -> None:
    """Let the numbers at logarithmic axes be formulas: matplotlib writes them as powers of ten."""
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            if axis.get_scale() in ("log", "symlog"):
                for text in axis.get_ticklabels(which="both"):
                    text.set_parse_math(True)


def formulas(artist: Artist) -> None:
    """Let the texts of `artist`, which are the program's own, be formulas between dollar signs."""
    for text in artist.findobj(Text):
        text.set_parse_math(True)


def title(figure: Figure, text: str) -> None:
    """Write the title of a figure in its upper left corner."""
    top = 1.0 - 0.1 / figure.get_figheight()
    figure.text(0.012, top, text, va="top", fontsize=11.5, fontweight="bold")
