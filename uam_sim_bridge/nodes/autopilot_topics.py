"""What the bridge tells of the autopilot: /uam/autopilot/state, /uam/autopilot/battery, the log."""

from __future__ import annotations

from typing import Any

from uam_msgs_py.messages import topics
from uam_msgs_py.messages.battery_state import battery_message
from uam_msgs_py.messages.stamps import seconds
from uam_msgs_py.messages.status import AutopilotState
from uam_msgs_py.node.base_node import UamNode
from uam_sim_bridge.mavlink.link.link import OffboardLink
from uam_sim_bridge.mavlink.offboard.sequence import OffboardSequence

STATE_PERIOD = 200_000_000  # ns between two reports of the autopilot's state
BATTERY_PERIOD = 1_000_000_000  # ns


class AutopilotTopics:
    """Publishes the state when it changes and five times a second, the battery once a second."""

    def __init__(self, node: UamNode, link: OffboardLink, sequence: OffboardSequence) -> None:
        self._logger, self._link, self._sequence = node.get_logger(), link, sequence
        self._state = node.publisher(topics.AUTOPILOT_STATE)
        self._battery = node.publisher(topics.AUTOPILOT_BATTERY)
        self._told: tuple[Any, ...] = ()
        self._told_at, self._battery_told = -STATE_PERIOD, -BATTERY_PERIOD
        self._warned: tuple[str, ...] = ()

    def tell(self, stamp: int) -> None:
        """Publish and log what is due at `stamp` [ns]."""
        self._tell_battery(stamp)
        self._tell_warnings()
        link, sequence = self._link, self._sequence
        connected = link.connected(seconds(stamp))
        what = (connected, link.mode, link.armed, sequence.phase, sequence.reasons)
        if what == self._told and stamp - self._told_at < STATE_PERIOD:
            return
        if what != self._told:
            armed = "armed" if link.armed else "disarmed"
            heard = "" if connected else ", no heartbeat"
            text = f"{sequence.phase.value}; autopilot {link.mode.name}, {armed}{heard}"
            self._logger.info("; ".join((text, *sequence.reasons)))
        self._told, self._told_at = what, stamp
        since = link.armed_since
        state = AutopilotState(
            connected,
            link.mode.name,
            link.armed,
            None if since is None else round(since * 1e6) * 1000,
            "; ".join(sequence.reasons),
            link.time_sync.quickest,
        )
        self._state.publish(state.to_message(stamp))

    def _tell_battery(self, stamp: int) -> None:
        battery = self._link.vitals.battery
        if battery is not None and stamp - self._battery_told >= BATTERY_PERIOD:
            self._battery_told = stamp
            self._battery.publish(battery_message(stamp, battery))

    def _tell_warnings(self) -> None:
        warnings = self._link.warnings
        for warning in warnings:
            if warning not in self._warned:
                self._logger.warning(warning)
        self._warned = warnings
