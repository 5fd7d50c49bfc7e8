"""The bridge node without valid commands in flight: bounded level hold, then no stream."""

import math
import time

import numpy as np
import pytest
from bridge_rig import PERIOD, WEIGHT, read_setpoint

from uam_control.maths.rotations import quaternion_from_euler
from uam_control.offboard.modes import Mode
from uam_control.setpoints.targets import AttitudeTarget
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.convert import PoseWriter
from uam_msgs_py.messages.status import MissionStatus
from uam_sim_bridge.mavlink.protocol.setpoint_messages import setpoint_message


def test_bad_commands_in_flight_hold_level_then_the_failsafe_acts(make_rig):
    rig = make_rig("-p", "hold_braking:=0.0", "-p", "return_after_lost_link:=true")
    rig.fly()
    thrusts = []
    for _ in range(200):
        rates, thrust = rig.tick((0, 0, math.nan))
        thrusts.append(thrust)
        assert np.all(np.isfinite(rates)) and np.all(np.abs(rates) <= 2.0)
    assert thrusts == pytest.approx([WEIGHT / 41.36] * 200, rel=0.02)
    assert rig.autopilot.status.mode is Mode.OFFBOARD
    for _ in range(650):
        rig.tick((0, 0, math.nan))
    assert rig.autopilot.status.mode is Mode.LAND  # COM_OF_LOSS_T after the hold
    assert rig.autopilot.status.armed
    assert "holding level" in rig.node.output
    # valid commands again: the bridge requests OFFBOARD again
    for _ in range(400):
        rig.tick((0, 0, WEIGHT))
    assert rig.autopilot.status.mode is Mode.OFFBOARD


@pytest.mark.parametrize(
    ("tau_q", "by_autopilot", "reason"),
    [
        ((0, math.nan, 0), False, "/uam/attitude/command: refused /probe (1 messages): effort of"),
        ((0, math.nan, 0), False, "effort of pitch is nan, not finite; publisher is /probe"),
        ((0, 0, 0), True, "SET_ATTITUDE_TARGET refused: rates.y is nan, not finite"),
    ],
)
def test_diagnostics_name_topic_and_field_of_what_is_not_finite(
    make_rig, probe, tau_q, by_autopilot, reason
):
    """Of the bridge's inputs, and of a setpoint that another sender gives the autopilot."""
    reports = probe.collect(topics.DIAGNOSTICS)
    rig = make_rig()
    rig.fly()
    if by_autopilot:
        bad = AttitudeTarget.of_rates(np.array([0.0, math.nan, 0.0]), 0.5)
        rig.companion.handle(rig.body.time, setpoint_message(bad, rig.body.time, 1))
        rig.autopilot_tick()
    rig.tick((0, 0, WEIGHT), tau_q)
    probe.until(
        lambda: any(reason in status.message for one in reports for status in one.status), reason
    )


def test_a_mission_in_failsafe_is_left_to_the_autopilot_down_to_the_ground(make_rig, probe):
    """The bridge holds level, then stops the stream and does not request OFFBOARD, at any height.

    Idle commands do not set the thrust to zero.
    """
    status = probe.publisher(topics.MISSION_STATUS)
    rig = make_rig()
    probe.until_connected("mavlink_bridge", [status], [])
    rig.fly()
    message = MissionStatus("aborted", 1.0, state="failsafe", cause="tilt").to_message(1)
    status.publish(message)
    time.sleep(0.2)  # no input of the join: wait until it arrives
    thrusts = np.array([rig.tick()[1] for _ in range(100)]) / (WEIGHT / 41.36)
    assert np.all((thrusts > 0.965) & (thrusts < 1.005))
    # it begins to sink, with 0.3 m/s^2; at the end it is level for the autopilot
    assert thrusts[[5, -1]] == pytest.approx([1.0 - 0.3 / 9.81, 1.0], rel=0.005)
    for _ in range(500):
        rig.tick()
    assert rig.autopilot.status.mode is Mode.LAND
    rig.body.position[2] = 0.2
    rig.received.clear()
    for _ in range(200):
        rig.tick()
    assert rig.autopilot.status.mode is Mode.LAND
    assert not rig.kinds() & {"SET_ATTITUDE_TARGET", "COMMAND_LONG"}


def test_idle_high_up_is_not_thrust_zero(make_rig):
    rig = make_rig("-p", "hold_braking:=0.0")
    rig.fly()
    _, thrust = rig.tick()
    assert thrust == pytest.approx(WEIGHT / 41.36, rel=0.02)


def test_states_without_commands_hold_level_then_the_failsafe_acts(make_rig):
    """Without a controller the states continue; the bridge counts time by their stamps."""
    rig = make_rig("-p", "return_after_lost_link:=true")
    rig.fly()
    stopped, thrusts, rolls = rig.count, [], []
    tilted = np.zeros((3, 8))
    tilted[0, 3] = 0.1  # roll [rad], without a reaction of the controllers
    tilted[0, 2] = 5.0  # as `fly`

    def tick():
        rig.publish(topics.STATE, rig.state.fill(rig.count * PERIOD, tilted))
        silent = rig.count - stopped < 24  # stale_after, 0.1 s, after the last command
        before = len(rig.setpoints)
        if not silent:
            rig.probe.until(lambda n=before: len(rig.setpoints) > n, "a setpoint without command")
            _, rates, thrust = read_setpoint(rig.setpoints[-1])
            thrusts.append(thrust)
            rolls.append(rates[0])
        rig.autopilot_tick()
        rig.count += 1

    for _ in range(950):
        tick()
    assert thrusts[:480] == pytest.approx([WEIGHT / 41.36] * 480, rel=0.02)
    expected = -0.1 * (6.0 + 6.0 * 0.004 * np.arange(480))  # hold_gain, hold_integral
    assert rolls[:480] == pytest.approx(expected, rel=0.03)
    assert thrusts[-1] == 0.0
    assert rig.autopilot.status.mode is Mode.LAND and rig.autopilot.status.armed
    # after "holding level" the next line of this kind waits for two seconds of wall time
    rig.probe.until(lambda: tick() or "stream stopped" in rig.node.output, "the stream stopped")
    rig.body.position[2] = 5.0  # it rolled and fell; low, the autopilot would be left to land
    rig.body.hover()
    for _ in range(400):
        rig.tick((0, 0, WEIGHT))
    assert rig.autopilot.status.mode is Mode.OFFBOARD


def test_realtime_watchdog_holds_level_and_then_stops(make_rig):
    """Ticks stop in flight: the bridge sends level setpoints for release_time, then none."""
    rig = make_rig("-p", "clock:=realtime", "-p", "stale_after:=2.0", "-p", "release_time:=3.0")
    rig.autopilot.set_parameter("COM_OF_LOSS_T", 30.0)
    rig.fly()
    before = len(rig.node.output)  # a stalled flight has such lines, too
    rig.receive()
    rig.received.clear()

    def stream():
        rig.receive()
        return [m for m in rig.received if m.get_type() == "SET_ATTITUDE_TARGET"]

    rig.probe.until(lambda: len(stream()) >= 5, "setpoints of the watchdog")
    assert stream()[-1].thrust == pytest.approx(WEIGHT / 41.36, rel=0.05)
    rig.probe.until(lambda: "stream stopped" in rig.node.output[before:], "the end of the stream")
    rig.receive()
    rig.received.clear()
    rig.probe.until(lambda: (rig.receive(), "HEARTBEAT" in rig.kinds())[1], "a heartbeat")
    assert stream() == []


def test_without_states_it_levels_by_the_motion_capture(make_rig):
    """Without the estimator the bridge levels by the attitude of the motion capture."""
    level = ("-p", "hold_gain:=3.0", "-p", "hold_integral:=0.0", "-p", "release_time:=3.0")
    rig = make_rig("-p", "clock:=realtime", "-p", "stale_after:=1.0", *level)
    rig.autopilot.set_parameter("COM_OF_LOSS_T", 30.0)
    rig.fly()
    pose, tilted = PoseWriter(), quaternion_from_euler(np.array([0.1, 0.0, 0.0]))
    rig.receive()
    rig.received.clear()

    def rolled():
        now = rig.count * PERIOD + round((time.monotonic() - begin) * 1e9)
        rig.publish(topics.MOCAP, pose.fill(now, np.full(3, 1e-12 * now), tilted))
        rig.receive()
        sent = [m for m in rig.received if m.get_type() == "SET_ATTITUDE_TARGET"]
        return any(m.body_roll_rate == pytest.approx(-0.3, abs=1e-3) for m in sent)

    begin = time.monotonic()
    rig.probe.until(rolled, "rates against the tilt that the mocap shows")


def test_a_tick_that_waited_for_a_stopped_process_gets_no_setpoint(make_rig):
    """It is answered, and nothing is sent; if later ones are as late, time stood still."""
    rig = make_rig("-p", "clock:=realtime", "-p", "stale_after:=2.0")
    rig.fly()
    while rig.tick((0, 0, WEIGHT))[1] == 0.0:  # a stall of the test itself
        pass
    rig.received.clear()
    time.sleep(0.4)
    assert rig.tick((0, 0, WEIGHT))[1] == 0.0
    assert "SET_ATTITUDE_TARGET" not in rig.kinds()
    rig.probe.until(lambda: rig.tick((0, 0, WEIGHT))[1] > 0.0, "setpoints again")
