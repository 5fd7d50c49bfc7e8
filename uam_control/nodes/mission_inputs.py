"""What the mission node hears besides state and autopilot, for the supervisor's limits.

The messages of many topics come more often than they are looked at: they are kept as they came and
read only a few times a second, by stamps. So it is cheap, and how fast another process was does not
matter to a flight that stays within its limits.
"""

import math
from collections.abc import Callable
from functools import partial
from typing import Any

from sensor_msgs.msg import BatteryState, Temperature

from uam_control.coordinates import JOINTS
from uam_control.supervision import Inputs, Readings
from uam_msgs_py.messages import topics
from uam_msgs_py.messages.convert import read_pose, read_values
from uam_msgs_py.messages.layouts import BadMessage
from uam_msgs_py.messages.name_checks import check_names
from uam_msgs_py.messages.stamps import seconds
from uam_msgs_py.node.base_node import UamNode

PERIOD = 20_000_000  # [ns] of stamps between two looks
GAINS = (
    (topics.POSITION_ADAPTATION, "position"),
    (topics.ATTITUDE_ADAPTATION, "attitude"),
    (topics.ARM_ADAPTATION, "arm"),
)
NAMES = list(JOINTS)


class MissionInputs:
    """Listens through a node; `readings` as of the last look."""

    def __init__(self, node: UamNode, control_period: float):
        """control_period [s]: of ticks."""
        self._node = node
        self._inputs = Inputs(control_period)
        self._newest: dict[str, tuple[Callable[[Any], None], Any]] = {}
        self._looked = -PERIOD
        self.readings = Readings()
        self._keep(topics.MOCAP, self._on_mocap)
        self._keep(topics.JOINTS, self._on_joints)
        self._keep(topics.AUTOPILOT_BATTERY, self._on_battery)
        node.listen(topics.ARM_TEMPERATURE, self._on_temperature, required=False)
        for topic, subsystem in GAINS:
            self._keep(topic, partial(self._on_gains, subsystem))

    def _keep(self, topic: topics.Topic, read: Callable[[Any], None]) -> None:
        """Keep the newest message of a topic for the next look."""

        def handle(message: Any) -> None:
            self._newest[topic.name] = read, message

        self._node.listen(topic, handle, required=False)

    def autopilot(self, stamp: float, round_trip: float | None) -> None:
        """Note that the bridge was connected with the autopilot at `stamp` [s].

        round_trip: how long its answers take [s], None where not known.
        """
        self._inputs.autopilot(stamp, math.nan if round_trip is None else round_trip)

    def tick(self, stamp: int) -> None:
        """Note the tick `stamp` [ns], and look at the messages when it is time to."""
        if stamp - self._looked >= PERIOD or stamp < self._looked:
            self._looked = stamp
            newest, self._newest = self._newest, {}
            for name, (read, message) in newest.items():
                try:
                    read(message)
                except BadMessage as error:
                    self._node.refused += 1
                    self._node.say(f"{name}: refused: {error}", key=name)
        self.readings = self._inputs.at(seconds(stamp))

    def _on_mocap(self, data: bytes) -> None:
        stamp, *pose = read_pose(data)  # one that the estimator cannot use does not count
        self._inputs.mocap(seconds(stamp), *pose)

    def _on_joints(self, data: bytes) -> None:
        stamp, names, effort = read_values(data, "effort")
        if names != NAMES:
            try:
                effort = effort[[names.index(name) for name in NAMES]]
            except ValueError:
                check_names(names, NAMES)
        self._inputs.joints(seconds(stamp), effort)

    def _on_battery(self, message: BatteryState) -> None:
        self._inputs.battery(message.percentage)

    def _on_temperature(self, message: Temperature) -> None:
        joint = message.header.frame_id
        if joint not in NAMES:
            raise BadMessage(f"frame_id {joint!r} is no joint; there are: {', '.join(NAMES)}")
        self._inputs.temperature(joint, message.temperature)

    def _on_gains(self, subsystem: str, data: bytes) -> None:
        stamp, names, values = read_values(data, "position")
        self._inputs.gains(seconds(stamp), subsystem, names, values)
