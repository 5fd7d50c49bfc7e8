"""What a flight decides about its payload: late poses, wind, a payload that is not there."""

from __future__ import annotations

from collections import deque

from uam_control.grasp import Grasp
from uam_control.mission import load_scenario
from uam_control.profiles.profile import load_profile
from uam_lab.flight.direct.flight import DirectFlight
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
    deliver, waiting = a_flight._delivered, deque()

    def late(samples):
        *others, payload = deliver(samples)
        now = a_flight.plant.time
        if payload is not None:
            waiting.append((now + delay, payload))
        due = None
        while waiting and waiting[0][0] <= now:
            _, due = waiting.popleft()
        return *others, due

    a_flight._delivered = late


def grasps(a_flight):
    return [decision.grasp for decision in a_flight.mission.grasps]


def test_a_held_payload_is_held_with_late_poses():
    """220 ms, just below payload_age: the payload follows the magnet by that time."""
    a_flight = flight()
    make_late(a_flight, 0.22)
    a_flight.run()
    assert grasps(a_flight) == [Grasp.APPROACHED, Grasp.HELD, Grasp.RELEASED]
