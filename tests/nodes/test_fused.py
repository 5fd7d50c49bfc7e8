"""The fused layout over ROS: what is seen from outside, who may publish, what is sent."""

import time

import numpy as np
import yaml
from free_port import free_port
from rcl_interfaces.srv import ListParameters, SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter

from uam_lab.flights.ros.node_arguments import FUSED, MODULES
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.control import read_state
from uam_msgs_py.messages.convert import ImuWriter, JointStateWriter, PoseWriter, TrajectoryWriter
from uam_msgs_py.messages.layouts import stamp_of
from uam_msgs_py.node import wiring

PERIOD = 4_000_000  # [ns]
SPACES = ("/separate", "/fused")
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
TICKS = 100


def port():
    return "--ros-args", "-p", f"mavlink_bridge:local_port:={free_port()}"


def seen(node, name, space):
    """What the graph says of a node: topics and services, without its namespace."""

    def bare(found):
        return {(one.removeprefix(space), *kinds) for one, kinds in found}

    return (
        bare(node.get_publisher_names_and_types_by_node(name, space)),
        bare(node.get_subscriber_names_and_types_by_node(name, space)),
        bare(node.get_service_names_and_types_by_node(name, space)),
    )


def arguments(space, folder):
    """Namespace and a port of the bridge; `-p node:name` reaches no node in a namespace."""
    file = folder / f"{space[1:]}.yaml"
    bridge = {"local_port": free_port()}
    file.write_text(yaml.safe_dump({wiring.BRIDGE: {"ros__parameters": bridge}}))
    return "--ros-args", "-r", f"__ns:={space}", "--params-file", file


def test_from_outside_the_nodes_are_those_of_the_separate_layout(start, probe, tmp_path):
    separate, fused = (arguments(space, tmp_path) for space in SPACES)
    for name in wiring.FUSED:
        start(MODULES[name], *separate)
    start(FUSED, *fused)

    def parameters(name, space):
        """Requested again each second: a service may not reach a client that it has just met."""
        client = probe.node.create_client(ListParameters, f"{space}/{name}/list_parameters")
        probe.until(client.service_is_ready, f"{name} in {space}")
        asked = []

        def answered():
            if not asked or time.monotonic() - asked[-1][0] > 1.0:
                future = client.call_async(ListParameters.Request())
                asked.append((time.monotonic(), future))
            return [future for _, future in asked if future.done()]

        probe.until(answered, f"the parameters of {name} in {space}")
        return set(answered()[0].result().result.names)

    for name in wiring.FUSED:
        found = [parameters(name, space) for space in SPACES]  # waits until the node is there
        assert found[0] == found[1]

        def alike(name=name):
            one, other = (seen(probe.node, name, space) for space in SPACES)
            return one == other and all(one)

        probe.until(alike, f"{name} to be the same in both layouts")
    every = probe.node.get_node_names_and_namespaces()
    inside = {node for node, space in every if space == "/fused"}
    assert inside - {wiring.FLIGHT_CONTROLLER} == set(wiring.FUSED)


class Vehicle:
    """Sensors of a vehicle at rest; the fused process answers each tick with the arm's efforts."""

    def __init__(self, probe, start, *arguments):
        self.probe, self.stamp = probe, 0
        self.out = [probe.publisher(t) for t in (topics.MOCAP, topics.JOINTS, topics.IMU)]
        self.writers = PoseWriter(), JointStateWriter(["alpha_1", "alpha_2"]), ImuWriter()
        self.efforts = probe.collect(topics.ARM_EFFORT)
        self.states = probe.collect(topics.STATE)
        self.process = start(FUSED, *port(), *arguments)
        probe.until_connected(wiring.ESTIMATOR, self.out, [topics.STATE])
        probe.until_connected(wiring.ARM, (), [topics.ARM_EFFORT])

    def tick(self):
        """Publish one tick's samples and wait for the answer."""
        self.stamp += PERIOD
        (mocap, joints, imu), (pose, joint, sample) = self.out, self.writers
        mocap.publish(pose.fill(self.stamp, np.zeros(3), LEVEL))
        joints.publish(joint.stamped(self.stamp))
        before = len(self.efforts)
        imu.publish(sample.fill(self.stamp, np.zeros(3), np.array([0.0, 0.0, 9.81])))
        self.probe.until(lambda: len(self.efforts) > before, f"an answer at {self.stamp} ns")


def test_another_publisher_of_an_inner_topic_is_refused_and_named(start, probe):
    vehicle = Vehicle(probe, start)
    impostor = Node("impostor", context=probe.node.context)
    out = impostor.create_publisher(topics.STATE.type, topics.STATE.name, topics.STATE.qos)
    probe.until_connected(wiring.ARM, [out])
    far = TrajectoryWriter(["x", "y", "z", "roll", "pitch", "yaw", "alpha_1", "alpha_2"])

    def named():
        out.publish(far.fill(vehicle.stamp + PERIOD, np.full((3, 8), 9.0)))
        vehicle.tick()
        return "refused /impostor (" in vehicle.process.output

    probe.until(named, "the impostor to be named")
    assert "publisher is /state_estimator" in vehicle.process.output
    own = [read_state(one)[1] for one in vehicle.states if read_state(one)[1][0, 0] != 9.0]
    assert len(own) >= 1 and np.max(np.abs([state[0, :3] for state in own])) < 0.1
    impostor.destroy_node()


def test_inner_topics_are_thinned_in_flight_answers_are_not(start, probe):
    vehicle = Vehicle(probe, start, "-p", "flight_controller:inner_rate:=50.0")
    for _ in range(TICKS):
        vehicle.tick()
    last = TICKS * PERIOD
    probe.until(lambda: stamp_of(vehicle.states[-1]) == last, "the last state")
    _, *stamps = [stamp_of(message) for message in vehicle.states]
    assert stamps == list(range(5 * PERIOD, TICKS * PERIOD + 1, 5 * PERIOD))
    assert len(vehicle.efforts) == TICKS

    asked = [Parameter("inner_rate", value=0.0).to_parameter_msg()]
    request = SetParameters.Request(parameters=asked)
    (result,) = probe.call(SetParameters, "/flight_controller/set_parameters", request).results
    assert result.successful, result.reason
    before = len(vehicle.states)
    for _ in range(10):
        vehicle.tick()
    probe.until(lambda: len(vehicle.states) == before + 10, "every state")


def test_a_wrong_parameter_is_refused_with_the_name_of_its_node(start):
    wrong = start(FUSED, *port(), "-p", "arm_controller:rate:=5.0")
    assert wrong.process.wait(60) == 2
    assert "flight_controller: arm_controller: rate: unknown" in wrong.output
    absent = start(FUSED, "--ros-args", "-p", "flight_controller:without:=arm")
    assert absent.process.wait(60) == 2
    assert "without: 'arm'; allowed: of state_estimator, mission, " in absent.output


def test_the_process_reports_its_ticks_and_ends_cleanly(start, probe):
    diagnostics = probe.collect(topics.DIAGNOSTICS)
    vehicle = Vehicle(probe, start)

    def reported():
        vehicle.tick()
        found = (one for message in diagnostics for one in message.status)
        own = [one for one in found if one.name == wiring.FLIGHT_CONTROLLER]
        return [values for one in own if (values := _values(one))["ticks"] not in ("0", "")]

    probe.until(reported, "a report with ticks")
    newest = reported()[-1]
    assert newest["nodes"] == ", ".join(wiring.FUSED) and newest["tick mean [ms]"]
    assert newest["one tick"] == "True"
    assert vehicle.process.interrupt(2) == 0
    assert "Traceback" not in vehicle.process.output


def _values(status):
    return {pair.key: pair.value for pair in status.values}
