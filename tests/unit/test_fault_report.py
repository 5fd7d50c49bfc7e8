"""Faults as messages, in the figures and on the page, and the matrix of a campaign."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from default_columns import COLUMNS

from uam_control.settings import configuration
from uam_control.vehicle import load_description
from uam_lab.cli.main import main
from uam_lab.experiments.faults import matrix as fault_matrix
from uam_lab.experiments.faults import report as fault_report
from uam_lab.experiments.faults.trial import FaultResult
from uam_lab.experiments.trials.outcome import OUTCOMES, classify, down_after, explained
from uam_lab.records.results import metrics
from uam_lab.report.figures import figures, panels
from uam_lab.report.figures.figures import draw
from uam_lab.report.figures.panels import DrawnFlight
from uam_lab.report.page import pages
from uam_sim_bridge.faults import CABLE, FAULTS, FaultError

MATRIX = configuration.path("campaign/faults.yaml")
GRIPPER = load_description("s500_gripper")


def record(begin, end, name="motor_loss", **values):
    return {"fault": name, "begin_s": begin, "end_s": end, "parameters": values}


def test_an_event_is_read_back_from_its_message_and_a_log():
    pytest.importorskip("rclpy")
    from uam_lab.records.recording.log_reader import fault_records
    from uam_msgs_py.messages.flight_events import FaultEvent

    first = FaultEvent("motor_loss", "plant", 0, True, {"motor": 2.0, "remaining": 0.7})
    other = FaultEvent("mavlink_cut", "MAVLink", 0, True, {"direction": "both"})
    over = FaultEvent("motor_loss", "plant", 0, False, {"motor": 2.0, "remaining": 0.7})
    reported = [(3_000_000_000, other), (2_000_000_000, first), (5_500_000_000, over)]
    for stamp, event in reported:
        assert FaultEvent.from_message(event.to_message(stamp)) == (stamp, event)
    assert fault_records(reported, 1_000_000_000) == [
        record(1.0, 4.5, motor=2.0, remaining=0.7),
        record(2.0, None, "mavlink_cut", direction="both"),
    ]


def test_faults_are_shaded_and_listed(flight_folder, flight, make_flight):
    faults = [
        record(10.0, 12.0, motor=2.0),
        record(50.0, None, "clock_jump", step=0.5),
        record(50.1, 60.0, "mocap_dropout"),
        record(500.0, None),
    ]
    marked = make_flight(info={"faults": faults})
    figure = figures.arm_inputs([DrawnFlight("x", marked)])
    axis = figure.axes[0]
    assert {"A", "B C"} <= {text.get_text() for text in axis.texts}
    assert not any("D" == text.get_text() for text in axis.texts)
    spans = {tuple(np.round([p.get_x(), p.get_x() + p.get_width()], 3)) for p in axis.patches}
    end = round(axis.get_xlim()[1], 3)
    assert {(10.0, 12.0), (50.0, end), (50.1, 60.0)} <= spans
    assert [t.get_text() for t in figure.legends[0].texts][-1] == "fault"
    draw([DrawnFlight("x", marked)], flight_folder / "figures", names=["arm_inputs"])
    (flight_folder / "info.json").write_text(json.dumps(marked.info))
    html = pages.write_page(flight_folder).read_text()
    assert "Faults injected in this flight" in html and "<code>clock_jump</code>" in html
    assert panels.fault_handles(flight.info) == []


def test_letters_go_on_after_z():
    assert [panels.letter(n) for n in (0, 25, 26, 27, 701, 702)] == [
        "A",
        "Z",
        "AA",
        "AB",
        "ZZ",
        "AAA",
    ]


def test_metrics_have_the_faults(flight):
    faults = [record(10.0, 12.0, motor=2.0)]
    assert metrics.compute(flight, {"faults": faults})["faults"] == faults
    assert metrics.compute(flight, {})["faults"] == []


def ended(make_flight, height=0.0, tilt=0.0, down=0.0, landed=True):
    """A made-up flight whose last second is changed."""
    series = make_flight()
    last = slice(-25, None)
    series.values[:, COLUMNS["truth.z"]] -= series["truth.z"][-1] - 0.285
    series.values[0, COLUMNS["truth.z"]] = 0.285
    series.values[last, COLUMNS["truth.z"]] = 0.285 + height
    series.values[last, COLUMNS["truth.roll"]] = tilt
    for column in ("truth.x_dot", "truth.y_dot", "truth.z_dot"):
        series.values[last, COLUMNS[column]] = 0.0
    series.values[-20, COLUMNS["truth.z_dot"]] = -down
    if not landed:
        series.phases[series.in_phase("landed")] = 0
    return series


@pytest.mark.parametrize(
    ("end", "outcome"),
    [
        ({}, "landed"),
        ({"landed": False}, "failsafe"),
        ({"height": 0.8, "landed": False}, "held"),
        ({"tilt": 1.2}, "lost"),
        ({"down": 3.0}, "lost"),
        ({"down": 3.0, "height": 0.8}, "held"),
    ],
)
def test_how_a_flight_ended(make_flight, end, outcome):
    series = ended(make_flight, **end)
    assert classify(series, {"mission_completed": False}) == outcome
    assert classify(series, {"mission_completed": True}) == "completed"
    assert outcome in OUTCOMES


def test_every_flight_that_is_not_completed_has_a_reason():
    done = {"mission_completed": True, "shortfalls": []}
    cut = {"mission_completed": False, "shortfalls": ["payload given up", "landed elsewhere"]}
    assert explained("completed", done) == ""
    assert explained("failsafe", done) == (
        "reached the ground in flight, while its reference was above it"
    )
    assert explained("failsafe", cut) == "payload given up; landed elsewhere"


def test_the_matrix_of_the_configuration_has_every_fault_and_moment():
    of_flights = {name for name, kind in FAULTS.items() if kind.PLACE != CABLE}
    ros, direct = (fault_matrix.read(MATRIX, engine) for engine in ("ros", "direct"))
    assert {entry["fault"] for entry in ros.faults} >= of_flights - {"node_slow", "discovery_loss"}
    assert len(direct.cells(1)) == 1 + len(direct.faults) * 4
    assert set(ros.rows) - set(direct.rows) == set(direct.left_out)
    assert list(direct.moments) == ["take-off", "transit", "with payload", "landing"]
    assert len(set(ros.rows)) == len(ros.rows)
    (one,) = fault_matrix.read(MATRIX, "direct", ["servo_jam"], ["landing"]).cells(3)[1:]
    assert one.schedule.faults[0].moment == {"at": "land", "after": 1.5}
    assert one.schedule.seed == 3


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("scenario: hover", "moments is missing"),
        ("{scenario: hover, moments: {a: 3}, faults: []}", "moments: names with"),
        ("{scenario: hover, moments: {}, faults: [{fault: servo_jam}]}", "moments: names with"),
        ("{scenario: hover, moments: {a: {at: pick}}, faults: []}", "no phase 'pick'"),
        ("{scenario: hover, moments: {a: {at: 3}}, faults: 3}", "a list of faults expected"),
        (
            "{scenario: hover, moments: {a: {at: 3}}, faults: [{fault: wind}]}",
            "unknown fault 'wind'",
        ),
        (
            "{scenario: hover, moments: {a: {at: 3}}, faults: [{fault: servo_jam, at: 2}]}",
            "at: not allowed here, the moments give the time",
        ),
        (
            "{scenario: hover, moments: {a: {at: 3}}, faults: [{fault: node_kill}]}",
            "nothing to fly",
        ),
        (
            "{scenario: hover, moments: {a: {at: 3}}, "
            "faults: [{fault: servo_jam, moments: [{a: 1}]}]}",
            "moments: a list of a expected",
        ),
    ],
)
def test_a_bad_matrix_is_refused_in_one_line(tmp_path, text, message):
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    with pytest.raises(FaultError, match=f"mine.yaml: .*{message}"):
        fault_matrix.read(file, "direct")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--only", "wind"], "unknown fault 'wind'; there are: mocap_dropout"),
        (["--moment", "tea"], "unknown moment 'tea'; there are: take-off"),
        (["--matrix", "no"], "unknown campaign 'no'; there are: cables, delays"),
        (["--engine", "fast"], "--engine: invalid choice: 'fast'"),
        (["--clock", "realtime"], "the direct engine has no clock"),
        (["--vehicle", "none"], "unknown vehicle 'none'; there are: hexa_arm"),
        (["--jobs", "0"], "--jobs: '0' is not a number of 1 or more"),
        (["--repeat", "0"], "--repeat: '0' is not a number of 1 or more"),
    ],
)
def test_wrong_use_is_one_line(capsys, monkeypatch, tmp_path, options, message):
    monkeypatch.chdir(tmp_path)
    try:
        status = main(["faults", *options])
    except SystemExit as stop:  # argparse
        status = stop.code
    assert status == 2
    out, err = capsys.readouterr()
    assert message in err and err.count("\n") == 1 and not out
    assert not any(tmp_path.iterdir())


def test_what_another_scenario_or_vehicle_does_not_have_is_left_out_with_its_reason(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text(
        "{scenario: quick_pick, moments: {a: {at: take-off}, b: {at: drop}}, faults: ["
        "{fault: servo_jam, joint: 3}, {fault: mocap_jump}, {fault: magnet_stuck, moments: [b]}]}"
    )
    matrix = fault_matrix.read(file, "direct", scenario="two_finger", vehicle=GRIPPER)
    assert [cell.fault for cell in matrix.cells(1)] == [fault_matrix.NOMINAL, "mocap_jump"]
    assert list(matrix.moments) == ["a"]
    assert matrix.left_out["b"].startswith("no phase 'drop' in two_finger, which has: take-off,")
    assert matrix.left_out["servo_jam (joint 3)"] == "joint 3: the vehicle has 2"
    assert matrix.left_out["magnet_stuck"] == "none of its moments: b"
    with pytest.raises(FaultError, match="nothing to fly: .*the vehicle has 2"):
        fault_matrix.read(file, "direct", only=["servo_jam"])
    file.write_text(file.read_text().replace("a: {at: take-off}", "a: {at: pick}"))
    with pytest.raises(FaultError, match="moments: no phase 'pick' in hover"):
        fault_matrix.read(file, "direct", scenario="hover")


def test_what_is_promised_of_a_row_is_read_and_judged(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text(
        "{scenario: hover, moments: {a: {at: 3}}, faults: ["
        "{fault: servo_jam, promise: {outcome: [held, landed], within: 4}}, {fault: magnet_stuck},"
        "{fault: mocap_jump, promise: {outcome: landed, because: exceeds}}]}"
    )
    matrix = fault_matrix.read(file, "direct")
    first, second, third = matrix.promises
    assert second is None and matrix.rows[0] == "servo_jam"
    assert first.kept("held", None, "") and first.kept("landed", 3.9, "")
    assert not first.kept("landed", 4.1, "") and not first.kept("lost", 1.0, "")
    assert third.kept("landed", 9.0, "tilt exceeds it") and not third.kept("landed", 9.0, "tilt")
    cells = matrix.cells(1, repeat=3)
    promised = 3 * [first] + 3 * [None] + 3 * [third]
    assert [cell.promise for cell in cells[1:]] == promised


@pytest.mark.parametrize(
    ("promise", "message"),
    [
        ("landed", "{outcome: ..., within: seconds, because: text} expected"),
        ("{outcome: [[held]]}", "outcome: unknown '['held']'; there are: refused, completed"),
        ("{outcome: fine}", "outcome: unknown 'fine'; there are: refused, completed"),
        ("{outcome: held, because: 3}", "because: a name expected, got 3"),
        ("{outcome: held, within: soon}", "within: a number expected, got 'soon'"),
        ("{outcome: held, by: 3}", "by: unknown; allowed: outcome, within"),
    ],
)
def test_a_bad_promise_is_refused_in_one_line(tmp_path, promise, message):
    file = tmp_path / "mine.yaml"
    file.write_text(
        "{scenario: hover, moments: {a: {at: 3}}, "
        f"faults: [{{fault: servo_jam, promise: {promise}}}]}}"
    )
    with pytest.raises(FaultError, match=f"mine.yaml: promise: .*{re.escape(message)}"):
        fault_matrix.read(file, "direct")


RANDOM = MATRIX.with_name("random.yaml")


def test_drawn_flights_are_the_same_ones_and_within_their_ranges():
    few, many = (fault_matrix.read(RANDOM, "direct", draws=count) for count in (20, 200))
    cells = many.cells(3)[1:]
    assert few.cells(3)[1:] == cells[:20] and many.cells(4)[1:] != cells
    pairs = [cell for cell in cells if len(cell.schedule.faults) == 2]
    assert 70 < len(pairs) < 130 and all(cell.fault.endswith(" and another") for cell in pairs)
    assert {cell.fault for cell in cells} <= set(many.rows)
    assert {cell.moment for cell in cells} == set(many.moments)
    flown = [one for cell in cells for one in cell.schedule.faults]
    lasting = {one.duration for one in flown}
    assert {1.0, 1.15, 1.5, 3.0, np.inf} <= lasting and len(lasting) > 20
    assert all(0.1 <= one <= 5.0 or one == np.inf for one in lasting)
    late = [one.fault.delay for one in flown if one.fault.NAME == "mocap_latency"]
    assert late and all(0.02 <= one <= 1.2 for one in late)


@pytest.mark.parametrize(
    ("text", "draws", "message"),
    [
        ("faults: [{fault: mocap_jump, x: [0, 1]}]", 0, "x: [0, 1]: a range needs --draws"),
        ("faults: [{fault: mocap_jump, x: [1, 0]}]", 9, "x: [1, 0]: two numbers [low, high]"),
        ("faults: [{fault: mocap_jump, x: [0, 99]}]", 9, "x: 99"),
        ("faults: [{fault: mocap_jump}], durations: 3", 9, "durations: a list of times"),
        ("faults: [{fault: mocap_jump}], durations: [-1]", 9, "duration: -1 is not a time"),
    ],
)
def test_a_range_is_checked_at_both_ends_and_needs_draws(tmp_path, text, draws, message):
    file = tmp_path / "mine.yaml"
    file.write_text(f"{{scenario: hover, moments: {{a: {{at: 3}}}}, {text}}}")
    with pytest.raises(FaultError, match=f"mine.yaml: .*{re.escape(message)}"):
        fault_matrix.read(file, "direct", draws=draws)


def test_a_row_may_have_a_range_of_durations_and_moments_with_numbers_for_names(tmp_path):
    file = tmp_path / "mine.yaml"
    rows = "[{fault: mocap_dropout, duration: [2, 3], moments: [2]}]"
    file.write_text(f"{{scenario: hover, moments: {{1: {{at: 3}}, 2: {{at: 4}}}}, faults: {rows}}}")
    cells = fault_matrix.read(file, "direct", draws=5).cells(1)[1:]
    assert {cell.moment for cell in cells} == {"2"}
    assert all(2.0 <= cell.schedule.faults[0].duration <= 3.0 for cell in cells)


def test_durations_are_those_of_every_row_without_its_own(tmp_path):
    file = tmp_path / "mine.yaml"
    rows = "[{fault: mocap_dropout}, {fault: imu_dropout, duration: 9}]"
    file.write_text(
        f"{{scenario: hover, moments: {{a: {{at: 3}}}}, durations: [1, null], faults: {rows}}}"
    )
    rows = fault_matrix.read(file, "direct").rows
    assert rows == ("mocap_dropout 1 s", "mocap_dropout", "imu_dropout 9 s")


def test_a_lost_flight_is_listed_with_its_command(tmp_path):
    matrix = fault_matrix.read(MATRIX, "direct", ["motor_loss"], ["landing"])
    given = "motor_loss@land+1.5:remaining=0.0 mavlink_cut@1.0"
    lost = FaultResult(matrix.rows[0], "landing", "lost", "it fell", 9.0, given=given)
    summary, page = fault_report.write(tmp_path, matrix, [lost], "s500_arm", "uam faults", "uam it")
    command = "uam it --fault motor_loss@land+1.5:remaining=0.0 --fault mavlink_cut@1.0"
    assert f"| {command} |" in summary and command in page.read_text()


def test_a_cell_flown_several_times_shows_the_worst(tmp_path):
    errors = {"position_m": [0.1, None, None]}
    results = [
        FaultResult("servo_jam", "a", outcome, "", 1.0, errors, down_after_s=down, kept=kept)
        for outcome, down, kept in (
            ("landed", 3.0, True),
            ("completed", None, True),
            ("landed", 5.0, False),
        )
    ]
    group = fault_report.grouped(results)["servo_jam", "a"]
    assert str(group) == "landed 2/3 5.0 s 0.10 m broken"
    assert "Promises kept: 2 of 3." in fault_report.sentence(results)


def test_down_is_since_when_it_did_not_rise_again(make_flight):
    series = ended(make_flight)
    height = series["truth.z"] - series["truth.z"][0]
    landed = series.time[np.flatnonzero(height > 0.08)[-1]]
    assert down_after(series, 10.0) == pytest.approx(landed - 10.0)
    assert down_after(ended(make_flight, height=0.8), 10.0) is None


def test_the_report_of_a_campaign(tmp_path):
    matrix = fault_matrix.read(MATRIX, "direct", ["servo_jam", "motor_loss"], ["landing"])
    worst = {"position_m": [0.1, 0.2, None], "attitude_deg": [1, 2, 3], "arm_deg": [4, 5]}
    results = [
        FaultResult(cell.fault, cell.moment, outcome, "why, not <so>", 12.0, worst)
        for cell, outcome in zip(
            matrix.cells(1), ["completed", "held", "lost", "lost"], strict=True
        )
    ]
    summary, written = fault_report.write(tmp_path, matrix, results, "s500_arm", "uam faults")
    assert summary.startswith("s500_arm, pick_and_place: 3 flights with a fault: 1 held, 2 lost. ")
    assert "Without a fault: completed." in summary
    assert "| servo_jam (joint 1) | held 0.20 m |" in summary
    html = written.read_text()
    assert "why, not &lt;so&gt;" in html and "node_kill" not in html
    lines = (tmp_path / "flights.csv").read_text().splitlines()
    assert len(lines) == 5 and lines[1].startswith("no fault,,completed,0.2,3,5,12.00")
    assert (tmp_path / "matrix.png").stat().st_size > 5000
    assert json.loads((tmp_path / "faults.json").read_text())["flights"][1]["outcome"] == "held"
