"""Targets of the fuzzer: both ends of the links with their real parsers, checked at every tick."""

from __future__ import annotations

import math
import random
import socket
from collections import Counter, deque

import numpy as np

from fuzzing.messages import number
from uam_control.frames import swap_body
from uam_control.offboard.sequence import OffboardSequence, Phase
from uam_control.setpoints.rate_thrust_map import RateThrustMap, SetpointRefused
from uam_control.setpoints.targets import AttitudeTarget
from uam_control.setpoints.thrust_curve import thrust_of_command
from uam_control.setpoints.thrust_identification import ThrustIdentification, identify
from uam_sim_bridge.autopilot.core import Autopilot
from uam_sim_bridge.autopilot.server import Server, UdpPort
from uam_sim_bridge.mavlink.hil.hil_server import HilServer
from uam_sim_bridge.mavlink.link.link import OffboardLink
from uam_sim_bridge.mavlink.protocol.wire import Codec, Framer, mavlink2

PERIOD = 0.004  # s
LONGEST_FRAME = 280
REBORN = 2000  # ticks of one object; then a new one, as a wild value may have silenced it
FLOAT32 = 1.0 + 1e-6  # limits after rounding to the wire's floats


class Violation(AssertionError):
    """A required condition is violated."""


def require(true: bool, what: str) -> None:
    """Raise Violation with the text `what` unless `true`."""
    if not true:
        raise Violation(what)


class MemoryTransport:
    """A transport in memory."""

    stream, connected, dropped = False, True, 0

    def __init__(self) -> None:
        self.arrived: list[bytes] = []
        self.sent: list[bytes] = []

    def send(self, data: bytes) -> None:
        self.sent.append(data)

    def receive(self) -> list[bytes]:
        arrived, self.arrived = self.arrived, []
        return arrived

    def close(self) -> None:
        pass


class Bridge:
    """The bridge's side of the link, alternately commanded to fly and to disarm."""

    name = "bridge"

    def __init__(self, rng: random.Random, counts: Counter) -> None:
        self._rng, self._counts = rng, counts
        self._codec = Codec(1, 1)
        self._ticks = 0
        self._begin()

    def _begin(self) -> None:
        self._transport = MemoryTransport()
        self._sequence = OffboardSequence()
        self._map = RateThrustMap()
        self._link = OffboardLink(self._transport, self._sequence, self._map.parameters)
        self._identification = ThrustIdentification()
        self._armed_desired = False

    def feed(self, chunks: list[bytes]) -> None:
        """Run one tick with the received `chunks`."""
        self._ticks += 1
        if self._ticks % REBORN == 0:
            self._begin()
        failed = self._sequence.phase is Phase.FAILED or not self._armed_desired
        if self._ticks % 400 == 100 or (failed and self._ticks % 20 == 0):  # a new start
            self._armed_desired = not self._armed_desired
            self._sequence.set_desired(self._armed_desired)
        now = self._ticks * PERIOD
        if self._ticks % REBORN < REBORN // 2 and self._ticks % 5 == 0:
            chunks = [*chunks, self._codec.encode(self._heartbeat())]
        self._transport.arrived = chunks
        self._link.poll(now)
        self._link.tick(now)
        self._setpoint(now)
        self._check()

    def _heartbeat(self):
        """Return a heartbeat in OFFBOARD, sometimes armed, so that the arming sequence proceeds."""
        armed = 128 if self._rng.random() < 0.1 else 0
        return mavlink2.MAVLink_heartbeat_message(2, 12, 1 | armed, 6 << 16, 4, 3)

    def _setpoint(self, now: float) -> None:
        rng, limit = self._rng, self._map.parameters.rate_limit
        wild = rng.random() < 0.3
        values = np.array([number(rng) if wild else rng.gauss(0.0, 3.0) for _ in range(12)])
        state = np.zeros((3, 8))
        state[0, 2:6], state[2, :3] = values[5:9], values[9:12]
        try:
            rates, thrust = self._map.map(values[0:3], values[3:6], values[6:9], values[9:12])
        except SetpointRefused:
            rates, thrust = np.zeros(3), 0.0
        require(0.0 <= thrust <= 1.0, f"thrust {thrust} of {values.tolist()}")
        require(bool(np.all(np.abs(rates) <= limit)), f"rates {rates} of {values.tolist()}")
        if wild:
            self._identification.switch(number(rng), rng.random() < 0.5)
        one, time = self._identification, number(rng) if rng.random() < 0.01 else now
        assumed = thrust_of_command(thrust, *self._map.curve)
        one.follow_magnet(time, math.isfinite(time + assumed))
        factor = self._map.thrust_factor = identify(
            time, state, thrust, assumed, rng.random() < 0.9, one.record, one.memory
        )
        p = one.parameters
        require(p.factor_min <= factor <= p.factor_max, f"thrust factor {factor}")
        self._link.send_setpoint(AttitudeTarget.of_rates(swap_body(rates), thrust), now)

    def _check(self) -> None:
        limit = self._map.parameters.rate_limit
        for data in self._transport.sent:
            m = self._codec.decode(data)
            require(m is not None, f"sent what is no message: {data.hex()}")
            kind = m.get_type()
            if kind == "SET_ATTITUDE_TARGET":
                self._counts["setpoints"] += 1
                rates = (m.body_roll_rate, m.body_pitch_rate, m.body_yaw_rate)
                fine = all(abs(r) <= c * FLOAT32 for r, c in zip(rates, limit, strict=True))
                require(fine and 0.0 <= m.thrust <= 1.0, f"sent rates {rates} thrust {m.thrust}")
            elif kind == "COMMAND_LONG" and m.command == 400:
                self._counts["arm requests"] += m.param1 == 1.0
                require(self._armed_desired or m.param1 == 0.0, "arming requested without command")
        self._transport.sent.clear()
        bounded = len(self._link.parameters.values) <= 100 and len(self._sequence.reasons) <= 10
        require(bounded, f"keeps {len(self._link.parameters.values)} parameters")


class FakeUdp:
    """Replaces the socket of UdpPort by lists of datagrams in memory."""

    def __init__(self) -> None:
        self.arrived: deque[bytes] = deque()
        self.sent: list[bytes] = []

    def recvfrom(self, size: int) -> tuple[bytes, tuple[str, int]]:
        if not self.arrived:
            raise BlockingIOError
        return self.arrived.popleft(), ("127.0.0.1", 14540)

    def sendto(self, data: bytes, peer: tuple[str, int]) -> None:
        self.sent.append(data)


class MemoryUdpPort(UdpPort):
    """UdpPort on a FakeUdp."""

    def __init__(self, codec: Codec) -> None:
        self._socket = self.memory = FakeUdp()
        self._codec, self._framer = codec, Framer(codec)
        self._peer, self._silence = ("127.0.0.1", 14540), None


class FakeSimulator:
    """The TCP link of the autopilot's Server: a list of chunks, then closed."""

    def __init__(self) -> None:
        self.chunks: deque[bytes] = deque()
        self.sent: list[bytes] = []

    def recv(self, size: int) -> bytes:
        return self.chunks.popleft() if self.chunks else b""

    def sendall(self, data: bytes) -> None:
        self.sent.append(data)


class StandIn:
    """The stand-in autopilot, fuzzed from its companion side (UDP) or the simulator's (TCP)."""

    def __init__(self, rng: random.Random, counts: Counter, side: str) -> None:
        self.name = f"autopilot, {side}"
        self._udp_side = side == "UDP"
        self._rng, self._counts = rng, counts
        self._simulation, self._companion = Codec(1, 200), Codec(1, 191)
        self._vision = mavlink2.MAVLink_vision_position_estimate_message(0, 0, 0, 0, 0, 0, 0)
        self._ticks = 0
        self._begin()

    def _begin(self) -> None:
        self._simulator = FakeSimulator()
        self._udp = MemoryUdpPort(Codec(1, 1))
        self._autopilot = Autopilot()
        self._server = Server(self._autopilot, self._simulator, self._udp)

    def feed(self, chunks: list[bytes]) -> None:
        """Run one tick with the received `chunks`; half of the time the link also works normally.

        The vehicle then has vision, is armed and gets setpoints, so that the target is in flight.
        """
        self._ticks += 1
        if self._ticks % REBORN == 0:
            self._begin()
        udp, simulator = self._udp.memory, self._simulator
        if self._ticks % REBORN < REBORN // 2:
            udp.arrived += [self._companion.encode(m) for m in self._usual()]
        if self._udp_side:
            udp.arrived += chunks
        else:
            simulator.chunks += chunks
        simulator.chunks.append(self._simulation.encode(self._sensor()))
        self._server.run()
        self._check()

    def _usual(self):
        yield self._vision
        yield mavlink2.MAVLink_set_attitude_target_message(
            0, 1, 1, 128, [1, 0, 0, 0], 0.1, 0.0, 0.0, 0.6
        )
        if self._ticks % 100 == 0:
            yield mavlink2.MAVLink_command_long_message(1, 1, 176, 0, 1, 6, 0, 0, 0, 0, 0)
            yield mavlink2.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)

    def _sensor(self):
        noise = [self._rng.gauss(0.0, 0.1) for _ in range(6)]
        return mavlink2.MAVLink_hil_sensor_message(
            self._ticks * 4000,
            noise[0],
            noise[1],
            noise[2] - 9.81,
            *noise[3:],
            0.2,
            0.0,
            0.4,
            1013.0,
            0.0,
            0.0,
            20.0,
            0x1FFF,
            0,
        )

    def _check(self) -> None:
        for data in self._simulator.sent:
            m = self._simulation.decode(data)
            require(m is not None and m.get_type() == "HIL_ACTUATOR_CONTROLS", data.hex())
            self._counts["motor answers"] += 1
            self._counts["armed motor answers"] += bool(m.mode & 128)
            require(all(0.0 <= c <= 1.0 for c in m.controls), f"motors {m.controls}")
        for data in self._udp.memory.sent:
            require(self._companion.decode(data) is not None, f"decoded no message: {data.hex()}")
        self._simulator.sent.clear()
        self._udp.memory.sent.clear()
        require(len(self._server._framer._rest) <= LONGEST_FRAME, "the framer keeps too much")


class Plant:
    """The plant's HilServer behind a pair of sockets."""

    name = "plant"

    def __init__(self, rng: random.Random, counts: Counter) -> None:
        self._counts = counts
        waits = 0.001, 0.0005
        self._server = HilServer(0, 4, waits=waits)
        self._server._link, self._far = socket.socketpair()
        self._far.setblocking(False)
        self._server._link.setblocking(False)
        self._ticks = 0

    def feed(self, chunks: list[bytes]) -> None:
        """Run ticks, each with one of the received `chunks`."""
        server = self._server
        for data in chunks:
            for k in range(0, len(data), 60000):
                self._far.send(data[k : k + 60000])
                motors = server.receive(0.0)
                self._counts["motor commands"] += 1
                require(bool(np.all((motors >= 0.0) & (motors <= 1.0))), f"motors {motors}")
                require(server.armed or not motors.any(), "motors run while disarmed")
        self._ticks += 1
        if self._ticks % 20 == 0:
            level = np.array([1.0, 0.0, 0.0, 0.0])
            server.send(self._ticks * PERIOD, np.zeros(3), np.zeros(3), np.zeros(3), level)
            self._far.recv(65536)
        require(server.connected, "hung up")
        require(len(server._framer._rest) <= LONGEST_FRAME, "the framer keeps too much")

    def close(self) -> None:
        """Close the sockets."""
        self._server.close()
        self._far.close()
