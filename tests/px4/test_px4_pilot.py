"""A pilot takes over from a real PX4's OFFBOARD; PX4's own battery failsafe does, too."""

import numpy as np
import pytest
from px4_at_hand import NO_PX4, installation
from px4_pilot import KILL_SWITCH, Pilot

from uam_control.coordinates import Z
from uam_control.offboard.modes import Mode
from uam_lab import CommandRefused, Flight
from uam_lab.records.results import timeseries

# the extra px4: it reads PX4's log, the record of what PX4 received
pytest.importorskip("pyulog")
from px4_take_over import read
from pyulog import ULog

TAKE_OFF, APPROACH, PICK, CARRY, LANDING = "take-off", "approach", "pick", "carry", "land"
PHASES = TAKE_OFF, APPROACH, PICK, CARRY, LANDING
# [s] until the command; at home RETURN lands at once, and is handed back in motion
HELD = {Mode.HOLD: 2.0, Mode.POSITION: 2.0, Mode.RETURN: 1.0}
INSTANCE = 31
HEARTBEAT = 1.0  # [s]
PATIENCE = 400.0  # [s] wall time; only a failing test waits that long
UPRIGHT = 30.0  # [deg]
# [rad/s] noise of the gyro makes 0.15; RETURN turns the vehicle meanwhile: PX4's own setpoint is
# then up to 0.47 from the present rates, with which the laws begin
RATE_STEP = {Mode.HOLD: 0.25, Mode.POSITION: 0.25, Mode.RETURN: 0.5}

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(installation() is None, reason=NO_PX4),
]


def flown(folder, phase, mode):
    """Fly quick_pick; the pilot acts 1 s after `phase` began, the command follows after HELD.

    Return the result, the pilot and the answer to the command.
    """
    answer, pilot = "", Pilot(INSTANCE + 1, mode)
    options = {"scenario": "quick_pick", "autopilot": "px4", "instance": INSTANCE}
    options |= {"px4_params": ["COM_RC_IN_MODE=1"]}  # sticks by MANUAL_CONTROL
    try:
        with Flight(**options, out=folder) as flight:
            flight.wait_for(TAKE_OFF, PATIENCE)
            with pytest.raises(CommandRefused):
                flight.resume()  # now the client is connected: the next command takes no time
            begun = flight.wait_for(lambda status: status.phase == phase, PATIENCE).time
            flight.wait_for(lambda status: status.time >= max(begun, 0.0) + 1.0, PATIENCE)
            pilot.act()
            flight.wait_for("released", PATIENCE)
            if mode in HELD:
                pilot.wait(HELD[mode])
                answer = flight.resume()
            result = flight.wait(PATIENCE)
    finally:
        pilot.close()
    return result, pilot, answer


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("mode", HELD, ids=lambda mode: mode.name)
def test_a_mode_of_the_pilot_stays_until_the_command(tmp_path, mode, phase):
    result, pilot, answer = flown(tmp_path / "flight", phase, mode)
    found = read(result.folder)
    assert found.released - found.left < HEARTBEAT
    early = [time for time in found.requests if time < found.commanded]
    assert early == [] and found.commanded < np.inf, answer
    assert pilot.since_acted[0] is mode
    assert found.back - found.commanded < HEARTBEAT
    assert found.rate_step < RATE_STEP[mode] and found.thrust_step < 0.1, found
    assert found.tilt < UPRIGHT
    assert result.completed, result.reason


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("mode", [Mode.LAND, None], ids=["LAND", "battery"])
def test_a_landing_by_pilot_or_battery_is_not_overridden(tmp_path, mode, phase):
    result, pilot, _ = flown(tmp_path / "flight", phase, mode)
    found = read(result.folder)
    assert found.released - found.left < HEARTBEAT
    assert found.requests == [] and found.back == np.inf
    # PX4 shows OFFBOARD again once it has disarmed
    assert [one for one in pilot.since_acted if one is not Mode.OFFBOARD] == [Mode.LAND]
    who = "the pilot or a ground station" if mode else "the autopilot's failsafe"
    assert not result.completed and f"{who}, in LAND, has control" in result.reason
    if phase != PICK:  # there it lands on the payload's stand: docs/supervision.md
        assert found.tilt < UPRIGHT


@pytest.mark.parametrize("phase", [TAKE_OFF, APPROACH, CARRY])
@pytest.mark.parametrize("seconds", [0.3, 1.0, 6.0])
def test_the_kill_switch_is_final(tmp_path, seconds, phase):
    """Engaged for a while in the air: the vehicle falls, and no motor turns again."""
    pilot = Pilot(INSTANCE + 1, kill=seconds)
    options = {"scenario": "quick_pick", "autopilot": "px4", "instance": INSTANCE}
    try:
        with Flight(**options, px4_params=KILL_SWITCH, out=tmp_path / "flight") as flight:
            begun = flight.wait_for(phase, PATIENCE).time
            flight.wait_for(lambda status: status.time >= max(begun, 0.0) + 1.0, PATIENCE)
            pilot.act()
            result = flight.wait(PATIENCE)
    finally:
        pilot.close()
    assert not result.completed
    assert "the pilot's kill switch has stopped the motors" in result.reason
    last = result.metrics["transitions"][-1]
    assert last["to"] == "disarmed"
    series = timeseries.read(result.folder / "timeseries.parquet")
    after = series.time > last["time_s"] + 0.2
    heights = series.block("truth.")[after, Z]
    assert np.all(heights <= heights[0] + 0.02) and heights[-1] < 0.5
    log = ULog(str(result.folder / "px4.ulg"), ["actuator_armed", "actuator_motors"])
    armed, motors = (log.get_dataset(name).data for name in ("actuator_armed", "actuator_motors"))
    name = "kill" if "kill" in armed else "manual_lockdown"
    killed = armed["timestamp"][armed[name] != 0][0]
    assert armed["armed"][-1] == 0
    off = motors["timestamp"] > killed + 0.5e6
    assert np.nan_to_num(motors["control[0]"][off]).max(initial=0.0) < 0.01
