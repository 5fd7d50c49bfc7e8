"""The simulator's side of an autopilot's sensors and motors: HIL_SENSOR out, controls in.

The control laws use neither sensor. PX4 requires both: its data validator reports a sensor with a
constant value as failed.
"""

import math
from typing import Any

import numpy as np

from uam_control.frames import swap_body, swap_quaternion
from uam_control.maths.rotations import matrix_from_quaternion, rotate_back
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, Message, mavlink2

FIELD = np.array([0.2150, 0.0100, 0.4250])  # gauss, NED: about the Earth's field at 47 deg north
ORIGIN_ALTITUDE = 488.0  # m above sea level
TEMPERATURE = 20.0  # deg C
_MAG_NOISE = 0.002  # gauss
_PRESSURE_NOISE = 0.01  # hPa, about 8 cm

# International Standard Atmosphere, troposphere
_SEA_PRESSURE, _SEA_TEMPERATURE, _LAPSE, _EXPONENT = 1013.25, 288.15, 0.0065, 5.25588
_IMU, _MAG, _BARO = 0x3F, 0x1C0, 0x1A00  # HIL_SENSOR.fields_updated
_ARMED = 128
CONTROLS = 16  # number of values of HIL_ACTUATOR_CONTROLS.controls
_SLOW_PERIOD = 0.02  # s


def pressure_at(altitude: float) -> float:
    """Return the static pressure [hPa] at an altitude [m] above sea level."""
    return _SEA_PRESSURE * (1.0 - _LAPSE * altitude / _SEA_TEMPERATURE) ** _EXPONENT


def altitude_of(pressure: float) -> float:
    """Return the pressure altitude [m] of a static pressure [hPa]: inverse of pressure_at."""
    return _SEA_TEMPERATURE / _LAPSE * (1.0 - (pressure / _SEA_PRESSURE) ** (1.0 / _EXPONENT))


class SlowSensors:
    """Magnetometer and barometer, both updated at 50 Hz."""

    def __init__(self, seed: int) -> None:
        self._noise = np.random.default_rng(seed)

    def magnetometer(self, quaternion_ned: np.ndarray) -> list[float]:
        """Return the field (3,) [gauss, FRD]; quaternion_ned (4,): attitude FRD → NED [w x y z]."""
        field = rotate_back(matrix_from_quaternion(quaternion_ned), FIELD)
        return (field + self._noise.normal(0.0, _MAG_NOISE, 3)).tolist()

    def barometer(self, height: float) -> tuple[float, float]:
        """Return pressure [hPa] and pressure altitude [m] at `height` [m] above the origin."""
        pressure = pressure_at(ORIGIN_ALTITUDE + height) + self._noise.normal(0.0, _PRESSURE_NOISE)
        return (pressure, altitude_of(pressure)) if math.isfinite(pressure) else (0.0, 0.0)


class HilMessages:
    """Encodes the sensors, takes the motor commands."""

    def __init__(self, motors: int, seed: int) -> None:
        """motors: their number; seed: of the noise of magnetometer and barometer."""
        self.motors = np.zeros(motors)  # newest commands 0..1 in PX4's order, zero while disarmed
        self.controls = np.zeros(CONTROLS)  # all newest ones
        self.armed = False  # from HIL_ACTUATOR_CONTROLS
        self.stamp = 0  # [us] of the newest sensors
        self._codec = Codec(1, 200)
        self._framer = Framer(self._codec)
        self._prepared = b""
        self._slow = SlowSensors(seed)
        self._slow_due = 0.0
        self._mag = [0.0, 0.0, 0.0]
        self._baro = (0.0, 0.0)

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
        return self._codec.encode(message)

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
