"""Whole flights in the fused layout: the same numbers, and what is promised when it is lost."""

import json

import numpy as np
import pytest
from whole_flight import assert_nothing_left

from uam_lab.records.results.timeseries import read
from uam_msgs_py.node import wiring

LEVEL = 0.5  # [rad]
ATTEMPTS = 5  # flights in real time: beside other tests one may be stalled
HOVER_ENDS, STALLED = 9.0, 0.2  # [s] of the scenario; of unchanged motor commands in the air


def tilt(flown):
    """The largest roll or pitch angle [rad]."""
    return max(np.abs(flown[f"truth.{axis}"]).max() for axis in ("roll", "pitch"))


def shows_the_descent(flight):
    """Whether the kill came in hover, and no stall of the autopilot tipped the vehicle over.

    A stalled orchestrator kills late or never. A stalled autopilot holds its motor commands.
    """
    if "fault node_kill of" not in flight.said:
        return False
    (fault,) = json.loads((flight.out / "metrics.json").read_text())["faults"]
    flown, begin = read(flight.out / "timeseries.parquet"), fault["begin_s"]
    command = flown["rotor_1.command"]
    new = (np.diff(command, prepend=np.nan) != 0.0) | (command == 0.0)  # zero: on the ground
    times = flown.time[new & (flown.time > begin)]
    stalled = np.diff([begin, *times, flown.time[-1]]).max() > STALLED
    return begin < HOVER_ENDS and (tilt(flown) < LEVEL or not stalled)


def test_a_fused_flight_in_lockstep_is_that_of_separate_nodes_to_the_digit(shared_flights):
    flight = shared_flights.uav1
    inside = ", ".join(wiring.FUSED)
    assert f"fused: {inside} in the process flight_controller" in flight.said
    one, other = (
        read(out / "timeseries.parquet") for out in (flight.out, shared_flights.single.out)
    )
    assert one.columns.names == other.columns.names and one.phase_names == other.phase_names
    np.testing.assert_array_equal(one.values, other.values)
    np.testing.assert_array_equal(one.phases, other.phases)
    assert one.info["layout"] == "fused: control nodes in one process"
    assert other.info["layout"] == "separate nodes"
    logs = {file.stem for file in (flight.out / "logs").glob("*.log")}
    assert wiring.FLIGHT_CONTROLLER in logs and not logs & set(wiring.FUSED)
    assert_nothing_left(flight, [])


@pytest.mark.long
def test_the_table_of_a_thinned_log_has_the_ticks_that_were_sent(fly, short_scenario):
    tables, figures = [], []
    for rate in ((), ("--inner-rate", "25")):
        flight = fly("--fused", "--scenario", str(short_scenario), *rate)
        assert flight.wait() == 0, flight.said + flight.complained
        tables.append(read(flight.out / "timeseries.parquet"))
        figures.append(json.loads((flight.out / "metrics.json").read_text()))
    full, thinned = tables
    assert "inner_rate" not in "".join(full.info["notes"])
    assert f"have {len(thinned)} of" in "".join(thinned.info["notes"])
    assert 9.9 < len(full) / len(thinned) < 10.1
    rows = np.searchsorted(full.time, thinned.time[thinned.flown] - 1e-6)
    np.testing.assert_allclose(thinned.time[thinned.flown], full.time[rows], atol=1e-9)
    sent = ("truth.", "estimate.", "reference.", "tau_", "setpoint.", "rotor_", "magnet.")
    columns = [n for n, name in enumerate(full.columns.names) if name.startswith(sent)]
    flown = thinned.values[thinned.flown][:, columns]
    np.testing.assert_array_equal(flown, full.values[rows][:, columns])
    for axis in range(3):
        of_all, of_sent = (one["rms"]["position_m"][axis] for one in figures)
        # the lift-off is a short peak: which tick of ten is sent changes the RMS by some per cent
        assert of_sent == pytest.approx(of_all, rel=0.1, abs=2e-4)
    whole, part = (one["max"]["position_m"] for one in figures)
    assert max(part) <= max(whole)


@pytest.mark.long  # in real time: it is flown again where a busy machine stalls it
def test_a_kill_of_one_of_its_nodes_ends_all_of_them_and_the_autopilot_descends(fly):
    kill = f"node_kill@hover+0.5:node={wiring.ATTITUDE}"
    affected = f"{wiring.ATTITUDE}, hence of the process {wiring.FLIGHT_CONTROLLER}, begins at"
    for _ in range(ATTEMPTS):
        flight = fly("--fused", "--scenario", "hover", "--clock", "realtime", "--fault", kill)
        status = flight.wait()
        if shows_the_descent(flight):
            break
    else:
        pytest.fail(f"each flight was stalled: {flight.said}{flight.complained}")
    assert status == 1, flight.said + flight.complained
    assert f"fault node_kill of {affected}" in flight.said
    lost = f"{wiring.FLIGHT_CONTROLLER} was killed by SIGKILL; the flight continues without it"
    assert lost in flight.said and "restarted" not in flight.said
    flown = read(flight.out / "timeseries.parquet")
    figures = json.loads((flight.out / "metrics.json").read_text())
    assert not figures["mission_completed"]
    height = flown["truth.z"]
    assert height.max() > height[0] + 0.5 and abs(height[-1] - height[0]) < 0.05
    assert tilt(flown) < LEVEL
    assert_nothing_left(flight, [])
