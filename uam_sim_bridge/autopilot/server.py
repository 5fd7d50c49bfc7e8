"""Executable `autopilot`: the stand-in on the sockets of a PX4 SITL instance.

TCP client of the simulator (HIL_SENSOR in, HIL_ACTUATOR_CONTROLS out), UDP to the companion
computer. All time is the simulator's. At each HIL_SENSOR the server first handles the messages
received over UDP, and sends its own messages before HIL_ACTUATOR_CONTROLS. So a lockstep flight is
deterministic.

With --serial, one line carries both, as on a flight controller in HITL mode; its other end is
`uam_sim_bridge.mavlink.hil.router`. With --companion, a serial line replaces the UDP
port alone, and the autopilot has a clock of its own.

Samples of a simulator come early and late. Their times in the autopilot's clock keep the
simulator's even spacing, and stay within WITHIN of the own clock: a simulator that stalls does not
stop the autopilot's clock, which the companion would take for a reboot.

`SerialLine` replaces both the simulator's socket and the companion's UDP port in `Server`.

examples:
  autopilot                         instance 0: simulator 4560, UDP 14580 -> 14540
  autopilot --instance 3            every port + 3
  autopilot --params my_frame.yaml  NAME: value lines, PX4's names
  autopilot --serial /dev/ttyUSB0:921600  at the far end of hitl_router's line
  autopilot --companion /dev/ttyUSB0:921600  TELEM2 on this line, simulator over TCP
"""

import argparse
import math
import select
import signal
import socket
import sys
import time
from collections.abc import Callable, Sequence

import numpy as np

from uam_control.settings.configuration import ConfigurationError
from uam_control.settings.parameter_set import ParameterError
from uam_control.vehicle import load_description
from uam_sim_bridge import hardware_priority
from uam_sim_bridge.autopilot.autopilot_estimator import GRAVITY
from uam_sim_bridge.autopilot.companion import Companion, warm_up
from uam_sim_bridge.autopilot.core import Autopilot
from uam_sim_bridge.autopilot.params import Parameters
from uam_sim_bridge.mavlink.hil.hil_messages import CONTROLS
from uam_sim_bridge.mavlink.hil.sitl_ports import Program, UdpPort, connect, fill_ports
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, Message, Signing, mavlink2
from uam_sim_bridge.mavlink.transport.stream_transport import SerialTransport
from uam_sim_bridge.mavlink.transport.transport import open_transport

WITHIN = 0.02  # [s] between the time of a sample and the own clock
FOLLOW = 0.002  # [1] part of the difference by which the times follow, per sample
LEAST = 0.0005  # [s] between two samples
_GYRO_AND_ACCELEROMETER = 0x3F  # HIL_SENSOR.fields_updated
_LOCKSTEP = 1  # HIL_ACTUATOR_CONTROLS.flags
_CUSTOM_MODE, _ARMED = 1, 128  # HIL_ACTUATOR_CONTROLS.mode
_LATEST = 2**53  # µs, latest time: its nanoseconds still fit MAVLink's 64 bits
_RATE_SAMPLES = 8  # number of intervals that measure the rate of HIL_SENSOR


class CompanionLine:
    """A serial line to the companion alone, as TELEM2; in the place of the UDP port in `Server`.

    It outlives the loss of the line: the device is opened again.
    """

    def __init__(self, place: str, codec: Codec) -> None:
        """place: DEVICE:BAUD. Raises PortError in one line if it cannot be opened."""
        self._transport: SerialTransport = open_transport(f"serial:{place}")
        self._codec, self._framer = codec, Framer(codec)

    def receive(self) -> list[Message]:
        chunks = self._transport.receive()
        return [message for data in chunks for message in self._framer.stream(data)]

    def send(self, messages: list[Message]) -> None:
        """Send the messages; those that the line's buffer has no room for are lost."""
        for message in messages:
            self._transport.send(self._codec.encode(message))

    def close(self) -> None:
        self._transport.close()


class SerialLine(CompanionLine):
    """One serial line; its loss ends the server, like a closed connection to the simulator."""

    def __init__(self, place: str, codec: Codec) -> None:
        super().__init__(place, codec)
        self._chunks: list[bytes] = []

    def recv(self, size: int) -> bytes:
        """Wait for bytes and return them; b"" if the line is lost. `size`: not used, see socket."""
        while not self._chunks:
            if self._transport.losses or not self._transport.connected:
                return b""
            select.select([self._transport.fileno()], [], [])
            self._chunks = self._transport.receive()
        return self._chunks.pop(0)

    def sendall(self, frame: bytes) -> None:
        """Send a frame; it is lost if the line's buffer is full, as on a flight controller."""
        self._transport.send(frame)

    def receive(self) -> list[Message]:
        """Return no messages: those of the companion arrive through `recv`."""
        return []


class OwnClock:
    """Converts the simulator's times [s] into the autopilot's, 0 at the first sample."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """clock: own clock [s]."""
        self._clock = clock
        self._start: float | None = None
        self._offset = self._last = 0.0

    def time(self, simulated: float) -> float:
        """Return the time [s] of a sample that arrives now; later than that of the one before."""
        if self._start is None:
            self._start, self._offset = self._clock(), -simulated
            return 0.0
        now = self._clock() - self._start
        late = now - (simulated + self._offset)
        self._offset += FOLLOW * late
        if abs(late) > WITHIN:
            self._offset += late - (WITHIN if late > 0.0 else -WITHIN)
        self._last = max(self._last + LEAST, simulated + self._offset)
        return self._last


class Server:
    """Autopilot, companion side and simulator side together."""

    def __init__(
        self,
        autopilot: Autopilot,
        simulator: socket.socket | SerialLine,
        udp: UdpPort | SerialLine | CompanionLine,
        clock: OwnClock | None = None,
    ) -> None:
        """simulator: source of HIL messages; udp: link to the companion; both may be one line;
        clock: None for the simulator's."""
        p = autopilot.parameters
        self._codec = Codec(int(p["MAV_SYS_ID"]), int(p["MAV_COMP_ID"]))
        self._framer = Framer(self._codec)
        self._autopilot = autopilot
        self._companion = Companion(autopilot)
        self._simulator, self._udp = simulator, udp
        self._gyro, self._accel = np.zeros(3), np.array([0.0, 0.0, -GRAVITY])
        self._microseconds = -1  # of the newest HIL_SENSOR
        self._clock, self._time = clock, -1e-6  # [s] of the autopilot
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
                    self._companion.handle(self._time, message)
                elif self._udp is self._simulator and self._microseconds >= 0:
                    self._companion.handle(self._time, message)

    def _sensor(self, m: Message) -> None:
        if m.id != 0 or not self._microseconds < m.time_usec <= _LATEST:
            return
        self._measure_rate(m.time_usec)
        self._microseconds = m.time_usec
        time = m.time_usec * 1e-6
        if self._clock is not None:
            time = self._clock.time(time)
        self._time = time
        for message in self._udp.receive():
            self._companion.handle(time, message)
        values = (m.xgyro, m.ygyro, m.zgyro, m.xacc, m.yacc, m.zacc)
        fresh = m.fields_updated & _GYRO_AND_ACCELEROMETER == _GYRO_AND_ACCELEROMETER
        if fresh and math.isfinite(sum(values)):
            self._gyro[:], self._accel[:] = values[:3], values[3:]
        motors = self._autopilot.update(time, self._gyro, self._accel)
        self._udp.send(self._companion.tick(time))
        mode = _CUSTOM_MODE | (_ARMED if self._autopilot.status.armed else 0)
        controls = [*motors.tolist(), *[0.0] * (CONTROLS - len(motors))]
        actuators = self._autopilot.outputs
        controls[CONTROLS - len(actuators) :] = actuators
        answer = mavlink2.MAVLink_hil_actuator_controls_message(
            m.time_usec, controls, mode, _LOCKSTEP
        )
        try:
            self._simulator.sendall(self._codec.encode(answer))
        except ConnectionError:
            pass  # the next recv detects the closed link

    def _measure_rate(self, microseconds: int) -> None:
        if self._microseconds < 0 or len(self._intervals) >= _RATE_SAMPLES:
            return
        self._intervals.append(microseconds - self._microseconds)
        if len(self._intervals) == _RATE_SAMPLES:
            self._autopilot.set_sample_rate(1e6 / float(np.median(self._intervals)))


def parser() -> Program:
    p = Program(__doc__)
    p.ports()
    p.vehicle()
    p.option("--params", "FILE", "parameters that override the vehicle's")
    p.option("--serial", "DEVICE:BAUD", "use this line instead of TCP and UDP, as in HITL")
    text = "use this line in place of UDP, as TELEM2, and an own clock; the simulator stays on TCP"
    p.option("--companion", "DEVICE:BAUD", text)
    p.switch("--once", "end with the simulator (default: wait for the next one)")
    text = (
        "run ahead of ordinary processes, as hardware of its own does, where the system permits it"
    )
    p.switch("--prefer", text)
    text = "sign messages on UDP and refuse unsigned ones: 64 hex digits, or a file of them"
    p.option("--signing-key", "KEY", text, "")
    return p


def _autopilot(options: argparse.Namespace) -> Autopilot:
    """Return the autopilot of the vehicle, as after power-on."""
    made = Autopilot(Parameters.of(load_description(options.vehicle), options.params))
    if options.serial and not options.params:
        made.set_parameter("SYS_HITL", 1)
    # as PX4 SITL; the highest instances exceed MAVLink's one byte
    made.set_parameter("MAV_SYS_ID", min(options.instance + 1, 250))
    return made


def main(arguments: Sequence[str] | None = None) -> int:
    """Run until SIGTERM, with --once until the simulator closes the link: 0; wrong use, port
    taken, no simulator: 2."""
    options = parser().parse_args(arguments)
    fill_ports(options)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    udp = link = None
    try:
        if options.serial and options.companion:
            raise ValueError("--serial carries the companion's messages, too: omit --companion")
        if options.serial and options.signing_key:
            raise ValueError("--signing-key is for UDP: omit it with --serial, which is not signed")
        autopilot = _autopilot(options)
        codec = Codec(
            int(autopilot.parameters["MAV_SYS_ID"]),
            int(autopilot.parameters["MAV_COMP_ID"]),
            Signing.from_text(options.signing_key),
        )
        if options.serial:
            link = udp = SerialLine(options.serial, codec)
            warm_up()
            print(f"autopilot: on the serial line {options.serial}", flush=True)
            Server(autopilot, link, udp).run()
            print("autopilot: the serial line is gone", flush=True)
            return 0
        if options.companion:
            udp = CompanionLine(options.companion, codec)
        else:
            udp = UdpPort(options.mavlink_port, options.companion_port, codec)
        warm_up()
        if options.prefer:
            hardware_priority.prefer()
        wait = options.wait
        while True:
            link = connect("autopilot", options.sim_host, options.sim_port, wait)
            print(
                f"autopilot: connected to the simulator at {options.sim_host}:{options.sim_port}",
                flush=True,
            )
            Server(autopilot, link, udp, OwnClock() if options.companion else None).run()
            print("autopilot: the simulator closed the link", flush=True)
            if options.once:
                return 0
            link.close()
            autopilot, wait = _autopilot(options), math.inf  # starts anew with a new simulator
    except (ParameterError, ConfigurationError, ValueError) as error:
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
