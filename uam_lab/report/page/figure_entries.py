"""The figures of a page: each as a picture, which plotly.js replaces where it can."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from uam_lab.records.results import templates
from uam_lab.report.figures.figures import FIGURES
from uam_lab.report.figures.zoomable import library


@dataclass(frozen=True)
class FigureEntry:
    """A figure: picture is a data URI; zoomable: JSON for plotly.js, "" without."""

    name: str
    caption: str
    picture: str
    zoomable: str


def figure_entries(folder: Path, names: Iterable[str]) -> dict[str, object]:
    """Return what figures.html.j2 needs: the figures that `folder` has of `names`, and plotly.js.

    plotly.js is 4.6 MB. It is left out where no figure needs it.
    """
    found = [_entry(folder, name) for name in names if (folder / f"{name}.png").exists()]
    needed = any(one.zoomable for one in found)
    return {"figures": found, "library": library() if needed else ""}


def _entry(folder: Path, name: str) -> FigureEntry:
    file = folder / f"{name}.json"
    text = file.read_text(encoding="utf-8").replace("<", "\\u003c") if file.exists() else ""
    picture = templates.embedded(folder / f"{name}.png")
    return FigureEntry(name, FIGURES[name][1], picture, text)
