"""A figure of matplotlib for plotly.js: it zooms, shows values, and turns where it has three axes.

Lines, spans, polygons, texts, axes and legends are converted, so that each figure is drawn once.
"""

import base64
import html
import math
import re
from collections.abc import Iterator, Sequence
from importlib import resources
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex, to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Annotation, Text

from uam_lab.report.figures import style

PIXELS = 100.0  # per inch of the figure: 960 in width
PER_POINT = PIXELS / 72.0
DASHES = {"-": "solid", "--": "dash", ":": "dot", "-.": "dashdot"}
MOST_TICKS = 14  # over the whole width
EYE = {"x": 1.4, "y": -1.9, "z": 1.3}  # of the camera, per size of the scene
ANCHORS = {"center_baseline": "middle", "center": "middle", "baseline": "bottom"}
Part = dict[str, Any]  # of a plotly figure: https://plotly.com/javascript/reference


def library() -> str:
    """Return the text of plotly.js."""
    file = resources.files("plotly") / "package_data" / "plotly.min.js"
    return file.read_text(encoding="utf-8")


def zoomable(figure: Figure) -> Part:
    """Return data and layout of the figure for plotly.js. Texts of the figure are no markup."""
    _, height = figure.get_size_inches()
    layout: Part = {
        "height": round(PIXELS * height),
        "margin": dict.fromkeys("lrtb", 0),
        "font": {"size": 12, "color": style.INK},
        "hovermode": "x unified",
        "plot_bgcolor": "#ffffff",
        "legend": {"orientation": "h", "x": 1, "xanchor": "right", "y": 1, "yanchor": "top"},
        "shapes": [],
        "annotations": [_text(one, "paper", "paper", one.get_position()) for one in figure.texts],
    }
    legends = [*figure.legends, *(one.get_legend() for one in figure.axes)]
    data = [key for legend in legends if legend is not None for key in _keys(legend)]
    names = {one["legendgroup"]: one["name"] for one in data}
    shown = [axes for axes in figure.axes if axes.get_visible()]
    for number, axes in enumerate(shown, start=1):
        if axes.name == "3d":
            data += _turning(axes, f"scene{_serial(number)}", layout, names)
        else:
            data += _panel(axes, number, shown, layout, names)
    return {"data": data, "layout": layout}


def _panel(
    axes: Axes, number: int, others: Sequence[Axes], layout: Part, names: dict[str, str]
) -> Iterator[Part]:
    """Write the axes and what is beside them to the layout, yield the lines."""
    place, serial = axes.get_position(), _serial(number)
    x, y = f"x{serial}", f"y{serial}"
    shared = axes.get_shared_x_axes()
    first = next(i for i, one in enumerate(others, 1) if one is axes or shared.joined(axes, one))
    layout[f"xaxis{serial}"] = {
        **_axis(axes.xaxis, axes.get_xlim(), place.width),
        **{"domain": [place.x0, place.x1], "anchor": y},
        **({"matches": f"x{_serial(first)}"} if first != number else {}),
    }
    layout[f"yaxis{serial}"] = {
        **_axis(axes.yaxis, axes.get_ylim(), 0.4),
        **{"domain": [place.y0, place.y1], "anchor": x},
        **({"scaleanchor": x} if axes.get_aspect() == 1 else {}),
    }
    if axes.get_aspect() == 1:
        layout["hovermode"] = "closest"
    for one in (*axes.texts, axes.title, *_titles(axes)):
        if one.get_text():
            layout["annotations"].append(_note(axes, one, x, y))
    layout["shapes"] += _shapes(axes, x, y)
    for patch in axes.patches:
        if patch.get_data_transform() == axes.transData:
            yield _polygon(patch) | {"xaxis": x, "yaxis": y}
    label = _formula(axes.yaxis.label)
    for line in axes.lines:
        if line.get_transform() == axes.transData:
            across, up = (np.asarray(values, dtype=float) for values in line.get_data())
            points = {"x": _packed(across), "y": _packed(up), "xaxis": x, "yaxis": y}
            yield _line(line, names, label) | {"type": "scatter"} | points


def _serial(number: int) -> str:
    """Return how plotly numbers its axes: x, x2, x3."""
    return "" if number == 1 else f"{number}"


def _turning(axes: Any, scene: str, layout: Part, names: dict[str, str]) -> Iterator[Part]:
    """Write a scene of three axes to the layout, yield its lines."""
    place = axes.get_position()
    ranges = {"x": axes.get_xlim(), "y": axes.get_ylim(), "z": axes.get_zlim()}
    longest = max(high - low for low, high in ranges.values())
    layout[scene] = {
        "domain": {"x": [place.x0, place.x1], "y": [place.y0, place.y1]},
        "aspectmode": "manual",
        "aspectratio": {n: (high - low) / longest for n, (low, high) in ranges.items()},
        "camera": {"eye": EYE},
    }
    for name, axis in (("x", axes.xaxis), ("y", axes.yaxis), ("z", axes.zaxis)):
        title = {"text": _formula(axis.label), "font": {"size": 11}}
        look = {"title": title, "tickfont": {"size": 10}, "nticks": 5}
        layout[scene][f"{name}axis"] = {"range": list(ranges[name])} | look
    for line in axes.lines:
        values = (np.asarray(one, dtype=float) for one in line.get_data_3d())
        points = dict(zip("xyz", map(_packed, values), strict=True))
        yield _line(line, names, "") | {"type": "scatter3d", "scene": scene} | points


def _axis(axis: Axis, limits: tuple[float, float], share: float) -> Part:
    """Return an axis; share of the figure's width that has room for the numbers at it."""
    logarithmic = axis.get_scale() == "log"
    edge = "labelbottom" if axis.axis_name == "x" else "labelleft"
    decades: Part = {}
    if logarithmic:  # whole powers of ten, at most five
        limits = tuple(np.log10(limits))
        step = math.ceil((limits[1] - limits[0]) / 5.0)
        decades = {"dtick": step, "exponentformat": "power"}
    return {
        "type": "log" if logarithmic else "linear",
        "range": [float(one) for one in limits],
        "title": {"text": _formula(axis.label), "standoff": 4},
        "showticklabels": bool(axis.get_tick_params()[edge]),
        "gridcolor": style.GRID,
        "zeroline": False,
        "nticks": round(MOST_TICKS * share),
        "tickangle": 0,
    } | decades


def _shapes(axes: Axes, x: str, y: str) -> Iterator[Part]:
    """Yield lines and spans over the whole height or width of a panel."""
    over = axes.get_xaxis_transform(which="grid")
    upright = {"type": "line", "xref": x, "yref": f"{y} domain", "y0": 0, "y1": 1}
    for line in axes.lines:
        if line.get_transform() == axes.transData:
            continue
        look = {"line": {"color": _colour(line), "width": 1, "dash": _dash(line)}}
        if line.get_transform() == over:
            at = float(np.ravel(line.get_xdata())[0])
            yield upright | {"x0": at, "x1": at} | look
        else:
            at = float(np.ravel(line.get_ydata())[0])
            level = {"type": "line", "xref": f"{x} domain", "x0": 0, "x1": 1}
            yield level | {"yref": y, "y0": at, "y1": at} | look
    for lines in axes.collections:
        if isinstance(lines, LineCollection):
            look = {"line": {"color": to_hex(lines.get_colors()[0]), "width": 1}}
            for segment in lines.get_segments():
                yield upright | {"x0": float(segment[0][0]), "x1": float(segment[0][0])} | look
    for patch in axes.patches:
        if patch.get_data_transform() != axes.transData:
            corners = patch.get_patch_transform().transform(patch.get_path().vertices)[:, 0]
            span = {"x0": float(corners.min()), "x1": float(corners.max())}
            look = {"type": "rect", "layer": "below", "line": {"width": 0}}
            yield upright | span | look | {"fillcolor": _rgba(patch.get_facecolor())}


def _polygon(patch: Any) -> Part:
    corners = patch.get_patch_transform().transform(patch.get_path().vertices)
    return {
        "type": "scatter",
        "mode": "lines",
        "fill": "toself",
        "x": _packed(corners[:, 0]),
        "y": _packed(corners[:, 1]),
        "fillcolor": _rgba(patch.get_facecolor()),
        "line": {"color": _rgba(patch.get_edgecolor()), "width": patch.get_linewidth()},
        "hoverinfo": "skip",
        "showlegend": False,
    }


def _keys(legend: Any) -> Iterator[Part]:
    """Yield an empty line per entry of the legend: a click on it hides the lines of its look."""
    for handle, text in zip(legend.legend_handles, legend.get_texts(), strict=True):
        name = {"name": _formula(text), "showlegend": True}
        yield _line(handle, {}, "") | {"type": "scatter", "x": [None], "y": [None]} | name


def _line(line: Line2D, names: dict[str, str], label: str) -> Part:
    """Return the look of a line; names: by look; label: of one that has no name."""
    look = f"{_colour(line)} {_dash(line)}"
    return {
        "mode": "lines" if line.get_linestyle() not in ("None", "") else "markers",
        "line": {
            "color": _colour(line),
            "width": round(PER_POINT * line.get_linewidth(), 2),
            "dash": _dash(line),
        },
        "marker": {"size": 3, "color": _colour(line)},
        "opacity": 1.0 if line.get_alpha() is None else line.get_alpha(),
        "legendgroup": look,
        "name": names.get(look, label),
        "showlegend": False,
    }


def _titles(axes: Axes) -> Iterator[Text]:
    """Yield the title above the left corner as the text that it is."""
    for side in ("left", "right"):
        if text := axes.get_title(loc=side):
            yield Text(0.0 if side == "left" else 1.0, 1.0, text, ha=side, va="bottom", fontsize=9)


def _note(axes: Axes, one: Text, x: str, y: str) -> Part:
    """Return a text of a panel, at its data or at the panel's edges."""
    across, up = f"{x} domain", f"{y} domain"
    if not isinstance(one, Annotation):
        if one.get_transform() == axes.transData:
            across, up = x, y
        return _text(one, across, up, one.get_position())
    coordinates = one.xycoords if isinstance(one.xycoords, tuple) else (one.xycoords,) * 2
    if coordinates[0] == "data":
        across = x
    if coordinates[1] == "data":
        up = y
    shift = np.multiply(PER_POINT, one.get_position())
    moved = {"xshift": float(shift[0]), "yshift": float(shift[1])}
    return _text(one, across, up, one.xy) | moved


def _text(one: Text, across: str, up: str, at: tuple[float, float]) -> Part:
    vertical = one.get_verticalalignment()
    text = _formula(one)
    return {
        "text": f"<b>{text}</b>" if one.get_fontweight() == "bold" else text,
        **{"xref": across, "yref": up, "x": float(at[0]), "y": float(at[1])},
        "xanchor": one.get_horizontalalignment(),
        "yanchor": ANCHORS.get(vertical, vertical),
        "font": {"size": round(PER_POINT * one.get_fontsize()), "color": to_hex(one.get_color())},
        "showarrow": False,
    }


def _formula(one: Text) -> str:
    """Return a text for plotly: what stands between dollar signs, if it is a formula, in letters.

    Greek letters have the names that they have in HTML.
    """
    parts = re.split(r"\$(.*?)\$", one.get_text()) if one.get_parse_math() else [one.get_text()]
    escaped = [html.escape(part) for part in parts]
    for i in range(1, len(parts), 2):
        text = re.sub(r"\\dot ?\{?(\\\w+|\w)\}?", "\\1\u0307", escaped[i])
        text = re.sub(r"\\hat ?\{?(\\\w+|\w)\}?", "\\1\u0302", text)
        for mark, tag in (("_", "sub"), (r"\^", "sup")):
            text = re.sub(mark + r"(?:\{([^{}]*)\}|(\\\w+|\w))", rf"<{tag}>\1\2</{tag}>", text)
        text = text.replace(r"\varrho", r"\rho").replace(r"\leq", r"\le").replace(r"\ldots", "…")
        escaped[i] = html.unescape(re.sub(r"\\([A-Za-z]+)", r"&\1;", text).replace("\\", ""))
    return "".join(escaped)


def _dash(line: Artist) -> str:
    return DASHES.get(line.get_linestyle(), "solid")


def _colour(line: Line2D) -> str:
    return to_hex(line.get_color())


def _rgba(colour: Any) -> str:
    red, green, blue, alpha = to_rgba(colour)
    return f"rgba({255 * red:.0f},{255 * green:.0f},{255 * blue:.0f},{alpha:.3g})"


def _packed(values: np.ndarray) -> Part:
    """Return numbers as plotly.js reads them from a page: little-endian, base64."""
    return {"dtype": "f4", "bdata": base64.b64encode(values.astype("<f4").tobytes()).decode()}
