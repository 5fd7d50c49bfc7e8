"""Parameters of the checklist's node: limits (reasons: docs/preflight.md) and options."""

from dataclasses import dataclass
from typing import Any

from uam_control.settings.parameter_set import (
    ParameterError,
    ParameterSet,
    number,
    switch,
    text,
    vector,
)


@dataclass(frozen=True)
class SensorLimits(ParameterSet):
    """Motion capture and IMU while the vehicle stands."""

    mocap_rate: float = number(100.0, "least rate of the mocap poses", "Hz", 10.0, 1000.0)
    mocap_latency: float = number(
        0.03, "largest mean age of a mocap pose at its arrival", "s", 0.001, 1.0
    )
    mocap_loss: float = number(0.02, "largest share of lost mocap frames", "1", 0.0, 1.0)
    mocap_gap: float = number(0.1, "longest time between two mocap poses", "s", 0.005, 5.0)
    imu_rate: float = number(0.95, "least share of the control rate in IMU samples", "1", 0.05, 1.0)
    level: float = number(0.05, "largest tilt by motion capture on the floor", "rad", 0.005, 0.5)
    gravity_angle: float = number(
        0.06, "largest angle between the vertical of accelerometer and mocap", "rad", 0.005, 0.5
    )
    gravity_size: float = number(
        0.5, "largest error of the accelerometer's size of gravity", "m/s^2", 0.05, 3.0
    )
    gyro_rest: float = number(0.05, "largest body rate at rest", "rad/s", 0.005, 0.5)
    spread_rest: float = number(0.01, "largest spread of the position at rest", "m", 0.001, 0.1)
    room_margin: float = number(
        0.3, "least distance of the standing vehicle from the sides of the geofence", "m", 0.0, 5.0
    )


@dataclass(frozen=True)
class DeviceLimits(ParameterSet):
    """Arm, battery, autopilot and companion computer."""

    stow_error: float = number(
        0.2, "largest distance of a joint from its stowed angle", "rad", 0.01, 1.0
    )
    joint_rate: float = number(
        0.95, "least share of the control rate in joint states", "1", 0.05, 1
    )
    servo_temperature: float = number(
        50.0, "highest servo temperature at the start", "deg C", 20.0, 80.0
    )
    battery: float = number(0.6, "least state of charge at the start", "1", 0.0, 1.0)
    disk: float = number(5.0, "least free space for the recording", "GB", 0.01, 1e5)
    clock_synchronised: bool = switch(True, "the clock must be synchronised (NTP, PTP)")
    clock_jump: float = number(
        0.02, "largest jump of the clock since the node started", "s", 0.001, 10.0
    )
    performance_governor: bool = switch(True, "every core must have the governor 'performance'")
    rtprio: float = number(
        0.0, "least real-time priority that the account may use (ulimit -r)", "1", 0.0, 99.0
    )
    radio: bool = switch(True, "the autopilot must receive the pilot's radio")
    node_silence: float = number(5.0, "longest time without diagnostics of a node", "s", 1.5, 60.0)


@dataclass(frozen=True)
class MotionLimits(ParameterSet):
    """What a motion by hand must reach, and how well the sensors must agree about it."""

    tilt: float = number(0.2, "least tilt in roll and in pitch", "rad", 0.1, 0.8)
    turn: float = number(0.35, "least turn in yaw", "rad", 0.1, 1.5)
    forward: float = number(0.3, "least way forward", "m", 0.1, 2.0)
    lift: float = number(0.2, "least way up", "m", 0.05, 2.0)
    joint: float = number(0.2, "least turn of a joint", "rad", 0.05, 1.5)
    other_axes: float = number(
        0.35, "largest motion of another axis or joint / motion of the tested one", "1", 0.05, 0.7
    )
    agreement: float = number(
        0.25, "largest difference between two sensors / motion", "1", 0.05, 0.7
    )
    rate_response: float = number(
        0.2, "least commanded body rate against a tilt or turn", "rad/s", 0.01, 2.0
    )
    hold_time: float = number(0.5, "time for which a pose is kept", "s", 0.2, 5.0)
    rest_time: float = number(0.5, "time at rest before a motion", "s", 0.2, 5.0)
    still_angle: float = number(
        0.07, "largest change of an angle that still counts as kept", "rad", 0.01, 0.3
    )
    still_position: float = number(
        0.05, "largest change of the position that still counts as kept", "m", 0.005, 0.3
    )
    upright: float = number(0.12, "largest tilt at the beginning of a motion", "rad", 0.02, 0.5)
    step_time: float = number(60.0, "longest time for a motion", "s", 5.0, 600.0)
    magnet_time: float = number(
        3.0, "longest time until the magnet's state follows", "s", 0.2, 30.0
    )
    kill_time: float = number(0.3, "least time with the kill switch engaged", "s", 0.0, 5.0)


@dataclass(frozen=True)
class ChecklistParameters(SensorLimits, DeviceLimits, MotionLimits):
    """All limits of the checklist."""


@dataclass(frozen=True)
class ChecklistOptions(ParameterSet):
    """What the checklist is about; it cannot change while the node runs."""

    nodes: str = text(
        "", "nodes that must run", "names with commas between; empty: recorder and those of a tick"
    )
    record: str = text("", "JSON file of the results", "a file; empty: none")
    recordings: str = text(".", "folder of the recording, for its disk space", "a folder")
    room_low: tuple = vector(
        (), "corner of the room that the geofence must keep, world: smallest x, y, z", "m",
        -1e4, 1e4, 3, optional=True,
    )  # fmt: skip
    room_high: tuple = vector(
        (), "the opposite corner: largest x, y, z", "m", -1e4, 1e4, 3, optional=True
    )
    magnet: bool = switch(True, "the vehicle has a magnet")

    def check_together(self) -> None:
        """Refuse a room with one corner only, or with a side of no length."""
        if bool(self.room_low) != bool(self.room_high):
            raise ParameterError("room_low, room_high: give both corners or none")
        if any(a >= b for a, b in zip(self.room_low, self.room_high, strict=True)):
            raise ParameterError("room_low must be below room_high on each axis")


def check_checklist(values: dict[str, Any]) -> None:
    """Raise ParameterError for what is no parameter of the checklist's node, or a wrong value."""
    options = ChecklistOptions.specs()
    ChecklistOptions.among(values)
    ChecklistParameters.from_mapping({k: v for k, v in values.items() if k not in options})
