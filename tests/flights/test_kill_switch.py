"""The pilot's kill switch and flight termination are final: whole flights, over MAVLink too.

The switch goes off again after 0.3 s and 1 s, while the stand-in is still armed in OFFBOARD, and
after 6 s, when it has disarmed by itself.
"""

from itertools import product

import numpy as np
import pytest
from longer import longer
from wired_flight import KILL_CHANNEL, wired_flight

from uam_control.coordinates import CHI, Z
from uam_control.mission import load_scenario
from uam_control.offboard.modes import MavCmd, Mode
from uam_control.profiles.profile import load_profile
from uam_control.supervision import Event, State
from uam_lab.flights.direct.flight import DirectFlight
from uam_sim_bridge.plant import Vehicle

GROUND, TAKE_OFF, HOVER, CARRY = "waiting", "take-off", "approach", "carry"
AFTER = {GROUND: 0.004, TAKE_OFF: 0.4, HOVER: 2.0, CARRY: 2.5}  # [s] in the phase
ENGAGED = 0.3, 1.0, 6.0  # [s]
IN_SHORT = {(GROUND, 1.0), (TAKE_OFF, 0.3), (HOVER, 6.0), (CARRY, 0.3)}  # each phase and each time


def direct(scenario):
    return DirectFlight(load_scenario(scenario), load_profile("s500"), Vehicle.load(), 0.2, 1)


def wired(scenario):
    return wired_flight(scenario)


def until(flight, phase):
    """Fly into the phase; GROUND: until the motors are armed."""
    output = flight.mission.output
    while output.phase != phase or (phase == GROUND and not flight.armed):
        flight.advance(5, 5)  # a new phase is decided: the last tick of these
        assert not output.done
    end = flight.plant.tick + round(AFTER[phase] / flight.plant.period)
    while flight.plant.tick < end:
        flight.advance(end - flight.plant.tick, end - flight.plant.tick)


def fly(flight, seconds):
    """Fly that long; return heights [m] and the largest motor command of each tick."""
    end, rows = flight.plant.time + seconds, []
    while flight.plant.time < end:
        flight.tick()
        rows.append((flight.plant.truth().state[CHI, Z], float(np.max(flight.autopilot.motors))))
    return np.array(rows).T


def press(flight, seconds):
    """Engage the switch that long and watch until 8 s after; return as `fly` does."""
    ground = getattr(flight.autopilot, "ground", None)
    switch = ground.kill_switch if ground else flight.autopilot.autopilot.kill_switch
    if ground:
        flight.autopilot.autopilot.set_parameter("RC_MAP_KILL_SW", KILL_CHANNEL)
    switch(True)
    engaged = fly(flight, seconds)
    switch(False)
    return np.hstack([engaged, fly(flight, 8.0)])


def assert_final(flight, heights, motors):
    """No motor turns any more, and the result says why."""
    assert motors[2:].max() < 1e-9 and heights[-1] <= heights[0] + 1e-3
    assert not flight.armed
    flight.run()
    output, last = flight.mission.output, flight.mission.changes[-1]
    assert output.done and output.state is State.DISARMED and output.phase == "aborted"
    assert "the pilot's kill switch has stopped the motors" in output.abort_reason
    assert last.event in (Event.STOPPED, Event.GIVEN_UP) and "kill switch" in last.cause


@pytest.mark.parametrize(
    ("phase", "seconds"),
    [case if case in IN_SHORT else longer(*case) for case in product(AFTER, ENGAGED)],
)
def test_a_kill_is_final_also_when_the_switch_goes_off_again(phase, seconds):
    flight = direct("quick_pick")
    until(flight, phase)
    assert_final(flight, *press(flight, seconds))


@pytest.mark.parametrize(
    ("phase", "seconds"),
    [
        (HOVER, 0.3),
        *(longer(*case) for case in [(GROUND, 0.3), (HOVER, 6.0)]),
    ],
)
def test_the_same_over_mavlink(phase, seconds):
    flight = wired("quick_pick")
    until(flight, phase)
    flight.autopilot.transport.sent.clear()
    assert_final(flight, *press(flight, seconds))
    requests = flight.autopilot.requests()
    assert all("command : 400, confirmation : 0, param1 : 0.0" in text for text in requests)


def test_flight_termination_ends_the_flight():
    flight = direct("hover")
    until(flight, TAKE_OFF)
    flight.autopilot.autopilot.command(
        flight.plant.time, MavCmd.DO_FLIGHTTERMINATION, (1.0, *[0.0] * 6)
    )
    heights, motors = fly(flight, 8.0)
    assert motors[2:].max() < 1e-9 and not flight.armed
    flight.run()
    assert "flight termination has stopped the motors" in flight.mission.output.abort_reason
    assert not flight.mission.start()[0]


def test_a_pilot_who_saves_the_vehicle_after_a_kill_is_left_alone():
    """Back in the air by another mode: it is the pilot's, OFFBOARD is not to be had any more."""
    flight = wired("hover")
    until(flight, TAKE_OFF)
    fly(flight, 3.0)
    ground, autopilot = flight.autopilot.ground, flight.autopilot.autopilot
    autopilot.set_parameter("RC_MAP_KILL_SW", KILL_CHANNEL)
    ground.kill_switch(True)
    fly(flight, 0.1)
    ground.kill_switch(False)
    ground.choose(Mode.HOLD)
    fly(flight, 0.5)
    flight.autopilot.transport.sent.clear()
    fly(flight, 3.0)
    assert flight.armed and autopilot.commander.mode is Mode.HOLD
    assert flight.autopilot.requests() == [] and flight.autopilot.setpoints == 0
    ground.choose(Mode.OFFBOARD)
    fly(flight, 0.5)
    assert autopilot.commander.mode is Mode.HOLD
