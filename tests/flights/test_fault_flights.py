"""Faults in whole flights of the direct engine, and a small matrix from the command line."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from longer import longer

from uam_control.mission import load_scenario
from uam_control.profiles.profile import load_profile
from uam_control.supervision import Event, State
from uam_lab.cli.main import main
from uam_lab.experiments.trials.outcome import classify, ending
from uam_lab.flights.direct.flight import DirectFlight
from uam_lab.records.results import metrics
from uam_lab.records.results.outcome import transitions
from uam_sim_bridge.faults import read_schedule
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.effects import presets

SCENARIO = load_scenario("hover")
QUICK_PICK = load_scenario("quick_pick")


def flown(*texts, seed=1, plant="calm", watch=None, scenario=SCENARIO):
    """A flight with faults: flight, series, metrics.

    plant: name of a preset; watch(flight): called once a second.
    """
    faults, payload = read_schedule(texts, scenario, seed), scenario.payload_mass
    vehicle = Vehicle.load().changed(presets.added({}, presets.read([plant])))
    flight = DirectFlight(scenario, load_profile("s500"), vehicle, payload, seed, faults)
    flight.run(watch and (lambda time, phase: watch(flight)))
    series = flight.recording.series()
    reason = flight.mission.output.abort_reason or flight.ended_by
    info = {
        "abort_reason": reason,
        "faults": flight.outcome().faults,
        "payload_mass_kg": payload,
        "drop_point": scenario.drop_point,
        "transitions": transitions(flight.mission.changes),
    }
    return flight, series, metrics.compute(series, info)


@pytest.fixture(scope="module")
def nominal():
    return flown()


def test_a_short_dropout_of_the_motion_capture_is_survived(nominal):
    _, series, figures = flown("mocap_dropout@hover+1+0.3")
    assert figures["mission_completed"], figures["shortfalls"]
    (fault,) = figures["faults"]
    assert (fault["begin_s"], fault["end_s"]) == pytest.approx((4.0, 4.3), abs=0.005)
    before = series.time < 3.99
    assert np.array_equal(series.values[before], nominal[1].values[before], equal_nan=True)
    assert figures["max"] != nominal[2]["max"]


def test_a_gap_of_the_imu_is_flown_with_the_last_commands(nominal):
    _, series, figures = flown("imu_dropout@hover+1+0.1")
    assert figures["mission_completed"], figures["shortfalls"]
    np.testing.assert_allclose(np.diff(series.time), 0.004, atol=1e-9)
    gap = (series.time > 4.01) & (series.time < 4.09)
    assert np.ptp(series["tau_p.z"][gap]) == 0.0 and np.ptp(series["truth.x"][gap]) > 0.0
    assert len(series) == pytest.approx(len(nominal[1]), abs=300)


def test_exchanged_axes_of_the_motion_capture_end_in_a_level_descent():
    flight, series, figures = flown("mocap_swap@take-off+1.5:axes=xy")
    assert classify(series, figures) == "failsafe"
    assert "contradict" in flight.mission.output.abort_reason
    assert np.hypot(series["truth.x"], series["truth.y"])[-1] < 2.0


def test_without_checks_of_the_grasp_the_mission_keeps_its_times(tmp_path):
    file = tmp_path / "unchecked.yaml"
    file.write_text("mission: {ros__parameters: {grasp_checks: 'off'}}")
    scenario = load_scenario("quick_pick")
    profile = load_profile("s500", str(file))
    faults = read_schedule(["magnet_weak@0:remaining=0"], scenario, 1)
    flight = DirectFlight(scenario, profile, Vehicle.load(), 0.2, 1, faults)
    flight.run()
    assert flight.mission.grasps == [] and flight.mission.delay == 0.0
    assert flight.mission.output.phase == "landed"


@pytest.mark.long  # after the crash it is armed for half a minute
def test_a_flight_without_a_motor_is_lost():
    _, series, figures = flown("motor_loss@hover+1:remaining=0")
    assert not figures["mission_completed"]
    assert classify(series, figures) == "lost"
    assert figures["faults"][0]["end_s"] is None


def test_without_imu_or_link_the_autopilot_brings_it_down_and_the_flight_ends():
    for text, reason in (
        ("imu_dropout@hover+1", "no state of the estimator for"),
        ("mavlink_cut@take-off+0.4", "no lift-off: the autopilot is silent"),
        ("mavlink_cut@hover+1", "no message of the autopilot for"),
    ):
        flight, series, figures = flown(text)
        assert reason in flight.ended_by + flight.mission.output.abort_reason
        assert classify(series, figures) == "failsafe", text
        assert figures["shortfalls"], text
        height, speed = flight.plant.truth().state[:2, 2]
        assert height < 0.3 and abs(speed) < 0.05, text  # on its legs the base is at 0.285 m
        assert not flight.armed, text
    # without a link the mission detects the touchdown by the estimate
    assert flight.mission.changes[-1].event is Event.TOUCHDOWN


@pytest.mark.parametrize(
    "text",
    [
        "mocap_dropout@pick+2.2+1.15",
        longer("mocap_freeze@pick+2.2+1.15"),
        longer("mocap_jump@pick+2.2+1.15:x=0.3"),
    ],
)
def test_poses_that_are_back_just_after_the_failsafe_limit_complete_the_mission(text):
    flight, _, figures = flown(text, scenario=QUICK_PICK)
    assert figures["mission_completed"], figures["shortfalls"]
    states = [change.target for change in flight.mission.changes]
    assert State.BLIND in states and State.FAILSAFE not in states


@pytest.mark.parametrize("text", ["mocap_dropout@pick+2.2", longer("mocap_freeze@carry+0.5")])
def test_without_poses_it_leaves_the_stand_before_the_autopilot_descends(text):
    flight, series, figures = flown(text, scenario=QUICK_PICK)
    assert classify(series, figures) == "failsafe" and not flight.armed
    low = series["truth.z"] < 0.7
    beside = np.hypot(series["truth.x"] + 0.789, series["truth.y"])[low & (series.time > 5.0)]
    assert beside.min() > 0.3
    assert np.abs(series["truth.pitch"]).max() < 0.35


@pytest.mark.parametrize(
    ("seed", "texts"),
    [  # body rates against the tilt came 0.19 s late: 178 degrees; now it levels by itself
        longer(1, ("mavlink_delay@carry+1.93+1.056:direction=to_autopilot,delay=0.186",)),
        # outliers are not for the autopilot: it had stood on the ground, armed, for minutes
        longer(
            4, ("imu_dropout@land+0.818+3", "mocap_outliers@take-off:share=0.371,distance=1.56")
        ),
        # nor exchanged axes, of which the estimate knows: was 173 degrees
        (2, ("mocap_swap@pick+2.2+4.423", "mocap_latency@take-off+0.4+1.5:delay=0.946")),
    ],
)
def test_what_is_known_to_be_wrong_does_not_reach_the_autopilot(seed, texts):
    flight, series, figures = flown(*texts, scenario=QUICK_PICK, seed=seed)
    assert classify(series, figures) == "failsafe" and not flight.armed


@pytest.mark.parametrize(
    ("seed", "text"),
    [  # the estimate followed these poses in *blind*: 176 degrees, 59 m high, 33 m/s
        (3, "mocap_swap@carry+0.2"),
        longer(5, "mocap_swap@carry+0:axes=yz"),
        longer(7, "mocap_swap@carry+0.2+3:axes=xz"),
        (2, "mocap_swap@take-off+1.085"),  # a contradiction in the open: no blind flight
    ],
)
def test_wrong_poses_are_not_followed_before_the_vehicle_is_down(seed, text):
    _, series, figures = flown(text, scenario=QUICK_PICK, seed=seed)
    assert classify(series, figures) == "failsafe"
    assert np.degrees(series.tilt.max()) < 20.0 and series["truth.z"].max() < 1.5


@pytest.mark.parametrize(
    ("text", "outcome"),
    [  # a level descent came down on the stand: 160 degrees
        (
            "@pick+2.5+1.0:unit=companion,gyro=0.185,accelerometer=-5.13,axis=z,over=0.2",
            "completed",
        ),
        longer("@pick+2.2:unit=companion,gyro=0,accelerometer=3,axis=x,over=1", "failsafe"),
    ],
)
def test_beside_the_stand_a_faulty_imu_moves_the_vehicle_clear_of_it_first(text, outcome):
    flight, series, figures = flown("imu_bias" + text, scenario=QUICK_PICK, seed=2)
    assert classify(series, figures) == outcome, figures["shortfalls"]
    assert np.degrees(series.tilt.max()) < 25.0
    assert State.BLIND in [change.target for change in flight.mission.changes]


@pytest.mark.parametrize(("late", "seed"), [(0.26, 1), longer(0.5, 2), longer(0.75, 1)])
def test_a_landing_beside_the_stand_moves_clear_of_it_first(late, seed):
    text = f"mocap_latency@take-off+3:delay={late}"
    _, series, figures = flown(text, scenario=QUICK_PICK, seed=seed)
    assert classify(series, figures) == "landed"
    end = ending(series)
    assert end.largest_tilt < 0.3 and end.impact < 0.4  # onto the stand: 3.1 rad, 3.7 m/s


@pytest.mark.parametrize(
    "text",
    [
        "mavlink_cut@pick+2.2",
        longer("mavlink_cut@pick+2.45"),
        longer("mavlink_cut@pick+2.2:direction=to_autopilot"),
    ],
)
def test_beside_the_stand_the_arm_gives_way_to_the_autopilots_landing(text):
    flight, series, figures = flown(text, scenario=QUICK_PICK, seed=2)
    assert classify(series, figures) == "failsafe" and not flight.armed
    end = ending(series)
    assert end.largest_tilt < 0.2 and end.impact < 0.9  # stiff: 0.58 rad, 1.3 m/s
    assert not flight.mission.output.magnet


@pytest.mark.parametrize(
    ("path", "text", "seed"),
    [
        ("lemniscate_payload", "mavlink_cut@carry+3.181", 9401),
        longer("race_5_payload", "mocap_freeze@drop+3.669", 46),
    ],
)
def test_a_payload_that_hangs_down_does_not_touch_the_ground_first(path, text, seed):
    _, series, figures = flown(text, seed=seed, scenario=load_scenario(path))
    assert classify(series, figures) in ("landed", "failsafe")


@pytest.mark.parametrize(
    "text", ["mocap_dropout@take-off", "imu_dropout@take-off+0.4", "mavlink_cut@take-off+0.4"]
)
@pytest.mark.parametrize("seed", [1, longer(2), longer(6)])
def test_a_take_off_without_sensors_ends_on_the_ground_and_disarmed(text, seed):
    flight, series, figures = flown(text, seed=seed)
    assert classify(series, figures) == "failsafe" and not flight.armed
    up = series["truth.z"] - series["truth.z"][0] > 0.02
    assert np.count_nonzero(np.diff(up.astype(int)) == 1) == 1  # one lift-off


@pytest.mark.parametrize(
    ("text", "seed", "outcome"),
    [
        ("clock_jump@take-off:step=-0.219", 5, "failsafe"),  # 180 deg, 2.4 m/s
        ("clock_jump@take-off+1.434+1.0:step=-0.378", 3, "completed"),  # 1.3 m/s
        longer("clock_jump@take-off+0.4:step=0.2", 2, "failsafe"),
        longer("clock_jump@start:step=-0.15", 3, "failsafe"),  # 46 deg; now it does not take off
    ],
)
def test_poses_of_a_wrong_clock_are_missing_poses(text, seed, outcome):
    _, series, figures = flown(text, scenario=QUICK_PICK, seed=seed)
    assert classify(series, figures) == outcome
    assert ending(series).largest_tilt < 0.2


def test_late_poses_do_no_harm():
    for delay in (0.05, 0.15):
        _, series, figures = flown(f"mocap_latency@hover+1+3:delay={delay}")
        assert classify(series, figures) == "completed"
        assert max(figures["max"]["position_m"]) < 0.1


def test_a_frozen_tracker_is_rejected():
    """Neither by the estimator nor by the autopilot, whose descent would use it."""
    flight, series, figures = flown("mocap_freeze@hover+1+6")
    assert classify(series, figures) == "failsafe"
    assert "mocap pose has been the same for 1.10 s" in figures["shortfalls"][0]
    assert not flight.armed


def test_a_stuck_encoder_at_the_grasp_is_noticed_and_the_payload_is_delivered():
    fault = "encoder_stuck@pick+1.43+3"
    _, series, figures = flown(fault, seed=9001, plant="laboratory", scenario=QUICK_PICK)
    assert classify(series, figures) == "completed", figures["shortfalls"]
    stuck = (series.time > 7.44) & (series.time < 10.42)
    assert np.ptp(series["estimate.alpha_1"][stuck & (series.time > 8.0)]) < 1e-4
    held = [one["cause"] for one in figures["transitions"] if one["to"] == "holding"]
    assert held == ["angle of a joint stays the same while its torque and its reference change"]
    # the arm swings, but not over: without the rule to -72 degrees from 42
    assert np.degrees(series["truth.alpha_1"][stuck].min()) > -30.0


def test_the_same_seed_gives_the_same_flight_with_random_faults():
    spec = "mocap_outliers@hover+1+2:share=0.1,distance=0.1"
    first, again, other = flown(spec), flown(spec), flown(spec, seed=2)
    assert np.array_equal(first[1].values, again[1].values, equal_nan=True)
    assert first[2]["max"] != other[2]["max"]


@pytest.mark.long
def test_a_matrix_from_the_command_line(tmp_path, capsys):
    file = tmp_path / "small.yaml"
    file.write_text(
        "scenario: hover\n"
        "moments: {up: {at: take-off, after: 2}, down: {at: land, after: 2}}\n"
        "faults:\n"
        "  - {fault: mocap_dropout, duration: 0.2}\n"
        "  - {fault: motor_loss, remaining: 0}\n"
        "  - {fault: node_kill}\n"
    )
    out = tmp_path / "out"
    assert main(["faults", "--matrix", str(file), "--jobs", "2", "--out", str(out)]) == 0
    message = capsys.readouterr().out
    assert "4 flights with a fault: 2 completed" in message
    why = "node_kill: the direct engine has no processes: needs --engine ros"
    assert f"left out: {why}" in message and f"Left out: {why}." in message
    reported = json.loads((out / "faults.json").read_text())["flights"]
    assert [(f["fault"], f["moment"]) for f in reported][:3] == [
        ("no fault", ""),
        ("mocap_dropout 0.2 s", "up"),
        ("mocap_dropout 0.2 s", "down"),
    ]
    assert reported[0]["outcome"] == "completed" and reported[3]["outcome"] == "lost"
    assert {p.name for p in out.iterdir()} == {
        "faults.json",
        "flights.csv",
        "flights.parquet",
        "matrix.png",
        "report.html",
        "summary.md",
    }


@pytest.mark.slow
def test_ctrl_c_ends_the_matrix_at_once_and_leaves_no_process(tmp_path):
    command = [
        sys.executable,
        "-m",
        "uam_lab.cli.main",
        "faults",
        "--jobs",
        "1",
        "--moment",
        "transit",
        "--out",
        str(tmp_path / "out"),
    ]
    running = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        cwd=Path(__file__).resolve().parents[2],
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    try:
        while "faults: 2 of" not in (line := running.stdout.readline()):
            assert line, "it ended before it was interrupted"
        begin = time.monotonic()
        os.killpg(running.pid, signal.SIGINT)  # as a terminal does: to the workers, too
        message = running.communicate(timeout=60)[0]
        assert running.returncode == 130
        assert message.splitlines()[-1].startswith("uam faults: interrupted; the same command")
        assert time.monotonic() - begin < 20.0
    finally:
        running.kill()
        running.wait()
    deadline = time.monotonic() + 20.0
    while _group_is_there(running.pid):
        assert time.monotonic() < deadline, "a process was left behind"
        time.sleep(0.05)


def _group_is_there(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


def test_a_fault_that_cannot_be_flown_is_refused_in_one_line(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for text, message in (
        ("node_kill@3", "needs --engine ros"),
        ("mocap@3", "unknown fault 'mocap'"),
        ("mocap_dropout@pick", "no phase 'pick' in the scenario, which has: take-"),
    ):
        assert main(["fly", "--engine", "direct", "--scenario", "hover", "--fault", text]) == 2
        err = capsys.readouterr().err
        assert message in err and err.count("\n") == 1
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("late", ["mavlink_delay@start:delay=0.03,direction=to_autopilot",
                                  "mavlink_delay@hover+0.5:delay=0.03",
                                  "mocap_latency@start:delay=0.03,jitter=0.008"])  # fmt: skip
def test_thirty_milliseconds_are_within_the_margin(late):
    _, _, figures = flown(late)
    assert figures["mission_completed"], figures["shortfalls"]


def test_a_link_slower_than_the_margin_is_refused_on_the_ground():
    flight, series, figures = flown("mavlink_delay@start:delay=0.1,direction=to_autopilot")
    assert "setpoint delay 0.104 s exceeds" in flight.mission.output.abort_reason
    assert not series.flown.any() and not figures["mission_completed"]


def test_a_link_that_becomes_slower_than_the_margin_is_left_before_the_vehicle_swings():
    flight, series, _ = flown("mavlink_delay@hover+1:delay=0.2,direction=to_autopilot")
    assert "setpoint delay" in flight.mission.output.abort_reason
    left = series.time < 6.0  # in the autopilot's hands after that
    tilt = np.hypot(series["truth.roll"][left], series["truth.pitch"][left])
    assert tilt.max() < 0.1
    assert [change.event for change in flight.mission.changes[-2:]] == [
        Event.HARD_LIMIT,
        Event.DOWN,
    ]


@pytest.mark.parametrize("plant", ["calm", longer("laboratory")])
def test_a_delay_that_begins_in_flight_is_measured_and_left_beyond_the_margin(plant):
    # TIMESYNC shows half of either, so that only the loop delay can start a reaction
    late = []
    _, _, figures = flown(
        "mavlink_delay@hover+0.5:delay=0.04,direction=to_autopilot",
        plant=plant,
        watch=lambda flight: late.append(flight.control.bridge.loop_delay.value),
    )
    assert figures["mission_completed"], figures["shortfalls"]
    assert np.nanmin(late) < 0.016 and np.nanmax(late) == pytest.approx(0.049, abs=0.006)

    flight, series, figures = flown(
        "mavlink_delay@hover+0.5:delay=0.07,direction=to_autopilot", plant=plant
    )
    assert "measured setpoint delay" in flight.mission.output.abort_reason
    assert classify(series, figures) == "failsafe" and series["truth.z"].max() < 1.1
    tilt = np.hypot(series["truth.roll"], series["truth.pitch"])
    assert tilt[series.flown].max() < 0.1
