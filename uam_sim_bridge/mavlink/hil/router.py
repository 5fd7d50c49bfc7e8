"""Executable `hitl_router`: puts a flight controller in HITL mode in the place of PX4 SITL.

    plant ◀─TCP 4560 + N─▶ hitl_router ◀─one link, typically serial─▶ flight controller
    bridge ◀─UDP 14540 + N, 14580 + N─▶ ↑

| from | message | to |
|---|---|---|
| flight controller | HIL_ACTUATOR_CONTROLS | plant |
| flight controller | all others of the common dialect | bridge |
| plant, bridge | all of the common dialect | flight controller |

On a full line HIL_SENSOR, HIL_GPS and SET_ATTITUDE_TARGET are sent first. HIL_SENSOR
is thinned to the rate that the line carries. A flight controller has its own
clock: the router stamps its motor commands with the time of the newest HIL_SENSOR, and answers a
dropped HIL_SENSOR with the newest motor commands. When the link to the flight controller is lost,
the router sends zero motor commands to the plant once.

examples:
  hitl_router serial:/dev/ttyACM0:921600               instance 0
  hitl_router serial:/dev/ttyUSB0:460800 --hil-rate 200
  hitl_router udp:192.168.1.20:14550 --instance 3      every port + 3
"""

import math
import select
import signal
import socket
import sys
import time as clock
from collections.abc import Sequence

from uam_sim_bridge.mavlink.hil.sitl_ports import Program, UdpPort, connect, fill_ports, within
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, Message, mavlink2
from uam_sim_bridge.mavlink.transport.pacing import Meter, Outbox
from uam_sim_bridge.mavlink.transport.transport import ALLOWED, Transport, open_transport
from uam_sim_bridge.ports import PortError

SENSOR_BYTES, SETPOINT_BYTES, VISION_BYTES = 77, 51, 129  # longest frames on the line
FULL_RATE, VISION_RATE = 250.0, 50.0  # Hz, of the control ticks and of vision poses
LEAST_RATE = 50.0  # Hz, lowest sensor rate with which a flight controller flies
USABLE = 0.8  # of the line's rate; above it frames wait in the queue
NAME = "hitl_router"
CHECK_PERIOD = 0.1  # s, longest wait; then a lost link is opened again and the load checked
FULL = 0.8  # of the line's rate, threshold of the warning
WARN_PERIOD = 10.0  # s between two warnings of the same direction
PLANT_PATIENCE = 5.0  # s, time limit of a send to the plant
AUTOPILOT_IDS, PLANT_IDS = (1, 1), (1, 200)  # system and component of messages encoded here
TO, FROM = "to the flight controller", "from the flight controller"


def sustainable_rate(bytes_per_second: float | None) -> float:
    """Return the rate [Hz] of HIL_SENSOR that a line carries, at most FULL_RATE.

    bytes_per_second: None for a line without limit. Raises ValueError below LEAST_RATE.
    """
    if bytes_per_second is None:
        return FULL_RATE
    others = FULL_RATE * SETPOINT_BYTES + VISION_RATE * VISION_BYTES
    rate = (USABLE * bytes_per_second - others) / SENSOR_BYTES
    if rate < LEAST_RATE:
        needed = (LEAST_RATE * SENSOR_BYTES + others) / USABLE
        raise ValueError(
            f"{bytes_per_second:.0f} bytes/s do not carry setpoints, vision and "
            f"sensors, {needed:.0f} are needed; or choose --hil-rate"
        )
    return min(FULL_RATE, rate)


class Thinner:
    """Passes HIL_SENSOR at a rate, with the `fields_updated` of the dropped messages included."""

    def __init__(self, rate: float) -> None:
        """rate [Hz], in the time of the sensor messages."""
        self._interval = 1e6 / rate
        self._due = -math.inf
        self._last = -math.inf
        self._fields = 0

    def take(self, message: Message) -> bool:
        """Return whether the message passes; its `fields_updated` then covers the dropped ones."""
        stamp = message.time_usec
        self._fields |= message.fields_updated
        if stamp < self._last:  # the simulator has restarted
            self._due = -math.inf
        self._last = stamp
        if stamp < self._due - 1.0:
            return False
        following = self._due + self._interval
        self._due = following if following > stamp else stamp + self._interval
        message.fields_updated, self._fields = self._fields, 0
        return True


class Router:
    """Connects one flight controller, one plant and one bridge."""

    def __init__(
        self, controller: Transport, plant: socket.socket, bridge: UdpPort, hil_rate: float
    ) -> None:
        """hil_rate [Hz]: highest rate of HIL_SENSOR to the flight controller."""
        self._controller, self._plant, self._bridge = controller, plant, bridge
        plant.settimeout(PLANT_PATIENCE)
        self._as_autopilot, self._as_plant = Codec(*AUTOPILOT_IDS), Codec(*PLANT_IDS)
        self._from_controller = Framer(self._as_autopilot)
        self._from_plant = Framer(self._as_plant)
        self._outbox = Outbox(controller)
        self._thinner = Thinner(hil_rate)
        self.meters = {TO: Meter(), FROM: Meter()}
        self._warned = dict.fromkeys(self.meters, -math.inf)
        self._stamp = 0  # us, of the newest HIL_SENSOR
        self._commands: Message | None = None  # the newest HIL_ACTUATOR_CONTROLS
        self._was_connected = controller.connected

    def run(self) -> None:
        """Forward messages until the plant closes its connection."""
        while self._step():
            pass

    def _step(self) -> bool:
        """Wait for messages and forward them; False after the plant has closed its connection."""
        readable = self._wait()
        plant_open = True
        if self._plant in readable:
            plant_open = self._take_plant()
        for message in self._bridge.receive():
            self._to_controller(message)
        for data in self._controller.receive():
            self.meters[FROM].add(len(data))
            for message in self._from_controller.take(data, self._controller.stream):
                plant_open = self._take_controller(message) and plant_open
        now = clock.monotonic()
        self.meters[TO].add(self._outbox.flush(now))
        self._watch(now)
        return plant_open and self._check_link()

    def _wait(self) -> list:
        sources: list = [self._plant, self._bridge]
        number, pause, drain = self._controller.fileno(), self._outbox.wait, []
        if number >= 0:
            sources.append(number)
            if pause is not None and pause <= 0.0:
                drain = [number]  # wait until the device accepts bytes
        timeout = CHECK_PERIOD if pause is None or drain else min(pause, CHECK_PERIOD)
        return select.select(sources, drain, [], timeout)[0]

    def _take_plant(self) -> bool:
        try:
            data = self._plant.recv(65536)
        except OSError:
            return False
        for message in self._from_plant.stream(data):
            if message.get_type() == "HIL_SENSOR":
                if not self._sensor(message):
                    return False
            else:
                self._to_controller(message)
        return bool(data)

    def _sensor(self, message: Message) -> bool:
        """Forward a HIL_SENSOR, or answer it if dropped; False if the plant's link is lost."""
        self._stamp = message.time_usec
        before = message.fields_updated
        if not self._controller.connected:
            return True
        if not self._thinner.take(message):
            return self._commands is None or self._to_plant(self._commands)
        if message.fields_updated == before:
            self._to_controller(message)
        else:
            self._outbox.put(message.get_type(), self._as_plant.encode(message))
        return True

    def _take_controller(self, message: Message) -> bool:
        if message.get_type() != "HIL_ACTUATOR_CONTROLS":
            self._bridge.send_frame(bytes(message.get_msgbuf()))
            return True
        self._commands = message
        return self._to_plant(message)

    def _to_controller(self, message: Message) -> None:
        self._outbox.put(message.get_type(), bytes(message.get_msgbuf()))

    def _to_plant(self, message: Message) -> bool:
        message.time_usec = self._stamp
        try:
            self._plant.sendall(self._as_autopilot.encode(message))
        except OSError:
            return False
        return True

    def _check_link(self) -> bool:
        """Handle a loss or reconnection of the flight controller's link; False: plant closed."""
        connected = self._controller.connected
        if connected == self._was_connected:
            return True
        self._was_connected = connected
        if connected:
            say("the link to the flight controller is open")
            return True
        say("the link to the flight controller is lost: motor commands are zero")
        self._outbox.clear()
        self._commands = None
        self._from_controller = Framer(self._as_autopilot)
        return self._to_plant(
            mavlink2.MAVLink_hil_actuator_controls_message(self._stamp, [0.0] * 16, 0, 0)
        )

    def _watch(self, now: float) -> None:
        """Warn when the line is nearly full."""
        capacity = self._controller.bytes_per_second
        for direction, meter in self.meters.items():
            if not meter.update(now) or capacity is None or meter.rate <= FULL * capacity:
                continue
            if now - self._warned[direction] >= WARN_PERIOD:
                self._warned[direction] = now
                say(
                    f"{meter.rate:.0f} bytes/s {direction}, {100.0 * meter.rate / capacity:.0f} % "
                    f"of the line ({self._outbox.dropped} messages dropped so far)"
                )

    def summary(self) -> str:
        """Return highest rates and losses of the link in one line."""
        rates = ", ".join(f"{m.highest:.0f} bytes/s {d}" for d, m in self.meters.items())
        return (
            f"at most {rates}; {self._outbox.dropped} messages dropped, "
            f"{self._from_controller.bad_bytes} invalid bytes"
        )


def say(text: str) -> None:
    """Print a line with the program's name."""
    print(f"{NAME}: {text}", flush=True)


def _stop(*_: object) -> None:
    """Exit without a traceback; ignore further signals."""
    for each in (signal.SIGINT, signal.SIGTERM):
        signal.signal(each, signal.SIG_IGN)
    sys.exit(0)


def parser() -> Program:
    p = Program(__doc__)
    p.add_argument("link", metavar="LINK", help=f"to the flight controller: {ALLOWED}")
    text = "highest rate of HIL_SENSOR (default: the rate that the line carries, up to 250)"
    p.option("--hil-rate", "HZ", text, type=within(float, "a rate in Hz", 1.0, 1000.0))
    p.ports()
    return p


def main(arguments: Sequence[str] | None = None) -> int:
    """Run until the simulator closes the link or a signal; return the exit status.

    0: ended by simulator or signal; 2: wrong use, or a port or device cannot be opened.
    """
    options = parser().parse_args(arguments)
    fill_ports(options)
    for each in (signal.SIGINT, signal.SIGTERM):
        signal.signal(each, _stop)
    closables = []
    try:
        closables.append(controller := open_transport(options.link))
        rate = options.hil_rate or sustainable_rate(controller.bytes_per_second)
        closables.append(
            bridge := UdpPort(options.mavlink_port, options.companion_port, Codec(*AUTOPILOT_IDS))
        )
        closables.append(plant := connect(NAME, options.sim_host, options.sim_port, options.wait))
        say(
            f"connected to the simulator at {options.sim_host}:{options.sim_port}; HIL_SENSOR at "
            f"{rate:.0f} Hz to {options.link}"
        )
        router = Router(controller, plant, bridge, rate)
        router.run()
        say(f"the simulator closed the link; {router.summary()}")
        return 0
    except (PortError, ValueError) as error:
        print(f"{NAME}: {error}", file=sys.stderr, flush=True)
        return 2
    finally:
        for closable in closables:
            closable.close()


if __name__ == "__main__":
    sys.exit(main())
