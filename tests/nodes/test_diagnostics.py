"""Diagnostics of every node: level, loop time, ages of its inputs."""

import numpy as np
import pytest
from free_port import free_port

from uam_control.coordinates import arm_coordinates, coordinates
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.control import PositionCommandWriter, ReferenceWriter
from uam_msgs_py.messages.convert import ImuWriter, JointStateWriter, PoseWriter, TrajectoryWriter
from uam_msgs_py.messages.status import ERROR, OK, STALE, WARN

COORDINATES = coordinates(2)
SIZE = len(COORDINATES)
JOINTS = arm_coordinates(2)

NODES = {
    "uam_control.nodes.position_controller": "/uam/state",
    "uam_control.nodes.attitude_controller": "/uam/position/command",
    "uam_control.nodes.arm_controller": "/uam/reference",
    "uam_control.nodes.state_estimator": "/imu/data",
    "uam_control.nodes.mission": "/uam/state",
    "uam_sim_bridge.nodes.mavlink_bridge": "/uam/attitude/command",
    "uam_sim_bridge.nodes.mujoco_sim": "/uam/setpoint",
    "uam_lab.cockpit.scene": "/uam/mission/status",
    "uam_lab.records.recorder": "/uam/state",
}


def arguments(name, folder):
    """Return arguments with free ports and a temporary file."""
    own = {
        "mujoco_sim": [f"hil_port:={free_port()}"],
        "mavlink_bridge": [f"local_port:={free_port()}"],
        "recorder": [f"file:={folder / 'log.mcap'}"],
    }.get(name, [])
    return ["--ros-args", *(word for value in own for word in ("-p", value))]


class NodeDiagnostics:
    """The newest diagnostics of a node."""

    def __init__(self, probe, name):
        self._name, self._heard = name, probe.collect(topics.DIAGNOSTICS)

    @property
    def status(self):
        found = [s for m in self._heard for s in m.status if s.name == self._name]
        return found[-1] if found else None

    @property
    def values(self):
        return {pair.key: pair.value for pair in self.status.values} if self.status else {}


@pytest.mark.parametrize("module", NODES)
def test_every_node_reports_level_loop_time_and_ages(start, probe, tmp_path, module):
    name = module.rpartition(".")[2]
    found = NodeDiagnostics(probe, name)
    start(module, *arguments(name, tmp_path))
    probe.until(lambda: found.status, f"diagnostics of {name}")
    loop = "poll" if name == "recorder" else "tick"
    assert {f"{loop} mean [ms]", f"{loop} max [ms]"} <= set(found.values)
    assert found.values[f"age of {NODES[module]} [ms]"] == "", "no message yet"
    if name != "recorder":
        probe.until(lambda: found.status.level == STALE, f"{name} to report that it waits")
        assert "waiting for" in found.status.message


def test_loop_time_and_age_are_those_of_the_work(start, probe):
    """A mission with inputs: it runs, a tick takes a fraction of a period, its input is new."""
    found = NodeDiagnostics(probe, "mission")
    start("uam_control.nodes.mission")
    outlet, writer = probe.publisher(topics.STATE), TrajectoryWriter(COORDINATES)
    probe.until_connected("mission", [outlet])
    stamp = 0

    def fed():
        nonlocal stamp
        stamp += 4_000_000
        outlet.publish(writer.fill(stamp, np.zeros((3, SIZE))))
        status = found.status
        if not (status and status.level == OK and found.values["tick mean [ms]"]):
            return False
        return float(found.values["age of /uam/state [ms]"]) < 1000.0  # more after a stall

    probe.until(fed, "a report of work on a new input")
    mean, most = (float(found.values[f"tick {kind} [ms]"]) for kind in ("mean", "max"))
    assert 0.0 < mean <= most
    assert float(found.values["age of /uam/state [ms]"]) >= 0.0
    assert found.values["age of /uam/autopilot/state [ms]"] == ""
    probe.until(lambda: found.status.level == STALE, "it waits again")
    assert float(found.values["age of /uam/state [ms]"]) > 1000.0


def test_an_estimator_that_diverges_says_so_and_is_silent_for_a_second(start, probe):
    found = NodeDiagnostics(probe, "state_estimator")
    node = start("uam_control.nodes.state_estimator")
    mocap, joints, imu = map(probe.publisher, (topics.MOCAP, topics.JOINTS, topics.IMU))
    states = probe.collect_raw(topics.STATE)
    probe.until_connected("state_estimator", [mocap, joints, imu])
    pose, joint, sample = PoseWriter(), JointStateWriter(JOINTS), ImuWriter()
    stamp, force = 0, 9.81

    def fed(level):
        nonlocal stamp
        stamp += 4_000_000
        position = np.array([1e-12 * stamp, 0.0, 0.0])
        mocap.publish(pose.fill(stamp, position, np.array([1.0, 0.0, 0.0, 0.0])))
        joints.publish(joint.stamped(stamp))
        imu.publish(sample.fill(stamp, np.zeros(3), np.array([0.0, 0.0, force])))
        return found.status and found.status.level == level and states

    probe.until(lambda: fed(OK), "states")
    force = 1e12  # of an IMU gone mad
    before = len(states)
    probe.until(lambda: fed(ERROR), "an error")
    assert "the estimate has diverged" in found.status.message
    node.until_logged("the estimate has diverged")
    known = len(states)
    probe.until(lambda: fed(ERROR) and found.status, "the same")
    assert len(states) == known > 0 and known < before + 100
    assert int(found.values["estimates begun anew"]) >= 1
    force = 9.81
    probe.until(lambda: fed(OK), "states again")


def test_an_estimator_reports_rejected_poses(start, probe):
    found = NodeDiagnostics(probe, "state_estimator")
    start("uam_control.nodes.state_estimator")
    mocap, joints, imu = map(probe.publisher, (topics.MOCAP, topics.JOINTS, topics.IMU))
    probe.until_connected("state_estimator", [mocap, joints, imu])
    pose, joint, sample = PoseWriter(), JointStateWriter(JOINTS), ImuWriter()
    noise = np.random.default_rng(1)
    stamp, jump = 0, 0.0

    def fed():
        nonlocal stamp
        stamp += 4_000_000
        position = np.array([jump, 0.0, 0.0]) + 1e-4 * noise.standard_normal(3)
        mocap.publish(pose.fill(stamp, position, np.array([1.0, 0.0, 0.0, 0.0])))
        joints.publish(joint.stamped(stamp))
        imu.publish(sample.fill(stamp, np.zeros(3), np.array([0.0, 0.0, 9.81])))
        return found.status and found.status.level == (WARN if jump else OK)

    probe.until(lambda: fed() and stamp > 1_500_000_000, "an estimator that is content")
    assert found.values["poses refused"] == "0"
    jump = 1.0
    probe.until(fed, "a warning")
    assert "new poses refused: too far from the estimate" in found.status.message
    assert int(found.values["poses refused"]) > 0


def test_a_hand_that_is_not_stabilised_any_more_is_announced(start, probe):
    """A straight arm hangs: its hand cannot go up or down."""
    found = NodeDiagnostics(probe, "arm_controller")
    start("uam_control.nodes.arm_controller", "--ros-args", "-p", "hand_bandwidth:=10.0")
    inputs = topics.STATE, topics.REFERENCE, topics.POSITION_COMMAND
    state, reference, position = map(probe.publisher, inputs)
    probe.until_connected("arm_controller", [state, reference, position])
    states, references, positions = (
        TrajectoryWriter(COORDINATES),
        ReferenceWriter(2),
        PositionCommandWriter(),
    )
    rows, stamp = np.zeros((3, SIZE)), 0

    def told(bend, level, text):
        nonlocal stamp
        stamp, rows[0, -1] = stamp + 4_000_000, bend
        state.publish(states.fill(stamp, rows))
        reference.publish(references.fill(stamp, rows, True, stamp))
        position.publish(positions.fill(stamp, rows, np.zeros((3, 3)), np.zeros(3)))
        now = found.values.get("hand's stabilisation", "")
        return found.status and found.status.level == level and text in now

    probe.until(lambda: told(1.5, OK, "acts"), "a hand that is stabilised")
    probe.until(lambda: told(0.0, WARN, "fades out: near a singular posture"), "a warning")
    assert "the hand's stabilisation fades out" in found.status.message
