"""All control nodes, in processes of their own or in one: the numbers are those of the maths."""

from dataclasses import replace

import numpy as np
import pytest
from rcl_interfaces.srv import GetParameters
from std_srvs.srv import SetBool, Trigger

from uam_control.control.controllers import ArmController, AttitudeController, PositionController
from uam_control.control.whole_body import WholeBody
from uam_control.coordinates import arm_coordinates, coordinates
from uam_control.estimation import StateEstimator
from uam_control.mission import Mission, StartParameters, load_scenario
from uam_control.profiles.profile import default_profile
from uam_control.stamps import SECOND
from uam_control.supervision import Readings
from uam_lab.flights.ros.node_arguments import FUSED, WHOLE_BODY
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.control import (
    read_position_command,
    read_reference,
    read_state,
    read_torque,
)
from uam_msgs_py.messages.convert import (
    ImuWriter,
    JointStateWriter,
    PoseWriter,
    TrajectoryWriter,
    read_joint_command,
)
from uam_msgs_py.messages.serialized import Serialized
from uam_msgs_py.messages.status import AutopilotState, MissionStatus
from uam_msgs_py.node.wiring import BRIDGE, READERS, WRITERS, Connections

COORDINATES = coordinates(2)
JOINTS = arm_coordinates(2)

WHOLE_BODY_L1 = "whole_body_l1"
PERIOD = 4_000_000  # [ns]
ARMED_AT = 40 * PERIOD  # take-off follows 0.5 s later
TICKS = 200
SHAKEN = 5.0  # [m/s] largest speed at the start: the samples are noisy
NODES = (
    "state_estimator",
    "mission",
    "position_controller",
    "attitude_controller",
    "arm_controller",
)


def samples():
    """Sensor samples of a vehicle on the ground that is shaken a little: (stamp, imu, mocap...)."""
    generator = np.random.default_rng(7)
    for tick in range(1, TICKS + 1):
        noise = 0.01 * generator.standard_normal(17)
        pose = None
        if tick % 2 == 1:
            quaternion = np.array([1.0, *noise[3:6]])
            pose = (noise[:3], quaternion / np.linalg.norm(quaternion))
        yield (
            tick * PERIOD,
            (noise[6:9], np.array([0.0, 0.0, 9.81]) + noise[9:12]),
            pose,
            (np.array([0.0, np.pi / 2]) + noise[12:14], noise[14:16]),
        )


def expected(law):
    """Return the maths' results for `samples`: state, tau_p, tau_q (None: idle), tau_alpha."""
    sets = default_profile(law).sets
    estimator = StateEstimator(sets["state_estimator"], 2)
    parameters = replace(sets["mission"], start_speed=SHAKEN)
    starts = StartParameters(auto_start=True)
    mission = Mission(load_scenario("pick_and_place"), parameters, starts)
    known = Readings(mocap_age=0.0, joint_age=0.0, controller_age=0.0, autopilot_age=0.0)
    position = PositionController(sets["position_controller"])
    attitude = AttitudeController(sets["attitude_controller"])
    arm = ArmController(sets["arm_controller"])
    whole, dt = WholeBody(position, attitude, arm), PERIOD / SECOND
    for stamp, imu, pose, joints in samples():
        time = stamp / SECOND
        if pose is not None:
            estimator.mocap(time, *pose)
        estimator.joints(time, *joints)
        estimator.imu(time, *imu)
        state = estimator.update()
        output = mission.output
        flying = output.flying
        if law == WHOLE_BODY_L1 and flying:
            whole.update(state, output.reference, dt)
            of = whole.arrays
            outputs = (one.all.tau for one in (of.position, of.attitude, of.arm))
        else:
            desired = position.attitude_reference
            outputs = (
                position.update(state, output.reference, flying, dt),
                attitude.update(state, output.reference, desired, flying, dt),
                arm.update(state, output.reference, desired, flying, dt),
            )
        tau_p, tau_q, tau_alpha = (one.copy() for one in outputs)
        yield state.copy(), tau_p if flying else None, tau_q if flying else None, tau_alpha
        armed = ARMED_AT / SECOND if stamp >= ARMED_AT else None
        mission.step((stamp + PERIOD) / SECOND, state, armed, known)


class Plant:
    """Publishes the samples of a tick and collects the nodes' messages."""

    def __init__(self, probe):
        self.probe = probe
        self.connections = Connections(probe.node)
        self.mocap = probe.publisher(topics.MOCAP)
        self.joints = probe.publisher(topics.JOINTS)
        self.imu = probe.publisher(topics.IMU)
        self.autopilot = probe.publisher(topics.AUTOPILOT_STATE)
        self.states = probe.collect(topics.STATE)
        self.references = probe.collect(topics.REFERENCE)
        self.position = probe.collect(topics.POSITION_COMMAND)
        self.attitude = probe.collect(topics.ATTITUDE_COMMAND)
        self.effort = probe.collect(topics.ARM_EFFORT)
        self.magnet = probe.collect(topics.MAGNET)
        self.status = probe.collect(topics.MISSION_STATUS)
        self.arming = probe.collect(topics.ARMING)
        self.adaptation = probe.collect(topics.ATTITUDE_ADAPTATION)
        self.received = (
            *(topics.STATE, topics.REFERENCE, topics.POSITION_COMMAND, topics.ATTITUDE_COMMAND),
            *(topics.ARM_EFFORT, topics.MAGNET),
        )
        self.pose, self.joint, self.imu_writer = PoseWriter(), JointStateWriter(JOINTS), ImuWriter()

    def wait_for_connections(self):
        """Return when both ends of every connection have found each other.

        One end is not enough: a subscriber drops messages of a publisher that it has not found yet.
        """
        reported = self.connections
        readers = {  # the probe subscribes to all topics but the sensors
            ("state_estimator", topics.STATE.name): 5,
            ("mission", topics.REFERENCE.name): 4,
            ("mission", topics.MAGNET.name): 1,
            ("position_controller", topics.POSITION_COMMAND.name): 4,
            ("attitude_controller", topics.ATTITUDE_COMMAND.name): 1,
            ("arm_controller", topics.ARM_EFFORT.name): 1,
        }
        both = (topics.STATE, topics.REFERENCE)
        inputs = {
            "state_estimator": (topics.IMU, topics.JOINTS, topics.MOCAP),
            "mission": (topics.STATE, topics.AUTOPILOT_STATE),
            "position_controller": both,
            "attitude_controller": (*both, topics.POSITION_COMMAND),
            "arm_controller": (*both, topics.POSITION_COMMAND),
        }
        self.probe.until(
            lambda: (
                all(
                    reported.count(end[0], READERS, end[1]) >= count
                    for end, count in readers.items()
                )
                and all(
                    reported.count(node, WRITERS, t.name)
                    for node, own in inputs.items()
                    for t in own
                )
                and all(p.get_subscription_count() for p in (self.imu, self.joints, self.mocap))
                and all(self.probe.has_writers(topic) for topic in self.received)
            ),
            "connections",
        )

    def tick(self, number, stamp, imu, pose, joints):
        """Publish one tick's samples and wait for all answers to it."""
        if pose is not None:
            self.mocap.publish(self.pose.fill(stamp, *pose))
        self.joint.position[:], self.joint.velocity[:] = joints
        self.joints.publish(self.joint.stamped(stamp))
        self.imu.publish(self.imu_writer.fill(stamp, *imu))
        if (stamp - ARMED_AT) % (25 * PERIOD) == 0:
            armed = stamp >= ARMED_AT
            state = AutopilotState(True, "OFFBOARD", armed, ARMED_AT if armed else None)
            self.autopilot.publish(state.to_message(stamp))
        answers = (self.states, self.position, self.attitude, self.effort, self.magnet)
        self.probe.until(
            lambda: all(len(messages) > number for messages in answers), f"answers to tick {number}"
        )


def start_separately(start, law):
    started = ("--ros-args", "-p", "auto_start:=true", "-p", f"start_speed:={SHAKEN}")
    whole = law == WHOLE_BODY_L1
    for name in NODES[:2] if whole else NODES:
        start(f"uam_control.nodes.{name}", *(started if name == "mission" else ()))
    if whole:
        laws = (word for name in NODES[2:] for word in ("-p", f"{name}:law:={law}"))
        start(WHOLE_BODY, "--ros-args", *laws)


def start_fused(start, law):
    given = {"mission:auto_start": "true", "mission:start_speed": SHAKEN}
    given |= {f"{name}:law": law for name in NODES[2:]}
    given["flight_controller:without"] = BRIDGE
    words = (word for name, value in given.items() for word in ("-p", f"{name}:={value}"))
    start(FUSED, "--ros-args", *words)


@pytest.mark.parametrize("law", ["modular", WHOLE_BODY_L1])
@pytest.mark.parametrize("layout", [start_separately, start_fused])
def test_the_nodes_compute_what_the_maths_does_bit_for_bit(start, probe, layout, law):
    layout(start, law)
    plant = Plant(probe)
    plant.wait_for_connections()
    for number, sample in enumerate(samples()):
        plant.tick(number, *sample)
    probe.until(lambda: len(plant.references) > TICKS, "the reference of the tick after the last")

    airborne = 0
    for i, (state, tau_p, tau_q, tau_alpha) in enumerate(expected(law)):
        stamp = (i + 1) * PERIOD
        at, published = read_state(plant.states[i])
        assert at == stamp
        np.testing.assert_array_equal(published, state)
        at, command = read_position_command(plant.position[i])
        assert at == stamp and command.flying == (tau_p is not None)
        at, torque = read_torque(plant.attitude[i])
        assert at == stamp and (torque is None) == (tau_q is None)
        np.testing.assert_array_equal(read_joint_command(plant.effort[i], JOINTS), tau_alpha)
        if tau_p is not None:
            airborne += 1
            np.testing.assert_array_equal(command.tau, tau_p)
            np.testing.assert_array_equal(torque, tau_q)
    assert airborne == TICKS - (ARMED_AT + 500_000_000) // PERIOD + 1

    for topic, messages in (
        (topics.STATE, plant.states),
        (topics.REFERENCE, plant.references),
        (topics.POSITION_COMMAND, plant.position),
        (topics.ATTITUDE_COMMAND, plant.attitude),
    ):
        frames = {Serialized(topic.type, message).layout.frame for message in messages}
        assert frames == {topic.frame}, topic.name

    stamps = [read_reference(message)[0] for message in plant.references]
    assert stamps == [(i + 1) * PERIOD for i in range(TICKS + 1)]  # the last is one tick ahead
    assert len(plant.effort) == len(plant.magnet) == TICKS
    assert [message.data for message in plant.arming] == [False, True]
    phases = [MissionStatus.from_message(message)[1].phase for message in plant.status]
    assert list(dict.fromkeys(phases)) == ["waiting", "take-off"]
    assert len(plant.adaptation) == pytest.approx(TICKS * 0.004 * 50, abs=1)


def test_a_state_with_nan_is_refused_and_the_next_one_used(start, probe):
    mission = start("uam_control.nodes.mission")
    states, magnet = probe.publisher(topics.STATE), probe.collect(topics.MAGNET)
    writer = TrajectoryWriter(COORDINATES)
    probe.until_connected("mission", [states], [topics.MAGNET])
    state = np.zeros((3, 8))
    state[1, 2] = np.nan
    states.publish(writer.fill(PERIOD, state))
    mission.until_logged("/uam/state: refused /probe (1 messages): velocities of z is nan, not fin")
    stamp = PERIOD

    def answered():
        nonlocal stamp
        stamp += PERIOD
        states.publish(writer.fill(stamp, np.zeros((3, 8))))
        return magnet

    probe.until(answered, "a good state to be used")


@pytest.mark.parametrize("layout", [start_separately, start_fused])
def test_the_node_of_the_whole_body_acts_on_all_three_controllers(start, probe, layout):
    def adapts(node):
        request = GetParameters.Request(names=["adapt"])
        return probe.call(GetParameters, f"/{node}/get_parameters", request).values[0].bool_value

    layout(start, WHOLE_BODY_L1)
    name = "/whole_body_controller/freeze_adaptation"
    for frozen in (True, False):
        answer = probe.call(SetBool, name, SetBool.Request(data=frozen))
        assert answer.success and answer.message.count("adapted gains") == 3
        assert [adapts(node) for node in NODES[2:]] == 3 * [not frozen]
    answer = probe.call(Trigger, "/whole_body_controller/reset_adaptation", Trigger.Request())
    assert answer.success and answer.message.count("at their initial values") == 3
