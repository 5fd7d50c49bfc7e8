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

_BOX = "corner of the box that must not be left, world frame: "
_MAGNET = ("keep", "release")
_ARM = ("stay", "stow")


@dataclass(frozen=True)
class SupervisionLimits(ParameterSet):
    """What is too much. A limit ending in _hold makes it hold, _land land, _failsafe the rest."""

    position_error_hold: float = number(1.0, "position error to hold at", "m", 0.05, 100.0)
    position_error_land: float = number(1.5, "position error to land at", "m", 0.05, 100.0)
    position_error_failsafe: float = number(
        3.0, "position error to leave it to the autopilot at", "m", 0.05, 100.0
    )
    tilt_hold: float = number(0.8, "tilt to hold at", "rad", 0.05, 3.2)
    tilt_failsafe: float = number(1.05, "tilt to leave it to the autopilot at", "rad", 0.05, 3.2)
    body_rate_hold: float = number(8.0, "body rate about any axis to hold at", "rad/s", 0.1, 100.0)
    body_rate_failsafe: float = number(
        15.0, "body rate about any axis to leave it to the autopilot at", "rad/s", 0.1, 100.0
    )
    altitude_hold: float = number(5.0, "height above the take-off to hold at", "m", 0.1, 1000.0)
    geofence_low: tuple = vector((-5.0, -5.0, -1.0), _BOX + "smallest x, y, z", "m", -1e4, 1e4, 3)
    geofence_high: tuple = vector((5.0, 5.0, 6.0), _BOX + "largest x, y, z", "m", -1e4, 1e4, 3)
    geofence_land: float = number(0.1, "distance outside the box to land at", "m", 0.0, 100.0)
    geofence_failsafe: float = number(
        2.0, "distance outside the box to leave it to the autopilot at", "m", 0.0, 1000.0
    )
    joint_angle_hold: tuple = vector(
        (1.9, 2.05), "angle of alpha_1, alpha_2 to either side to hold at", "rad", 0.01, 6.3, 2
    )
    joint_effort_hold: tuple = vector(
        (2.8, 2.8), "measured torque of alpha_1, alpha_2 to hold at", "N m", 0.01, 100.0, 2
    )
    temperature_hold: float = number(
        70.0, "temperature of a servo to hold at (a Dynamixel X switches off at 80)", "deg C", 0.0,
        150.0,
    )  # fmt: skip
    temperature_land: float = number(75.0, "temperature of a servo to land at", "deg C", 0.0, 150.0)
    battery_land: float = number(0.15, "charge left to land at", "1", 0.0, 1.0)
    mocap_age_hold: float = number(0.25, "age of the mocap pose to hold at", "s", 0.02, 10.0)
    mocap_age_failsafe: float = number(
        1.0, "age of the mocap pose to leave it to the autopilot at", "s", 0.02, 60.0
    )
    mocap_distance_hold: float = number(
        0.15, "distance of the mocap pose from the estimate to hold at", "m", 0.05, 1000.0
    )
    joint_age_hold: float = number(0.25, "age of the joint angles to hold at", "s", 0.02, 10.0)
    controller_age_hold: float = number(
        0.25, "age of the gains that a controller tells, to hold at", "s", 0.05, 10.0
    )
    autopilot_age_land: float = number(
        0.75, "how long nothing is heard of the autopilot, or of the bridge, to land at", "s", 0.3,
        60.0,
    )  # fmt: skip
    round_trip_land: float = number(
        0.03, "round trip of the autopilot's link to land at", "s", 0.005, 10.0
    )
    round_trip_failsafe: float = number(
        0.05, "round trip of the autopilot's link to leave it to the autopilot at", "s", 0.005, 10.0
    )
    missed_ticks_hold: float = number(
        125.0, "control ticks missed within a second to hold at", "1", 1.0, 1e4
    )
    missed_ticks_failsafe: float = number(
        250.0, "control ticks missed within a second to leave it to the autopilot at", "1", 1.0, 1e4
    )
    gain_hold: tuple = vector(
        (100.0, 100.0, 1000.0),
        "largest adapted gain K0..K3, zeta of position, attitude, arm to hold at",
        "1", 1e-3, 1e9, 3,
    )  # fmt: skip

    def check_together(self) -> None:
        """See `ParameterSet.check_together`: reactions escalate, and the box has an inside."""
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
    """How long a limit must be passed, and what arm, magnet and reference do then."""

    hold_after: float = number(0.5, "how long beyond a limit, until it holds", "s", 0.0, 10.0)
    land_after: float = number(0.3, "how long beyond a limit, until it lands", "s", 0.0, 10.0)
    failsafe_after: float = number(
        0.1, "how long beyond a limit, until it is left to the autopilot", "s", 0.0, 10.0
    )
    clear_after: float = number(
        1.0, "how long back within a limit, until that counts as clear", "s", 0.0, 60.0
    )
    hysteresis: float = number(
        0.2, "part of a limit by which a value must be back within it", "1", 0.0, 0.9
    )
    hold_timeout: float = number(
        5.0, "how long it holds beyond a limit, until it lands", "s", 0.0, 600.0
    )
    resume_automatically: bool = switch(False, "go on by itself once a limit is clear again")
    after_restart: str = choice(
        "go_on",
        "what follows a hold for a lost controller that is back: go_on, stay (until a command) "
        "or land",
        ("go_on", "stay", "land"),
    )
    arm_holding: str = choice("stay", "where the arm goes while holding", _ARM)
    arm_landing: str = choice("stow", "where the arm goes in a landing that is not planned", _ARM)
    arm_failsafe: str = choice("stow", "where the arm goes in failsafe", _ARM)
    magnet_holding: str = choice("keep", "an energised magnet while holding", _MAGNET)
    magnet_landing: str = choice(
        "keep", "an energised magnet in a landing that is not planned", _MAGNET
    )
    magnet_failsafe: str = choice("keep", "an energised magnet in failsafe", _MAGNET)
    airborne_height: float = number(
        0.3, "height above the take-off from which it counts as flying", "m", 0.05, 10.0
    )
    stop_time: float = number(1.0, "shortest time to stop or to go on in", "s", 0.1, 30.0)
    stop_acceleration: float = number(
        0.5, "acceleration of the reference when stopping or going on", "m/s^2", 0.05, 10.0
    )
    travel_speed: float = number(
        0.3, "peak speed of the reference in a landing that is not planned", "m/s", 0.05, 3.0
    )
    stow_rate: float = number(0.8, "peak rate of the joints when stowing", "rad/s", 0.05, 5.0)
    failsafe_timeout: float = number(
        30.0, "longest wait in failsafe for the autopilot to disarm", "s", 1.0, 600.0
    )


@dataclass(frozen=True)
class SupervisionParameters(Reactions, SupervisionLimits):
    """Everything that the supervisor can be told."""
