"""Faults in flights of the ROS engine: as in the direct engine, and recorded in the log."""

import json
import shutil

import pytest
from whole_flight import assert_nothing_left

from uam_control.mission import load_scenario
from uam_control.profiles.profile import load_profile
from uam_lab.cli.main import main
from uam_lab.flights.direct.flight import DirectFlight
from uam_lab.records.rebuild import rebuild
from uam_msgs_py.node import wiring
from uam_sim_bridge.faults import read_schedule
from uam_sim_bridge.plant import Vehicle

IN_BOTH = (
    "wind_gust@take-off+0+1.5:speed=2",
    "imu_dropout@hover+0+0.06",
    "mavlink_corruption@0.5+1:share=0.1",
)
IN_NODES = (
    "mavlink_delay@1+0.5:delay=0.01",
    "node_stall@hover+0+0.3:node=mission",
    "node_kill@take-off+0.5:node=scene",
)


@pytest.mark.long
def test_without_the_autopilots_voice_it_lands_by_itself(fly):
    """Setpoints still arrive, but nobody knows: no heartbeat for 3 s, then autopilot_age_land."""
    cut = "mavlink_cut@hover+0.5:direction=from_autopilot"
    flight = fly("--fused", "--scenario", "hover", "--fault", cut)
    assert flight.wait() == 1
    figures = json.loads((flight.out / "metrics.json").read_text())
    passed = [(one["to"], one["cause"]) for one in figures["transitions"]]
    assert passed[-2][0] == "landing" and "no message of the autopilot for" in passed[-2][1]
    assert passed[-1] == ("disarmed", "touchdown")
    assert max(figures["max"]["position_m"]) < 0.1
    assert "no heartbeat" in (flight.out / f"logs/{wiring.FLIGHT_CONTROLLER}.log").read_text()


@pytest.mark.slow
def test_faults_begin_on_time_and_are_in_the_log(fly, short_scenario, tmp_path):
    options = [word for text in (*IN_BOTH, *IN_NODES) for word in ("--fault", text)]
    flight = fly("--scenario", str(short_scenario), *options, report=True)
    assert flight.wait() == 0, flight.said + flight.complained
    assert "scene was killed by SIGKILL; the flight continues without it" in flight.said
    figures = json.loads((flight.out / "metrics.json").read_text())
    found = {fault["fault"]: fault for fault in figures["faults"]}
    assert len(found) == len(IN_BOTH + IN_NODES)

    scenario = load_scenario(str(short_scenario))
    direct = DirectFlight(
        scenario, load_profile("s500"), Vehicle.load(), 0.0, 1, read_schedule(IN_BOTH, scenario, 1)
    )
    direct.run()
    for fault in direct.outcome().faults:
        own = found[fault["fault"]]
        same = 1e-6 if fault["fault"] != "mavlink_corruption" else 0.005  # heard a tick later
        for key in ("begin_s", "end_s"):
            assert own[key] == pytest.approx(fault[key], abs=same), fault["fault"]
        assert own["parameters"] == fault["parameters"]
    assert found["node_kill"]["end_s"] is None and found["node_stall"]["end_s"] is not None
    assert 0.5 <= found["node_kill"]["begin_s"] <= 2.5

    page = (flight.out / "report.html").read_text()
    assert "Faults injected in this flight" in page
    alone = tmp_path / "alone"
    alone.mkdir()
    shutil.copy(flight.out / "log.mcap", alone)
    assert rebuild(alone, tmp_path / "again")["faults"] == figures["faults"]
    assert_nothing_left(flight, [])


@pytest.mark.slow
def test_a_flight_waits_for_a_silent_controller(fly):
    """In real time, hence on an idle machine; the lease is 20 s."""
    loss = "discovery_loss@approach+0+24:node=arm_controller"
    flight = fly("--scenario", "pick_and_place", "--clock", "realtime", "--fault", loss)
    flight.wait()
    assert "fault discovery_loss of arm_controller ends at" in flight.said
    figures = json.loads((flight.out / "metrics.json").read_text())
    passed = [(one["to"], one["cause"]) for one in figures["transitions"]]
    held = [cause for to, cause in passed if to == "holding"]
    assert len(held) == 1 and "a controller's gains" in held[0]
    assert ("flying", "the controller is back") in passed
    assert passed[-1][0] == "disarmed" and max(figures["max"]["position_m"]) < 0.3


@pytest.mark.slow
def test_what_is_promised_of_killed_processes_is_kept(tmp_path):
    """In real time, hence on an idle machine: every process at one moment."""
    options = ["--matrix", "processes", "--engine", "ros", "--clock", "realtime"]
    options += ["--only", "node_kill", "--moment", "transit"]
    assert main(["faults", *options, "--out", str(tmp_path / "faults")]) == 0
    summary = (tmp_path / "faults" / "summary.md").read_text()
    assert "Promises kept: 7 of 7." in summary
