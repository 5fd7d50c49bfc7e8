"""The scene over real ROS: the messages for RViz and Foxglove."""

import numpy as np
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from uam_control.coordinates import coordinates
from uam_lab.cockpit.scene import HAND_NAMES
from uam_lab.records.recording.bag import schema
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.control import PositionCommandWriter, ReferenceWriter
from uam_msgs_py.messages.convert import PoseWriter, TrajectoryWriter, read_joints
from uam_msgs_py.messages.status import MissionStatus
from uam_msgs_py.node.wiring import READERS, Connections

COORDINATES = coordinates(2)
SIZE = len(COORDINATES)

MODULE = "uam_lab.cockpit.scene"
TICK = 4_000_000  # [ns]
# rows q_d, Omega_d, Omega_d_dot: what the position law desires
ATTITUDE_DESIRED = np.array([[-0.1, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, 0.0]])
FRAME = 10 * TICK


def transforms(messages):
    """Return child → (parent, x) of the newest transforms, and the stamps of base_link [ns]."""
    name = "tf2_msgs/msg/TFMessage"
    kind = Schema(id=1, name=name, encoding="ros2msg", data=schema(name).encode())
    decode = DecoderFactory().decoder_for("cdr", kind)
    newest, stamps = {}, []
    for data in messages:
        for entry in decode(data).transforms:
            newest[entry.child_frame_id] = entry.header.frame_id, entry.transform.translation.x
            if entry.child_frame_id == "base_link":
                stamps.append(entry.header.stamp.sec * 10**9 + entry.header.stamp.nanosec)
    return newest, stamps


class Rig:
    """The scene node; the test replaces estimator, mission and simulator."""

    def __init__(self, start, probe, truth=True):
        self.probe, self.stamp = probe, 0
        self.node = start(MODULE, "--ros-args", "-p", "scenario:=hover")
        self.tf, self.still = (probe.collect_raw(t) for t in (topics.TF, topics.TF_STATIC))
        self.markers = probe.collect(topics.MARKERS)
        self.errors = probe.collect(topics.TRACKING_ERROR)
        self.robot = probe.collect(topics.ROBOT_DESCRIPTION)
        inputs = [topics.STATE, topics.REFERENCE, topics.POSITION_COMMAND]
        inputs += [topics.TRUTH_PAYLOAD] * truth
        self.outlets = [probe.publisher(topic) for topic in inputs]
        self.status = probe.publisher(topics.MISSION_STATUS)
        self.writers = (
            TrajectoryWriter(COORDINATES),
            ReferenceWriter(2),
            PositionCommandWriter(),
            PoseWriter(),
        )
        self.tell(MissionStatus(phase="waiting"))
        probe.until(lambda: self.robot and self.still, "URDF and fixed frames")
        probe.until_connected("scene", self.outlets, [topics.TF, topics.TRACKING_ERROR])

    def tell(self, status):
        self.status.publish(status.to_message(self.stamp))

    def tick(self, flying=True):
        """Publish a tick: state at x = 0.1, reference at x = 0.3, payload at x = 0.7."""
        self.stamp += TICK
        state, desired = np.zeros((3, SIZE)), np.zeros((3, SIZE))
        state[0, 0], desired[0, 0], desired[0, 7] = 0.1, 0.3, 0.5
        level = np.array([1.0, 0.0, 0.0, 0.0])
        messages = (
            self.writers[0].fill(self.stamp, state),
            self.writers[1].fill(self.stamp, desired, flying, 0),
            self.writers[2].fill(self.stamp, desired, ATTITUDE_DESIRED, np.zeros(3)),
            self.writers[3].fill(self.stamp, np.array([0.7, 0.0, 0.0]), level),
        )
        for outlet, message in list(zip(self.outlets, messages, strict=False))[::-1]:
            outlet.publish(message)

    def fly(self, until, what, **how):
        """Tick at about real time until `until()` is true."""

        def step():
            self.tick(**how)
            self.tell(MissionStatus(phase="hover", time=1.0))
            return until()

        self.probe.until(step, what)


def test_frames_urdf_and_markers_of_a_simulated_flight(start, probe):
    rig = Rig(start, probe)
    rig.fly(lambda: len(rig.tf) > 10 and "reference" in transforms(rig.tf)[0], "transforms")
    found, stamps = transforms(rig.tf + rig.still)
    assert found["base_link"] == ("world", 0.1) and found["reference"] == ("world", 0.3)
    assert found["payload"] == ("world", 0.7)
    parents = {child: parent for child, (parent, _) in found.items()}
    assert parents["shoulder"] == parents["link_1"] == "base_link"
    assert (parents["link_2"], parents["magnet"]) == ("link_1", "link_2")
    assert "<robot" in rig.robot[-1].data
    frames = (stamps[-1] - stamps[0]) / FRAME
    assert len(stamps) <= frames + 2, "25 Hz of the messages' time, however fast they come"
    assert deserialize_message(rig.errors[-1], JointState).header.frame_id == "world"
    _, position, velocity = read_joints(rig.errors[-1], list(COORDINATES))
    assert position.round(9).tolist() == [-0.2, 0, 0, 0.1, 0, 0, 0, -0.5]
    assert velocity.round(9).tolist() == [0, 0, 0, 0, -0.2, 0, 0, 0]
    _, hand, swept = read_joints(rig.errors[-1], HAND_NAMES)
    # 0.1 rad of roll move the hand, which hangs 0.2 to 0.4 m below, to the left
    assert -0.4 < hand[0] < 0.0 and 0.02 < hand[1] < 0.04
    assert swept[0] > 0.02  # -0.2 rad/s of pitch
    probe.until(lambda: any(m.text == "hover" for m in rig.markers[-1].markers), "the phase")
    assert {"payload", "magnet", "reference path"} <= {m.ns for m in rig.markers[-1].markers}
    assert rig.node.interrupt() == 0 and "Traceback" not in rig.node.output


def test_on_hardware_there_is_no_truth(start, probe):
    rig = Rig(start, probe, truth=False)
    rig.fly(lambda: len(rig.tf) > 10 and len(rig.markers) > 1, "transforms", flying=False)
    found, _ = transforms(rig.tf)
    assert set(found) == {"base_link", "link_1", "link_2", "magnet"}
    assert "payload" not in {m.ns for m in rig.markers[-1].markers}
    _, position, _ = read_joints(rig.errors[-1], list(COORDINATES))
    assert position.round(9).tolist() == [0, 0, 0, 0, 0, 0, 0, -0.5], "on the ground: the arm alone"
    assert not np.any(read_joints(rig.errors[-1], HAND_NAMES)[1])


def test_alone_it_waits_for_the_mission_and_listens_to_nothing_else(start, probe):
    node = start(MODULE)
    node.until_logged("waiting for /uam/mission/status")
    connections = Connections(probe.node)
    state = probe.publisher(topics.STATE)
    probe.until(lambda: connections.count("scene", READERS, topics.DIAGNOSTICS.name), "diagnostics")
    listeners = probe.node.get_subscriptions_info_by_topic(topics.STATE.name)
    assert listeners == [] and state.get_subscription_count() == 0
    assert node.interrupt(times=3) == 0


def test_what_it_cannot_load_is_refused_in_one_line(start):
    for name, value in (("scenario", "nowhere"), ("vehicle", "glider"), ("frame_rate", "1e3")):
        node = start(MODULE, "--ros-args", "-p", f"{name}:={value}")
        assert node.process.wait(60) == 2, node.output
        shown_text = [line for line in node.output.splitlines() if line.startswith("scene: ")]
        assert len(shown_text) == 1 and "Traceback" not in node.output
