"""The simulator's side of an autopilot's sensors and motors: HIL_SENSOR out, controls in."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from uam_control.frames import swap_body, swap_quaternion
from uam_sim_bridge.mavlink.hil.hil_sensors import TEMPERATURE, SlowSensors
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, Message, mavlink2

_IMU, _MAG, _BARO = 0x3F, 0x1C0, 0x1A00  # HIL_SENSOR.fields_updated
_ARMED = 128
CONTROLS = 16  # number of values of HIL_ACTUATOR_CONTROLS.controls
_SLOW_PERIOD = 0.02  # s


class HilMessages:
    """Encodes the sensors, takes the motor commands.

    `motors` (n,): newest motor commands 0..1 in PX4's order, zero while disarmed; `controls` (16,):
    all newest controls; `armed`: from HIL_ACTUATOR_CONTROLS; `stamp` [us]: of the newest sensors.
    """

    def __init__(self, motors: int, seed: int) -> None:
        """motors: their number; seed: of the noise of magnetometer and barometer."""
        self.motors = np.zeros(motors)
        self.controls = np.zeros(CONTROLS)
        self.armed = False
        self.stamp = 0
        self._codec = Codec(1, 200)
        self._framer = Framer(self._codec)
        self._prepared = b""
        self._slow = SlowSensors(seed)
        self._slow_due = 0.0
        self._mag = [0.0, 0.0, 0.0]
        self._baro = (0.0, 0.0)

    def encode(self, message: Message) -> bytes:
        """Return a message of the simulator as bytes."""
        return self._codec.encode(message)

    def received(self, data: bytes) -> list[Message]:
        """Return the messages that are complete with `data`."""
        return self._framer.stream(data)

    def sensors(
        self,
        time: float,
        gyro: np.ndarray,
        accel: np.ndarray,
        position: np.ndarray,
        quaternion: np.ndarray,
    ) -> bytes:
        """Return HIL_SENSOR of the tick at `time` [s].

        gyro (3,) [rad/s, FLU]; accel (3,): specific force [m/s^2, FLU]; true position (3,)
        [m, ENU] and quaternion (4,) FLU → ENU [w x y z], for magnetometer and barometer.
        """
        self.stamp, fields = round(time * 1e6), _IMU
        if time + 1e-9 >= self._slow_due:
            self._slow_due = time + _SLOW_PERIOD
            fields |= _MAG | _BARO
            self._mag = self._slow.magnetometer(swap_quaternion(quaternion))
            self._baro = self._slow.barometer(float(position[2]))
        message = mavlink2.MAVLink_hil_sensor_message(
            self.stamp,
            *swap_body(accel).tolist(),
            *swap_body(gyro).tolist(),
            *self._mag,
            self._baro[0],
            0.0,
            self._baro[1],
            TEMPERATURE,
            fields,
            0,
        )
        return self.encode(message)

    def prepare(self, *sample: Any) -> None:
        """Encode the sensors of a tick for `flush`; sample: see `sensors`."""
        self._prepared = self.sensors(*sample)

    def flush(self) -> None:
        """Send what is prepared, once."""
        data, self._prepared = self._prepared, b""
        self._put(data)

    def _put(self, data: bytes) -> None:
        """Send `data` on the link."""
        raise NotImplementedError

    def send(self, *sample: Any) -> None:
        """Send the sensors of a tick; sample: see `sensors`."""
        self.prepare(*sample)
        self.flush()

    def take(self, message: Message) -> bool:
        """Take a message of the autopilot; return whether it has motor commands."""
        if message.get_type() != "HIL_ACTUATOR_CONTROLS":
            return False
        self.armed = bool(message.mode & _ARMED)
        self.controls[:] = message.controls
        commands = message.controls[: len(self.motors)]
        if self.armed and all(map(math.isfinite, commands)):
            self.motors[:] = [min(max(command, 0.0), 1.0) for command in commands]
        else:
            self.motors[:] = 0.0
        return True

    def forget(self) -> np.ndarray:
        """Forget a lost autopilot: zero commands, disarmed; return `motors`."""
        self._framer = Framer(self._codec)
        self.armed = False
        self.motors[:] = self.controls[:] = 0.0
        return self.motors
