"""Executable `autopilot`: the stand-in on the sockets of a PX4 SITL instance.

TCP client of the simulator (HIL_SENSOR in, HIL_ACTUATOR_CONTROLS out), UDP towards the companion
computer. All time is the simulator's. Before a HIL_SENSOR is handled, everything that has arrived
over UDP is; what is to be told goes out before the answer. So a lockstep flight is deterministic.
"""

from __future__ import annotations

import argparse
import math
import signal
import socket
import sys
import time as clock
from collections.abc import Sequence

import numpy as np

from uam_control.configuration import ConfigurationError, path
from uam_control.parameters import ParameterError
from uam_sim_bridge.autopilot.companion import Companion, warm_up
from uam_sim_bridge.autopilot.core import Autopilot
from uam_sim_bridge.autopilot.params import Parameters
from uam_sim_bridge.mavlink.wire import Codec, Framer, Message, mavlink2

HOST = "127.0.0.1"
_GYRO_AND_ACCELEROMETER = 0x3F  # HIL_SENSOR.fields_updated
_LOCKSTEP = 1  # HIL_ACTUATOR_CONTROLS.flags
_CUSTOM_MODE, _ARMED = 1, 128  # its mode
_LATEST = 2**53  # µs: MAVLink's nanoseconds end a little later
_RATE_SAMPLES = 8  # intervals from which the rate of HIL_SENSOR is measured


class ServerError(RuntimeError):
    """The server cannot go on; the text is one line for the user."""


class UdpPort:
    """The companion side: answers only the first peer that sends a valid message, as PX4 does."""

    def __init__(self, local: int, remote: int, codec: Codec) -> None:
        """local: port to listen on; remote: port told unasked until a peer has spoken.

        Raises ServerError where the port is taken.
        """
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((HOST, local))
        except OSError as error:
            self._socket.close()
            raise ServerError(f"UDP port {local} for the companion computer: {error.strerror}; "
                              "choose another instance or --mavlink-port") from None
        self._socket.setblocking(False)
        self._codec = codec
        self._framer = Framer(codec)
        self._peer = (HOST, remote)
        self._locked = False

    def receive(self) -> list[Message]:
        """Return all messages that have arrived."""
        messages: list[Message] = []
        while True:
            try:
                data, sender = self._socket.recvfrom(65535)
            except BlockingIOError:
                return messages
            except ConnectionError:  # the peer's port was closed when we sent last
                continue
            if self._locked and sender != self._peer:
                continue
            new = self._framer.datagram(data)
            if new:
                self._peer, self._locked = sender, True
            messages += new

    def send(self, messages: list[Message]) -> None:
        """Send each message in a datagram of its own; nobody listening is no error."""
        for message in messages:
            try:
                self._socket.sendto(self._codec.encode(message), self._peer)
            except (BlockingIOError, ConnectionError):
                pass

    def close(self) -> None:
        """Give the port back."""
        self._socket.close()


class Server:
    """Autopilot, companion side and simulator side together."""

    def __init__(self, autopilot: Autopilot, simulator: socket.socket, udp: UdpPort) -> None:
        p = autopilot.parameters
        self._codec = Codec(int(p["MAV_SYS_ID"]), int(p["MAV_COMP_ID"]))
        self._framer = Framer(self._codec)
        self._autopilot = autopilot
        self._companion = Companion(autopilot)
        self._simulator, self._udp = simulator, udp
        self._gyro, self._accel = np.zeros(3), np.array([0.0, 0.0, -9.81])
        self._microseconds = -1
        self._intervals: list[int] = []

    def run(self) -> None:
        """Serve until the simulator closes the link."""
        while True:
            try:
                data = self._simulator.recv(65536)
            except ConnectionError:
                return
            if not data:
                return
            for message in self._framer.stream(data):
                kind = message.get_type()
                if kind == "HIL_SENSOR":
                    self._sensor(message)
                elif kind in ("VISION_POSITION_ESTIMATE", "ODOMETRY"):
                    self._companion.handle(self._microseconds * 1e-6, message)

    def _sensor(self, m: Message) -> None:
        if m.id != 0 or not self._microseconds < m.time_usec <= _LATEST:
            return
        self._measure_rate(m.time_usec)
        self._microseconds = m.time_usec
        time = m.time_usec * 1e-6
        for message in self._udp.receive():
            self._companion.handle(time, message)
        values = (m.xgyro, m.ygyro, m.zgyro, m.xacc, m.yacc, m.zacc)
        fresh = m.fields_updated & _GYRO_AND_ACCELEROMETER == _GYRO_AND_ACCELEROMETER
        if fresh and math.isfinite(sum(values)):
            self._gyro[:], self._accel[:] = values[:3], values[3:]
        motors = self._autopilot.update(time, self._gyro, self._accel)
        self._udp.send(self._companion.tick(time))
        mode = _CUSTOM_MODE | (_ARMED if self._autopilot.status.armed else 0)
        answer = mavlink2.MAVLink_hil_actuator_controls_message(
            m.time_usec, [*motors.tolist(), *[0.0] * 12], mode, _LOCKSTEP)
        try:
            self._simulator.sendall(self._codec.encode(answer))
        except ConnectionError:
            pass  # the next recv says that the link is closed

    def _measure_rate(self, microseconds: int) -> None:
        if self._microseconds < 0 or len(self._intervals) >= _RATE_SAMPLES:
            return
        self._intervals.append(microseconds - self._microseconds)
        if len(self._intervals) == _RATE_SAMPLES:
            self._autopilot.set_sample_rate(1e6 / float(np.median(self._intervals)))


def connect(host: str, port: int, patience: float) -> socket.socket:
    """Return the link to the simulator, waiting up to `patience` seconds for it to listen.

    Raises ServerError when it does not.
    """
    end = clock.monotonic() + patience
    said = False
    while True:
        try:
            link = socket.create_connection((host, port), timeout=max(0.1, patience))
            break
        except socket.gaierror as error:
            raise ServerError(f"simulator host {host}: {error.strerror}") from None
        except OSError as error:
            if clock.monotonic() > end:
                raise ServerError(f"no simulator at {host}:{port} within {patience:g} s "
                                  f"({error.strerror or 'no answer'})") from None
            if not said:
                print(f"autopilot: waiting for the simulator at {host}:{port}", flush=True)
                said = True
            clock.sleep(0.05)
    link.settimeout(None)
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return link


def _port(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 65535:
        raise argparse.ArgumentTypeError(f"{text} is not a port (1..65535)")
    return int(text)


def _instance(text: str) -> int:
    if not text.isdecimal() or int(text) > 254:
        raise argparse.ArgumentTypeError(f"{text} is not an instance number (0..254)")
    return int(text)


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 <= value <= 86400.0:
        raise argparse.ArgumentTypeError(f"{text} is not a time in seconds (0..86400)")
    return value


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = argparse.ArgumentParser(
        prog="autopilot",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description="PX4-class autopilot stand-in: TCP client of a simulator, MAVLink 2 over UDP,\n"
        "on the ports of PX4 SITL. All its time is the simulator's.",
        epilog="examples:\n"
        "  autopilot                         instance 0: simulator 4560, UDP 14580 -> 14540\n"
        "  autopilot --instance 3            every port + 3\n"
        "  autopilot --params my_frame.yaml  NAME: value lines, PX4's names\n",
    )
    p.add_argument("-i", "--instance", type=_instance, default=0, metavar="N",
                   help="PX4 instance number, added to the default ports")
    p.add_argument("--sim-host", default=HOST, metavar="HOST",
                   help="simulator (default %(default)s)")
    p.add_argument("--sim-port", type=_port, metavar="PORT", help="simulator (default 4560 + N)")
    p.add_argument("--mavlink-port", type=_port, metavar="PORT",
                   help="own UDP port (default 14580 + N)")
    p.add_argument("--companion-port", type=_port, metavar="PORT",
                   help="UDP port told unasked until a peer speaks (default 14540 + N)")
    p.add_argument("--params", metavar="FILE",
                   help="parameters (default: config/autopilot/s500.yaml)")
    p.add_argument("--wait", type=_seconds, default=60.0, metavar="SECONDS",
                   help="how long to wait for the simulator (default %(default)g)")
    return p


def main(arguments: Sequence[str] | None = None) -> int:
    """Run until the simulator closes the link: 0; wrong use, port taken, no simulator: 2."""
    options = parser().parse_args(arguments)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    udp = link = None
    try:
        file = options.params or path("autopilot/s500.yaml")
        autopilot = Autopilot(Parameters.load(file))
        codec = Codec(int(autopilot.parameters["MAV_SYS_ID"]),
                      int(autopilot.parameters["MAV_COMP_ID"]))
        n = options.instance
        udp = UdpPort(options.mavlink_port or 14580 + n, options.companion_port or 14540 + n, codec)
        warm_up()
        link = connect(options.sim_host, options.sim_port or 4560 + n, options.wait)
        print(f"autopilot: connected to the simulator at {options.sim_host}:"
              f"{options.sim_port or 4560 + n}", flush=True)
        Server(autopilot, link, udp).run()
        print("autopilot: the simulator closed the link", flush=True)
        return 0
    except (ServerError, ParameterError, ConfigurationError, ValueError) as error:
        print(f"autopilot: {error}", file=sys.stderr, flush=True)
        return 2
    except KeyboardInterrupt:
        return 0
    finally:
        for closable in (link, udp):
            if closable is not None:
                closable.close()


if __name__ == "__main__":
    sys.exit(main())
