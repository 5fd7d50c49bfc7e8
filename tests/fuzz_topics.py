"""A process that publishes malformed, extreme and deep messages on every topic that somebody reads.

    python tests/fuzz_topics.py [--seconds 600] [--seed 1] [--rate 400] [--each 30]

ROS_DOMAIN_ID and the transport come from the environment. The topics come from the ROS graph, so a
new topic is covered by itself. Some messages are those of the flight with changed bytes, numbers
and texts. It prints "covered" when each topic got as many messages as `--each` says, and at the end
how many it got, as JSON.
"""

import argparse
import importlib
import json
import math
import random
import signal
import struct
import threading
import time
from contextlib import suppress

import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.signals import SignalHandlerOptions

from uam_msgs_py.messages.tf_message import TFMessage

NAME = "fuzz"
LOOK_PERIOD = 1.0  # [s] between two looks at the graph
NUMBERS = (math.nan, math.inf, -math.inf, 1e308, -1e308, 1e16)  # none that a flight may follow
DEEP = "[" * 3000  # three times as deep as Python reads
TEXTS = (
    *("", "abc", "nan", "1e999", "-1", "9" * 5000, "True", "null -> 1", "a\0b", "é\n\r\t[/x][mm]"),
    *("<script>alert(1)</script>", "\\ud800", '"\\ud800" -> "\\udfff"', "..", "x" * 5000, "{}"),
    *(DEEP, f"{DEEP} -> {DEEP}", '{"a":' * 2000, '{"found": [], "required": 1, "why": {}}'),
)
KEYS = (
    *("tick max [ms]", "pose age at arrival, mean [ms]", "saturated", "by", "number", "place"),
    *("time", "armed_since", "readers of /uam/state", "adapt", "real time factor"),
)
STAMPS = ((0, 0), (-1, 0), (-(2**31), 2**32 - 1), (4_102_444_800 - 2**32, 0), (2**31 - 1, 10**9))
# a good goal would be followed: these get no message with a field that a flight may use
PLANS = (
    *("goal_pose", "base_trajectory", "arm_trajectory"),
    *("end_effector/goal_pose", "end_effector/trajectory", "end_effector/twist"),
)
HEAD = b"\0\1\0\0"


def broken(rng: random.Random, seen: bytes) -> bytes:
    """Return bytes that are no message, or one with damage; seen: a message of the topic."""
    kind = rng.randrange(8)
    if kind == 0:
        return rng.choice((b"", b"\0", HEAD, HEAD + b"\xff" * 8, b"\0\0\0\0" + seen[4:]))
    if kind == 1:
        return HEAD + rng.randbytes(rng.randrange(300))
    if kind == 2:
        return seen[: rng.randrange(len(seen) + 1)]
    if kind == 3:
        return seen + rng.randbytes(rng.randrange(5000))
    data = bytearray(seen)
    if kind == 7:
        return no_text(rng, data)
    for _ in range(rng.randrange(1, 6)):
        if len(data) < 16:
            break
        if kind == 4:
            data[rng.randrange(len(data))] = rng.randrange(256)
        elif kind == 5:  # a length, a stamp
            at = 4 + 4 * rng.randrange(len(data) // 4 - 1)
            data[at : at + 4] = struct.pack("<i", rng.choice((-1, 0, 2**31 - 1, 2**20, 1001)))
        else:
            at = 4 + 8 * rng.randrange((len(data) - 4) // 8)
            data[at : at + 8] = struct.pack("<d", rng.choice(NUMBERS))
    return bytes(data)


def no_text(rng: random.Random, data: bytes) -> bytes:
    """Return `data` with some letters replaced by bytes that are not UTF-8."""
    damaged = bytearray(data)
    letters = [at for at in range(4, len(data)) if data[at : at + 1].isalpha()]
    for at in letters[:: rng.randrange(1, 9)]:
        damaged[at] = rng.choice(b"\xff\xc3\xed\xf4\x80")
    return bytes(damaged)


def extreme(rng: random.Random, message, share: float):
    """Replace about this share of a message's fields by extreme ones, also in its lists."""
    if type(message).__name__ == "Time":
        if rng.random() < share:
            message.sec, message.nanosec = rng.choice(STAMPS)
        return message
    for name, form in message.get_fields_and_field_types().items():
        value = getattr(message, name)
        setattr(message, name, _extreme(rng, value, form, share, rng.random() < share))
    return message


def _extreme(rng, value, form, share, changed):
    if isinstance(value, str):
        return rng.choice(TEXTS + KEYS) if changed else value
    if isinstance(value, bool):
        return rng.random() < 0.5 if changed else value
    if isinstance(value, bytes):
        return rng.randbytes(1) if changed else value
    if isinstance(value, float):
        return rng.choice(NUMBERS) if changed else value
    if isinstance(value, int):
        return rng.choice(whole(form)) if changed else value
    if not hasattr(value, "__len__"):
        return extreme(rng, value, share)
    size = rng.choice((0, 1, len(value) + 1, 3000)) if changed else len(value)
    if form.startswith("sequence<string"):
        return [rng.choice(TEXTS) for _ in range(min(size, 30))] if changed else value
    if form.startswith(("sequence<double", "sequence<float", "double[", "float[")):
        fixed = not form.startswith("sequence")
        return [rng.choice(NUMBERS) for _ in range(len(value) if fixed else size)]
    if form.startswith("sequence<") and "/" in form:
        kind = message_type(form.removeprefix("sequence<").rstrip(">").replace("/", "/msg/"))
        parts = [*value] if not changed else [kind() for _ in range(min(size, 30))]
        return [extreme(rng, part, share) for part in parts]
    return value


def whole(form: str) -> tuple[int, ...]:
    """Return the extreme values of `int32`, `uint8` ..."""
    bits = int(form.lstrip("uint"))
    if form.startswith("u"):
        return 0, 1, 2**bits - 1
    return 0, -1, 2 ** (bits - 1) - 1, -(2 ** (bits - 1))


def message_type(name: str):
    """Return the class of `package/msg/Name`."""
    package, _, kind = name.split("/")
    if kind == "TFMessage":
        return TFMessage
    return getattr(importlib.import_module(f"{package}.msg"), kind)


class Target:
    """A topic that somebody reads."""

    def __init__(self, node: Node, topic: str, kind: type):
        self.kind, self.sent = kind, 0
        reliable = QoSProfile(
            depth=1,
            reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL,  # suits every subscription
        )
        self._out = node.create_publisher(kind, topic, reliable)
        self._in = node.create_subscription(
            kind, topic, lambda _: None, qos_profile_sensor_data, raw=True
        )
        self._seen = HEAD if kind is TFMessage else serialize_message(kind())
        self._plan = topic.endswith(PLANS)

    def listen(self) -> None:
        """Keep a message of the flight; one that is damaged is one of this process."""
        while (found := self._in.handle.take_message(self.kind, True)) is not None:
            if self.kind is TFMessage or self._read(found[0]) is not None:
                self._seen = found[0]

    def _read(self, data: bytes):
        try:
            return deserialize_message(data, self.kind)
        except Exception:
            return None

    def send(self, rng: random.Random) -> None:
        """Publish one message."""
        data = None
        if self.kind is not TFMessage and rng.random() < 0.6:
            base = self._read(self._seen) if rng.random() < 0.7 else self.kind()
            share = 1.0 if self._plan else rng.choice((0.1, 0.5, 1.0))
            message = extreme(rng, base or self.kind(), share)
            data = self._read(serialize_message(message)) and serialize_message(message)
            if data and rng.random() < 0.1:
                data = no_text(rng, data)
        if self._plan and data is None:
            data = broken(rng, HEAD + b"\xff" * rng.randrange(300))
        with suppress(RCLError):  # the middleware does not send everything
            self._out.publish(data or broken(rng, self._seen))
            self.sent += 1


def targets(node: Node, known: dict[str, Target]) -> None:
    """Add the topics that nodes other than this one read by now."""
    for topic, kinds in node.get_topic_names_and_types():
        readers = {end.node_name for end in node.get_subscriptions_info_by_topic(topic)}
        if topic not in known and readers - {NAME}:
            known[topic] = Target(node, topic, message_type(kinds[0]))


def main() -> None:
    """Publish for the given time, or until Ctrl-C."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rate", type=float, default=400.0, help="messages per second, all topics")
    parser.add_argument("--each", type=int, default=30, help="messages until a topic is covered")
    options = parser.parse_args()
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node, rng = Node(NAME, start_parameter_services=False, enable_rosout=False), random.Random()
    rng.seed(options.seed)
    known: dict[str, Target] = {}
    end, looked, covered = time.monotonic() + options.seconds, 0.0, False
    stop = threading.Event()  # an exception of the signal could be lost in a call of the middleware
    signal.signal(signal.SIGINT, lambda *_: stop.set())
    while not stop.is_set() and (now := time.monotonic()) < end:
        if now - looked > LOOK_PERIOD:
            looked = now
            targets(node, known)
            if not covered and known and min(t.sent for t in known.values()) >= options.each:
                covered = True
                print("covered", flush=True)
        for target in list(known.values()):
            target.listen()
            target.send(rng)
            time.sleep(1.0 / options.rate)
        if not known:
            time.sleep(0.1)
    print(json.dumps({topic: target.sent for topic, target in sorted(known.items())}))
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
