"""Parameters of grasp and release, part of those of the mission node."""

from dataclasses import dataclass

from uam_control.ages import FORWARDED
from uam_control.arm.chain import ChainParameters
from uam_control.settings.parameter_set import choice, integer, number, vector
from uam_control.vehicle.gripper import KINDS, MAGNET


@dataclass(frozen=True)
class GraspParameters(ChainParameters):
    """Attempts, tolerances and times of grasp and release, and the arm's numbers."""

    grasp_checks: str = choice(
        "on",
        "on: grasp and release are checked and repeated; off: the scenario's times alone",
        ("on", "off"),
    )
    grasp_attempts: int = integer(3, "approaches to the payload before it is given up", 1, 20)
    gripper: str = choice(MAGNET, "what holds the payload", KINDS, fixed=True)
    gripper_opening: tuple = vector(
        (1.0, 0.0),
        "opening of the gripper, closed and open; a magnet: on and off",
        "m",
        0.0,
        1.0,
        2,
    )
    gripper_force: float = number(0.0, "limit of the force of each finger", "N", 0.0, 1000.0)
    align_tolerance: float = number(
        0.008, "distance tool - payload, horizontal mean, at which the descent begins", "m",
        0.001, 0.1,
    )  # fmt: skip
    align_swing: float = number(
        0.010, "standard deviation of that distance at which the descent begins", "m", 0.001, 0.1
    )
    align_timeout: float = number(
        12.0, "longest wait above the payload, then the descent begins", "s", 0.0, 60.0
    )
    align_range: float = number(
        0.08, "largest correction of the path, per axis; a payload farther away is not approached",
        "m", 0.0, 1.0,
    )  # fmt: skip
    press_depth: float = number(
        0.004, "end of a corrected descent: tool below the payload's top", "m", 0.0, 0.05
    )
    descent_miss: float = number(
        0.025, "horizontal distance near the payload at which a descent is broken off", "m",
        0.005, 0.2,
    )  # fmt: skip
    held_distance: float = number(
        0.05, "distance tool - payload above which the payload is not held", "m", 0.01, 0.5
    )
    held_mass: float = number(
        0.05, "identified mass above which a payload without mocap counts as held", "kg", 0.001, 5.0
    )
    pick_throttle: float = number(
        0.9, "thrust as sent, expected with the payload, above which it is not picked", "1",
        0.1, 2.0,
    )  # fmt: skip
    carry_throttle: float = number(
        0.92, "thrust as sent from which on a payload is too heavy: set down, or landed with", "1",
        0.1, 2.0,
    )  # fmt: skip
    lift_timeout: float = number(
        4.0, "longest wait for the evidence that the payload is lifted", "s", 0.0, 60.0
    )
    lost_after: float = number(
        0.3, "time of evidence against a held payload after which it is lost", "s", 0.0, 10.0
    )
    release_timeout: float = number(
        3.0, "longest wait for the payload to leave the tool", "s", 0.0, 60.0
    )
    payload_lost: str = choice(
        "go_on", "reaction to a lost payload: go_on with the scenario, or land", ("go_on", "land")
    )
    grasp_given_up: str = choice(
        "go_on", "reaction to a payload that is given up or absent: go_on, or land",
        ("go_on", "land"),
    )  # fmt: skip
    contact_error: float = number(
        0.10, "position error near the payload that counts as a contact of the arm", "m", 0.02, 1.0
    )
    contact_climb: float = number(0.15, "climb after such a contact", "m", 0.0, 1.0)
    payload_age: float = number(
        FORWARDED, "age of the payload's mocap pose above which it is unknown", "s", 0.02, 10.0
    )
