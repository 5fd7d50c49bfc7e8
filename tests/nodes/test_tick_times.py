"""A node that measures its ticks, on the cores that it may use."""

import os
from pathlib import Path

import numpy as np
from free_port import free_port

from uam_control.coordinates import arm_coordinates, coordinates
from uam_control.stamps import SECOND
from uam_lab.experiments.budget.path import tick_path
from uam_lab.flights.ros.node_arguments import FUSED
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.control import ReferenceWriter
from uam_msgs_py.messages.convert import ImuWriter, JointStateWriter, PoseWriter, TrajectoryWriter
from uam_msgs_py.node import wiring
from uam_msgs_py.node.tick_times import PARTS, read_tick_times

MODULE, NAME = "uam_control.nodes.position_controller", "position_controller"
PERIOD = SECOND // 250  # [ns]
TICKS = 40


def fly(probe, node) -> list[int]:
    """Send TICKS ticks, each after the answer to the one before; return their stamps [ns]."""
    state = TrajectoryWriter(coordinates(2))
    reference, rows = ReferenceWriter(2), np.zeros((3, 8))
    outlets = [probe.publisher(topic) for topic in (topics.REFERENCE, topics.STATE)]
    answers = probe.collect(topics.POSITION_COMMAND)
    probe.until_connected(NAME, outlets, [topics.POSITION_COMMAND])
    stamps = []
    for tick in range(1, TICKS + 1):
        stamp = tick * PERIOD
        outlets[0].publish(reference.fill(stamp, rows, True, 0))
        outlets[1].publish(state.fill(stamp, rows))
        probe.until(lambda tick=tick: len(answers) == tick, "answer")
        stamps.append(stamp)
    return stamps


def test_its_ticks_are_written_at_the_end(start, probe, tmp_path):
    file = tmp_path / "times.npz"
    parameters = ["-p", f"tick_times:={file}", "-p", "tick_times_kept:=30"]
    node = start(MODULE, "--ros-args", *parameters)
    stamps = fly(probe, node)
    assert node.interrupt() == 0
    found = read_tick_times(file)
    assert found["stamp"].tolist() == stamps[-30:]
    spent = sum(found[part] for part in PARTS)
    assert (spent == found["done"] - found["woken"]).all()
    assert (found["woken"] < found["sending"]).all()
    assert (found["sending"] < found["sent"]).all() and (found["sent"] <= found["done"]).all()
    assert (found["done"][:-1] <= found["woken"][1:]).all()
    for part in PARTS:
        assert (found[part] > 0).all(), part


def test_without_the_parameter_there_is_no_file(start, probe, tmp_path):
    node = start(MODULE)
    fly(probe, node)
    assert node.interrupt() == 0
    assert not list(Path(tmp_path).glob("*.npz"))


def test_all_threads_have_the_chosen_cores(start, probe):
    core = max(os.sched_getaffinity(0))
    node = start(MODULE, "--ros-args", "-p", f"cores:='{core}'", "-p", "nice:=3")
    fly(probe, node)
    threads = [int(one.name) for one in Path(f"/proc/{node.process.pid}/task").iterdir()]
    assert len(threads) > 1  # those of Fast DDS, too
    for thread in threads:
        assert os.sched_getaffinity(thread) == {core}
        assert os.getpriority(os.PRIO_PROCESS, thread) == 3


def test_a_node_that_polls_answers_every_tick(start, probe):
    node = start(MODULE, "--ros-args", "-p", "busy_poll:=0.004")
    assert len(fly(probe, node)) == TICKS
    assert node.interrupt() == 0


def test_nodes_of_one_process_share_its_ticks(start, probe, tmp_path):
    every = (wiring.FLIGHT_CONTROLLER, *wiring.FUSED)
    words = ["-p", f"{wiring.BRIDGE}:local_port:={free_port()}"]
    for name in every:
        words += ["-p", f"{name}:tick_times:={tmp_path / name}.npz"]
    node = start(FUSED, "--ros-args", *words)
    mocap, joints, imu = map(probe.publisher, (topics.MOCAP, topics.JOINTS, topics.IMU))
    answers = probe.collect(topics.SETPOINT)
    probe.until_connected(wiring.ESTIMATOR, [mocap, joints, imu])
    probe.until_connected(wiring.BRIDGE, [], [topics.SETPOINT])
    pose, angles, samples = PoseWriter(), JointStateWriter(arm_coordinates(2)), ImuWriter()
    level, gravity = np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 9.81])
    for tick in range(1, TICKS + 1):
        stamp = tick * PERIOD
        mocap.publish(pose.fill(stamp, np.zeros(3), level))
        joints.publish(angles.stamped(stamp))
        imu.publish(samples.fill(stamp, np.zeros(3), gravity))
        probe.until(lambda tick=tick: len(answers) == tick, "answer")
    assert node.interrupt() == 0
    measured = {one: read_tick_times(tmp_path / f"{one}.npz") for one in every}
    path = tick_path((wiring.FLIGHT_CONTROLLER,), measured, wiring.FUSED)
    assert len(path.stamps) > TICKS // 2
    process, *nodes = np.moveaxis(path.times, 1, 0)
    assert (process[:, 1] > 0.0).all()  # take
    for times in nodes:
        assert (times[:, 0] == 0.0).all() and (times[:, 3] > 0.0).all()  # no wake-up, a stage
    columns = measured[wiring.FLIGHT_CONTROLLER]
    rows = np.isin(columns["stamp"], path.stamps)
    whole = 1e-6 * (columns["sent"] - columns["woken"])[rows]
    np.testing.assert_allclose(path.totals, whole, atol=1e-6)
