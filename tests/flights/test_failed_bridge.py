"""A bridge that has failed, in whole flights over MAVLink: no take-off, a landing, no resistance.

It fails as it does when the autopilot reboots while it is armed.
"""

import pytest
from longer import longer
from wired_flight import wired_flight

from uam_control.coordinates import CHI, CHI_DOT, Z
from uam_control.offboard.modes import Mode
from uam_control.offboard.sequence import Phase
from uam_control.supervision import State

REBOOTED = "the autopilot rebooted in flight"


def failed(until):
    """Fly until `until(flight)`, then fail."""
    flight = wired_flight("hover")
    while not until(flight):
        flight.tick()
    flight.sequence.rebooted(flight.plant.time)
    assert flight.sequence.phase is Phase.FAILED
    return flight


def fly(flight, seconds, until=lambda: False):
    """Fly that long at most; return the largest speed downwards near the ground [m/s]."""
    end, impact = flight.plant.time + seconds, 0.0
    while flight.plant.time < end and not until():
        flight.tick()
        state = flight.plant.truth().state
        if state[CHI, Z] < 0.4:  # on its legs the base is at 0.28 m
            impact = max(impact, -state[CHI_DOT, Z])
    return impact


def hovers(flight):
    return flight.mission.output.time > 4.0


def test_on_the_ground_there_is_no_take_off():
    flight = failed(lambda flight: flight.sequence.phase is Phase.FLYING)
    flight.run()
    output = flight.mission.output
    assert output.state is State.DISARMED and output.phase == "aborted" and not flight.armed
    assert f"bridge: {REBOOTED}" in output.abort_reason
    assert flight.recording.series()["truth.z"].max() < 0.3


def test_in_flight_it_lands_the_vehicle():
    flight = failed(hovers)
    assert fly(flight, 20.0, lambda: not flight.armed) < 0.6
    flight.run()
    passed = [change.target for change in flight.mission.changes]
    assert passed[-2:] == [State.LANDING, State.DISARMED]
    assert f"bridge: {REBOOTED}" in flight.mission.output.abort_reason


@pytest.mark.parametrize("mode", [longer(Mode.LAND), Mode.POSITION])
def test_who_takes_over_from_a_failed_bridge_has_the_vehicle(mode):
    flight = failed(hovers)
    fly(flight, 0.3)
    flight.autopilot.transport.sent.clear()
    if mode is Mode.POSITION:
        flight.autopilot.ground.sticks()
    flight.autopilot.ground.choose(mode)
    fly(flight, 0.3)
    assert flight.sequence.released_to == f"the pilot or a ground station, in {mode.name}"
    assert flight.mission.output.state is State.RELEASED
    fly(flight, 3.0, lambda: not flight.armed)
    assert flight.autopilot.requests() == []
    flight.autopilot.ground.choose(Mode.LAND)
    flight.run()
    assert not flight.armed and flight.mission.output.state is State.DISARMED
    assert "the pilot or a ground station" in flight.mission.output.abort_reason
