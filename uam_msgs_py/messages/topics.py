"""All topics of the stack: name, message type, quality of service.

Names are relative: a namespace moves them, without one `uam/state` is `/uam/state`. They can be
remapped as usual in ROS. Absolute, as all ROS programs expect: /tf, /tf_static, /diagnostics and
/rosout; there `uam_msgs_py.node.namespace` puts the namespace before frames and names. The clock
is relative: each simulated vehicle has its own time. Frames are those of REP-103: ENU world, FLU
body.
"""

from dataclasses import dataclass, field

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import Odometry, Path
from rcl_interfaces.msg import Log
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import BatteryState, Imu, JointState, Temperature
from std_msgs.msg import Bool, Float64MultiArray, String
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory
from visualization_msgs.msg import MarkerArray

try:
    from tf2_msgs.msg import TFMessage
except ImportError:  # not among the wheels of PyPI
    from uam_msgs_py.messages.tf_message import TFMessage

WORLD = "world"  # frame of poses and states, ENU; the vehicles of a domain share it
BODY = "base_link"  # frame of rates, forces and torques, FLU; with the prefix of the namespace


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


@dataclass(frozen=True)
class Topic:
    """A topic. one_publisher: a second one is a mistake; see `uam_msgs_py.node.sole_publisher`.

    recorded: the recorder subscribes to it.
    """

    name: str
    type: type
    qos: QoSProfile = field(hash=False)  # not hashable
    content: str
    one_publisher: bool = True
    recorded: bool = True

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


CLOCK = Topic("clock", Clock, _qos(1, reliable=False), "simulation time")

# Sensors
IMU = Topic("imu/data", Imu, SENSOR_DATA, "body rates and specific force, FLU, 250 Hz")
JOINTS = Topic("joint_states", JointState, SENSOR_DATA, "alpha_1, alpha_2, 250 Hz")
MOCAP = Topic("vrpn_mocap/uam/pose", PoseStamped, SENSOR_DATA, "motion capture, world, 120 Hz")
ODOMETRY_IN = Topic(
    "odometry/in",
    Odometry,
    SENSOR_DATA,
    "poses of an odometry in place of the motion capture (`pose_source: odometry`); 30 to 360 Hz",
    one_publisher=False,
)
PAYLOAD = Topic(
    "vrpn_mocap/payload/pose",
    PoseStamped,
    SENSOR_DATA,
    "motion capture of the payload: its grip point, the middle of its upper side",
)

# Control, once per tick, stamped with the IMU sample that the tick belongs to
STATE = Topic("uam/state", JointTrajectory, RELIABLE, "estimated chi, chi_dot, chi_ddot")
IMU_BIAS = Topic(
    "uam/imu_bias", Imu, RELIABLE, "estimated biases of gyroscope and accelerometer, FLU, 50 Hz"
)
REFERENCE = Topic(
    "uam/reference", JointTrajectory, RELIABLE, "chi_d ... of the controlled coordinates"
)
POSITION_COMMAND = Topic(
    "uam/position/command", JointTrajectory, RELIABLE, "p_d, q_d, their derivatives, and tau_p"
)
ATTITUDE_COMMAND = Topic("uam/attitude/command", JointTrajectory, RELIABLE, "tau_q, FLU")
ARM_COMMAND = Topic("uam/arm/command", JointTrajectory, RELIABLE, "tau_alpha")
ARM_EFFORT = Topic("arm_effort_controller/commands", Float64MultiArray, RELIABLE, "tau_alpha [N m]")
ARM_GOALS = Topic(
    "arm_position_controller/commands",
    Float64MultiArray,
    RELIABLE,
    "goal positions [rad], with setpoint: position of the arm controller",
)
MAGNET = Topic("uam/magnet", Bool, RELIABLE, "magnet on")
MAGNET_STATE = Topic(
    "uam/magnet/state",
    Bool,
    LATCHED,
    "magnet as its driver has switched it: acknowledged by the autopilot or read back from the "
    "line; not simulated",
    one_publisher=False,
)
SETPOINT = Topic(
    "uam/setpoint", TwistStamped, RELIABLE, "body rates FLU and thrust 0..1 (linear.z) as sent"
)
THRUST = Topic(
    "uam/thrust",
    JointState,
    RELIABLE,
    "factor: true / assumed thrust as identified; effort: low-pass of the thrust [N], 10 Hz",
)
POSITION_ADAPTATION = Topic(
    "uam/position/adaptation", JointState, RELIABLE, "the gains of the law, by its names, 50 Hz"
)
ATTITUDE_ADAPTATION = Topic("uam/attitude/adaptation", JointState, RELIABLE, "as for position")
ARM_ADAPTATION = Topic("uam/arm/adaptation", JointState, RELIABLE, "as for position")

# States of mission and autopilot
ARMING = Topic("uam/arming", Bool, LATCHED, "desired: armed and in OFFBOARD; Bool: no stamp")
AUTOPILOT_STATE = Topic(
    "uam/autopilot/state",
    DiagnosticArray,
    LATCHED,
    "see uam_msgs_py.messages.status.AutopilotState",
)
AUTOPILOT_BATTERY = Topic(
    "uam/autopilot/battery", BatteryState, RELIABLE, "autopilot's battery, 1 Hz; NaN: unknown"
)
ARM_TEMPERATURE = Topic(
    "uam/arm/temperature",
    Temperature,
    RELIABLE,
    "servo temperature; frame_id: its joint; from a vehicle's driver, not simulated",
    one_publisher=False,
)
MISSION_STATUS = Topic(
    "uam/mission/status", DiagnosticArray, LATCHED, "see uam_msgs_py.messages.status.MissionStatus"
)
PREFLIGHT = Topic(
    "uam/preflight",
    DiagnosticArray,
    LATCHED,
    "pre-arm report, before a flight twice a second: one status per check",
)
CHECKLIST = Topic(
    "uam/checklist",
    DiagnosticArray,
    LATCHED,
    "checklist of a real vehicle: its state, see uam_msgs_py.messages.status.ChecklistState, and "
    "one status per item; not simulated",
)

# For planners and standard tools
PLANS = _qos(10)  # each message counts
GOAL_POSE = Topic(
    "goal_pose",
    PoseStamped,
    PLANS,
    "pose to fly to, world; z = 0 keeps the height, orientation of zeros the heading",
    one_publisher=False,
)
BASE_TRAJECTORY = Topic(
    "base_trajectory",
    MultiDOFJointTrajectory,
    PLANS,
    "trajectory of the base, world; velocities and accelerations optional",
    one_publisher=False,
)
ARM_TRAJECTORY = Topic(
    "arm_trajectory",
    JointTrajectory,
    PLANS,
    "trajectory of all joints; velocities and accelerations optional",
    one_publisher=False,
)
ODOMETRY = Topic(
    "odometry",
    Odometry,
    RELIABLE,
    "the estimate: pose in world, twist in base_link; 50 Hz, only with a subscriber",
    recorded=False,
)
PATH = Topic(
    "path", Path, LATCHED, "planned positions of the next 250 s; on change, only with a subscriber",
    recorded=False,
)  # fmt: skip
END_EFFECTOR = Topic(
    "end_effector/pose",
    PoseStamped,
    RELIABLE,
    "the estimate of the end effector, a hanging one straight down; 50 Hz, only with a subscriber",
    recorded=False,
)
END_EFFECTOR_REFERENCE = Topic(
    "end_effector/reference",
    PoseStamped,
    RELIABLE,
    "the end effector of the reference, in flight; 50 Hz, only with a subscriber",
    recorded=False,
)

# Events: reliable and latched, as each is sent only once
CHANGES = Topic(
    "uam/parameter_changes",
    DiagnosticArray,
    _qos(1000, latched=True),
    "see uam_msgs_py.messages.parameter_changes.ParameterChange",
    one_publisher=False,
)

FAULTS = Topic(
    "uam/faults",
    DiagnosticArray,
    _qos(1000, latched=True),
    "faults put into the flight; see uam_msgs_py.messages.fault_events.FaultEvent",
    one_publisher=False,
)

RESTARTS = Topic(
    "uam/restarts",
    DiagnosticArray,
    _qos(100, latched=True),
    "nodes that uam fly starts again after a loss; name: the node",
)

# True values, from the simulator only
TRUTH_STATE = Topic("uam/truth/state", JointTrajectory, RELIABLE, "true chi, chi_dot, chi_ddot")
TRUTH_PAYLOAD = Topic("uam/truth/payload", PoseStamped, RELIABLE, "payload, world")
TRUTH_ROTORS = Topic(
    "uam/truth/rotors", JointState, RELIABLE, "rotor_1..4: command 0..1, speed rad/s, thrust N"
)
TRUTH_MAGNET = Topic(
    "uam/truth/magnet", JointState, RELIABLE, "magnet: on 0/1, holding force N; swing: angle rad"
)

# For RViz and Foxglove. A lost message is no problem: the next one is complete.
ROBOT_DESCRIPTION = Topic("robot_description", String, LATCHED, "URDF", one_publisher=False)
TF = Topic("/tf", TFMessage, _qos(100), "vehicle, reference, payload, 25 Hz", one_publisher=False)
TF_STATIC = Topic("/tf_static", TFMessage, LATCHED, "fixed frames", one_publisher=False)
TRACKING_ERROR = Topic(
    "uam/tracking/error",
    JointState,
    RELIABLE,
    "estimate - reference: chi, chi_dot; attitude: from q_d of the position law; 0 without a "
    "reference; 25 Hz",
    one_publisher=False,
)
MARKERS = Topic(
    "uam/markers", MarkerArray, LATCHED, "paths, payload, magnet, phase", one_publisher=False
)

# Of the recording
RECORDED_UNTIL = Topic(
    "uam/recorded_until",
    Clock,
    _qos(1, reliable=False),
    "simulation time up to which every topic is recorded; in lockstep the plant waits for it",
    recorded=False,
)

# ROS conventions
DIAGNOSTICS = Topic("/diagnostics", DiagnosticArray, RELIABLE, "health, 1 Hz", one_publisher=False)
ROSOUT = Topic("/rosout", Log, _qos(1000, latched=True), "log of all nodes", one_publisher=False)

ALL = [topic for topic in list(vars().values()) if isinstance(topic, Topic)]
RECORDED = [topic for topic in ALL if topic.recorded]
