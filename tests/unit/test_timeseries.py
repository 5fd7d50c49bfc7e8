"""The table of a flight: columns, errors, spans, writing and reading a file."""

import numpy as np
import pyarrow.parquet as pq
import pytest
from default_columns import COLUMNS

from uam_lab.records.results import timeseries
from uam_lab.records.results.timeseries import FlightTable, UnreadableFlight


def recording(phases, dt=0.5, start=-1.0):
    """A recording with one row per phase name and every number zero."""
    made = FlightTable(2, COLUMNS)
    for k, phase in enumerate(phases):
        row = made.next_row(phase)
        row[:] = 0.0
        row[COLUMNS["time"]] = start + k * dt
    return made


def test_blocks_lay_out_a_state_row_by_row():
    made = recording(["hover"])
    made.values[0, COLUMNS.block("truth.")] = np.arange(24.0).reshape(3, 8).ravel()
    series = made.series()
    assert series["truth.x"][0] == 0.0
    assert series["truth.alpha_2"][0] == 7.0
    assert series["truth.x_dot"][0] == 8.0
    assert series["truth.alpha_2_ddot"][0] == 23.0
    assert series.block("adaptation.arm.").shape == (1, 36)  # the gains of all laws


def test_a_column_that_is_not_there_has_near_ones():
    with pytest.raises(KeyError, match=r"truth.q: unknown, did you mean truth.[xyz]\?"):
        COLUMNS["truth.q"]


def test_a_prefix_without_adjacent_columns_is_refused():
    with pytest.raises(KeyError, match="nothing"):
        COLUMNS.block("nothing.")
    with pytest.raises(KeyError, match="rotor_"):
        timeseries.Columns({"rotor_1": "N", "x": "m", "rotor_2": "N"}).block("rotor_")


def test_error_is_truth_minus_reference_with_angles_wrapped():
    made = recording(["hover"])
    made.values[0, COLUMNS["truth.x"]] = 1.0
    made.values[0, COLUMNS["reference.x"]] = 1.25
    made.values[0, COLUMNS["truth.yaw"]] = np.pi - 0.1
    made.values[0, COLUMNS["reference.yaw"]] = -np.pi + 0.1
    series = made.series()
    assert series["error.x"][0] == -0.25
    assert series["error.yaw"][0] == pytest.approx(-0.2)


def test_the_flight_lasts_from_take_off_command_to_touchdown_command():
    series = recording(["waiting", "waiting", "take-off", "land", "landed", "landed"]).series()
    assert series.flown.tolist() == [False, False, True, True, False, False]
    assert series.phase_spans() == [
        ("waiting", -1.0, 0.0),
        ("take-off", 0.0, 0.5),
        ("land", 0.5, 1.0),
        ("landed", 1.0, 1.5),
    ]


def test_time_counts_down_to_the_take_off_command():
    made = recording(["waiting"] * 3 + ["take-off"] * 3, start=-1.5)
    made.values[:3, COLUMNS["time"]] = -1.0
    assert made.series().time.tolist() == [-1.5, -1.0, -0.5, 0.0, 0.5, 1.0]
    never = recording(["waiting"] * 3, start=-1.5)
    never.values[:3, COLUMNS["time"]] = -1.0
    assert never.series().time.tolist() == [-1.0, -1.0, -1.0]


def test_magnet_spans_end_where_it_is_switched_off_or_the_recording_ends():
    made = recording(["carry"] * 6, start=0.0)
    made.values[:6, COLUMNS["magnet.on"]] = [0, 1, 1, 0, 0, 1]
    assert made.series().magnet_spans() == [(0.5, 1.5), (2.5, 2.5)]


def test_a_file_gives_back_what_was_written(tmp_path):
    made = recording(["waiting", "take-off", "hover", "take-off"])
    made.values[:4, COLUMNS["payload.z"]] = [0.1, 1 / 3, np.nan, 2.0]
    series = made.series({"seed": 7, "controller": "modular"})
    series.write(tmp_path / "timeseries.parquet")
    back = timeseries.read(tmp_path / "timeseries.parquet")
    np.testing.assert_array_equal(back.values, series.values)
    assert [s[0] for s in back.phase_spans()] == ["waiting", "take-off", "hover", "take-off"]
    assert back.info == {"seed": 7, "controller": "modular"}
    names = pq.read_schema(tmp_path / "timeseries.parquet").names
    assert names[:3] == ["time [s]", "phase", "truth.x [m]"]
    assert "truth.roll_ddot [rad/s^2]" in names
    assert [p.name for p in tmp_path.iterdir()] == ["timeseries.parquet"]


def test_a_file_that_is_no_flight_is_refused_in_one_line(tmp_path):
    (tmp_path / "x.parquet").write_bytes(b"no")
    with pytest.raises(UnreadableFlight, match="not a readable flight") as caught:
        timeseries.read(tmp_path / "x.parquet")
    assert "\n" not in str(caught.value)
    table = recording(["hover"]).series().table().drop_columns(["tau_p.x [N]"])
    pq.write_table(table, tmp_path / "y.parquet")
    with pytest.raises(UnreadableFlight, match=r"column 'tau_p.x \[N\]' missing"):
        timeseries.read(tmp_path / "y.parquet")


def test_a_flight_from_before_a_law_was_added_has_unknown_gains_of_it(tmp_path):
    made = recording(["hover"])
    made.values[0, COLUMNS["adaptation.arm.K1"]] = 2.0
    label = "adaptation.position.K0 [1]"
    pq.write_table(made.series().table().drop_columns([label]), tmp_path / "y.parquet")
    back = timeseries.read(tmp_path / "y.parquet")
    assert np.isnan(back["adaptation.position.K0"]).all() and back["adaptation.arm.K1"][0] == 2.0
