"""A direct flight over real sockets: bridge, stand-in and a ground station speak MAVLink over UDP.

All are in one process. A datagram on loopback has arrived when `sendto` returns, so the flight is
the same each time. Every byte that the bridge sends is kept.
"""

from __future__ import annotations

import struct
from unittest import mock

import numpy as np
from free_port import free_port

from uam_control.frames import swap_body
from uam_control.mission import load_scenario
from uam_control.offboard.firmware import FIRMWARES
from uam_control.offboard.modes import FORCE, MavCmd, Mode
from uam_control.profiles.profile import load_profile
from uam_control.setpoints.rate_thrust_map import RateThrustParameters
from uam_control.vehicle import load_description
from uam_lab.flights.direct import flight as direct
from uam_sim_bridge.autopilot.companion import Companion
from uam_sim_bridge.autopilot.params import DEFINITIONS
from uam_sim_bridge.mavlink.hil.sitl_ports import HOST, UdpPort
from uam_sim_bridge.mavlink.link.link import OffboardLink
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, mavlink2
from uam_sim_bridge.mavlink.transport.transport import UdpTransport
from uam_sim_bridge.plant import Vehicle
from uam_sim_bridge.plant.effects.network_delay import SetpointDelay

GROUND_STATION = 255, 190  # system and component
KILL_CHANNEL = 7
REQUESTS = "SET_MODE", "COMMAND_LONG", "COMMAND_INT"
HARMLESS = (
    MavCmd.SET_MESSAGE_INTERVAL,
    MavCmd.REQUEST_MESSAGE,
    MavCmd.RUN_PREARM_CHECKS,
)  # commands that change neither mode nor arming


class _Kept(UdpTransport):
    """UDP that keeps what it sends: `sent`."""

    def __init__(self, remote: tuple[str, int]) -> None:
        super().__init__(0, remote)
        self.sent: list[bytes] = []

    def send(self, data: bytes) -> bool:
        self.sent.append(bytes(data))
        return super().send(data)


class GroundStation:
    """A pilot or ground station at the stand-in's second port."""

    def __init__(self, port: int) -> None:
        self._codec, self._udp = Codec(*GROUND_STATION), UdpTransport(0, (HOST, port))

    def send(self, message) -> None:
        self._udp.send(self._codec.encode(message))

    def command(self, command: int, *parameters: float) -> None:
        values = (*parameters, *[0.0] * (7 - len(parameters)))
        self.send(mavlink2.MAVLink_command_long_message(1, 1, command, 0, *values))

    def choose(self, mode: Mode) -> None:
        self.command(MavCmd.DO_SET_MODE, *FIRMWARES["px4"].mode_request(mode))

    def stop_motors(self) -> None:
        self.command(MavCmd.ARM_DISARM, 0.0, FORCE)

    def kill_switch(self, engaged: bool) -> None:
        """Send the radio's channels; its kill switch is on KILL_CHANNEL."""
        channels = [1500] * 8
        channels[KILL_CHANNEL - 1] = 2000 if engaged else 1000
        self.send(mavlink2.MAVLink_rc_channels_override_message(1, 1, *channels))

    def sticks(self, forward: float = 0.0) -> None:
        self.send(mavlink2.MAVLink_manual_control_message(1, round(1000 * forward), 0, 500, 0, 0))

    def set_parameter(self, name: str, value: float) -> None:
        kind = mavlink2.MAV_PARAM_TYPE_REAL32
        if DEFINITIONS[name].integer:
            kind = mavlink2.MAV_PARAM_TYPE_INT32
            value = struct.unpack("<f", struct.pack("<i", int(value)))[0]
        self.send(mavlink2.MAVLink_param_set_message(1, 1, name.encode(), value, kind))


class WiredAutopilot:
    """The stand-in behind sockets, in place of `JoinedAutopilot`; `link`: the bridge's end."""

    def __init__(self, autopilot, sequence, network) -> None:
        assert network is None, "the sockets do not delay"
        self.autopilot, self.sequence, self.motors = autopilot, sequence, autopilot.motors
        self.time, self.network = 0.0, SetpointDelay(0.0, 0.0, 0.0, 0)
        self._companion = Companion(autopilot)
        self.link = OffboardLink(None, sequence, RateThrustParameters.of(load_description()))
        self.connect()

    def connect(self) -> None:
        """Open new sockets: at the start, and in a fork, whose sockets must be its own."""
        codec, ports = Codec(1, 1), [free_port() for _ in range(2)]
        self._udp, self._second = (UdpPort(port, 9, codec) for port in ports)
        self.transport = self.link.transport = _Kept((HOST, ports[0]))
        self.ground = GroundStation(ports[1])

    def __getattr__(self, name):
        return getattr(self.__dict__["link"], name)

    def update(self, time, gyro, force):
        """Run the autopilot's cycle of `time` [s]; gyro, force (3,): FLU."""
        for message in (*self._udp.receive(), *self._second.receive()):
            self._companion.handle(time, message)
        motors = self.autopilot.update(time, swap_body(gyro), swap_body(force))
        self._udp.send(self._companion.tick(time))
        return motors

    def requests(self) -> list[str]:
        """The requests on the wire that may change mode or arming, in order."""
        found = []
        for message in Framer(Codec(1, 1)).stream(b"".join(self.transport.sent)):
            kind = message.get_type()
            if kind in REQUESTS and getattr(message, "command", None) not in HARMLESS:
                found.append(str(message))
        return found

    @property
    def setpoints(self) -> int:
        """The number of setpoints on the wire."""
        stream = Framer(Codec(1, 1)).stream(b"".join(self.transport.sent))
        return sum(message.get_type() == "SET_ATTITUDE_TARGET" for message in stream)


class Steps:
    """Largest steps of the companion's setpoint, from the last tick of the autopilot's own mode on:
    `rates` [rad/s], `thrust`.

    The first setpoint is compared with the vehicle's body rates and the thrust of the own mode.
    """

    def __init__(self, autopilot) -> None:
        self.rates = self.thrust = 0.0
        self._autopilot, self._own, self._last = autopilot, None, None
        self._made = autopilot._own_setpoint
        autopilot._own_setpoint = self._keep

    def _keep(self, *arguments):
        made = self._made(*arguments)
        self._own = np.array([*self._autopilot.rates, made[0][3]])
        return made

    def tick(self) -> None:
        """Call it after each tick; the first tick is what the next ones are compared with."""
        used = self._autopilot._setpoint.copy() if self._own is None else self._own
        if self._last is not None and self._own is None:
            step = np.abs(used - self._last)
            self.rates = max(self.rates, float(np.max(step[:3])))
            self.thrust = max(self.thrust, float(step[3]))
        self._last, self._own = used, None


def wired_flight(
    scenario: str = "quick_pick", payload: float = 0.2, **changes: object
) -> direct.DirectFlight:
    """Return a flight of the default profile over sockets, before its first tick.

    changes: of the vehicle, see `Vehicle.changed`.
    """
    with mock.patch.object(direct, "JoinedAutopilot", WiredAutopilot):
        return direct.DirectFlight(
            load_scenario(scenario),
            load_profile("s500"),
            Vehicle.load().changed(changes),
            payload,
            1,
        )
