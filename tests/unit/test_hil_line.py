"""An autopilot in HITL on a line of its own: sensors, motors, and the ground station there."""

import time

import numpy as np
import pytest
import serial
from set_clock import SetClock

from uam_sim_bridge.laboratory.hil_line import (
    ALTITUDE,
    LATITUDE,
    LONGITUDE,
    SILENT,
    STOPPED,
    GroundStation,
    HilLine,
)
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, mavlink2


class Px4:
    """What PX4 does on its USB line: opens the device, sends messages, reads those that come."""

    def __init__(self, path):
        self.port = serial.Serial(str(path), 921600, timeout=0)
        self._codec = Codec(1, 1)
        self._framer = Framer(self._codec)

    def send(self, *messages):
        for message in messages:
            self.port.write(self._codec.encode(message))

    def read(self):
        return self._framer.stream(self.port.read(65536))


HEARTBEAT = mavlink2.MAVLink_heartbeat_message(2, 12, 81, 0, 3, 3)


def motors(*values, armed=True, magnet=0.0):
    controls = [*values, *[0.0] * (10 - len(values)), magnet, *[0.0] * 5]
    return mavlink2.MAVLink_hil_actuator_controls_message(5, controls, 128 if armed else 0, 0)


def until(condition):
    end = time.monotonic() + 30.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.002)


@pytest.fixture
def line(tmp_path):
    clock = SetClock(100.0)
    made = HilLine(tmp_path / "ttyUSB", 4, 1, clock)
    yield made, clock
    made.close()
    assert not (tmp_path / "ttyUSB").exists()


def test_sensors_go_to_the_autopilot_and_motors_come_back_over_the_line(line):
    hil, clock = line
    assert not hil.connected and not hil.accept(0.0)
    px4 = Px4(hil.path)
    px4.send(HEARTBEAT)
    until(lambda: hil.accept(0.1))
    body = np.zeros(3), np.array([0.0, 0.0, 9.81]), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    hil.send(0.004, *body)
    seen = []
    until(lambda: (seen.extend(px4.read()), "HIL_SENSOR" in {m.get_type() for m in seen})[1])
    sensor = next(m for m in seen if m.get_type() == "HIL_SENSOR")
    assert (sensor.time_usec, sensor.get_srcSystem()) == (4000, 1)
    assert sensor.zacc == pytest.approx(-9.81)
    # the ground station is on the same line, with an id of its own
    kinds = {m.get_type(): m.get_srcSystem() for m in seen}
    station = {"HEARTBEAT": 255, "MANUAL_CONTROL": 255, "SET_GPS_GLOBAL_ORIGIN": 255}
    assert kinds == station | {"HIL_SENSOR": 1}
    px4.send(motors(0.1, 0.2, 0.3, 0.4, magnet=1.0))
    until(lambda: hil.receive(0.0).any())
    assert hil.motors == pytest.approx([0.1, 0.2, 0.3, 0.4]) and hil.armed
    assert hil.controls[10] == 1.0
    px4.port.close()


def test_motors_stop_when_the_autopilot_is_silent(line):
    hil, clock = line
    px4 = Px4(hil.path)
    px4.send(motors(0.5, 0.5, 0.5, 0.5))
    until(lambda: hil.receive().any())
    clock.now += 0.9 * STOPPED
    assert hil.receive().all()
    clock.now += 0.2 * STOPPED
    assert not hil.receive().any() and not hil.armed and hil.connected
    clock.now += SILENT
    assert not hil.connected
    px4.port.close()


def test_the_ground_station_asks_for_the_origin_until_it_is_there():
    station, kinds = GroundStation(), []
    for k in range(100):
        kinds += [message.get_type() for message in station.due(0.0501 * k)]
    assert kinds.count("MANUAL_CONTROL") == 100 and kinds.count("HEARTBEAT") == 5
    assert kinds.count("SET_GPS_GLOBAL_ORIGIN") == 3
    # PX4 keeps latitude and longitude alone while its height is not valid
    station.take(mavlink2.MAVLink_gps_global_origin_message(LATITUDE, LONGITUDE, 0))
    assert not station.origin_known
    again = [message.get_type() for message in station.due(30.0)]
    assert "SET_GPS_GLOBAL_ORIGIN" in again
    station.take(mavlink2.MAVLink_gps_global_origin_message(LATITUDE - 1, LONGITUDE, ALTITUDE))
    assert station.origin_known
    later = [message.get_type() for message in station.due(60.0)]
    assert "SET_GPS_GLOBAL_ORIGIN" not in later and "HEARTBEAT" in later
