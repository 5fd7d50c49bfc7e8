"""The table of all topics: what each is, carries, who publishes it and who needs it.

docs/interfaces.md is made from it.

Names are relative: a namespace moves them, without one `uam/state` is `/uam/state`. They can be
remapped as usual in ROS. Absolute, as all ROS programs expect: /tf, /tf_static, /diagnostics and
/rosout; there `uam_msgs_py.node.namespace` puts the namespace before frames and names. The clock
is relative: each simulated vehicle has its own time. Frames are those of REP-103: ENU world, FLU
body.
"""

from dataclasses import KW_ONLY, dataclass, field
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import Odometry, Path
from rcl_interfaces.msg import Log
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import BatteryState, Imu, JointState, Joy, Temperature
from std_msgs.msg import Bool, Float64, Float64MultiArray, String
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory
from visualization_msgs.msg import MarkerArray

from uam_msgs_py.messages.node_names import (
    ARM,
    ARM_DRIVER,
    ATTITUDE,
    BRIDGE,
    ESTIMATOR,
    MISSION,
    PLANT,
    POSITION,
    RECORDER,
    SCENE,
)

try:
    from tf2_msgs.msg import TFMessage
except ImportError:  # not among the wheels of PyPI
    from uam_msgs_py.messages.tf_message import TFMessage

WORLD = "world"  # frame of poses and states, ENU; the vehicles of a domain share it
BODY = "base_link"  # frame of rates, forces and torques, FLU; with the prefix of the namespace
TOOL = "end_effector"  # frame of the end effector; likewise
JOINT_SPACE = "joints"  # angles and torques about the joints' axes
CHI_UNITS, POSE, TEXT, EACH_GAIN = "m, rad; /s; /s²", "m, quaternion", "text", "of each gain"
TICK, CAMERAS, FRAMES, GAINS, SLOW = "250 Hz", "120 Hz", "25 Hz", "50 Hz", "1 Hz"
ON_CHANGE, ONCE, ASKED_FOR = "on change", "once", "50 Hz with a subscriber"
PLANNERS = "planners, RViz, MoveIt"


def _qos(depth: int, reliable: bool = True, latched: bool = False) -> QoSProfile:
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


DEPTH = 32  # of a publisher: 128 ms at control rate
# Of a subscription: the messages of all publishers share it. A process that stalls for 1.6 s at
# control rate loses no message; beside an impostor at control rate, for 0.8 s. Fast DDS stores no
# more (max_samples_per_instance).
READING_DEPTH = 400
SENSOR_DATA = _qos(DEPTH, reliable=False)  # rclpy.qos.qos_profile_sensor_data, but deeper
RELIABLE = _qos(DEPTH)
NEWEST = _qos(4, reliable=False)  # for readers that poll and use only the newest message
LATCHED = _qos(1, latched=True)  # a late subscriber gets the last message
PLANS = _qos(10)  # each message counts


@dataclass(frozen=True)
class Topic:
    """A topic."""

    name: str
    type: type
    qos: QoSProfile = field(hash=False)  # not hashable
    frame: str  # of the numbers, "" for none
    unit: str
    rate: str  # in messages per second of the flight's time
    publisher: str  # node, or in words
    _: KW_ONLY
    about: str
    to: tuple[str, ...] | None = None  # nodes that a flight waits for; None: no `node.wiring.Wire`
    readers: str = ""  # who uses it, if it is no wire
    optional: bool = False  # these nodes also work without the topic
    one_publisher: bool = True  # a second one is a mistake, see `node.sole_publisher`
    recorded: bool = True  # the recorder subscribes to it

    def outlet(self, node: Node, **how: Any) -> Publisher:
        """Return a publisher of this topic; how: see `Node.create_publisher`."""
        return node.create_publisher(self.type, self.name, self.qos, **how)

    @property
    def reading(self) -> QoSProfile:
        """Return the quality of service of the subscriptions in this stack.

        Best effort for messages of every tick: the next message replaces a lost one, and thousands
        of acknowledgements per second are saved. Other subscribers may request reliable delivery.
        Deeper than the publisher's where there should be one publisher: messages of a second one,
        which are refused after they are taken, must not replace messages of the rightful one.
        """
        qos = SENSOR_DATA if self.qos is RELIABLE and self is not DIAGNOSTICS else self.qos
        if not self.one_publisher:
            return qos
        return QoSProfile(
            depth=READING_DEPTH, reliability=qos.reliability, durability=qos.durability
        )


# fmt: off
CLOCK = Topic("clock", Clock, _qos(1, reliable=False), "", "s", TICK, PLANT, to=(),
    about="simulation time")

# Sensors
IMU = Topic("imu/data", Imu, SENSOR_DATA, BODY, "rad/s, m/s²", TICK, PLANT, to=(ESTIMATOR,),
    about="body rates and specific force, FLU")
JOINTS = Topic("joint_states", JointState, SENSOR_DATA, JOINT_SPACE, "rad, rad/s, N m", TICK,
    PLANT, to=(ESTIMATOR, MISSION),
    about="alpha_1, alpha_2; of a two-finger gripper `gripper`: opening m, closing force N")
MOCAP = Topic("vrpn_mocap/uam/pose", PoseStamped, SENSOR_DATA, WORLD, POSE, CAMERAS, PLANT,
    to=(ESTIMATOR, MISSION, BRIDGE), about="motion capture, world")
ODOMETRY_IN = Topic("odometry/in", Odometry, SENSOR_DATA, "world, map or odom", POSE,
    "30 to 360 Hz", "mujoco_sim or your driver",
    readers="state_estimator, mission, mavlink_bridge",
    about="poses of an odometry in place of the motion capture (`pose_source: odometry`)")
PAYLOAD = Topic("vrpn_mocap/payload/pose", PoseStamped, SENSOR_DATA, WORLD, POSE, CAMERAS, PLANT,
    to=(MISSION,), optional=True,
    about="motion capture of the payload: its grip point, the middle of its upper side")

# Control, once per tick, stamped with the IMU sample that the tick belongs to
STATE = Topic("uam/state", JointTrajectory, RELIABLE, WORLD, CHI_UNITS, TICK, ESTIMATOR,
    to=(MISSION, POSITION, ATTITUDE, ARM, BRIDGE), about="estimated chi, chi_dot, chi_ddot")
IMU_BIAS = Topic("uam/imu_bias", Imu, RELIABLE, BODY, "rad/s; m/s²",
    "50 Hz, not for a second after a gap", ESTIMATOR, to=(MISSION,), optional=True,
    about="estimated biases of gyroscope and accelerometer, FLU")
REFERENCE = Topic("uam/reference", JointTrajectory, RELIABLE, WORLD, CHI_UNITS, TICK, MISSION,
    to=(POSITION, ATTITUDE, ARM), about="chi_d ... of the controlled coordinates")
POSITION_COMMAND = Topic("uam/position/command", JointTrajectory, RELIABLE, WORLD,
    "m, rad; /s; /s²; N", TICK, POSITION, to=(ATTITUDE, ARM, BRIDGE, MISSION),
    about="p_d, q_d, their derivatives, and tau_p")
ATTITUDE_COMMAND = Topic("uam/attitude/command", JointTrajectory, RELIABLE, BODY, "N m", TICK,
    ATTITUDE, to=(BRIDGE,), about="tau_q, FLU")
ARM_COMMAND = Topic("uam/arm/command", JointTrajectory, RELIABLE, JOINT_SPACE, "N m", TICK, ARM,
    to=(), about="tau_alpha")
ARM_EFFORT = Topic("arm_effort_controller/commands", Float64MultiArray, RELIABLE, JOINT_SPACE,
    "N m", TICK, ARM, to=(PLANT,), about="tau_alpha [N m]")
ARM_GOALS = Topic("arm_position_controller/commands", Float64MultiArray, RELIABLE, JOINT_SPACE,
    "rad", "250 Hz, in place of the efforts", ARM, to=(PLANT,), optional=True,
    about="goal positions [rad], with setpoint: position of the arm controller")
MAGNET = Topic("uam/magnet", Bool, RELIABLE, "", "on or off", TICK, MISSION, to=(PLANT,),
    about="magnet on")
MAGNET_STATE = Topic("uam/magnet/state", Bool, LATCHED, "", "on or off", "1 Hz and on change",
    "magnet_driver or mavlink_bridge", readers=RECORDER, one_publisher=False,
    about="magnet as its driver has switched it: acknowledged by the autopilot or read back "
    "from the line; not simulated")
GRIPPER_STATE = Topic("gripper/state", Float64, RELIABLE, "", "m, or 0/1", ASKED_FOR, MISSION,
    readers="scene, your program", recorded=False,
    about="measured opening; of a magnet the command")
SETPOINT = Topic("uam/setpoint", TwistStamped, RELIABLE, BODY, "rad/s, thrust 0..1", TICK, BRIDGE,
    to=(PLANT,), about="body rates FLU and thrust 0..1 (linear.z) as sent")
THRUST = Topic("uam/thrust", JointState, RELIABLE, "", "1, N", "10 Hz", BRIDGE, to=(MISSION,),
    optional=True,
    about="factor: true / assumed thrust as identified; effort: low-pass of the thrust [N]; "
    "velocity: the same of the thrust as sent, 0..1")
POSITION_ADAPTATION = Topic("uam/position/adaptation", JointState, RELIABLE, "", EACH_GAIN, GAINS,
    POSITION, to=(MISSION,), optional=True, about="the gains of the law, by its names")
ATTITUDE_ADAPTATION = Topic("uam/attitude/adaptation", JointState, RELIABLE, "", EACH_GAIN, GAINS,
    ATTITUDE, to=(MISSION,), optional=True, about="as for position")
ARM_ADAPTATION = Topic("uam/arm/adaptation", JointState, RELIABLE, "", EACH_GAIN, GAINS, ARM,
    to=(MISSION,), optional=True, about="as for position")

# States of mission and autopilot
ARMING = Topic("uam/arming", Bool, LATCHED, "", "yes or no", ON_CHANGE, MISSION, to=(BRIDGE,),
    about="desired: armed and in OFFBOARD; Bool: no stamp")
AUTOPILOT_STATE = Topic("uam/autopilot/state", DiagnosticArray, LATCHED, "", TEXT,
    "5 Hz and on change", BRIDGE, to=(MISSION, ATTITUDE),
    about="see uam_msgs_py.messages.status.AutopilotState")
AUTOPILOT_BATTERY = Topic("uam/autopilot/battery", BatteryState, RELIABLE, "", "V, A, 0..1", SLOW,
    BRIDGE, to=(MISSION,), optional=True, about="autopilot's battery; NaN: unknown")
ARM_TEMPERATURE = Topic("uam/arm/temperature", Temperature, RELIABLE, "", "°C", SLOW, ARM_DRIVER,
    readers=MISSION, one_publisher=False,
    about="servo temperature; frame_id: its joint; from a vehicle's driver, not simulated")
MISSION_STATUS = Topic("uam/mission/status", DiagnosticArray, LATCHED, "", TEXT,
    "2 Hz and on change", MISSION, to=(PLANT, BRIDGE),
    about="see uam_msgs_py.messages.status.MissionStatus")
PREFLIGHT = Topic("uam/preflight", DiagnosticArray, LATCHED, "", TEXT, "2 Hz before a flight",
    MISSION, readers="cockpit, uam",
    about="pre-arm report, before a flight twice a second: one status per check")
CHECKLIST = Topic("uam/checklist", DiagnosticArray, LATCHED, "", TEXT, "5 Hz before a flight",
    "checklist", readers="mission, cockpit, uam",
    about="checklist of a real vehicle: its state, see "
    "uam_msgs_py.messages.status.ChecklistState, and one status per item; not simulated")

# For planners and standard tools
GOAL_POSE = Topic("goal_pose", PoseStamped, PLANS, WORLD, POSE, ON_CHANGE,
    f"{PLANNERS}, cockpit, uam goto", readers=MISSION, one_publisher=False,
    about="pose to fly to, world; z = 0 keeps the height, orientation of zeros the heading")
BASE_TRAJECTORY = Topic("base_trajectory", MultiDOFJointTrajectory, PLANS, WORLD,
    "m, quaternion; /s; /s²", ON_CHANGE, PLANNERS, readers=MISSION,
    one_publisher=False,
    about="trajectory of the base, world; velocities and accelerations optional")
ARM_TRAJECTORY = Topic("arm_trajectory", JointTrajectory, PLANS, JOINT_SPACE, "rad; /s; /s²",
    ON_CHANGE, PLANNERS, readers=MISSION, one_publisher=False,
    about="trajectory of all joints; velocities and accelerations optional")
ODOMETRY = Topic("odometry", Odometry, RELIABLE, WORLD, "m, quaternion; m/s, rad/s", ASKED_FOR,
    ESTIMATOR, readers="planners, viewers", recorded=False,
    about="the estimate: pose in world, twist in base_link")
PATH = Topic("path", Path, LATCHED, WORLD, "m", "on change, with a subscriber", MISSION,
    readers="planners, viewers", recorded=False,
    about="planned positions of the next 250 s")
END_EFFECTOR = Topic("end_effector/pose", PoseStamped, RELIABLE, WORLD, POSE, ASKED_FOR,
    ESTIMATOR, readers="planners, viewers", recorded=False,
    about="the estimate of the end effector, a hanging one straight down; 50 Hz, only with a "
    "subscriber")
END_EFFECTOR_REFERENCE = Topic("end_effector/reference", PoseStamped, RELIABLE, WORLD, POSE,
    ASKED_FOR, MISSION, readers="planners, viewers", recorded=False,
    about="the end effector of the reference, in flight")
END_EFFECTOR_GOAL = Topic("end_effector/goal_pose", PoseStamped, PLANS, WORLD, POSE, ON_CHANGE,
    f"{PLANNERS}, cockpit, uam goto --hand", readers=MISSION, one_publisher=False,
    about="pose of the end effector to fly to, world; a turn about the vertical is a heading alone")
END_EFFECTOR_TRAJECTORY = Topic("end_effector/trajectory", MultiDOFJointTrajectory, PLANS, WORLD,
    "m, quaternion; /s; /s²", ON_CHANGE, PLANNERS, readers=MISSION, one_publisher=False,
    about="trajectory of the end effector, world; velocities and accelerations optional")
END_EFFECTOR_TWIST = Topic("end_effector/twist", TwistStamped, PLANS, "world or end_effector",
    "m/s, rad/s", "10 Hz or more", "teleop, planners", readers=MISSION, one_publisher=False,
    about="jog of the end effector; it stops when silent")
GRIPPER_COMMAND = Topic("gripper/command", Float64, PLANS, "", "m, or 0/1", ON_CHANGE,
    "teleop, your program", readers="mission, mujoco_sim, arm_driver", one_publisher=False,
    about="opening of a two-finger gripper, a magnet 0/1; until the scenario grips or opens next")
JOY = Topic("joy", Joy, SENSOR_DATA, "", "-1..1, 0 or 1", "of the gamepad", "joy_node",
    readers="teleop", one_publisher=False, recorded=False, about="axes and buttons of a gamepad")

# Events: reliable and latched, as each is sent only once
CHANGES = Topic("uam/parameter_changes", DiagnosticArray, _qos(1000, latched=True), "", TEXT,
    ON_CHANGE, "every tunable node", readers="cockpit, uam fly", one_publisher=False,
    about="see uam_msgs_py.messages.flight_events.ParameterChange")
FAULTS = Topic("uam/faults", DiagnosticArray, _qos(1000, latched=True), "", TEXT, ON_CHANGE,
    "mujoco_sim, mavlink_bridge, uam fly", readers="cockpit", one_publisher=False,
    about="faults put into the flight; see uam_msgs_py.messages.flight_events.FaultEvent")
RESTARTS = Topic("uam/restarts", DiagnosticArray, _qos(100, latched=True), "", TEXT, ON_CHANGE,
    "uam fly", readers="mujoco_sim, cockpit",
    about="nodes that uam fly starts again after a loss; name: the node")

# True values, from the simulator only
TRUTH_STATE = Topic("uam/truth/state", JointTrajectory, RELIABLE, WORLD, CHI_UNITS, TICK, PLANT,
    to=(), about="true chi, chi_dot, chi_ddot")
TRUTH_PAYLOAD = Topic("uam/truth/payload", PoseStamped, RELIABLE, WORLD, POSE, TICK, PLANT, to=(),
    about="payload, world")
TRUTH_ROTORS = Topic("uam/truth/rotors", JointState, RELIABLE, "", "0..1, rad/s, N", TICK, PLANT,
    to=(), about="rotor_1..4: command 0..1, speed rad/s, thrust N")
TRUTH_MAGNET = Topic("uam/truth/magnet", JointState, RELIABLE, "", "on or off, N, rad", TICK,
    PLANT, to=(), about="magnet: on 0/1, holding force N; swing: angle rad; gripper: m, N")

# For RViz and Foxglove. A lost message is no problem: the next one is complete.
ROBOT_DESCRIPTION = Topic("robot_description", String, LATCHED, BODY, "URDF", ONCE, SCENE,
    readers="viewers", one_publisher=False, about="URDF")
TF = Topic("/tf", TFMessage, _qos(100, ), WORLD, POSE, FRAMES, SCENE, readers="viewers",
    one_publisher=False, about="vehicle, reference, payload")
TF_STATIC = Topic("/tf_static", TFMessage, LATCHED, BODY, POSE, ONCE, SCENE, readers="viewers",
    one_publisher=False, about="fixed frames")
TRACKING_ERROR = Topic("uam/tracking/error", JointState, RELIABLE, WORLD, "m, rad; /s", FRAMES,
    SCENE, readers="viewers", one_publisher=False,
    about="estimate - reference: chi, chi_dot, then the end effector; attitude: from q_d of the "
    "position law; 0 without a reference")
MARKERS = Topic("uam/markers", MarkerArray, LATCHED, WORLD, "m", "2 Hz and on change", SCENE,
    readers="viewers", one_publisher=False, about="paths, payload, magnet, phase")

# Of the recording
RECORDED_UNTIL = Topic("uam/recorded_until", Clock, _qos(1, reliable=False), "", "s",
    "up to 50 Hz of wall time", RECORDER, readers=PLANT, recorded=False,
    about="simulation time up to which every topic is recorded; in lockstep the plant waits "
    "for it")

# ROS conventions
DIAGNOSTICS = Topic("/diagnostics", DiagnosticArray, RELIABLE, "", TEXT, "1 Hz each node",
    "every node but those of the cockpit", readers="mujoco_sim, cockpit", one_publisher=False,
    about="health")
ROSOUT = Topic("/rosout", Log, _qos(1000, latched=True), "", TEXT, "on each line", "every node",
    readers="viewers", one_publisher=False, about="log of all nodes")
# fmt: on

ALL = [topic for topic in list(vars().values()) if isinstance(topic, Topic)]
RECORDED = [topic for topic in ALL if topic.recorded]
