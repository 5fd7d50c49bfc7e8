"""Limits and reactions of the supervisor, parameters of the mission node."""

from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from uam_control import ages
from uam_control.settings.parameter_set import ParameterError, ParameterSet, choice, number, vector


def _limit(reaction: str, default: float, what: str, unit: str, low: float, high: float) -> Any:
    """Declare a limit [unit] within [low, high]: value of `what` that starts the reaction."""
    return number(default, f"{what} that starts {reaction}", unit, low, high)


_hold, _land, _failsafe = (partial(_limit, it) for it in ("a hold", "a landing", "the failsafe"))
_BOX = "corner of the geofence, world frame: "
_MAGNET = ("keep", "release")
_ARM = ("stay", "stow")


@dataclass(frozen=True)
class SupervisionLimits(ParameterSet):
    """Limits. Their endings name the reaction: _hold, _land, _failsafe (the autopilot descends)."""

    position_error_hold: float = _hold(1.0, "position error", "m", 0.05, 100.0)
    position_error_land: float = _land(1.5, "position error", "m", 0.05, 100.0)
    position_error_failsafe: float = _failsafe(3.0, "position error", "m", 0.05, 100.0)
    tilt_hold: float = _hold(0.8, "tilt", "rad", 0.05, 3.2)
    tilt_failsafe: float = _failsafe(1.05, "tilt", "rad", 0.05, 3.2)
    body_rate_hold: float = _hold(8.0, "body rate about any axis", "rad/s", 0.1, 100.0)
    body_rate_failsafe: float = _failsafe(15.0, "body rate about any axis", "rad/s", 0.1, 100.0)
    heading_error_hold: float = _hold(0.7, "error of the yaw angle", "rad", 0.05, 3.1)
    altitude_hold: float = _hold(5.0, "height above take-off", "m", 0.1, 1000.0)
    geofence_low: tuple = vector((-5.0, -5.0, -1.0), _BOX + "smallest x, y, z", "m", -1e4, 1e4, 3)
    geofence_high: tuple = vector((5.0, 5.0, 6.0), _BOX + "largest x, y, z", "m", -1e4, 1e4, 3)
    geofence_land: float = _land(0.1, "distance outside the geofence", "m", 0.0, 100.0)
    geofence_failsafe: float = _failsafe(2.0, "distance outside the geofence", "m", 0.0, 1000.0)
    joint_angle_hold: tuple = vector(
        (), "angle of a joint to either side of its middle that starts a hold", "rad", 0.01, 6.3
    )
    joint_angle_middle: tuple = vector((0.0,), "middle of a joint's range", "rad", -6.3, 6.3)
    joint_effort_hold: tuple = vector(
        (), "measured joint torque that starts a hold", "N m", 0.01, 100.0
    )
    # a Dynamixel X switches off at 80 deg C
    temperature_hold: float = _hold(70.0, "servo temperature", "deg C", 0.0, 150.0)
    temperature_land: float = _land(75.0, "servo temperature", "deg C", 0.0, 150.0)
    battery_land: float = _land(0.15, "state of charge", "1", 0.0, 1.0)
    mocap_age_hold: float = _hold(ages.HOLD, "age of the mocap pose", "s", 0.02, 10.0)
    mocap_age_failsafe: float = _failsafe(ages.FAILSAFE, "age of the mocap pose", "s", 0.02, 60.0)
    mocap_age_start: float = number(
        ages.STALE, "age of the mocap pose that prevents the take-off", "s", 0.02, 10.0
    )
    mocap_distance_hold: float = _hold(
        0.15, "distance of the mocap pose from the estimate", "m", 0.05, 1000.0
    )
    contradiction_failsafe: float = _failsafe(
        1.0, "fast change of the accelerometer's estimated bias", "m/s^2", 0.1, 1000.0
    )
    joint_age_hold: float = _hold(ages.HOLD, "age of the joint angles", "s", 0.02, 10.0)
    controller_age_hold: float = _hold(
        ages.HOLD, "age of a controller's newest gains", "s", 0.05, 10.0
    )
    autopilot_age_land: float = _land(
        ages.LAND, "time without a message of autopilot or bridge", "s", 0.3, 60.0
    )
    # delay of the setpoints against the margin of the profile, see checks.py
    delay_margin: float = number(
        0.05, "delay of the setpoints at which the loops oscillate: uam margins", "s", 0.001, 10.0
    )
    delay_nominal: float = number(
        0.007, "loop delay of a link without delay, part of every profile", "s", 0.0, 1.0
    )
    delay_warn: float = number(0.6, "share of delay_margin that causes a warning", "1", 0.05, 1.0)
    delay_land: float = _land(0.8, "share of delay_margin", "1", 0.05, 10.0)
    delay_failsafe: float = _failsafe(1.0, "share of delay_margin", "1", 0.05, 100.0)
    delay_share_of_round_trip: float = number(
        1.0, "share of the round trip that counts as delay before take-off", "1", 0.0, 1.0
    )
    missed_ticks_hold: float = _hold(125.0, "control ticks missed within a second", "1", 1.0, 1e4)
    missed_ticks_failsafe: float = _failsafe(
        250.0, "control ticks missed within a second", "1", 1.0, 1e4
    )
    # an autopilot with its own clock, see `Pace`
    slower_hold: float = _hold(
        0.1, "share by which a simulation runs slower than the wall clock", "1", 0.0, 1.0
    )
    gain_hold: tuple = vector(
        (100.0, 100.0, 1000.0),
        "largest adapted gain K0..K3, zeta of position, attitude, arm that starts a hold",
        "1", 1e-3, 1e9, 3,
    )  # fmt: skip

    @property
    def setpoint_delay_land(self) -> float:
        """Delay of the setpoints [s] that starts a landing."""
        return self.delay_land * self.delay_margin

    @property
    def setpoint_delay_failsafe(self) -> float:
        """Delay of the setpoints [s] that starts the failsafe."""
        return self.delay_failsafe * self.delay_margin

    def check_together(self) -> None:
        """Check that limits increase with the reaction and that the box is not empty.

        Raises ParameterError; see `ParameterSet.check_together`.
        """
        super().check_together()
        known = self.specs()
        for stem in dict.fromkeys(name.rpartition("_")[0] for name in known):
            order = [stem + end for end in ("_hold", "_land", "_failsafe") if stem + end in known]
            for less, more in pairwise(order):
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
    delay_after: float = number(
        1.0, "time of a measured loop delay beyond a limit before its reaction", "s", 0.0, 10.0
    )
    blind_time: float = number(
        1.5, "time without usable poses, on the IMU alone, before the failsafe", "s", 0.0, 5.0
    )
    clear_after: float = number(
        1.0, "time within a limit, less the hysteresis, before it counts as clear", "s", 0.0, 60.0
    )
    hysteresis: float = number(
        0.2, "fraction of a limit by which a value must be within it to be clear", "1", 0.0, 0.9
    )
    hold_timeout: float = number(
        5.0, "time of a hold beyond a limit before a landing", "s", 0.0, 600.0
    )
    when_clear: str = choice(
        "resume",
        "reaction when the limit that started a hold is clear again: resume, land, wait (for a "
        "command)",
        ("resume", "land", "wait"),
    )
    resumes_allowed: float = number(
        5.0,
        "holds of one quantity that when_clear ends by a resume; the next one lands",
        "1",
        0.0,
        1e3,
    )
    wait_timeout: float = number(
        30.0, "time of a hold without a command before a landing", "s", 1.0, 3600.0
    )
    command_timeout: float = number(
        300.0, "the same for a hold by command and at a goal", "s", 1.0, 36000.0
    )
    regain_timeout: float = number(
        5.0,
        "time in which OFFBOARD must be back after a resume; later it is a hold",
        "s",
        0.5,
        60.0,
    )
    after_restart: str = choice(
        "go_on",
        "reaction when a lost controller is back: go_on, stay (hold until a command) or land",
        ("go_on", "stay", "land"),
    )
    arm_holding: str = choice("stay", "arm during a hold", _ARM)
    arm_landing: str = choice("stow", "arm during an unplanned landing", _ARM)
    arm_failsafe: str = choice("stow", "arm during failsafe", _ARM)
    arm_released: str = choice(
        "stow_to_land",
        "arm while somebody else has control; stow_to_land: stays, but is stowed if the autopilot "
        "lands",
        (*_ARM, "stow_to_land"),
    )
    magnet_released: str = choice(
        "keep", "energised magnet while somebody else has control", _MAGNET
    )
    magnet_holding: str = choice("keep", "energised magnet during a hold", _MAGNET)
    magnet_landing: str = choice("keep", "energised magnet during an unplanned landing", _MAGNET)
    magnet_failsafe: str = choice("keep", "energised magnet during failsafe", _MAGNET)
    airborne_height: float = number(
        0.3, "height above take-off from which the vehicle counts as flying", "m", 0.05, 10.0
    )
    liftoff_timeout: float = number(
        2.0, "time of a reference above airborne_height without the vehicle, then it gives up", "s",
        0.2, 60.0,
    )  # fmt: skip
    stop_time: float = number(1.0, "shortest time to stop or to resume", "s", 0.1, 30.0)
    stop_acceleration: float = number(
        0.5, "acceleration of the reference when stopping or resuming", "m/s^2", 0.05, 10.0
    )
    travel_speed: float = number(
        0.3, "peak speed in an unplanned landing; a faster path is stopped first", "m/s", 0.05, 3.0
    )
    turn_rate: float = number(0.8, "peak yaw rate of the return to the path", "rad/s", 0.05, 3.0)
    stow_rate: float = number(0.8, "peak rate of the joints when stowing", "rad/s", 0.05, 5.0)
    failsafe_timeout: float = number(
        30.0, "longest wait in failsafe for the autopilot to disarm", "s", 1.0, 600.0
    )


@dataclass(frozen=True)
class SupervisionParameters(Reactions, SupervisionLimits):
    """All parameters of the supervisor."""

    @property
    def joint_ranges(self) -> np.ndarray:
        """Lowest and highest angle (2, n) [rad] of each joint that start no hold."""
        return np.multiply.outer((-1.0, 1.0), self.joint_angle_hold) + self.joint_angle_middle

    def room(self, ground: float) -> np.ndarray:
        """Return the corners (2, 3) [m] of the space above a take-off at height `ground` [m]."""
        found = np.array([self.geofence_low, self.geofence_high])
        found[1, 2] = min(found[1, 2], ground + self.altitude_hold)
        return found
