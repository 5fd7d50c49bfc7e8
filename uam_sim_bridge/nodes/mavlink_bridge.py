"""Node: tau_p and tau_q → SET_ATTITUDE_TARGET; OFFBOARD, arming, vision and telemetry over MAVLink.

One tick per stamp at which state, position command and attitude command are there. At a tick: what
the autopilot sent is read, then go out: heartbeat and requests, the newest mocap pose, the
setpoint; /uam/setpoint repeats what was sent and acknowledges the tick.

| commands at a tick | sent |
|---|---|
| good | body rates and thrust from the map |
| idle (not flying) | rates 0, thrust 0: the stream goes on, the vehicle stays on the ground |
| not finite or malformed, on the ground | as idle |
| the same in flight; the mission in failsafe; idle high above the start; in real time none for \
`stale_after` | level hold \
for `hold_time`, then nothing: the autopilot's failsafe acts |
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.clock import Clock, ClockType
from rclpy.parameter import Parameter

from uam_control.coordinates import ATTITUDE
from uam_control.parameters import ParameterError, ParameterSet, choice, number
from uam_control.supervision import State
from uam_msgs_py import topics
from uam_msgs_py.battery import battery_message
from uam_msgs_py.control import (
    TAU_Q,
    read_position_command,
    read_state,
    read_torque,
)
from uam_msgs_py.convert import JointStateWriter, SetpointWriter, read_pose, seconds
from uam_msgs_py.joins import StampJoin
from uam_msgs_py.layouts import BadMessage, stamp_of
from uam_msgs_py.node import UamNode, run
from uam_msgs_py.parameters import NodeParameters, given
from uam_msgs_py.status import OK, WARN, AutopilotState, MissionStatus
from uam_sim_bridge.faults import LINK, Schedule
from uam_sim_bridge.flight.fault_log import FaultTopic
from uam_sim_bridge.flight.ports import PortError
from uam_sim_bridge.mavlink.faulty_transport import FaultyTransport
from uam_sim_bridge.mavlink.forwarding import GroundStation
from uam_sim_bridge.mavlink.hold import HoldParameters, LevelHold
from uam_sim_bridge.mavlink.link import OffboardLink
from uam_sim_bridge.mavlink.link_report import faults, report
from uam_sim_bridge.mavlink.offboard import OffboardParameters, OffboardSequence
from uam_sim_bridge.mavlink.parameter_check import adopted, differences
from uam_sim_bridge.mavlink.setpoint import RateThrustMap, RateThrustParameters, SetpointRefused
from uam_sim_bridge.mavlink.signing import Signing
from uam_sim_bridge.mavlink.thrust_identification import (
    ThrustIdentification,
    ThrustIdentificationParameters,
    steady_force,
)
from uam_sim_bridge.mavlink.transport import Transport, UdpTransport, open_transport
from uam_sim_bridge.mavlink.vision import vision_message
from uam_sim_bridge.mavlink.wire import Codec, mavlink2

NAME = "mavlink_bridge"
STATE_PERIOD = 500_000_000  # ns between two reports of the autopilot's state
BATTERY_PERIOD = 1_000_000_000  # ns
THRUST_PERIOD = 100_000_000  # ns between two reports of the thrust factor
WATCH_PERIOD = 0.02  # s between two looks of the real-time watchdog, and its setpoints
BAD = object()  # stands for a message that must not be used


@dataclass(frozen=True)
class BridgeParameters(ParameterSet):
    """Ports and rates of the bridge; fixed once the node runs."""

    clock: str = choice(
        "lockstep",
        "lockstep: ticks alone; realtime: a watchdog on wall time as well",
        ("lockstep", "realtime"),
    )
    local_port: float = number(14540, "own UDP port (14540 + instance)", "1", 1, 65535)
    autopilot_port: float = number(
        14580, "UDP port of the autopilot (14580 + instance)", "1", 1, 65535
    )
    autopilot_system: float = number(1, "MAVLink system id of the autopilot", "1", 1, 255)
    signing_link_id: float = number(0, "number of this link in MAVLink 2 signatures", "1", 0, 255)
    vision_interval: float = number(0.02, "least time between two vision poses sent", "s", 0.0, 1.0)
    vision_position_deviation: float = number(
        0.005, "standard deviation told with a vision pose", "m", 1e-4, 1.0
    )
    vision_attitude_deviation: float = number(
        0.02, "standard deviation told with a vision pose", "rad", 1e-4, 1.0
    )
    autopilot_parameters: str = choice(
        "warn",
        "where the autopilot's MC_*RATE_P/K or THR_MDL_FAC differ from the mapping: warn, "
        "or adopt them before arming",
        ("warn", "adopt"),
    )
    stale_after: float = number(
        0.1, "real time without a tick, after which the commands count as lost", "s", 0.01, 5.0
    )


class MavlinkBridgeNode(UamNode):
    """Publishes /uam/setpoint, /uam/thrust, /uam/autopilot/state and /uam/autopilot/battery."""

    def __init__(self) -> None:
        super().__init__(NAME)
        self._map_parameters = NodeParameters(self, RateThrustParameters)
        self._options = NodeParameters(self, BridgeParameters, read_only=True).current
        offboard = NodeParameters(self, OffboardParameters, read_only=True).current
        hold = NodeParameters(self, HoldParameters, read_only=True).current

        self.map = RateThrustMap(self._map_parameters.current)
        self._map_parameters.apply = self._configure
        thrust = NodeParameters(self, ThrustIdentificationParameters)
        self.identification = ThrustIdentification(thrust.current)
        thrust.apply = self.identification.configure
        self.sequence = OffboardSequence(offboard)
        self._hold = LevelHold(hold)
        options = self._options
        self._station: GroundStation | None = None
        self._faulty: FaultyTransport | None = None
        self.link = self._open_link(hold.hold_time)
        self._state = np.zeros((3, 8))
        self._pose: tuple[int, np.ndarray, np.ndarray] | None = None
        self._pose_sent = -1.0
        self._told: tuple[Any, ...] = ()
        self._told_at = -STATE_PERIOD
        self._warned: tuple[str, ...] = ()
        self._adopted: tuple[str, ...] = ()
        self._battery_told = -BATTERY_PERIOD
        self._last_tick = time.monotonic()
        self._ground: float | None = None  # height [m] at which the vehicle stood
        self._margin = hold.ground_margin
        self._idle = np.zeros(3)
        self._warm_up()

        self._setpoint = self.publisher(topics.SETPOINT)
        self._autopilot_state = self.publisher(topics.AUTOPILOT_STATE)
        self._battery = self.publisher(topics.AUTOPILOT_BATTERY)
        self._thrust = self.publisher(topics.THRUST)
        self._writer = SetpointWriter()
        self._factor_writer = JointStateWriter(["factor"])
        names = [t.name for t in (topics.STATE, topics.POSITION_COMMAND, topics.ATTITUDE_COMMAND)]
        self._join = StampJoin(names, self._tick)
        self.joins.append(self._join)
        self._arming = self.listen(topics.ARMING, self._on_arming, required=False)
        self._mocap = self.listen(topics.MOCAP, self._on_mocap)
        self._mission = self.listen(topics.MISSION_STATUS, self._on_mission, required=False)
        self._feed(topics.STATE, read_state)
        self._feed(topics.POSITION_COMMAND, read_position_command)
        self._feed(topics.ATTITUDE_COMMAND, self._read_attitude_command)
        self.triggers = (topics.ATTITUDE_COMMAND.name,)
        if options.clock == "realtime":
            steady = Clock(clock_type=ClockType.STEADY_TIME)
            self.create_timer(WATCH_PERIOD, self._watch, clock=steady)

    def _open_link(self, hold_time: float) -> OffboardLink:
        """Open the links that the parameters name; raises PortError, FaultError in one line."""
        options = self._options
        system = int(options.autopilot_system)
        about = ParameterDescriptor(
            description="address of the autopilot's UDP port, where `autopilot` names no link",
            read_only=True,
        )
        host = self.declare_parameter("autopilot_host", "127.0.0.1", about).value
        url = self._text(
            "autopilot",
            "link to the autopilot, in place of the UDP port: "
            "udp:HOST:PORT[:LOCAL_PORT], tcp:HOST:PORT or serial:DEVICE:BAUD",
        )
        station = self._text("gcs", "ground station that watches: udp:HOST:PORT[:LOCAL_PORT]")
        signing = Signing.from_text(
            self._text(
                "signing_key",
                "MAVLink 2 signing: 64 hex digits, or a file that holds "
                "them; read as 'set' from outside",
                secret=True,
            ),
            int(options.signing_link_id),
        )
        transport: Transport
        if url:
            transport = open_transport(url)
        else:
            transport = UdpTransport(int(options.local_port), (host, int(options.autopilot_port)))
        faults = Schedule.from_text(
            self._text(
                "faults",
                "JSON, faults of the MAVLink connection and when they come, see "
                "docs/faults.md; empty = none",
            )
        ).only(LINK)
        if faults:
            transport = self._faulty = FaultyTransport(transport, faults)
            self._fault_topic = FaultTopic(self)
        if station:
            codec = Codec(system, mavlink2.MAV_COMP_ID_ONBOARD_COMPUTER, signing)
            transport = self._station = GroundStation(station, transport, codec)
        return OffboardLink(
            transport, self.sequence, self.map.parameters, system, hold_time, signing
        )

    def _text(self, name: str, description: str, secret: bool = False) -> str:
        """Declare a read-only text, '' by default, and return it; a secret one is not shown.

        Raises PortError where something else is given, such as a key that reads as a number.
        """
        value = given(self).get(name, "")
        if not isinstance(value, str):
            raise PortError(f"{name}: a text expected" + (", or a file's name" if secret else ""))
        shown = "set" if secret and value else value
        descriptor = ParameterDescriptor(description=description, read_only=True)
        self.declare_parameter(name, shown, descriptor, ignore_override=True)
        return value

    def _configure(self, parameters: RateThrustParameters) -> None:
        self.map.configure(parameters)
        self.link.set_mapping(parameters)

    def destroy_node(self) -> None:
        """Close the link, then the node."""
        if hasattr(self, "link"):
            self.link.close()
        super().destroy_node()

    def _feed(self, topic: topics.Topic, read) -> None:
        """Join a topic; a message that must not be used still counts for its stamp."""

        def handle(data: bytes) -> None:
            try:
                stamp, value = read(data)
            except BadMessage:
                self._join.add(topic.name, stamp_of(data), BAD)
                raise
            self._join.add(topic.name, stamp, value)

        self.listen(topic, handle)

    @staticmethod
    def _read_attitude_command(data: bytes) -> tuple[int, tuple[np.ndarray | None]]:
        stamp, torque = read_torque(data, TAU_Q)
        return stamp, (torque,)  # None means "idle" here, but "not there" to the join

    def _on_arming(self, message) -> None:
        self.sequence.want(bool(message.data))

    def _on_mission(self, message) -> None:
        stamp, status = MissionStatus.from_message(message)
        self.identification.switch(seconds(stamp), status.magnet)
        self.sequence.let_go = status.state == State.FAILSAFE.value
        if self._faulty is not None:
            self._faulty.mission_at(seconds(stamp), status.time)

    def _on_mocap(self, data: bytes) -> None:
        self._pose = read_pose(data)

    def _tick(self, stamp: int, state, position, torque) -> None:
        begun = time.perf_counter()
        now = seconds(stamp)
        self._last_tick = time.monotonic()
        self.take_waiting(self._arming)
        self.take_waiting(self._mocap)
        self.take_waiting(self._mission)
        if state is not BAD:
            self._state = state
        self._update_faults(now)
        self.link.poll(now)
        self._adopt()
        setpoint = self._command(now, state, position, torque)
        self._send(now, setpoint)
        self._tell(stamp)
        rates, thrust = setpoint or (self._idle, 0.0)
        self._identify(stamp, state, position, thrust)
        self._setpoint.publish(self._writer.fill(stamp, rates, thrust))
        self.done_tick(stamp, begun)

    def _update_faults(self, now: float) -> None:
        if self._faulty is not None:
            self._fault_topic.tell(round(now * 1e9), self._faulty.update(now))

    def _adopt(self) -> None:
        """Take the autopilot's parameters over where that is wished; never while it is armed."""
        link = self.link
        wished = self._options.autopilot_parameters == "adopt"
        if not wished or link.armed or not link.mapping_told:
            return
        old, changes = self.map.parameters, tuple(differences(self.map.parameters, link.values))
        if not changes or changes == self._adopted:
            return
        self._adopted = changes
        try:
            new = adopted(old, link.values)
        except ParameterError as error:
            self.get_logger().warning(f"the autopilot's parameters are not adopted: {error}")
            return
        names = ("rate_p", "rate_k", "thr_mdl_fac")
        taken = [Parameter(name, value=_plain(getattr(new, name))) for name in names]
        self.change_parameters(taken, "autopilot")
        for change in changes:
            self.get_logger().info(f"adopted from the autopilot: {change}")

    def _identify(self, stamp: int, state, position, thrust: float) -> None:
        """Compare the thrust sent with the acceleration; the factor counts from the next tick."""
        if stamp // THRUST_PERIOD != self.stamp // THRUST_PERIOD:
            self._factor_writer.position[0] = self.map.thrust_factor  # as applied at this tick
            self._thrust.publish(self._factor_writer.stamped(stamp))
        if state is BAD or position is BAD:
            return
        self.map.thrust_factor = self.identification.update(
            seconds(stamp),
            state,
            thrust,
            self.map.assumed_thrust(thrust),
            position.flying and self.link.armed,
        )

    def _command(self, now: float, state, position, torque) -> tuple[np.ndarray, float] | None:
        """Return body rates (3,) and thrust for this tick, None for no setpoint at all."""
        good = state is not BAD and position is not BAD and torque is not BAD
        good = good and not self.sequence.let_go
        if good and position.flying and torque[0] is not None:
            try:
                chi, chi_dot = state[0], state[1]
                rates, thrust = self.map.map(
                    position.tau, torque[0], chi[ATTITUDE], chi_dot[ATTITUDE]
                )
            except SetpointRefused as error:
                self.say(f"setpoint refused: {error}")
            else:
                self._hold.good(now, thrust)
                return rates, thrust
        elif good and not position.flying and torque[0] is None and not self._high():
            self._hold.reset()
            return self._idle, 0.0
        return self._without_command(now)

    def _high(self) -> bool:
        """Whether the vehicle is armed and well above the place where it stood disarmed."""
        height = float(self._state[0, 2])
        if self._ground is None or not self.link.armed:
            self._ground = height
        return height - self._ground > self._margin

    def _without_command(self, now: float) -> tuple[np.ndarray, float] | None:
        if not self.link.armed or (self.link.landed and not self._high()):
            return self._idle, 0.0
        setpoint = self._hold.setpoint(now, self._state[0, ATTITUDE])
        self.say(
            "no usable commands in flight: "
            + ("holding level" if setpoint else "stream stopped, the failsafe acts"),
            "hold",
        )
        return setpoint

    def _send(self, now: float, setpoint: tuple[np.ndarray, float] | None) -> None:
        """Send the autopilot what is due: heartbeat, requests, vision, setpoint."""
        link, options = self.link, self._options
        link.tick(now)
        if self._pose is not None:
            exposed, position, quaternion = self._pose
            exposed = seconds(exposed)
            if exposed - self._pose_sent >= options.vision_interval - 1e-9:
                self._pose, self._pose_sent = None, exposed
                link.send_vision(
                    exposed,
                    position,
                    quaternion,
                    options.vision_position_deviation,
                    options.vision_attitude_deviation,
                )
        if setpoint is not None and self.sequence.streaming:
            link.send_setpoint(*setpoint, now)
        if self._station is not None:
            self._station.forward()

    def _watch(self) -> None:
        """In real time: act when ticks stop coming."""
        silence = time.monotonic() - self._last_tick
        if self.ticks == 0 or silence < self._options.stale_after:
            return
        now = seconds(self.stamp) + silence
        self._update_faults(now)
        self.link.poll(now)
        self._send(now, self._without_command(now))
        self._tell(round(now * 1e9))

    def _tell(self, stamp: int) -> None:
        """Publish the autopilot's state when it changes and twice a second, its battery once."""
        link, sequence = self.link, self.sequence
        if link.battery is not None and stamp - self._battery_told >= BATTERY_PERIOD:
            self._battery_told = stamp
            self._battery.publish(battery_message(stamp, link.battery))
        connected = link.connected(seconds(stamp))
        what = (connected, link.mode, link.armed, sequence.phase, sequence.reasons)
        if link.warnings != self._warned:
            for warning in link.warnings:
                if warning not in self._warned:
                    self.get_logger().warning(warning)
            self._warned = link.warnings
        if what == self._told and stamp - self._told_at < STATE_PERIOD:
            return
        if what != self._told:
            text = f"{sequence.phase.value}; autopilot {link.mode.name}, " + (
                "armed" if link.armed else "disarmed"
            )
            self.get_logger().info("; ".join((text, *sequence.reasons)))
        self._told, self._told_at = what, stamp
        since = link.armed_since
        self._autopilot_state.publish(
            AutopilotState(
                connected,
                link.mode.name,
                link.armed,
                None if since is None else round(since * 1e6) * 1000,
                "; ".join(sequence.reasons),
            ).to_message(stamp)
        )

    def diagnose(self):
        link, sequence = self.link, self.sequence
        notes = (*sequence.reasons, *faults(link), *link.warnings)
        values = {
            "sequence": sequence.phase.value,
            "autopilot mode": link.mode.name,
            "armed": link.armed,
            "landed": link.landed,
            "messages of other systems": link.ignored,
            "refused": link.refused,
            "link open": link.open,
            "frames dropped": link.dropped,
            "level hold": self._hold.active,
            "adopted": "; ".join(self._adopted),
            **report(link),
            "thrust factor [1]": f"{self.map.thrust_factor:.4f}",
        }
        summary = "; ".join((sequence.phase.value, *notes))
        return WARN if notes else OK, summary, values

    def _warm_up(self) -> None:
        """Compile the maths before the flight: a first call takes a second."""
        spare, zero, level = RateThrustMap(), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
        spare.map(zero, zero, self._state[0, ATTITUDE], self._state[1, ATTITUDE])
        spare.assumed_thrust(0.5)
        steady_force(self._state, 0.1, 1.0)
        vision_message(0.0, zero, level, 1.0, 1.0)


def _plain(value: float | tuple[float, ...]) -> float | list[float]:
    """Return the value as ROS parameters take it."""
    return list(value) if isinstance(value, tuple) else value


def main() -> int:
    """Run the node; return its exit status."""
    return run(MavlinkBridgeNode, NAME)
