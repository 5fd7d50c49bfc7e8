"""What a flight decides about its payload: late poses, wind, a payload that is not there."""

from __future__ import annotations

from collections import deque

import pytest

from uam_control.grasp import Grasp
from uam_control.mission import load_scenario
from uam_control.profiles.profile import load_profile
from uam_lab.flights.direct.flight import DirectFlight
from uam_lab.records.results.metrics import compute
from uam_lab.records.results.outcome import grasp_decisions
from uam_sim_bridge.plant import Vehicle


def flight(scenario="quick_pick", payload=0.2, seed=1, **changes):
    return DirectFlight(
        load_scenario(scenario),
        load_profile("s500"),
        Vehicle.load().changed(changes),
        payload,
        seed,
    )


def make_late(a_flight, delay):
    """Deliver the payload's poses `delay` [s] later, with their stamps."""
    control, waiting = a_flight.control, deque()

    def late(control):
        signals, now = control.signals, a_flight.plant.time
        if signals.payload is not None:
            waiting.append((now + delay, signals.payload))
        signals.payload = None
        while waiting and waiting[0][0] <= now:
            _, signals.payload = waiting.popleft()
        return True

    control.insert(control.stages[0].name, "late payload", late)


def grasps(a_flight):
    return [decision.grasp for decision in a_flight.mission.grasps]


def test_a_held_payload_is_held_with_late_poses():
    """220 ms, just below payload_age: the payload follows the magnet by that time."""
    a_flight = flight()
    make_late(a_flight, 0.22)
    a_flight.run()
    assert grasps(a_flight) == [Grasp.APPROACHED, Grasp.HELD, Grasp.RELEASED]


def test_a_payload_in_its_place_is_picked_without_a_wait():
    """The approach ends where the descent begins; there is nothing to correct."""
    a_flight = flight()
    a_flight.run()
    assert grasps(a_flight) == [Grasp.APPROACHED, Grasp.HELD, Grasp.RELEASED]
    series = a_flight.recording.series()
    landed = series.time[series.in_phase("landed")][0]
    assert landed == pytest.approx(a_flight.mission.scenario.landing.at + 4.0, abs=1.0)


@pytest.mark.parametrize("seed", [4, 9])
def test_a_payload_in_its_place_is_picked_in_gusts(seed):
    """With 1.2 m/s of gusts these two were taken for flights without payload."""
    a_flight = flight(seed=seed, **{"air.wind": [3.0, 2.0, 0.0], "air.gust": 1.2})
    a_flight.run()
    assert grasps(a_flight)[-2:] == [Grasp.HELD, Grasp.RELEASED]


def test_a_payload_beside_its_stand_is_a_shortfall():
    a_flight = flight(**{"variation.payload_offset": [0.05, 0.05]})
    a_flight.run()
    told = grasp_decisions(a_flight.mission.grasps, a_flight.mission.changes)
    info = {"payload_mass_kg": 0.2, "grasps": told}
    (shortfall,) = compute(a_flight.recording.series(), info)["shortfalls"]
    assert shortfall.startswith("payload absent, not within 0.08 m of its place; payload at (")
