"""Nodes started by hand: nothing arms until /mission/start; reset; restart of a node."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import rclpy
from rclpy.node import Node
from std_srvs.srv import Trigger

from uam_lab.flights.operator import NoFlight, Operator
from uam_lab.flights.processes.node_environment import ros_environment
from uam_lab.flights.ros.node_arguments import MODULES
from uam_msgs_py.messages import topics
from uam_msgs_py.node import wiring
from uam_sim_bridge.ports import Reservation

pytestmark = pytest.mark.slow

PATIENCE = 90.0  # [s] only a failing test waits that long
# the order of docs/commands.md
ORDER = (
    wiring.PLANT,
    wiring.ESTIMATOR,
    wiring.POSITION,
    wiring.ATTITUDE,
    wiring.ARM,
    wiring.BRIDGE,
    wiring.MISSION,
    wiring.SCENE,
)


class ByHand:
    """The nodes and the autopilot, each a process; `operator` speaks to them."""

    def __init__(self, ports, folder, scenario):
        self.folder, self.running = folder, {}
        self.environment = os.environ | ros_environment(ports.domain, folder)
        hil, scene = f"hil_port:={ports.simulator_tcp}", f"scenario:={scenario}"
        bridge = [f"local_port:={ports.offboard_udp}", f"autopilot_port:={ports.autopilot_udp}"]
        bridge.append(f"autopilot_system:={ports.instance + 1}")
        self.options = {wiring.PLANT: [hil], wiring.BRIDGE: bridge}
        self.options |= {wiring.MISSION: [scene], wiring.SCENE: [scene]}
        code = "import sys; from uam_sim_bridge.autopilot.server import main; sys.exit(main())"
        self.launch("autopilot", code, ["--instance", str(ports.instance), "--wait", "60"])
        for name in ORDER:
            self.start(name)
        self.context = rclpy.Context()
        os.environ.update(ros_environment(ports.domain, folder))
        rclpy.init(context=self.context)
        self.node = Node("tester", context=self.context)
        self.operator = Operator(self.node)
        self.heights, self.armings = [], []
        self.listen(topics.TRUTH_STATE, lambda m: self.heights.append(m.points[0].positions[2]))
        self.listen(topics.ARMING, lambda m: self.armings.append(m.data))

    def listen(self, topic, note):
        self.node.create_subscription(topic.type, topic.name, note, topic.qos)

    def start(self, name):
        options = [word for one in self.options.get(name, []) for word in ("-p", one)]
        code = f"import sys; from {MODULES[name]} import main; sys.exit(main())"
        self.launch(name, code, ["--ros-args", *options])

    def launch(self, name, code, arguments):
        with (self.folder / f"{name}.txt").open("ab") as output:
            self.running[name] = subprocess.Popen(
                [sys.executable, "-c", code, *arguments],
                stdout=output,
                stderr=subprocess.STDOUT,
                env=self.environment,
            )

    def stop(self, name, number=signal.SIGKILL):
        process = self.running.pop(name)
        process.send_signal(number)
        process.wait(PATIENCE)

    def said(self, name):
        return (self.folder / f"{name}.txt").read_text()

    def until(self, condition, what):
        end = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < end, f"{what}; {self.statuses()}"
            self.operator.look(0.05)

    def statuses(self):
        texts = {name: self.said(name)[-600:] for name in (*ORDER, "autopilot")}
        return "\n".join(f"--- {name}\n{text}" for name, text in texts.items())

    def begin(self):
        """Call /mission/start until the pre-arm report is green."""
        end = time.monotonic() + PATIENCE
        while True:
            try:
                accepted, text = self.operator.command("start")
            except NoFlight as absent:
                accepted, text = False, str(absent)
            if accepted:
                return
            assert time.monotonic() < end, f"{text}\n{self.statuses()}"
            time.sleep(0.2)

    def fly(self):
        """Start, fly to the end; return the largest true height and the largest error."""
        self.heights.clear()
        self.begin()
        worst = 0.0

        def over():
            nonlocal worst
            status = self.operator.mission()
            worst = max(worst, status.position_error)
            return status.done and status.time > 0.0 and status.phase in ("landed", "aborted")

        self.until(lambda: not self.operator.mission().done, "the flight to begin")
        self.until(over, "the flight to end")
        status = self.operator.mission()
        assert status.phase == "landed" and status.abort_reason == "", status
        return max(self.heights), worst

    def call(self, service):
        client = self.node.create_client(Trigger, service)
        self.until(client.service_is_ready, service)
        future = client.call_async(Trigger.Request())
        self.until(future.done, f"answer of {service}")
        return future.result()

    def end(self):
        for process in self.running.values():
            process.send_signal(signal.SIGINT)
        for process in self.running.values():
            try:
                process.wait(10.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        self.node.destroy_node()
        self.context.try_shutdown()


@pytest.fixture
def by_hand(tmp_path, short_scenario):
    with Reservation() as reservation:
        made = ByHand(reservation.ports, tmp_path, short_scenario)
        yield made
        made.end()


def test_nodes_by_hand_fly_twice_and_after_a_restart_of_the_simulator(by_hand):
    ticks = []
    by_hand.listen(topics.TRUTH_STATE, lambda m: ticks.append(m.header.stamp.sec))
    by_hand.until(lambda: ticks and ticks[-1] >= 6, "six seconds of simulation")
    assert not any(by_hand.armings), "nothing arms by itself"
    assert by_hand.operator.mission().phase == "waiting"
    assert not by_hand.operator.autopilot().armed

    first = by_hand.fly()
    assert first[0] > 0.5
    assert by_hand.running[wiring.PLANT].poll() is None, "the simulator goes on"
    by_hand.until(lambda: not by_hand.operator.autopilot().armed, "disarmed")
    answer = by_hand.call("mujoco_sim/reset")
    assert answer.success, answer.message
    second = by_hand.fly()
    np.testing.assert_allclose(second, first, atol=0.03)

    by_hand.stop(wiring.PLANT)
    by_hand.until(lambda: "waiting for" in by_hand.said(wiring.ESTIMATOR)[-400:], "a report")
    ticks.clear()
    by_hand.start(wiring.PLANT)
    by_hand.until(lambda: len(ticks) > 250, "ticks of the new simulator")
    third = by_hand.fly()
    np.testing.assert_allclose(third, first, atol=0.03)


def test_every_node_may_be_stopped_and_started(by_hand):
    first = by_hand.fly()
    for name in (wiring.ESTIMATOR, wiring.ARM, wiring.BRIDGE):
        by_hand.stop(name)
        by_hand.until(lambda: "time goes on without it" in by_hand.said(wiring.PLANT), "a report")
        by_hand.start(name)
    # the simulator is lost in flight: the next flight begins from the ground
    by_hand.begin()
    by_hand.until(lambda: by_hand.operator.mission().state == "flying", "a flight")
    by_hand.stop(wiring.PLANT)
    by_hand.start(wiring.PLANT)
    np.testing.assert_allclose(by_hand.fly(), first, atol=0.03)
    # neither mission nor simulator is left: the estimator is older than both
    by_hand.stop(wiring.MISSION)
    by_hand.stop(wiring.PLANT)
    by_hand.start(wiring.MISSION)
    by_hand.start(wiring.PLANT)
    np.testing.assert_allclose(by_hand.fly(), first, atol=0.03)
