"""What a flight decides about its payload: late poses, wind, a payload that is not there."""

from __future__ import annotations

import re
from collections import deque
from pathlib import Path

import pytest
from longer import longer

from uam_control.grasp import Grasp
from uam_control.mission import load_scenario
from uam_control.profiles.profile import load_profile
from uam_lab.experiments.trials.trial import feasible
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


@pytest.mark.parametrize("seed", [4, longer(9)])
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


TABLE_PICK = """
arm_start: {alpha_1_deg: 0, alpha_2_deg: 90}
environment:
  - {kind: table, position: [-0.68, 0.5], size: [0.3, 0.3], height: 0.537}
  - {kind: payload, rests_on: table, position: [-0.789, 0.5], size: [0.08, 0.05, 0.03]}
moves:
  - {coordinate: z, from: 0, until: 2, to: 0.8}
  - {coordinate: x, from: 2, until: 5, to: -1.0}
  - {coordinate: y, from: 5, until: 7, to: 0.5}
  - {coordinate: alpha_1, from: 2, until: 5, to_deg: 45}
  - {coordinate: alpha_2, from: 2, until: 5, to_deg: 45}
  - {coordinate: z, from: 7, until: 9, to: 0.74}
  - {coordinate: z, from: 9.6, until: 11.6, to: 1.1}
  - {coordinate: x, from: 12, until: 15, to: 0.0}
  - {coordinate: y, from: 12, until: 15, to: 0.0}
  - {coordinate: alpha_1, from: 16.5, until: 18.5, to_deg: 0}
  - {coordinate: alpha_2, from: 16.5, until: 18.5, to_deg: 90}
magnet: [{at: 9.2, energised: true}, {at: 15.5, energised: false}]
payload: {mass: 0.2}
landing: {at: 18.5, duration: 5}
"""


def test_a_payload_is_picked_from_a_table_by_the_scenario_alone(tmp_path):
    """0.2 m lower than the stand, 0.5 m to the left, another payload: 0.537 + 0.03 + 0.2 = 0.767 m,
    the height of the usual grip point. The feet stay beside the table."""
    file = tmp_path / "table_pick.yaml"
    file.write_text(TABLE_PICK)
    a_flight = flight(str(file))
    a_flight.run()
    assert grasps(a_flight) == [Grasp.APPROACHED, Grasp.HELD, Grasp.RELEASED]


def test_the_trajectory_of_the_page_picks_and_drops(tmp_path):
    """The CSV file of docs/scenarios.md, with a payload of its usual mass; `uam fly` takes it."""
    page = (Path(__file__).resolve().parents[2] / "docs/scenarios.md").read_text()
    (rows,) = re.findall(r"^```\n(t,px.*?magnet\n.*?)^```", page, re.M | re.S)
    file = tmp_path / "pick.csv"
    file.write_text(rows)
    feasible(str(file), load_profile("s500"))
    a_flight = flight(str(file))
    a_flight.run()
    assert grasps(a_flight) == [Grasp.APPROACHED, Grasp.HELD, Grasp.RELEASED]
