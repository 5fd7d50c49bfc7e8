"""What each topic carries: frame, unit, rate, and its publisher if it is no wire of a flight.

`docs/interfaces.md` is made from this table, from `topics` and from `node.wiring`.
"""

from __future__ import annotations

from dataclasses import dataclass

from uam_msgs_py.messages import topics
from uam_msgs_py.messages.topics import BODY, WORLD

TICK, MOCAP, FRAMES, GAINS, SLOW = "250 Hz", "120 Hz", "25 Hz", "50 Hz", "1 Hz"
ON_CHANGE, ONCE = "on change", "once"
PLANNERS = "planners, RViz, MoveIt"
JOINT_SPACE = "joints"  # angles and torques about the joints' axes
CHI_UNITS = "m, rad; /s; /s²"


@dataclass(frozen=True)
class Content:
    """frame: of the numbers, "" for none; rate: in messages per second of the flight's time.

    publisher, readers: of topics that are no wire of a flight (`node.wiring`).
    """

    frame: str
    unit: str
    rate: str
    publisher: str = ""
    readers: str = ""


CONTENTS = {
    topics.CLOCK: Content("", "s", TICK),
    topics.IMU: Content(BODY, "rad/s, m/s²", TICK),
    topics.JOINTS: Content(JOINT_SPACE, "rad, rad/s, N m", TICK),
    topics.MOCAP: Content(WORLD, "m, quaternion", MOCAP),
    topics.ODOMETRY_IN: Content(
        "world, map or odom",
        "m, quaternion",
        "30 to 360 Hz",
        "mujoco_sim or your driver",
        "state_estimator, mission, mavlink_bridge",
    ),
    topics.PAYLOAD: Content(WORLD, "m, quaternion", MOCAP),
    topics.STATE: Content(WORLD, CHI_UNITS, TICK),
    topics.REFERENCE: Content(WORLD, CHI_UNITS, TICK),
    topics.POSITION_COMMAND: Content(WORLD, f"{CHI_UNITS}; N", TICK),
    topics.ATTITUDE_COMMAND: Content(BODY, "N m", TICK),
    topics.ARM_COMMAND: Content(JOINT_SPACE, "N m", TICK),
    topics.ARM_EFFORT: Content(JOINT_SPACE, "N m", TICK),
    topics.ARM_GOALS: Content(JOINT_SPACE, "rad", f"{TICK}, in place of the efforts"),
    topics.MAGNET: Content("", "on or off", TICK),
    topics.MAGNET_STATE: Content(
        "", "on or off", f"{SLOW} and on change", "magnet_driver or mavlink_bridge", "recorder"
    ),
    topics.IMU_BIAS: Content(BODY, "rad/s; m/s²", "50 Hz, not for a second after a gap"),
    topics.SETPOINT: Content(BODY, "rad/s, thrust 0..1", TICK),
    topics.THRUST: Content("", "1, N", "10 Hz"),
    topics.POSITION_ADAPTATION: Content("", "of each gain", GAINS),
    topics.ATTITUDE_ADAPTATION: Content("", "of each gain", GAINS),
    topics.ARM_ADAPTATION: Content("", "of each gain", GAINS),
    topics.ARMING: Content("", "yes or no", ON_CHANGE),
    topics.AUTOPILOT_STATE: Content("", "text", "5 Hz and on change"),
    topics.AUTOPILOT_BATTERY: Content("", "V, A, 0..1", SLOW),
    topics.ARM_TEMPERATURE: Content("", "°C", SLOW, "arm_driver", "mission"),
    topics.MISSION_STATUS: Content("", "text", "2 Hz and on change"),
    topics.PREFLIGHT: Content("", "text", "2 Hz before a flight", "mission", "cockpit, uam"),
    topics.CHECKLIST: Content(
        "", "text", "5 Hz before a flight", "checklist", "mission, cockpit, uam"
    ),
    topics.GOAL_POSE: Content(
        WORLD, "m, quaternion", ON_CHANGE, f"{PLANNERS}, cockpit, uam goto", "mission"
    ),
    topics.BASE_TRAJECTORY: Content(
        WORLD, "m, quaternion; /s; /s²", ON_CHANGE, PLANNERS, "mission"
    ),
    topics.ARM_TRAJECTORY: Content(JOINT_SPACE, "rad; /s; /s²", ON_CHANGE, PLANNERS, "mission"),
    topics.ODOMETRY: Content(
        WORLD,
        "m, quaternion; m/s, rad/s",
        "50 Hz with a subscriber",
        "state_estimator",
        "planners, viewers",
    ),
    topics.END_EFFECTOR: Content(
        WORLD, "m, quaternion", "50 Hz with a subscriber", "state_estimator", "planners, viewers"
    ),
    topics.END_EFFECTOR_REFERENCE: Content(
        WORLD, "m, quaternion", "50 Hz with a subscriber", "mission", "planners, viewers"
    ),
    topics.PATH: Content(
        WORLD, "m", "on change, with a subscriber", "mission", "planners, viewers"
    ),
    topics.CHANGES: Content("", "text", ON_CHANGE, "every tunable node", "cockpit, uam fly"),
    topics.FAULTS: Content("", "text", ON_CHANGE, "mujoco_sim, mavlink_bridge, uam fly", "cockpit"),
    topics.RESTARTS: Content("", "text", ON_CHANGE, "uam fly", "mujoco_sim, cockpit"),
    topics.TRUTH_STATE: Content(WORLD, CHI_UNITS, TICK),
    topics.TRUTH_PAYLOAD: Content(WORLD, "m, quaternion", TICK),
    topics.TRUTH_ROTORS: Content("", "0..1, rad/s, N", TICK),
    topics.TRUTH_MAGNET: Content("", "on or off, N, rad", TICK),
    topics.ROBOT_DESCRIPTION: Content(BODY, "URDF", ONCE, "scene", "viewers"),
    topics.TF: Content(WORLD, "m, quaternion", FRAMES, "scene", "viewers"),
    topics.TF_STATIC: Content(BODY, "m, quaternion", ONCE, "scene", "viewers"),
    topics.TRACKING_ERROR: Content(WORLD, "m, rad; /s", FRAMES, "scene", "viewers"),
    topics.MARKERS: Content(WORLD, "m", "2 Hz and on change", "scene", "viewers"),
    topics.RECORDED_UNTIL: Content("", "s", "up to 50 Hz of wall time", "recorder", "mujoco_sim"),
    topics.DIAGNOSTICS: Content(
        "", "text", "1 Hz each node", "every node but those of the cockpit", "mujoco_sim, cockpit"
    ),
    topics.ROSOUT: Content("", "text", "on each line", "every node", "viewers"),
}
