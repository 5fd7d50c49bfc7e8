"""Content of the figures: lines, phases, events, RMS, one flight or several."""

import numpy as np
import pytest
from default_columns import COLUMNS
from PIL import Image

from uam_control.profiles.profile import load_profile
from uam_lab.analysis.stability import analyse
from uam_lab.records.results import metrics
from uam_lab.records.results.timeseries import Series, columns, gain_columns
from uam_lab.report.figures import figures, panels, style
from uam_lab.report.figures.panels import DrawnFlight
from uam_sim_bridge.plant import Vehicle


def words(figure):
    """Return all texts of a figure."""
    found = [text.get_text() for text in figure.texts]
    for axis in figure.axes:
        found += [text.get_text() for text in axis.texts] + [axis.get_ylabel()]
    for legend in figure.legends:
        found += [text.get_text() for text in legend.get_texts()]
    return found


def without_magnet(flight):
    """Return the flight without the data of magnet and payload."""
    values = flight.values.copy()
    values[:, COLUMNS.block("magnet.")] = 0.0
    values[:, COLUMNS.block("payload.")] = np.nan
    return Series(
        values, flight.phases, flight.phase_names, {"payload_mass_kg": 0.0}, flight.columns
    )


def test_thinning_keeps_every_peak():
    time = np.arange(10_000) * 0.004
    values = np.sin(time)
    values[[1234, 8765]] = [9.0, -9.0]
    thin_time, thin_values = panels.thin(time, values, buckets=100)
    assert len(thin_time) <= 200
    assert thin_values.max() == 9.0
    assert thin_values.min() == -9.0
    assert thin_time[thin_values.argmax()] == time[1234]
    assert np.all(np.diff(thin_time) > 0.0)


def test_short_series_are_not_thinned():
    time, values = np.arange(10.0), np.arange(10.0) ** 2
    np.testing.assert_array_equal(panels.thin(time, values)[1], values)


def test_all_figures_are_written_as_png_and_svg(flight, tmp_path):
    steps = []
    found = analyse(flight, load_profile("s500").sets, Vehicle.load(), 0.2)
    written = figures.draw([DrawnFlight("modular", flight, found)], tmp_path, steps.append)
    assert written == [name for name in figures.FIGURES if name != "px4_log"]  # no PX4 flew
    assert len(steps) == len(figures.FIGURES)
    for name in written:
        with Image.open(tmp_path / f"{name}.png") as picture:
            assert picture.width == 1536
        assert (tmp_path / f"{name}.svg").read_text().startswith("<?xml")


def test_the_same_flight_gives_the_same_picture(flight, tmp_path):
    for place in ("a", "b"):
        figures.draw([DrawnFlight("modular", flight)], tmp_path / place, names=["arm_errors"])
    first, second = (tmp_path / place / "arm_errors.svg" for place in ("a", "b"))
    assert first.read_bytes() == second.read_bytes()


def test_an_error_figure_names_phases_events_and_rms(flight):
    figure = figures.position_errors([DrawnFlight("modular", flight)])
    shown = words(figure)
    for phase in ("take-off", "approach", "pick", "carry", "drop", "return", "land"):
        assert phase in shown
    assert "landed" not in shown
    assert {"magnet on", "magnet off", "modular"} <= set(shown)
    x = metrics.errors(flight)["position_m"][0]
    assert f"{x:.3f} m" in shown
    assert "paper 0.05 m" in shown
    marks = [line.get_xdata()[0] for line in figure.axes[0].lines if line.get_linestyle() == "--"]
    assert marks == pytest.approx([35.0, 70.0], abs=0.05)


def test_a_line_shows_the_flight_in_the_unit_of_its_label(flight):
    figure = figures.attitude_errors([DrawnFlight("modular", flight)])
    line = figure.axes[1].lines[0]
    assert figure.axes[1].get_ylabel() == "pitch θ error [°]"
    drawn = line.get_ydata()
    assert drawn.max() == pytest.approx(np.degrees(flight["error.pitch"][flight.flown].max()))
    assert line.get_xdata()[0] >= 0.0


def test_several_flights_lie_over_one_another(flight, make_flight):
    other = make_flight(seed=2, scale=3.0)
    figure = figures.arm_errors([DrawnFlight("modular", flight), DrawnFlight("ASMC-1", other)])
    shown = words(figure)
    assert {"modular", "ASMC-1"} <= set(shown)
    assert not any("RMS" in text for text in shown)
    colours = {line.get_color() for line in figure.axes[0].lines[:2]}
    assert len(colours) == 2


def test_a_flight_without_payload_has_no_payload_figure_and_one_path(flight, tmp_path):
    plain = DrawnFlight("modular", without_magnet(flight))
    written = figures.draw([plain], tmp_path, names=["path", "payload", "position_errors"])
    assert written == ["path", "position_errors"]
    assert len(figures.path_figure([plain]).axes) == 1
    assert len(figures.path_figure([DrawnFlight("modular", flight)]).axes) == 3


def test_a_law_without_adaptation_has_no_adaptation_figure(flight):
    values = flight.values.copy()
    values[:, COLUMNS.block("adaptation.")] = np.nan
    series = Series(values, flight.phases, flight.phase_names, flight.info, flight.columns)
    assert figures.adaptation([DrawnFlight("other", series)]) is None


def test_powers_of_ten_at_an_axis_are_no_source_code(flight, tmp_path):
    figure = figures.adaptation([DrawnFlight("modular", flight)])
    style.save(figure, tmp_path / "adaptation.png")
    labels = [text for axis in figure.axes for text in axis.yaxis.get_ticklabels()]
    powers = [text for text in labels if "mathdefault" in text.get_text()]
    assert powers and all(text.get_parse_math() for text in powers)


def test_each_law_has_its_own_rows_in_the_adaptation_figure(flight):
    values = flight.values.copy()
    values[:, COLUMNS.block("adaptation.")] = np.nan
    values[:, gain_columns("position", ("D1", "D2", "D3", "s_norm"), COLUMNS)] = [
        -0.1,
        0.2,
        0.3,
        0.4,
    ]
    other = DrawnFlight(
        "ASMC-1", Series(values, flight.phases, flight.phase_names, flight.info, flight.columns)
    )
    rows = ["$\\hat D$", "‖s‖"]
    alone = figures.adaptation([other])
    assert [axis.get_ylabel() for axis in alone.axes[::3]] == rows
    assert alone.axes[0].lines[0].get_ydata().max() == -0.1  # signed, hence linear
    assert [axis.get_yscale() for axis in alone.axes[::3]] == ["linear", "log"]
    both = figures.adaptation([DrawnFlight("modular", flight), other])
    assert [axis.get_ylabel() for axis in both.axes[::3]][4:] == rows


def test_the_theta_hat_of_every_joint_is_drawn_beside_a_flight_with_fewer_joints(flight):
    found = columns(joints=5, rotors=4)
    values = np.full((len(flight.values), len(found)), np.nan)
    values[:, found["time"]] = flight.time
    values[:, gain_columns("arm", [f"bias{i}" for i in range(1, 6)], found)] = [1, 2, 3, 4, 5]
    series = Series(values, flight.phases, flight.phase_names, flight.info, found)
    figure = figures.adaptation([DrawnFlight("five", series), DrawnFlight("two", flight)])
    rows = [axis.get_ylabel() for axis in figure.axes[::3]]
    arm = figure.axes[3 * rows.index("$\\hat\\theta$") + 2]
    assert [line.get_ydata()[0] for line in arm.lines[:5]] == [1, 2, 3, 4, 5]
    assert len({line.get_color() for line in arm.lines[:5]}) == 5
    legend = [text.get_text() for text in arm.get_legend().get_texts()]
    assert legend == [f"$\\hat\\theta_{i}$" for i in range(1, 6)]


def test_a_flight_that_never_took_off_is_drawn_too(flight, tmp_path):
    rows = flight.time < -0.5
    series = Series(
        flight.values[rows], flight.phases[rows], flight.phase_names, flight.info, flight.columns
    )
    names = ["position_errors", "path", "adaptation"]
    assert figures.draw([DrawnFlight("modular", series)], tmp_path, names=names)[:2] == names[:2]
