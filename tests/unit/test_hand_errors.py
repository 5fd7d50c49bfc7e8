"""Columns, metrics and figures of the end effector, on a table small enough to work out by hand."""

import math

import numpy as np
import pytest

from uam_control.arm.hand import reach, shoulder
from uam_control.vehicle import chain_of, load_description
from uam_lab.records.results import metrics, timeseries
from uam_lab.records.results.timeseries import FlightTable
from uam_lab.report.facts import flight_summary
from uam_lab.report.figures import figures
from uam_lab.report.figures.panels import DrawnFlight

INFO = {"scenario": "ee_circle_010", "wall_s": 2.0}
PHASES = ("waiting", "take-off", "run-up", "trajectory", "run-out", "land", "landed")


def flight(**truth):
    """One tick per phase, 0.5 s apart; the arm at (0, 90) deg, the magnet level; all at rest.

    truth: values of the four ticks from the take-off to the trajectory, beside the reference's.
    """
    made = FlightTable.of(len(PHASES), load_description())
    for k, phase in enumerate(PHASES):
        row = made.next_row(phase)
        row[:] = 0.0
        row[made.columns["time"]] = -0.5 + 0.5 * k
    values, columns = made.values, made.columns
    for group in ("truth.", "reference."):
        values[:, columns[f"{group}z"]] = 1.0
        values[:, columns[f"{group}alpha_2"]] = math.pi / 2
    values[:, columns["magnet.swing"]] = -math.pi / 2
    for name, value in truth.items():
        values[1:5, columns[f"truth.{name}"]] += value
    return made.series()


def test_the_hand_is_where_base_and_arm_have_it():
    series = flight(x=0.03)
    assert series["end_effector.x"][1] == pytest.approx(0.03 + 0.14)
    assert series["end_effector.z"][1] == pytest.approx(1.0 - 0.073 - 0.1 - 0.03)
    assert series["end_effector_reference.x"][1] == pytest.approx(0.14)
    assert series["end_effector_error.x"][1] == pytest.approx(0.03)
    assert series["end_effector_error.elevation"][1] == pytest.approx(0.0)


def test_the_reference_leans_as_its_acceleration_needs():
    made = FlightTable.of(1, load_description())
    row = made.next_row("trajectory")
    row[:] = 0.0
    row[made.columns["reference.x_ddot"]] = 9.81  # 45 deg nose down
    series = made.series()
    # joint 2 at 0: the pivot is 0.313 m below the base, and the magnet level
    lever = 0.313 * math.sqrt(0.5)
    assert series["end_effector_reference.x"][0] == pytest.approx(-lever)
    assert series["end_effector_reference.z"][0] == pytest.approx(-lever - 0.03)


def test_figures_of_the_whole_flight_and_of_the_trajectory_with_ramps():
    found = metrics.compute(flight(x=0.03, y=-0.04), INFO)
    # five ticks are flown, four of them 0.05 m off
    share = math.sqrt(4 / 5)
    rms, worst = found["rms"], found["max"]
    assert rms["end_effector_m"] == pytest.approx([0.03 * share, 0.04 * share, 0.0])
    assert rms["end_effector_norm_m"] == pytest.approx(0.05 * share)
    assert rms["epsilon_m"] == pytest.approx(0.05 * share)
    assert rms["rho"] == pytest.approx(0.05 * share / 0.27)  # 0.1 + 0.14 + 0.03 m
    assert worst["end_effector_m"] == pytest.approx([0.03, 0.04, 0.0])
    assert worst["rho"] == pytest.approx(0.05 / 0.27)
    ramps = found["trajectory_with_ramps"]
    assert ramps["seconds"] == pytest.approx(1.5)
    assert ramps["rms"]["end_effector_norm_m"] == pytest.approx(0.05)
    assert ramps["max"]["end_effector_norm_m"] == pytest.approx(0.05)
    assert ramps["rms"]["position_m"] == pytest.approx([0.03, 0.04, 0.0])


def test_the_error_of_the_hand_in_words():
    found = metrics.compute(flight(x=0.03, y=-0.04), INFO)
    words = "50.0 mm RMS, 50.0 mm at most, heading 0.00° RMS, on the trajectory with its ramps"
    assert flight_summary.hand_story(found) == words
    share = "44.7 mm RMS, 50.0 mm at most, heading 0.00° RMS, in flight"  # 50 mm x sqrt(4 / 5)
    assert flight_summary.hand_story(found | {"trajectory_with_ramps": None}) == share
    assert flight_summary.hand_story({"rms": {}}) is None


def test_the_deviation_while_the_load_changes():
    """A minute, gripped from 20 to 40 s. The vehicle is off by z from 3 s before the grip on, 8 s
    long, by y from 7 s after the opening on: 50 mm and 30 mm; in between by x: 90 mm."""
    made = FlightTable.of(60, load_description())
    for k in range(60):
        row = made.next_row("carry")
        row[:] = 0.0
        at = made.columns
        row[at["time"]], row[at["magnet.on"]] = k, 20 <= k < 40
        row[at["truth.z"]] = 0.05 * (17 <= k < 25)
        row[at["truth.y"]] = 0.03 * (k >= 47)
        row[at["truth.x"]] = 0.09 * (30 <= k < 35)
    found = metrics.compute(made.series(), INFO)
    lift, down = (found["load_steps"][name] for name in ("lift", "set_down"))
    assert (lift["epsilon_m"], down["epsilon_m"]) == pytest.approx((0.05, 0.03))
    assert down["rho"] == pytest.approx(0.03 / 0.27) and found["max"]["epsilon_m"] >= 0.09
    assert metrics.compute(flight(), INFO)["load_steps"] is None
    story = flight_summary.payload_story(found | {"payload_lifted": True})
    assert "at most 50 mm (rho 0.19) at the lift, 30 mm (rho 0.11) at the set-down" in story


def test_the_reach_counts_from_the_shoulder():
    """T650: joint 1 turns about the vertical. From joint 2: |(0.024, -0.000089, -0.128)| +
    |(0.128927, -0.019976, -0.02175)| + 0.108 m, 0.37 m as published."""
    chain = chain_of(load_description("t650"))
    assert shoulder(chain) == 1 and shoulder(chain_of(load_description())) == 0
    assert reach(chain, shoulder(chain)) == pytest.approx(0.1302 + 0.1323 + 0.108, abs=1e-4)


def test_a_turned_vehicle_moves_its_hand_aside():
    found = metrics.compute(flight(yaw=0.1), INFO)["trajectory"]
    assert found["rms"]["end_effector_heading_deg"] == pytest.approx(math.degrees(0.1))
    assert found["rms"]["end_effector_m"] == pytest.approx(
        [0.14 * (1 - math.cos(0.1)), 0.14 * math.sin(0.1), 0.0]
    )
    assert found["rms"]["epsilon_m"] == 0.0


def test_the_columns_are_in_the_file(tmp_path):
    series = flight(x=0.03)
    series.write(tmp_path / "flight.parquet")
    again = timeseries.read(tmp_path / "flight.parquet")
    np.testing.assert_array_equal(again["end_effector_error.x"], series["end_effector_error.x"])
    assert metrics.compute(again, INFO)["max"] == metrics.compute(series, INFO)["max"]


def test_figures_show_the_hand_of_a_vehicle_that_has_one(tmp_path):
    names = ["end_effector_path", "end_effector_errors"]
    drawn = [DrawnFlight("modular", flight(x=0.03))]
    assert figures.draw(drawn, tmp_path, names=names) == names
    above = figures.FIGURES[names[0]][0](drawn).axes[0]
    reference, true = (line.get_xdata() for line in above.lines)
    np.testing.assert_allclose(true - reference, [0.03, 0.03, 0.03])
    without = [DrawnFlight("modular", flight())]
    without[0].series.columns = timeseries.columns(2, 4)
    assert figures.draw(without, tmp_path, names=names) == []
