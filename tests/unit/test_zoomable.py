"""Figures of matplotlib for plotly.js, by hand: lines, axes, spans, texts, legends, escapes."""

import base64
import json

import numpy as np
import pytest
from matplotlib.figure import Figure

from uam_lab.report.figures import style
from uam_lab.report.figures.zoomable import zoomable


def numbers(packed):
    """Return packed numbers."""
    return np.frombuffer(base64.b64decode(packed["bdata"]), dtype="<f4").tolist()


def lines(found):
    return [one for one in found["data"] if "bdata" in str(one["x"])]


def test_a_line_has_its_numbers_its_look_and_its_axes():
    figure = Figure(figsize=(9.6, 3.0))
    axes = figure.add_axes((0.1, 0.2, 0.8, 0.7))
    axes.plot([0.0, 1.0], [2.0, 0.5], color="#112233", linestyle="--", linewidth=1.44)
    axes.set(xlim=(-1.0, 2.0), ylim=(0.0, 4.0), xlabel="time [s]", ylabel="x [m]")
    found = zoomable(figure)
    (line,) = lines(found)
    assert (numbers(line["x"]), numbers(line["y"])) == ([0.0, 1.0], [2.0, 0.5])
    assert line["line"] == {"color": "#112233", "width": 2.0, "dash": "dash"}
    assert line["name"] == "x [m]" and (line["xaxis"], line["yaxis"]) == ("x", "y")
    layout = found["layout"]
    assert layout["height"] == 300
    assert layout["xaxis"]["range"] == [-1.0, 2.0]
    assert layout["xaxis"]["domain"] == pytest.approx([0.1, 0.9])
    assert layout["yaxis"]["domain"] == pytest.approx([0.2, 0.9])
    assert layout["xaxis"]["title"]["text"] == "time [s]"
    json.dumps(found)  # it is written so


def test_panels_with_one_time_axis_zoom_together():
    figure = Figure()
    first, second = figure.subplots(2, 1, sharex=True)
    figure.add_axes((0.0, 0.0, 0.1, 0.1))
    layout = zoomable(figure)["layout"]
    assert "matches" not in layout["xaxis"] and layout["xaxis2"]["matches"] == "x"
    assert "matches" not in layout["xaxis3"]
    assert not layout["xaxis"]["showticklabels"] and layout["xaxis2"]["showticklabels"]


def test_a_logarithmic_axis_has_whole_powers():
    figure = Figure()
    axes = figure.add_subplot()
    axes.set(yscale="log", ylim=(1e-6, 1e2))
    found = zoomable(figure)["layout"]["yaxis"]
    assert found["type"] == "log" and found["range"] == pytest.approx([-6.0, 2.0])
    assert found["dtick"] == 2


def test_spans_and_limits_go_over_the_whole_panel():
    figure = Figure()
    axes = figure.add_subplot()
    axes.axvspan(1.0, 3.0, color="#ff0000", alpha=0.5)
    axes.axvline(2.0, color="#00ff00")
    axes.axhline(5.0, color="#0000ff")
    axes.vlines([7.0, 8.0], 0.0, 1.0, transform=axes.get_xaxis_transform(), color="#00ffff")
    found = zoomable(figure)
    assert lines(found) == []
    upright, level, first, second, span = found["layout"]["shapes"]
    assert (upright["x0"], upright["yref"]) == (2.0, "y domain")
    assert (level["y0"], level["xref"]) == (5.0, "x domain")
    assert (first["x0"], second["x0"]) == (7.0, 8.0)
    assert (span["x0"], span["x1"], span["fillcolor"]) == (1.0, 3.0, "rgba(255,0,0,0.5)")


def test_an_entry_of_the_legend_names_the_lines_of_its_look():
    figure = Figure()
    axes = figure.add_subplot()
    axes.plot([0.0], [0.0], color="#123456")
    axes.plot([1.0], [1.0], color="#654321")
    figure.legend(handles=[style.key("truth", "#123456")])
    found = zoomable(figure)
    first, second = lines(found)
    (entry,) = [one for one in found["data"] if one["showlegend"]]
    assert entry["name"] == first["name"] == "truth" and second["name"] == ""
    assert entry["legendgroup"] == first["legendgroup"] != second["legendgroup"]


def test_texts_are_no_markup_and_formulas_are_letters():
    figure = Figure()
    axes = figure.add_subplot()
    style.note(axes, "<a href=x>$K$</a>", (2.0, 1.0), (0, 72), ha="center")
    axes.set_ylabel("$\\tau_{p,x}$ & $\\hat\\theta^2$ [N]", parse_math=True)
    with style.styled():
        figure.text(0.5, 1.0, "$x$", fontweight="bold", parse_math=False)
    found = zoomable(figure)["layout"]
    whole, note = found["annotations"]
    assert whole["text"] == "<b>$x$</b>" and whole["xref"] == "paper"
    assert found["yaxis"]["title"]["text"] == ("τ<sub>p,x</sub> &amp; θ̂<sup>2</sup> [N]")
    assert "&lt;a href=x&gt;" in note["text"] and "<a" not in note["text"]
    assert (note["x"], note["xref"], note["yref"], note["yshift"]) == (2.0, "x", "y domain", 100.0)


def test_three_axes_turn_with_one_scale():
    figure = Figure()
    axes = figure.add_subplot(projection="3d")
    axes.plot([0.0, 1.0], [0.0, 2.0], [0.0, 3.0])
    axes.set(xlim=(0.0, 1.0), ylim=(0.0, 2.0), zlim=(0.0, 4.0), zlabel="z [m]")
    found = zoomable(figure)
    (line,) = lines(found)
    assert line["type"] == "scatter3d" and numbers(line["z"]) == [0.0, 3.0]
    scene = found["layout"]["scene"]
    assert scene["aspectratio"] == {"x": 0.25, "y": 0.5, "z": 1.0}
    assert scene["zaxis"]["title"]["text"] == "z [m]"
