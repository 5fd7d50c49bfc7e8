"""Interrupted flights: the reason is reported, the recording is kept, no process stays."""

import json
import os
import signal
import time

import psutil
import pytest
from mcap.reader import make_reader
from whole_flight import assert_nothing_left, wait_until_gone

from uam_lab.preflight.doctor.finding import Verdict
from uam_lab.preflight.doctor.ros import room
from uam_lab.records.results import timeseries
from uam_sim_bridge.ports import Reservation, held, lock_file


def kept(flight):
    """The metrics of a flight that was cut short after its take-off."""
    figures = json.loads((flight.out / "metrics.json").read_text())
    assert not figures["mission_completed"]
    series = timeseries.read(flight.out / "timeseries.parquet")
    assert series.flown.any() and not series.in_phase("landed").any()
    assert json.loads((flight.out / "info.json").read_text())["partial"] is True
    return figures


@pytest.mark.parametrize(
    "victim",
    [
        "state_estimator",
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("autopilot", "recorder")),
    ],
)
def test_a_killed_node_ends_the_flight_and_is_named(fly, long_scenario, victim):
    flight = fly("--scenario", str(long_scenario))
    flight.until_phase("hover")
    nodes = flight.children()
    assert len(nodes) == 10
    os.kill(nodes[victim], signal.SIGKILL)
    assert flight.wait() == 1
    assert f"uam fly: {victim} was killed by SIGKILL" in flight.complained
    assert "Traceback" not in flight.complained
    assert_nothing_left(flight, list(nodes.values()))
    if victim != "recorder":
        assert f"{victim} was killed by SIGKILL" in kept(flight)["abort_reason"]


@pytest.mark.slow
def test_a_killed_scene_is_announced_and_the_flight_goes_on(fly, short_scenario):
    flight = fly("--scenario", str(short_scenario))
    flight.until_phase("take-off")
    os.kill(flight.children()["scene"], signal.SIGKILL)
    assert flight.wait() == 0
    assert "scene was killed by SIGKILL; the flight continues without it" in flight.said
    figures = json.loads((flight.out / "metrics.json").read_text())
    assert figures["mission_completed"]
    assert_nothing_left(flight, [])


@pytest.mark.long
@pytest.mark.skipif(room().verdict is not Verdict.OK, reason=room().advice)
def test_a_recorder_without_processor_time_loses_nothing(fly):
    flight = fly("--scenario", "hover")  # longer than the stops
    flight.until_phase("take-off")
    recorder, stops = psutil.Process(flight.children()["recorder"]), []
    for _ in range(3):  # the plant waits for it meanwhile, so the flight is not over
        recorder.suspend()
        flight.until(lambda: recorder.status() == psutil.STATUS_STOPPED, "a stopped recorder")
        begin = time.time_ns()
        time.sleep(2.0)
        stops.append((begin, time.time_ns()))
        recorder.resume()
        time.sleep(0.7)
    assert flight.wait() == 0
    with (flight.out / "log.mcap").open("rb") as file:
        ticks = [tick.publish_time for *_, tick in make_reader(file).iter_messages(["/clock"])]
    for begin, end in stops:
        flown = sum(begin < tick < end for tick in ticks) * 0.004
        assert flown < 1.01, "the receive buffers have room for a second"
    assert json.loads((flight.out / "logs/recorder.json").read_text())["lost"] == {}
    time_of = timeseries.read(flight.out / "timeseries.parquet").time
    assert {round(1e6 * step) for step in time_of[1:] - time_of[:-1]} == {4000}


@pytest.mark.slow
def test_a_node_that_hangs_is_named_and_killed(fly, long_scenario):
    flight = fly("--scenario", str(long_scenario))
    flight.until_phase("hover")
    nodes = flight.children()
    os.kill(nodes["arm_controller"], signal.SIGSTOP)
    assert flight.wait() == 1
    assert "arm_controller is stopped (SIGSTOP) and does not go on" in flight.complained
    assert "the flight is waiting for arm command; arm_controller is silent" in flight.said
    assert "did not stop and were killed: arm_controller" in flight.said
    assert_nothing_left(flight, list(nodes.values()))
    kept(flight)


@pytest.mark.long
def test_a_node_that_stops_for_a_while_changes_nothing(fly, short_scenario, shared_flights):
    """Longer than any wait of a node; no wall time is in a lockstep flight."""
    flight = fly("--scenario", str(short_scenario), "--seed", "3")
    flight.until_phase("take-off")
    nodes = [psutil.Process(flight.children()[one]) for one in ("attitude_controller", "autopilot")]
    for node in nodes:
        node.suspend()
        time.sleep(13.0)
        node.resume()
    assert flight.wait() == 0
    assert "attitude_controller is stopped (SIGSTOP): the flight waits" in flight.said
    series, single = (
        timeseries.read(one.out / "timeseries.parquet") for one in (flight, shared_flights.single)
    )
    assert series.values.tobytes() == single.values.tobytes()


def test_ctrl_c_keeps_what_was_flown(fly, long_scenario):
    flight = fly("--fused", "--scenario", str(long_scenario), report=True)
    flight.until_phase("hover")
    nodes = flight.children()
    flight.process.send_signal(signal.SIGINT)
    assert flight.wait() == 130
    assert "Traceback" not in flight.complained
    assert_nothing_left(flight, list(nodes.values()))
    assert kept(flight)["abort_reason"] == "interrupted by the user"
    assert "partial" in (flight.out / "report.html").read_text()


@pytest.mark.long
def test_ctrl_c_before_the_first_tick_leaves_nothing(fly, long_scenario):
    flight = fly("--scenario", str(long_scenario))
    flight.until(lambda: "processes in ROS domain" in flight.said, "started")
    nodes = flight.children()
    flight.process.send_signal(signal.SIGINT)
    assert flight.wait() == 130
    assert "Traceback" not in flight.complained
    assert_nothing_left(flight, list(nodes.values()))


def test_no_node_survives_a_killed_orchestrator(fly, long_scenario):
    flight = fly("--scenario", str(long_scenario))
    flight.until_phase("take-off")
    nodes = flight.children()
    flight.process.kill()
    flight.wait()
    wait_until_gone(list(nodes.values()))
    assert flight.out.joinpath("logs/mujoco_sim.json").exists(), "the nodes ended in good order"
    if not held(lock_file(None, flight.instance)):  # else another flight has taken it already
        with Reservation(flight.instance):
            pass
