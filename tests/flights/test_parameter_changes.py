"""500 random parameter changes in one flight: the flight continues, the log has all of them."""

import json
import math
import random
from collections import Counter

import numpy as np
import pytest
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter

from uam_control.profiles.profile import load_profile
from uam_control.settings.parameter_set import Bound
from uam_control.stamps import SECOND
from uam_lab.flights.processes.guest import Guest
from uam_lab.flights.processes.node_environment import transport_environment
from uam_lab.records.results import timeseries
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.flight_events import ParameterChange
from uam_msgs_py.messages.layouts import stamp_of
from uam_msgs_py.node.door import Door

NODES = ("position_controller", "attitude_controller", "arm_controller", "state_estimator")
COUNT = 500
ANSWER_TIME = 0.25  # [s] of simulated time


def valid(generator, kept):
    """A gain within 5 % of what the profile flies."""
    specs = kept.specs()
    names = [n for n, s in specs.items() if isinstance(s, Bound) and np.all(getattr(kept, n))]
    name = generator.choice(names)
    value = getattr(kept, name)
    near = [x * generator.uniform(0.95, 1.05) for x in np.atleast_1d(value).tolist()]
    spec = specs[name]
    near = [min(max(x, spec.low), spec.high) for x in near]
    return name, near if isinstance(value, tuple) else near[0]


def invalid(generator, kept):
    """Something that must not fly."""
    name, value = valid(generator, kept)
    size = len(value) if isinstance(value, list) else 0
    wrong = generator.choice([
        (name, -1.0 if not size else [-1.0] * size),
        (name, math.nan if not size else [math.nan] * size),
        (name, math.inf if not size else [math.inf] * size),
        (name, [1.0] * (size + 1)),
        (name, "much"),
        (name, True),
        ("no_such_gain", 1.0),
    ])  # fmt: skip
    return wrong


class Tuner:
    """Asks the nodes of a flight, each one thing at a time."""

    def __init__(self, guest):
        self.node = guest.node
        self.executor = SingleThreadedExecutor(context=guest.context)
        self.executor.add_node(self.node)
        service = "set_parameters_atomically"
        self.clients = {
            node: self.node.create_client(SetParametersAtomically, f"/{node}/{service}")
            for node in NODES
        }
        self._clock = Door(self.node).listen(topics.CLOCK, raw=True)
        self._now = 0
        self.reported = []  # (stamp [ns], change)
        topic = topics.CHANGES
        self._changes = self.node.create_subscription(
            topic.type,
            topic.name,
            lambda m: self.reported.append(ParameterChange.from_message(m)),
            topic.qos,
        )

    def now(self):
        """Simulation time [ns]."""
        taken = self._clock.handle.take_message(self._clock.msg_type, True)
        if taken is not None:
            self._now = stamp_of(taken[0])
        return self._now

    def ask(self, requests, going_on):
        """Send `requests`: (node, name, value); return (simulation time [ns], outcome) of each."""
        waiting = {node: [] for node in NODES}
        for number, (node, *_) in enumerate(requests):
            waiting[node].append(number)
        answers, underway = [None] * len(requests), {}
        while None in answers:
            going_on()
            for node, numbers in waiting.items():
                if node in underway or not numbers:
                    continue
                number = numbers.pop(0)
                _, name, value = requests[number]
                request = SetParametersAtomically.Request(
                    parameters=[Parameter(name, value=value).to_parameter_msg()]
                )
                underway[node] = number, self.now(), self.clients[node].call_async(request)
            self.executor.spin_once(timeout_sec=0.01)
            for node, (number, sent, future) in list(underway.items()):
                if future.done():
                    answers[number] = sent, future.result().result
                    del underway[node]
        return answers


@pytest.mark.slow
def test_five_hundred_changes_in_a_flight(fly):
    generator = random.Random(20)
    sets = load_profile("s500").sets
    requests = []
    for _ in range(COUNT):
        node = generator.choice(NODES)
        kind = valid if generator.random() < 0.6 else invalid
        requests.append((node, *kind(generator, sets[node])))
    flight = fly("--scenario", "hover_60", report=True)
    flight.until(lambda: "ROS domain" in flight.said, "started")
    domain = int(flight.said.split("ROS domain ")[1].split(",")[0])
    with Guest("tuner", transport_environment(), domain) as guest:
        tuner = Tuner(guest)

        def going_on():
            assert flight.process.poll() is None, flight.said + flight.complained

        flight.until(
            lambda: all(client.service_is_ready() for client in tuner.clients.values()), "services"
        )
        flight.until_phase("take-off")
        answers = tuner.ask(requests, going_on)
        reported = list(tuner.reported)
    assert flight.wait() == 0, flight.said + flight.complained

    expected = Counter()
    for (node, name, _), (_, result) in zip(requests, answers, strict=True):
        assert result.successful or result.reason
        expected[node, name, result.successful, result.reason] += 1
    info = json.loads((flight.out / "info.json").read_text())
    logged = info["parameter_changes"]
    assert len(logged) == COUNT
    assert 100 < sum(one["accepted"] for one in logged) < 400
    found = Counter((one["node"], *one["values"], one["accepted"], one["reason"]) for one in logged)
    assert found == expected
    for node in NODES:  # in the order of the requests, with the requested values
        requested = [r for r in requests if r[0] == node]
        listed = [one for one in logged if one["node"] == node]
        for (_, name, value), one in zip(requested, listed, strict=True):
            new = one["values"][name][1]
            assert new == value or not one["accepted"]

    series = timeseries.read(flight.out / "timeseries.parquet")
    steps = {round(1e6 * step) for step in np.diff(series.time)}
    assert steps == {4000}, "a tick is missing"
    assert json.loads((flight.out / "logs/recorder.json").read_text())["lost"] == {}
    assert "Parameters changed in flight" in (flight.out / "report.html").read_text()

    sent = {node: [a[0] for r, a in zip(requests, answers, strict=True) if r[0] == node]
            for node in NODES}  # fmt: skip
    late = [
        (stamp - sent[change.node].pop(0)) / SECOND
        for stamp, change in reported
        if sent[change.node]
    ]
    # A node looks for changes five times a second, see `OtherEntities`.
    figures = [round(float(np.percentile(late, part)), 3) for part in (50, 90, 99, 100)]
    print(f"simulated seconds from request to effect, 50, 90, 99, 100 %: {figures}")
    assert figures[0] < ANSWER_TIME, figures
