"""Parameters of the mission node."""

import math
from dataclasses import dataclass

from uam_control.grasp import GraspParameters
from uam_control.settings.parameter_set import ParameterSet, number, switch, vector
from uam_control.supervision import SupervisionParameters
from uam_control.vehicle import GRAVITY


@dataclass(frozen=True)
class StartParameters(ParameterSet):
    """How a flight begins; fixed once the node runs."""

    auto_start: bool = switch(
        False, "arm and take off without /mission/start, as soon as the pre-arm report is green"
    )
    dry_run: bool = switch(
        False, "compute all commands for the present pose; never arm (set it for the bridge too)"
    )
    require_checklist: bool = switch(
        False, "start only when the checklist of a real vehicle has passed (/uam/checklist)"
    )
    autopilot_has_clock: bool = switch(
        False,
        "an autopilot with its own clock flies a simulated vehicle (hardware in the loop): the "
        "simulation must keep real time, see slower_hold",
    )


@dataclass(frozen=True)
class PlanLimits(ParameterSet):
    """Speeds on the way to a goal pose, and limits that a trajectory must keep to be flown."""

    goal_speed: float = number(0.3, "peak speed on the way to a goal pose", "m/s", 0.01, 3.0)
    goal_yaw_rate: float = number(0.5, "peak yaw rate towards a goal pose", "rad/s", 0.01, 3.0)
    plan_start_distance: float = number(
        0.3, "distance of a trajectory's first point from the reference", "m", 0.0, 5.0
    )
    plan_start_angle: float = number(0.3, "the same for yaw and for each joint", "rad", 0.0, 3.2)
    plan_speed: float = number(1.0, "largest speed of a plan", "m/s", 0.05, 10.0)
    plan_acceleration: float = number(1.5, "largest acceleration of a plan", "m/s^2", 0.05, 10.0)
    plan_yaw_rate: float = number(1.0, "largest yaw rate of a plan", "rad/s", 0.05, 10.0)
    plan_yaw_acceleration: float = number(
        2.0, "largest yaw acceleration of a plan", "rad/s^2", 0.05, 20.0
    )
    plan_joint_rate: float = number(2.0, "largest joint rate of a plan", "rad/s", 0.05, 20.0)
    plan_joint_acceleration: float = number(
        6.0, "largest joint acceleration of a plan", "rad/s^2", 0.05, 100.0
    )


@dataclass(frozen=True)
class HandLimits(ParameterSet):
    """Limits of what the end effector is commanded, in addition to those of plans. Without a value
    in the profile speed, turn rate and stop of a jog follow from the attitude law: `jog_limits`."""

    hand_floor: float = number(0.0, "lowest height of the hand's goals", "m", -1e4, 1e4)
    jog_speed: float = number(0.1, "largest speed of hand and base in a jog", "m/s", 1e-3, 1.0)
    jog_turn_rate: float = number(0.2, "largest turn rate of a jog", "rad/s", 0.01, 2.0)
    jog_acceleration: float = number(
        0.5, "largest acceleration when the speed of a jog changes", "m/s^2", 0.05, 5.0
    )
    jog_hold: float = number(
        0.05, "age of a jog's message from which on it slows down", "s", 0.01, 1.0
    )
    jog_stop: float = number(0.4, "time in which it then stops", "s", 0.05, 2.0)


@dataclass(frozen=True)
class BrakeLimits(ParameterSet):
    """Bounds of the reference that begins in the vehicle's motion, after somebody else flew it."""

    brake_acceleration: float = number(
        2.0, "largest acceleration of the braking reference", "m/s^2", 0.1, 20.0
    )
    brake_jerk: float = number(16.0, "largest jerk of the braking reference", "m/s^3", 1.0, 200.0)
    brake_yaw_acceleration: float = number(2.0, "the same for yaw", "rad/s^2", 0.1, 20.0)
    brake_yaw_jerk: float = number(8.0, "the same for yaw", "rad/s^3", 1.0, 200.0)


@dataclass(frozen=True)
class FeasibilityLimits(ParameterSet):
    """Limits of the reference before take-off, in addition to the supervisor's. Without a value
    in the profile they are the position controller's thrust_max and tilt_max, 90 % of the bridge's
    rate_limit, and 75 % of the attitude controller's torque_max / inertia, about yaw of its
    torque_max: the law needs the rest.
    """

    reference_thrust: float = number(36.0, "largest force that a reference needs", "N", 0.1, 1e3)
    retime_reserve: float = number(
        0.7, "share of the thrust beyond the weight that `retime` leaves free", "1", 0.0, 0.9
    )
    reference_tilt: float = number(0.35, "largest tilt that a reference needs", "rad", 0.01, 1.5)
    reference_body_rate: float = number(
        5.4, "largest body rate of roll and pitch that a reference needs", "rad/s", 0.01, 50.0
    )
    reference_yaw_rate: float = number(
        2.7, "largest yaw rate that a reference needs", "rad/s", 0.01, 50.0
    )
    reference_yaw_torque: float = number(
        0.225, "largest torque about yaw that a reference needs", "N m", 1e-4, 1e3
    )
    reference_turn: float = number(
        34.0,
        "largest change of the body rates of roll and pitch that a reference needs, with "
        "setpoints in time",
        "rad/s^2",
        0.1,
        1e4,
    )
    reference_delay: float = number(
        0.012,
        "delay of the setpoints with which references are checked: every flight has two ticks of "
        "it, and more may begin in flight",
        "s",
        0.0,
        1.0,
    )
    rate_lag: float = number(
        0.04, "lag of the body rates behind their setpoint, of the autopilot's rate loop; a delay "
        "as long halves the change of the body rates that the law can make", "s", 0.001, 1.0,
    )  # fmt: skip

    @property
    def largest_turn(self) -> float:
        """Return the largest change of the body rates [rad/s^2] with `reference_delay`.

        At a change a the law sees body rates that are older by the delay, so a (rate_lag + delay)
        below the rates that follow. Of the torque that it may ask for, this is delay / rate_lag
        of the part that accelerates.
        """
        return self.reference_turn / (1.0 + self.reference_delay / self.rate_lag)

    def delay_of(self, turn: float) -> float:
        """Return the delay of the setpoints [s] at which a reference with this largest change of
        the body rates [rad/s^2] is at its limit; inf for 0."""
        return self.rate_lag * (self.reference_turn / turn - 1.0) if turn else math.inf


@dataclass(frozen=True)
class FlatnessParameters(ParameterSet):
    """What the attitude of the reference depends on, see `flatness.write_reference`."""

    gravity: float = number(GRAVITY, "acceleration of gravity", "m/s^2", 0.1, 30.0)
    drag: tuple = vector(
        (0.0, 0.0, 0.0), "linear drag per mass along the world axes, 0 = none", "1/s", 0.0, 10.0, 3
    )
    attitude_rate_max: float = number(
        8.0, "largest rate of roll and pitch in the reference", "rad/s", 0.0, 50.0
    )
    attitude_acceleration_max: float = number(
        40.0, "largest second derivative of roll and pitch in the reference", "rad/s^2", 0.0, 1e3
    )


@dataclass(frozen=True)
class MissionParameters(
    GraspParameters,
    FeasibilityLimits,
    PlanLimits,
    HandLimits,
    BrakeLimits,
    FlatnessParameters,
    SupervisionParameters,
):
    """Times and limits of start, take-off, touchdown, plans, braking, grasps, and of the
    supervisor."""

    start_speed: float = number(0.3, "largest speed at the start", "m/s", 0.01, 5.0)
    start_arm_error: float = number(
        0.3, "largest distance of a joint from its angle at the start", "rad", 0.01, 6.3
    )
    start_tilt: float = number(
        0.35, "largest tilt of the first moves across, which begin on the ground", "rad", 0.01, 1.5
    )
    takeoff_delay: float = number(0.5, "time from armed to take-off", "s", 0.0, 60.0)
    clear_distance: float = number(
        0.7, "from a payload's stand, before a landing after a hold", "m", 0.0, 10.0
    )
    clear_height: float = number(0.2, "climb on the way to clear_distance", "m", 0.0, 5.0)
    touchdown_height: float = number(0.05, "height that counts as on the ground", "m", 0.0, 0.15)
    touchdown_speed: float = number(0.10, "vertical speed that counts as at rest", "m/s", 0.0, 0.3)
    touchdown_time: float = number(
        0.3, "time on the ground and at rest before touchdown is detected", "s", 0.0, 5.0
    )
    touchdown_timeout: float = number(8.0, "longest wait for touchdown", "s", 0.0, 60.0)
    settle_time: float = number(
        1.5, "time from touchdown to the end of the mission", "s", 0.0, 60.0
    )
