"""Fixtures of the node tests: real ROS on the local machine, in a separate domain."""

import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import rclpy
from bridge_rig import Rig
from node_forks import Forked, Forks
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from uam_lab.flights.processes.node_environment import ros_environment
from uam_msgs_py.messages.serialized import stays_serialized
from uam_msgs_py.node.wiring import READERS, WRITERS, Connections
from uam_sim_bridge.ports import Reservation

PATIENCE = 60.0  # s, time limit of a wait


@pytest.fixture(scope="session", autouse=True)
def domain(tmp_path_factory) -> Iterator[int]:
    """A ROS domain that no other flight or test uses."""
    with Reservation() as reservation:
        logs = tmp_path_factory.mktemp("ros_log")
        os.environ.update(ros_environment(reservation.ports.domain, logs))
        yield reservation.ports.domain


class Probe:
    """A node of the test and its executor."""

    def __init__(self, context):
        self.node = Node("probe", context=context)
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self.node)
        self._connections = Connections(self.node)

    def until(self, condition: Callable[[], object], what: str) -> None:
        """Spin until `condition()`; fail after PATIENCE with `what` in the error."""
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline, f"{what}: not within {PATIENCE:g} s"
            self._executor.spin_once(timeout_sec=0.02)

    def collect(self, topic) -> list:
        """Return a list of the received messages of `topic`, serialized if the nodes read it so."""
        messages, raw = [], stays_serialized(topic.type)
        self.node.create_subscription(topic.type, topic.name, messages.append, topic.qos, raw=raw)
        return messages

    def collect_raw(self, topic) -> list:
        """Return a list of the received messages of `topic`, all serialized."""
        messages = []
        self.node.create_subscription(topic.type, topic.name, messages.append, topic.qos, raw=True)
        return messages

    def publisher(self, topic):
        """Return a publisher of `topic`."""
        return self.node.create_publisher(topic.type, topic.name, topic.qos)

    def until_connected(self, node: str, publishers=(), receives=()) -> None:
        """Wait until `node` is connected to `publishers` and topics `receives` of the test.

        Both ends must be connected: a best-effort subscriber loses earlier messages.
        """
        reported = self._connections
        self.until(
            lambda: (
                all(
                    p.get_subscription_count() and reported.count(node, WRITERS, p.topic_name)
                    for p in publishers
                )
                and all(
                    reported.count(node, READERS, topic.name) and self.has_writers(topic)
                    for topic in receives
                )
            ),
            f"{node} to be connected",
        )

    def has_writers(self, topic) -> bool:
        """Return whether each of the test's subscriptions to `topic` has a publisher."""
        ours = [s for s in self.node.subscriptions if s.topic_name.endswith(topic.name)]
        return all(listener.get_publisher_count() for listener in ours)

    def call(self, kind, name: str, request):
        """Call a service and return its response."""
        client = self.node.create_client(kind, name)
        self.until(client.service_is_ready, f"service {name}")
        future = client.call_async(request)
        self.until(future.done, f"answer of {name}")
        self.node.destroy_client(client)
        return future.result()


@pytest.fixture
def probe() -> Iterator[Probe]:
    """A node in the test's own process."""
    context = rclpy.Context()
    rclpy.init(context=context)
    made = Probe(context)
    yield made
    made.node.destroy_node()
    context.try_shutdown()


class Running:
    """A node in a separate process; its output goes to a file."""

    def __init__(self, process: Forked, log: Path):
        self.process, self.log = process, log

    @property
    def output(self) -> str:
        """Return the output so far."""
        return self.log.read_text()

    def until_logged(self, text: str) -> None:
        """Wait until the node has printed `text`."""
        deadline = time.monotonic() + PATIENCE
        while text not in self.output:
            assert self.process.poll() is None, f"ended before saying {text!r}:\n{self.output}"
            assert time.monotonic() < deadline, f"no output {text!r}:\n{self.output}"
            time.sleep(0.05)

    def interrupt(self, times: int = 1, number: int = signal.SIGINT) -> int:
        """Send SIGINT (several times in a row) and return the exit status."""
        for _ in range(times):
            self.process.send_signal(number)
            time.sleep(0.005)
        return self.process.wait(PATIENCE)


@pytest.fixture(scope="session")
def forks() -> Iterator[Forks]:
    """The process that has imported the nodes."""
    made = Forks()
    yield made
    made.close()


@pytest.fixture
def start(forks, tmp_path) -> Iterator[Callable[..., Running]]:
    """start(module, *arguments) runs module.main() in a process that ends with the test."""
    running: list[Running] = []

    def launch(module: str, *arguments: object, publishers: str = "any") -> Running:
        """publishers: the node's parameter; by default the probe may publish every topic."""
        if (".nodes." in module or module.startswith("uam_lab.")) and publishers:
            arguments = (*arguments, "--ros-args", "-p", f"publishers:={publishers}")
        log = tmp_path / f"node_{len(running)}.log"
        node = Running(forks.start(module, [str(one) for one in arguments], log), log)
        running.append(node)
        return node

    yield launch
    for node in running:
        node.process.kill()
        node.process.wait(PATIENCE)


@pytest.fixture
def make_rig(probe, start):
    rigs = []

    def make(*arguments):
        rigs.append(Rig(probe, start, *arguments))
        return rigs[-1]

    yield make
    for rig in rigs:
        rig.socket.close()
