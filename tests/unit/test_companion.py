"""The autopilot's MAVLink behaviour without sockets: parameters, streams, commands, odd input."""

import math
import random
import struct

import numpy as np
import pytest
from pymavlink.dialects.v20 import development as mavlink2

from uam_control.frames import swap_quaternion, swap_world
from uam_control.offboard.firmware import FIRMWARES
from uam_control.offboard.modes import MavCmd, MavResult, Mode
from uam_control.setpoints.targets import VisionPose
from uam_sim_bridge.autopilot.companion import Companion
from uam_sim_bridge.autopilot.core import Autopilot
from uam_sim_bridge.mavlink.protocol.setpoint_messages import covariance, vision_message
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, clean_text

DOWN = np.array([0.0, 0.0, -9.81])
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


class Rig:
    """An autopilot on the ground and the two ends of a link in memory."""

    def __init__(self):
        self.autopilot = Autopilot()
        self.companion = Companion(self.autopilot)
        self._ours, self._theirs = Codec(1, 191), Codec(1, 1)
        self.time = 0.0

    def send(self, *messages):
        for message in messages:
            for arrived in Framer(self._theirs).datagram(self._ours.encode(message)):
                self.companion.handle(self.time, arrived)

    def tick(self, ticks=1):
        """Advance; return what the autopilot sent, as it arrives."""
        received = []
        for _ in range(ticks):
            self.autopilot.update(self.time, np.zeros(3), DOWN)
            for message in self.companion.tick(self.time):
                received += Framer(self._ours).datagram(self._theirs.encode(message))
            self.time += 0.004
        return received

    def received(self, kind, ticks=1):
        return [m for m in self.tick(ticks) if m.get_type() == kind]

    def command(self, command, *parameters):
        self.send(
            mavlink2.MAVLink_command_long_message(1, 1, command, 0, *(*parameters, *[0.0] * 7)[:7])
        )
        return self.received("COMMAND_ACK")[0].result

    def setpoint(self, *rates, thrust=0.0, mask=128):
        self.send(
            mavlink2.MAVLink_set_attitude_target_message(
                0, 1, 1, mask, [1, 0, 0, 0], *rates, thrust
            )
        )


def test_heartbeat_is_a_px4_quadrotor_at_1_hz():
    beats = Rig().received("HEARTBEAT", 1000)
    assert len(beats) == 4
    assert beats[0].autopilot == mavlink2.MAV_AUTOPILOT_PX4
    assert beats[0].type == mavlink2.MAV_TYPE_QUADROTOR
    assert FIRMWARES["px4"].mode(beats[0].custom_mode) is Mode.HOLD
    assert not beats[0].base_mode & 128


def test_message_intervals():
    rig = Rig()
    number = mavlink2.MAVLINK_MSG_ID_ATTITUDE_QUATERNION
    assert len(rig.received("ATTITUDE_QUATERNION", 250)) == 50
    assert rig.command(MavCmd.SET_MESSAGE_INTERVAL, number, 4000.0) == MavResult.ACCEPTED
    assert len(rig.received("ATTITUDE_QUATERNION", 250)) == 250
    assert rig.command(MavCmd.SET_MESSAGE_INTERVAL, number, -1.0) == MavResult.ACCEPTED
    assert rig.received("ATTITUDE_QUATERNION", 250) == []
    assert rig.command(MavCmd.SET_MESSAGE_INTERVAL, number, 0.0) == MavResult.ACCEPTED
    assert len(rig.received("ATTITUDE_QUATERNION", 250)) == 50
    for bad in ((9999.0, 1000.0), (math.nan, 1000.0), (float(number), math.nan)):
        assert rig.command(MavCmd.SET_MESSAGE_INTERVAL, *bad) == MavResult.DENIED


def test_request_message():
    rig = Rig()
    rig.tick(10)
    rig.send(
        mavlink2.MAVLink_command_long_message(
            1, 1, MavCmd.REQUEST_MESSAGE, 0, mavlink2.MAVLINK_MSG_ID_ODOMETRY, 0, 0, 0, 0, 0, 0
        )
    )
    kinds = [m.get_type() for m in rig.tick()]
    assert "ODOMETRY" in kinds and "COMMAND_ACK" in kinds
    assert rig.command(MavCmd.REQUEST_MESSAGE, 9999.0) == MavResult.UNSUPPORTED


def test_parameters_read_list_set():
    rig = Rig()
    rig.send(mavlink2.MAVLink_param_request_read_message(1, 1, b"MC_ROLLRATE_P", -1))
    (value,) = rig.received("PARAM_VALUE")
    assert clean_text(value.param_id) == "MC_ROLLRATE_P"
    assert value.param_value == pytest.approx(0.15)
    rig.send(mavlink2.MAVLink_param_request_list_message(1, 1))
    listed = rig.received("PARAM_VALUE", 50)
    assert len(listed) == listed[0].param_count == len(rig.autopilot.parameters.names)
    assert [v.param_index for v in listed] == list(range(len(listed)))
    rig.send(mavlink2.MAVLink_param_set_message(1, 1, b"MC_ROLLRATE_P", 0.2, 9))
    assert rig.received("PARAM_VALUE")[0].param_value == pytest.approx(0.2)
    rig.send(mavlink2.MAVLink_param_set_message(1, 1, b"MC_ROLLRATE_P", -3.0, 9))
    answer = rig.tick()
    assert [m.param_value for m in answer if m.get_type() == "PARAM_VALUE"] == [pytest.approx(0.2)]
    assert any("out of range" in clean_text(m.text) for m in answer if m.get_type() == "STATUSTEXT")
    rig.send(mavlink2.MAVLink_param_request_read_message(1, 1, b"NOT_THERE", -1))
    assert rig.received("PARAM_VALUE") == []


def test_integer_parameters_travel_as_bytes():
    rig = Rig()
    rig.send(mavlink2.MAVLink_param_request_read_message(1, 1, b"MAV_SYS_ID", -1))
    (value,) = rig.received("PARAM_VALUE")
    assert value.param_type == mavlink2.MAV_PARAM_TYPE_INT32
    assert struct.unpack("<i", struct.pack("<f", value.param_value))[0] == 1


def test_timesync_is_answered_in_sensor_time():
    rig = Rig()
    rig.tick(250)
    rig.send(mavlink2.MAVLink_timesync_message(0, 123456789))
    answers = [m for m in rig.received("TIMESYNC") if m.tc1]
    assert [(m.tc1, m.ts1) for m in answers] == [(1_000_000_000, 123456789)]


def odometry_message(stamp, position, quaternion):
    """ODOMETRY of a pose at rest, which another bridge may send."""
    return mavlink2.MAVLink_odometry_message(
        round(stamp * 1e6),
        mavlink2.MAV_FRAME_LOCAL_NED,
        mavlink2.MAV_FRAME_BODY_FRD,
        *swap_world(position).tolist(),
        swap_quaternion(quaternion).tolist(),
        *[0.0] * 6,
        covariance(0.01, 0.01),
        covariance(0.1, 0.01),
    )


@pytest.mark.parametrize("odometry", [False, True])
def test_vision_reaches_the_estimate(odometry):
    rig = Rig()
    position, yaw = np.array([1.0, 2.0, 3.0]), 0.4
    q = np.array([math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)])
    for _ in range(300):
        if odometry:
            rig.send(odometry_message(rig.time, position, q))
        else:
            rig.send(vision_message(VisionPose(rig.time, position, q, 0.01, 0.01)))
        rig.tick()
    rig.send(
        mavlink2.MAVLink_command_long_message(
            1, 1, MavCmd.REQUEST_MESSAGE, 0, mavlink2.MAVLINK_MSG_ID_ODOMETRY, 0, 0, 0, 0, 0, 0
        )
    )
    found = rig.received("ODOMETRY")[0]
    assert (found.x, found.y, found.z) == pytest.approx((2.0, 1.0, -3.0), abs=1e-3)
    ned_yaw = 2 * math.atan2(found.q[3], found.q[0])
    assert ned_yaw == pytest.approx(math.pi / 2 - yaw, abs=1e-3)


def test_setpoints_with_another_mask_or_not_finite_are_refused():
    rig = Rig()
    rig.setpoint(0.1, 0.2, 0.3, mask=0)
    told = "".join(clean_text(m.text) for m in rig.received("STATUSTEXT"))
    assert "SET_ATTITUDE_TARGET refused: type_mask 0, allowed: 128" in told
    assert np.all(rig.autopilot._setpoint == 0.0)
    rig.setpoint(math.nan, 0.0, 0.0, thrust=0.5)
    assert np.all(rig.autopilot._setpoint == 0.0)
    rig.setpoint(0.1, 0.2, 0.3, thrust=0.5)
    assert rig.autopilot._setpoint == pytest.approx([0.1, 0.2, 0.3, 0.5])


def test_a_refused_setpoint_is_named_with_message_and_field_every_five_seconds():
    rig, told = Rig(), []
    for _ in range(1300):  # 5.2 s: at 0 and at 5 s
        rig.setpoint(math.nan, 0.0, 0.0, thrust=0.5)
        told += [text for _, text in rig.autopilot.commander.take_texts()]
        rig.time += 0.004
    assert told == ["SET_ATTITUDE_TARGET refused: rates.x is nan, not finite"] * 2


def test_messages_for_another_system_are_ignored():
    rig = Rig()
    rig.send(
        mavlink2.MAVLink_set_attitude_target_message(0, 9, 1, 128, [1, 0, 0, 0], 0.1, 0.2, 0.3, 0.5)
    )
    assert np.all(rig.autopilot._setpoint == 0.0)


def test_mutated_messages_never_change_flight_into_nonsense():
    """Valid frames with any field values: no exception, and the setpoint stays in range."""
    random.seed(11)
    rig = Rig()
    codec, framer = Codec(1, 191), Framer(Codec(1, 1))
    from_here = [
        mavlink2.MAVLink_set_attitude_target_message(0, 1, 1, 128, [1, 0, 0, 0], 0, 0, 0, 0.5),
        mavlink2.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0),
        mavlink2.MAVLink_command_int_message(1, 1, 0, 176, 0, 0, 1, 6, 0, 0, 0, 0, 0),
        mavlink2.MAVLink_set_mode_message(1, 1, 0x60000),
        mavlink2.MAVLink_param_set_message(1, 1, b"MC_ROLLRATE_P", 0.2, 9),
        mavlink2.MAVLink_param_request_read_message(1, 1, b"THR_MDL_FAC", -1),
        vision_message(VisionPose(0.0, np.zeros(3), LEVEL, 0.01, 0.01)),
        odometry_message(0.0, np.zeros(3), LEVEL),
        mavlink2.MAVLink_timesync_message(0, 1),
    ]
    floats = [0.0, 1.0, -1.0, 1e30, -1e30, math.nan, math.inf, 21196.0, 511.0, 6.0]
    handled = 0
    for k in range(4000):
        message = random.choice(from_here)
        frame = bytearray(codec.encode(message))
        for _ in range(random.randrange(3)):
            at = random.randrange(10, len(frame) - 2)
            size = min(4, len(frame) - 2 - at)
            frame[at : at + size] = struct.pack("<f", random.choice(floats))[:size]
        extra = message.crc_extra
        crc = mavlink2.x25crc(bytes(frame[1:-2]) + bytes([extra])).crc
        frame[-2:] = struct.pack("<H", crc)
        for arrived in framer.datagram(bytes(frame)):
            rig.companion.handle(rig.time, arrived)
            handled += 1
        if k % 10 == 0:
            rig.tick()
        assert np.all(np.isfinite(rig.autopilot._setpoint))
        assert 0.0 <= rig.autopilot._setpoint[3] <= 1.0
        assert np.all((rig.autopilot.motors >= 0.0) & (rig.autopilot.motors <= 1.0))
    assert handled > 3000
