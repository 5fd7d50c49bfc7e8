"""Limits and reactions of the supervisor, parameters of the mission node."""

from __future__ import annotations

from dataclasses import dataclass

from uam_control.settings.parameter_set import (
    ParameterError,
    ParameterSet,
    choice,
    number,
    switch,
    vector,
)

_BOX = "corner of the geofence, world frame: "
_MAGNET = ("keep", "release")
_ARM = ("stay", "stow")


@dataclass(frozen=True)
class SupervisionLimits(ParameterSet):
    """Limits. Their endings name the reaction: _hold, _land, _failsafe (the autopilot descends)."""

    position_error_hold: float = number(1.0, "position error that starts a hold", "m", 0.05, 100.0)
    position_error_land: float = number(
        1.5, "position error that starts a landing", "m", 0.05, 100.0
    )
    position_error_failsafe: float = number(
        3.0, "position error that starts the failsafe", "m", 0.05, 100.0
    )
    tilt_hold: float = number(0.8, "tilt that starts a hold", "rad", 0.05, 3.2)
    tilt_failsafe: float = number(1.05, "tilt that starts the failsafe", "rad", 0.05, 3.2)
    body_rate_hold: float = number(
        8.0, "body rate about any axis that starts a hold", "rad/s", 0.1, 100.0
    )
    body_rate_failsafe: float = number(
        15.0, "body rate about any axis that starts the failsafe", "rad/s", 0.1, 100.0
    )
    altitude_hold: float = number(5.0, "height above take-off that starts a hold", "m", 0.1, 1000.0)
    geofence_low: tuple = vector((-5.0, -5.0, -1.0), _BOX + "smallest x, y, z", "m", -1e4, 1e4, 3)
    geofence_high: tuple = vector((5.0, 5.0, 6.0), _BOX + "largest x, y, z", "m", -1e4, 1e4, 3)
    geofence_land: float = number(
        0.1, "distance outside the geofence that starts a landing", "m", 0.0, 100.0
    )
    geofence_failsafe: float = number(
        2.0, "distance outside the geofence that starts the failsafe", "m", 0.0, 1000.0
    )
    joint_angle_hold: tuple = vector(
        (), "joint angle, to either side, that starts a hold", "rad", 0.01, 6.3
    )
    joint_effort_hold: tuple = vector(
        (), "measured joint torque that starts a hold", "N m", 0.01, 100.0
    )
    temperature_hold: float = number(
        70.0, "servo temperature that starts a hold (a Dynamixel X switches off at 80)", "deg C",
        0.0, 150.0,
    )  # fmt: skip
    temperature_land: float = number(
        75.0, "servo temperature that starts a landing", "deg C", 0.0, 150.0
    )
    battery_land: float = number(0.15, "state of charge that starts a landing", "1", 0.0, 1.0)
    mocap_age_hold: float = number(
        0.25, "age of the mocap pose that starts a hold", "s", 0.02, 10.0
    )
    mocap_age_failsafe: float = number(
        1.0, "age of the mocap pose that starts the failsafe", "s", 0.02, 60.0
    )
    mocap_distance_hold: float = number(
        0.15, "distance of the mocap pose from the estimate that starts a hold", "m", 0.05, 1000.0
    )
    joint_age_hold: float = number(
        0.25, "age of the joint angles that starts a hold", "s", 0.02, 10.0
    )
    controller_age_hold: float = number(
        0.25, "age of a controller's newest gains that starts a hold", "s", 0.05, 10.0
    )
    autopilot_age_land: float = number(
        0.75, "time without a message of autopilot or bridge that starts a landing", "s", 0.3,
        60.0,
    )  # fmt: skip
    round_trip_land: float = number(
        0.03, "round trip of the autopilot's link that starts a landing", "s", 0.005, 10.0
    )
    round_trip_failsafe: float = number(
        0.05, "round trip of the autopilot's link that starts the failsafe", "s", 0.005, 10.0
    )
    missed_ticks_hold: float = number(
        125.0, "control ticks missed within a second that start a hold", "1", 1.0, 1e4
    )
    missed_ticks_failsafe: float = number(
        250.0, "control ticks missed within a second that start the failsafe", "1", 1.0, 1e4
    )
    gain_hold: tuple = vector(
        (100.0, 100.0, 1000.0),
        "largest adapted gain K0..K3, zeta of position, attitude, arm that starts a hold",
        "1", 1e-3, 1e9, 3,
    )  # fmt: skip

    def check_together(self) -> None:
        """Check that limits increase with the reaction and that the box is not empty.

        Raises ParameterError; see `ParameterSet.check_together`.
        """
        super().check_together()
        for order in (
            ("position_error_hold", "position_error_land", "position_error_failsafe"),
            ("tilt_hold", "tilt_failsafe"),
            ("body_rate_hold", "body_rate_failsafe"),
            ("geofence_land", "geofence_failsafe"),
            ("mocap_age_hold", "mocap_age_failsafe"),
            ("missed_ticks_hold", "missed_ticks_failsafe"),
            ("temperature_hold", "temperature_land"),
            ("round_trip_land", "round_trip_failsafe"),
        ):
            for less, more in zip(order, order[1:], strict=False):
                low, high = getattr(self, less), getattr(self, more)
                if not low < high:
                    raise ParameterError(f"{less}: {low:g} is not below {more}, {high:g}")
        for axis, low, high in zip("xyz", self.geofence_low, self.geofence_high, strict=True):
            if not low < high:
                raise ParameterError(
                    f"geofence_low: {low:g} in {axis} is not below geofence_high, {high:g}"
                )


@dataclass(frozen=True)
class Reactions(ParameterSet):
    """Times beyond a limit before a reaction, and what arm, magnet and reference do then."""

    hold_after: float = number(0.5, "time beyond a limit before a hold", "s", 0.0, 10.0)
    land_after: float = number(0.3, "time beyond a limit before a landing", "s", 0.0, 10.0)
    failsafe_after: float = number(0.1, "time beyond a limit before the failsafe", "s", 0.0, 10.0)
    clear_after: float = number(
        1.0, "time within a limit, less the hysteresis, before it counts as clear", "s", 0.0, 60.0
    )
    hysteresis: float = number(
        0.2, "fraction of a limit by which a value must be within it to be clear", "1", 0.0, 0.9
    )
    hold_timeout: float = number(
        5.0, "time of a hold beyond a limit before a landing", "s", 0.0, 600.0
    )
    resume_automatically: bool = switch(
        False, "resume without a command when the limit is clear again"
    )
    after_restart: str = choice(
        "go_on",
        "reaction when a lost controller is back: go_on, stay (hold until a command) or land",
        ("go_on", "stay", "land"),
    )
    arm_holding: str = choice("stay", "arm during a hold", _ARM)
    arm_landing: str = choice("stow", "arm during an unplanned landing", _ARM)
    arm_failsafe: str = choice("stow", "arm during failsafe", _ARM)
    magnet_holding: str = choice("keep", "energised magnet during a hold", _MAGNET)
    magnet_landing: str = choice("keep", "energised magnet during an unplanned landing", _MAGNET)
    magnet_failsafe: str = choice("keep", "energised magnet during failsafe", _MAGNET)
    airborne_height: float = number(
        0.3, "height above take-off from which the vehicle counts as flying", "m", 0.05, 10.0
    )
    stop_time: float = number(1.0, "shortest time to stop or to resume", "s", 0.1, 30.0)
    stop_acceleration: float = number(
        0.5, "acceleration of the reference when stopping or resuming", "m/s^2", 0.05, 10.0
    )
    travel_speed: float = number(
        0.3, "peak speed of the reference in an unplanned landing", "m/s", 0.05, 3.0
    )
    stow_rate: float = number(0.8, "peak rate of the joints when stowing", "rad/s", 0.05, 5.0)
    failsafe_timeout: float = number(
        30.0, "longest wait in failsafe for the autopilot to disarm", "s", 1.0, 600.0
    )


@dataclass(frozen=True)
class SupervisionParameters(Reactions, SupervisionLimits):
    """All parameters of the supervisor."""
