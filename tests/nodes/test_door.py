"""Messages that cannot be used end no node: they are refused, counted and named in /diagnostics."""

import time

import pytest
from rclpy.qos import QoSProfile

from uam_msgs_py.messages import topics
from uam_msgs_py.messages.status import ERROR
from uam_msgs_py.node.answering import answered
from uam_msgs_py.node.door import Door
from uam_msgs_py.node.executor import LeanExecutor

BROKEN = (b"", b"\0", bytes.fromhex("00010000ffffffff"), b"\0\1\0\0" + b"\xff" * 60)


def test_a_node_refuses_broken_messages_and_says_so(start, probe):
    reports, state = probe.collect(topics.DIAGNOSTICS), probe.publisher(topics.AUTOPILOT_STATE)
    mission = start("uam_control.nodes.mission")
    probe.until(lambda: state.get_subscription_count(), "the mission listens")

    def named():
        for data in BROKEN:
            state.publish(data)
        errors = [s for m in reports for s in m.status if s.level == ERROR]
        return any("/uam/autopilot/state: refused" in one.message for one in errors)

    probe.until(named, "the refusal is named")
    mission.until_logged("/uam/autopilot/state: refused")
    assert mission.interrupt() == 0


def test_the_executor_hands_on_good_messages_after_broken_ones(probe):
    """rclpy's own take would discard broken ones and report that there is no message."""
    node, topic = probe.node, topics.AUTOPILOT_STATE
    out = node.create_publisher(topic.type, "fuzzed", QoSProfile(depth=20))
    heard = []

    def hear(message):
        heard.append(message)
        if len(heard) == 1:
            raise RecursionError("too deep")

    inlet = node.create_subscription(topic.type, "fuzzed", hear, QoSProfile(depth=20))
    probe.until(lambda: out.get_subscription_count(), "a connection")
    for data in (*BROKEN, topic.type(), topic.type()):
        out.publish(data)
    node.door = Door(node)
    executor = LeanExecutor(node)
    end = time.monotonic() + 20.0
    while len(heard) < 2 and time.monotonic() < end:
        executor.spin_once(0.1)
    assert len(heard) == 2
    assert node.door.refusals.count >= 3  # the middleware may not send all
    (line,) = node.door.news()
    assert line.startswith("/fuzzed: refused /probe (") and "RecursionError: too deep" in line
    assert node.door.news() == []  # told once
    assert node.door.values()["messages refused"] == node.door.refusals.count
    executor.shutdown()
    node.destroy_subscription(inlet)


def test_a_program_without_diagnostics_logs_a_refusal_at_most_every_two_seconds(probe, monkeypatch):
    node, topic, lines = probe.node, topics.FAULTS, []
    monkeypatch.setattr(type(node.get_logger()), "warning", lambda self, text: lines.append(text))
    door = Door(node, tells=True)
    inlet = door.listen(topic)
    for number in range(5):
        door.refuse(inlet, ValueError(f"bad {number}"))
    assert lines == ["/uam/faults: message refused: ValueError: bad 0"]
    assert door.refusals.count == 5


def test_a_request_that_cannot_be_read_ends_no_node():
    class Handle:
        def service_take_request(self, kind):
            raise RuntimeError("no request")

    class Service:
        handle, service_name, logger_name = Handle(), "/a", "a"

        class srv_type:
            Request = None

    assert answered(Service())


@pytest.mark.parametrize("topic", [topics.ROSOUT, topics.DIAGNOSTICS, topics.TF, topics.GOAL_POSE])
def test_a_recorder_in_a_namespace_outlives_broken_messages(start, probe, tmp_path, topic):
    out = probe.node.create_publisher(topic.type, topic.name, topic.qos)
    if topic is topics.GOAL_POSE:
        out = probe.node.create_publisher(topic.type, f"/uav1/{topic.name}", topic.qos)
    reports = probe.collect(topics.DIAGNOSTICS)
    file = tmp_path / "log.mcap"
    recorder = start(
        "uam_lab.records.recorder", "--ros-args", "-r", "__ns:=/uav1", "-p", f"file:={file}"
    )
    probe.until(lambda: out.get_subscription_count() >= 1, "the recorder listens")

    due, pause = 0.0, 0.3 if topic is topics.DIAGNOSTICS else 0.0  # of the report's own topic

    def named():
        nonlocal due
        if time.monotonic() >= due:
            due = time.monotonic() + pause
            for data in BROKEN:
                out.publish(data)
        statuses = [s for m in reports for s in m.status if s.name == "uav1/recorder"]
        reports.clear()
        return any(": refused /probe (" in one.message for one in statuses)

    probe.until(named, "the refusal is named")
    assert recorder.interrupt() == 0
    assert file.stat().st_size > 0
